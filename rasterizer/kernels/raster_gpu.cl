// raster, GPU form: one work-group a tile of 16x16 pixels; inputs, outputs and formulas are those
// of raster_cpu.cl, and for drawing (RGBA) those of draw_cpu.cl.
// Reads:   tile_start (tiles + 1), intersections, record (N, 12); with HEAT value and weight of
//          each splat; backward as raster_cpu.cl.
// Writes:  image (3, H, W) and transmittance (H, W), or with RGBA image (H, W, 4); tile_end;
//          backward the slots (count, 12).
// Units:   pixels, row 0 on top; display sRGB; transmittance 0..1; depths in metres.
#include "common/raster_pixels.cl"
#define LANES 32  // of the backward pass: splats in flight

#ifdef SURFACE  // as in raster_cpu.cl
// The terms of z = Z (1 + l) / (1 + 2 l + q) that the gradients need.
typedef struct {
  float z, ahead, per;
} Depth;

inline Depth depth_under(const float8 f, float dx, float dy) {
  Depth d;
  const float l = f.s1 * dx + f.s2 * dy;
  const float q = f.s3 * dx * dx + 2 * f.s4 * dx * dy + f.s5 * dy * dy;
  d.ahead = 1 + l;
  d.per = 1 / fmax(1 + 2 * l + q, SURFACE_LEAST);
  d.z = f.s0 * d.ahead * d.per;
  return d;
}
#endif

// A work-item owns a pixel; the group loads 256 splats at a time to local memory.
__kernel __attribute__((reqd_work_group_size(PIXELS, 1, 1))) void rasterize(
    RASTERIZE_TAKES) {
#ifdef SURFACE
  // Which splat each of the batch is: its eight numbers of depth stay in global memory.
  __local int splat_of[PIXELS];
  float depth = 0;
#endif
#ifdef HEAT
  __local float2 heats[PIXELS];
  float2 hot = 0;
#endif
  __local float batch[PIXELS * RECORD];
  __local int open;
  PIXEL_OF_ITEM
  // Outside the image T is 0, so these items only load and wait.
  float T = inside ? 1 : 0, r = 0, g = 0, b = 0;
  int p = tile_start[tile];
  const int end = tile_start[tile + 1];
  while (p < end) {
    END_WHERE_ALL_ARE_DONE
    const int n = min(PIXELS, end - p);
    // Every item fetches one splat, then all items read all of them.
    if (l < n) {
      __global const float* s = record + (size_t)RECORD * intersections[p + l];
      for (int k = 0; k < RECORD; k++) batch[l * RECORD + k] = s[k];
#ifdef SURFACE
      splat_of[l] = intersections[p + l];
#endif
#ifdef HEAT
      heats[l] = heat[intersections[p + l]].xw;
#endif
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    // Near to far: C += c alpha T, T *= 1 - alpha (3DGS, eq. 3; paper eq. 2).
    for (int j = 0; j < n && T >= STOP; j++) {
      __local const float* s = batch + j * RECORD;
      WEIGHT_OF(s, w)
      // Sums stay in registers: a pixel is written once, at the end.
      r += w * s[RED];
      g += w * s[GREEN];
      b += w * s[BLUE];
#ifdef HEAT
      // Heat is blended with the weights of colours, and looked up in a palette later.
      hot += w * heats[j];
#endif
#ifdef SURFACE
      const float8 f = vload8(splat_of[j], surface);
      const float z = fmin(fmax(depth_under(f, dx, dy).z, f.s6), f.s7);
#ifdef LIGHT_LEFT
      if (T > LIGHT_LEFT && T - w <= LIGHT_LEFT) depth = z;
#else
      depth += w * z;
#endif
#endif
      // T (1 - alpha).
      T -= w;
    }
    p += n;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  // The whole list or where all pixels were done: the backward pass ends there.
  if (l == 0) tile_end[tile] = p;
  if (!inside) return;
  const size_t at = (size_t)py * width + px, plane = (size_t)width * height;
#ifdef RGBA  // premultiplied, alpha last, for drawing
  vstore4((float4)(r, g, b, 1 - T), at, image);
#else
  // What light is left comes from the background.
  image[at] = r + T * red;
  image[at + plane] = g + T * green;
  image[at + 2 * plane] = b + T * blue;
  transmittance[at] = T;
#endif
#ifdef SURFACE
  metres[at] = depth;
#endif
#ifdef HEAT
  heat_image[at] = hot;
#endif
}

// A work-item owns a splat, the pixels lie in local memory; item l meets pixel i - l at step i, so
// that every pixel sees the splats in order and no two items hold a pixel at once: no atomics, no
// sums across items.  Formulas as in raster_cpu.cl.
__kernel __attribute__((reqd_work_group_size(LANES, 1, 1))) void rasterize_backward(
    RASTERIZE_BACKWARD_TAKES) {
  // Of all pixels: T, what is still to come from behind, and dL/dC.
  __local float T[PIXELS], rest[PIXELS], grad_r[PIXELS], grad_g[PIXELS], grad_b[PIXELS];
#ifdef SHARE
  __local float pixel_error[PIXELS];
#endif
#ifdef SURFACE
  __local float grad_z[PIXELS];
#endif
  const int tile = get_group_id(0), l = get_local_id(0);
  const int tile_x = tile % tiles_x, tile_y = tile / tiles_x;
  const int x0 = tile_x * TILE, y0 = tile_y * TILE;
  const size_t plane = (size_t)width * height;
  // Thirty-two items fill 256 pixels; those outside the image have T = 0 and take no part.
  for (int i = l; i < PIXELS; i += LANES) {
    const int px = x0 + i % TILE, py = y0 + i / TILE;
    const size_t at = (size_t)py * width + px;
    T[i] = rest[i] = grad_r[i] = grad_g[i] = grad_b[i] = 0;
#ifdef SHARE
    pixel_error[i] = px < width && py < height ? error[at] : 0;
#endif
#ifdef SURFACE
    grad_z[i] = px < width && py < height ? grad_metres[at] : 0;
#endif
    if (px >= width || py >= height) continue;
    grad_r[i] = grad_image[at];
    grad_g[i] = grad_image[at + plane];
    grad_b[i] = grad_image[at + 2 * plane];
    T[i] = 1;
    // rest = dL/dC . C + dL/dT T at first, less what each splat gives: raster_cpu.cl derives it.
    rest[i] = grad_r[i] * image[at] + grad_g[i] * image[at + plane] +
              grad_b[i] * image[at + 2 * plane];
    if (with_transmittance) rest[i] += grad_transmittance[at] * transmittance[at];
#ifdef SURFACE
    rest[i] += grad_z[i] * metres[at];
#endif
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  // Lists again from their beginning to where the forward pass stopped.
  const int end = tile_end[tile], last = tile_start[tile + 1];
  for (int p = tile_start[tile]; p < end; p += LANES) {
    // Thirty-two splats in flight, one an item; the last round has fewer.
    const bool mine = p + l < end;
    float s[RECORD], sum[RECORD], xx = 0, xy = 0, yy = 0, along_x = 0, along_y = 0;
    const int splat = mine ? intersections[p + l] : 0;
    for (int k = 0; k < RECORD; k++) {
      // An item without a splat has an opacity of 0 and meets no pixel, but every barrier.
      s[k] = mine ? record[(size_t)RECORD * splat + k] : 0;
      sum[k] = 0;
    }
#ifdef SURFACE
    // The eight numbers of the splat's depth (common/surface.cl).
    const float8 f = mine ? vload8(splat, surface) : (float8)(0);
    float8 by = 0;  // of the surface's own floats
    float by_l = 0, by_x = 0, by_y = 0;
#endif
    const float A = s[CONIC_A], B = s[CONIC_B], C = s[CONIC_C];
    // A pipeline: at step i item l is at pixel i - l, one behind its neighbour in front of it.
    for (int i = 0; i < PIXELS + LANES - 1; i++) {
      const int pixel = i - l;
      const bool meets = mine && pixel >= 0 && pixel < PIXELS;
      const float dx = x0 + (pixel & (TILE - 1)) + 0.5f - s[MEAN_X];
      const float dy = y0 + (pixel >> 4) + 0.5f - s[MEAN_Y];
      const float q = A * dx * dx + 2 * B * dx * dy + C * dy * dy;
      // T >= STOP: a pixel that was done in the forward pass takes nothing more.
      if (meets && q <= s[POWER_THRESHOLD] && T[pixel] >= STOP) {
        const float raw = s[OPACITY] * exp(-0.5f * q), alpha = fmin(raw, MAX_ALPHA);
        const float before = T[pixel], w = alpha * before;
        float given = grad_r[pixel] * s[RED] + grad_g[pixel] * s[GREEN] + grad_b[pixel] * s[BLUE];
#ifdef SURFACE
        // Held depths give their gradient to the bound that holds them.
        const Depth d = depth_under(f, dx, dy);
        const float all = w * grad_z[pixel];
        given += grad_z[pixel] * fmin(fmax(d.z, f.s6), f.s7);
        const float h = d.z >= f.s6 && d.z <= f.s7 ? all : 0;
        const float by_ahead = h * f.s0 * d.per * (1 - 2 * d.ahead * d.per);
        const float qu = -h * d.z * d.per * dx, qv = -h * d.z * d.per * dy;
        by_l += by_ahead;
        by_x += qu;
        by_y += qv;
        by += (float8)(h * d.ahead * d.per, by_ahead * dx, by_ahead * dy, qu * dx, 2 * qu * dy,
                       qv * dy, d.z < f.s6 ? all : 0, d.z > f.s7 ? all : 0);
#endif
        // The rest after this splat is what those behind it share.
        const float behind = rest[pixel] - w * given;
        rest[pixel] = behind;
        T[pixel] = before - w;
        // dL/dc = alpha T dL/dC.
        sum[RED] += w * grad_r[pixel];
        sum[GREEN] += w * grad_g[pixel];
        sum[BLUE] += w * grad_b[pixel];
        // dL/dalpha = T (c . dL/dC) - rest / (1 - alpha); none where 0.99 holds it.
        const float grad_alpha = before * given - behind / (1 - alpha);
        const float grad = raw > MAX_ALPHA ? 0 : alpha * grad_alpha;
        // What is summed: g d and g d d^T; the conic and the factors follow after the last pixel.
        const float gx = grad * dx, gy = grad * dy;
        sum[OPACITY] += grad;
        along_x += gx;
        along_y += gy;
        xx += gx * dx;
        xy += gx * dy;
        yy += gy * dy;
#ifdef ABSOLUTE
        // AbsGS: absolute values, which do not cancel across a splat.
        sum[EXTENT_X] += fabs(A * gx + B * gy);
        sum[EXTENT_Y] += fabs(B * gx + C * gy);
#endif
#ifdef SHARE
        sum[EXTENT_X] += w * pixel_error[pixel];
#endif
#ifdef WEIGHT
        sum[POWER_THRESHOLD] += w;
#endif
      }
      // Everybody moves on by one pixel at once.
      barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (mine) {
      // The factors that all pixels share: d ln alpha / d mean = Q d; by the conic Q -d d^T / 2.
      sum[MEAN_X] = A * along_x + B * along_y;
      sum[MEAN_Y] = B * along_x + C * along_y;
      sum[CONIC_A] = -0.5f * xx;
      sum[CONIC_B] = -xy;
      sum[CONIC_C] = -0.5f * yy;
      sum[OPACITY] /= s[OPACITY];
#ifdef SURFACE
      // The mean on the screen moves u and v the other way.
      sum[MEAN_X] -= f.s1 * by_l + 2 * (f.s3 * by_x + f.s4 * by_y);
      sum[MEAN_Y] -= f.s2 * by_l + 2 * (f.s4 * by_x + f.s5 * by_y);
#endif
      // A slot of its own for each intersection: no atomics, and sums in a fixed order.
      const int slot = first_slot[splat] + rank_of_tile(tile_bounds[splat], tile_x, tile_y);
      for (int k = 0; k < RECORD; k++) slots[(size_t)RECORD * slot + k] = sum[k];
#ifdef SURFACE
      vstore8(by, slot, depth_slots);
#endif
    }
  }
  // What lies behind the early stop was not seen: its gradients are zero.
  for (int p = end + l; p < last; p += LANES) {  // behind the early stop: nothing is felt there
    const int slot = first_slot[intersections[p]] +
                     rank_of_tile(tile_bounds[intersections[p]], tile_x, tile_y);
    for (int k = 0; k < RECORD; k++) slots[(size_t)RECORD * slot + k] = 0;
#ifdef SURFACE
    vstore8((float8)(0), slot, depth_slots);
#endif
  }
}
