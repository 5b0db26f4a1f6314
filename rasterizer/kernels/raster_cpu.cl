// raster, CPU form, for training (draw_cpu.cl is for the screen): lists of intersections -> an
// image, and the gradients of an image -> those of every intersection.
// One work-item a tile of 16x16 pixels, kept in registers and the first cache, in blocks of PIXELS
// pixels (common/raster_blocks.cl).  Blending front to back (3DGS, eq. 3; paper eq. 2):
//   C = sum of c alpha T,  T the product of 1 - alpha of what lies before
// Early stop: blocks whose transmittance is below STOP everywhere are dropped from the mask every
// BATCH intersections; a tile ends with its last block.
// Reads:   tile_start (tiles + 1), intersections, record (N, 12); backward also tile_end,
//          drawn_blocks, the image, its transmittance and the gradients of both, tile_bounds and
//          first_slot.
// Writes:  image (3, H, W), transmittance (H, W), tile_end and, an intersection each, drawn_blocks:
//          a bit for each block that it was drawn in; backward the slots (count, 12).
// Units:   pixels, row 0 on top; display sRGB; transmittance 0..1; depths in metres.
#include "common/vector.cl"
#include "common/raster.cl"
#include "common/raster_blocks.cl"

#ifdef SURFACE
// The fraction of surface.cl: depth under pixels (dx, dy) from the mean, before it is held.
typedef struct {
  floatp z, ahead, per;  // metres; 1 + l; 1 / (1 + 2 l + q)
} Depths;

inline Depths depth_under(const float8 f, floatp dx, floatp dy) {
  Depths d;
  const floatp l = fma(f.s1, dx, f.s2 * dy);
  const floatp q = fma(dx, fma(f.s3, dx, 2 * f.s4 * dy), f.s5 * dy * dy);
  d.ahead = 1.0f + l;
  d.per = 1.0f / fmax(fma((floatp)(2.0f), l, 1.0f + q), SURFACE_LEAST);
  // Z (1 + l) / (1 + 2 l + q), with the terms that the gradients need kept.
  d.z = f.s0 * d.ahead * d.per;
  return d;
}
#endif

// SURFACE: with a depth a splat (surface.cl), metres become the sum of alpha T z; with LIGHT_LEFT
// the depth of the splat behind which no more light than that is left, 0 where there is none.
__kernel void rasterize(RASTERIZE_TAKES, __global uint* drawn_blocks) {
  const int tile = get_global_id(0);
  const int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;
#ifdef SURFACE
  floatp Z[BLOCKS];
  for (int k = 0; k < BLOCKS; k++) Z[k] = 0;
#endif
  // Transmittance and colours of all 256 pixels.
  floatp T[BLOCKS], R[BLOCKS], G[BLOCKS], B[BLOCKS], block_x[BLOCKS], block_y[BLOCKS];
  for (int k = 0; k < BLOCKS; k++) {
    BLOCK_CENTRES(k)
    T[k] = inside(k, x0, y0, width, height);
    R[k] = G[k] = B[k] = 0;
  }
  OPEN_TILE
  while (p < end && open) {
    const int n = fetch(p, end, x0, y0, intersections, record, &batch);
    for (int j = 0; j < n; j++) {
      const float* s = batch.splats + RECORD * j;
      // Means from the tile's corner: small numbers, whose differences keep their digits.
      const float mx = s[MEAN_X] - x0, my = s[MEAN_Y] - y0;
      EXPONENTS(s[CONIC_A], s[CONIC_B], s[CONIC_C])
#ifdef SURFACE
      const float8 f = vload8(intersections[p + j], surface);
#endif
      // Only blocks that are open and that the ellipse touches.
      const uint drawn = open & batch.blocks[j];
      drawn_blocks[p + j] = drawn;
      for (uint left = drawn; left; left &= left - 1) {
        const int k = lowest(left);
        POWER_IN(k)
        floatp alpha = fmin(s[OPACITY] * exp2p(power), MAX_ALPHA);
        // Not drawn where the power is beyond its threshold (alpha below min alpha).
        alpha = select((floatp)(0), alpha, power >= least);
        // The weight alpha T of the splat in this pixel.
        const floatp w = alpha * T[k];
        R[k] = fma(w, s[RED], R[k]);
        G[k] = fma(w, s[GREEN], G[k]);
        B[k] = fma(w, s[BLUE], B[k]);
#ifdef SURFACE
        const floatp z = fmin(fmax(depth_under(f, dx, dy).z, f.s6), f.s7);
#ifdef LIGHT_LEFT
        Z[k] = select(Z[k], z, (T[k] > LIGHT_LEFT) & (T[k] - w <= LIGHT_LEFT));
#else
        Z[k] = fma(w, z, Z[k]);
#endif
#endif
        // T (1 - alpha).
        T[k] -= w;
      }
    }
    p += n;
    open = still_open(open, T);  // what is opaque takes no part in the next batch
  }
  // The backward pass stops at the same intersection.
  tile_end[tile] = p;
  // Planar output: three channels of (H, W), as the losses read them.
  const size_t plane = (size_t)width * height;
  for (int k = 0; k < BLOCKS; k++) {
    const floatp t = T[k];
    float r[PIXELS], g[PIXELS], b[PIXELS], a[PIXELS];
    // What light is left comes from the background.
    STORE_PIXELS(fma(t, red, R[k]), 0, r);
    STORE_PIXELS(fma(t, green, G[k]), 0, g);
    STORE_PIXELS(fma(t, blue, B[k]), 0, b);
    STORE_PIXELS(t, 0, a);
#ifdef SURFACE
    float z[PIXELS];
    STORE_PIXELS(Z[k], 0, z);
#endif
    for (int lane = 0; lane < PIXELS; lane++) {
      const int x = x0 + k / DOWN * BLOCK_W + lane % BLOCK_W;
      const int y = y0 + k % DOWN * BLOCK_H + lane / BLOCK_W;
      if (x >= width || y >= height) continue;
      const size_t at = (size_t)y * width + x;
      image[at] = r[lane];
      image[at + plane] = g[lane];
      image[at + 2 * plane] = b[lane];
      transmittance[at] = a[lane];
#ifdef SURFACE
      metres[at] = z[lane];
#endif
    }
  }
}

// Front to back again, with the same decisions.  Per pixel: T, and rest = what the gradient still
// expects from behind: dL/dC . C + dL/dT T at first, less what each splat gave.  Then
// dL/dalpha = T (c . dL/dC) - rest / (1 - alpha)
// which needs no division to get T back, as 3DGS's walk from back to front does.  Each intersection
// writes its 12 numbers to its own slot.
// For densification: ABSOLUTE sums |gradient of the mean| in slots 9 and 10 (AbsGS), or SHARE sums
// alpha T times an error of the pixel in 9; WEIGHT sums alpha T in 11.  Each only where it is
// defined.
__kernel void rasterize_backward(RASTERIZE_BACKWARD_TAKES,
                                 __global const uint* drawn_blocks) {
  const int tile = get_global_id(0);
  const int tile_x = tile % tiles_x, tile_y = tile / tiles_x;
  const int x0 = tile_x * TILE, y0 = tile_y * TILE;
  const size_t plane = (size_t)width * height;
  // Of all 256 pixels: T, what is still to come from behind, and dL/dC.
  floatp T[BLOCKS], rest[BLOCKS], grad_r[BLOCKS], grad_g[BLOCKS], grad_b[BLOCKS];
  floatp block_x[BLOCKS], block_y[BLOCKS];
#ifdef SHARE
  floatp pixel_error[BLOCKS];
#endif
#ifdef SURFACE
  floatp grad_z[BLOCKS];
#endif
  for (int k = 0; k < BLOCKS; k++) {
    BLOCK_CENTRES(k)
    float r[PIXELS], g[PIXELS], b[PIXELS], d[PIXELS];
#ifdef SHARE
    float e[PIXELS];
#endif
#ifdef SURFACE
    float z[PIXELS];
#endif
    for (int lane = 0; lane < PIXELS; lane++) {
      const int x = x0 + k / DOWN * BLOCK_W + lane % BLOCK_W;
      const int y = y0 + k % DOWN * BLOCK_H + lane / BLOCK_W;
      const size_t at = (size_t)y * width + x;
      r[lane] = g[lane] = b[lane] = d[lane] = 0;
#ifdef SHARE
      e[lane] = x < width && y < height ? error[at] : 0;
#endif
#ifdef SURFACE
      z[lane] = x < width && y < height ? grad_metres[at] : 0;
#endif
      if (x >= width || y >= height) continue;
      r[lane] = grad_image[at];
      g[lane] = grad_image[at + plane];
      b[lane] = grad_image[at + 2 * plane];
      // rest at first: dL/dC . C + dL/dT T of the finished pixel.
      d[lane] = r[lane] * image[at] + g[lane] * image[at + plane] + b[lane] * image[at + 2 * plane];
      if (with_transmittance) d[lane] += grad_transmittance[at] * transmittance[at];
#ifdef SURFACE
      d[lane] += z[lane] * metres[at];
#endif
    }
    T[k] = inside(k, x0, y0, width, height);
    grad_r[k] = LOAD_PIXELS(0, r);
    grad_g[k] = LOAD_PIXELS(0, g);
    grad_b[k] = LOAD_PIXELS(0, b);
    rest[k] = LOAD_PIXELS(0, d);
#ifdef SHARE
    pixel_error[k] = LOAD_PIXELS(0, e);
#endif
#ifdef SURFACE
    grad_z[k] = LOAD_PIXELS(0, z);
#endif
  }
  // Only as far as the forward pass went: behind it nothing was drawn.
  float splats[BATCH * RECORD];
  const int end = tile_end[tile], last_intersection = tile_start[tile + 1];
  for (int p = tile_start[tile]; p < end; p += BATCH) {
    const int n = min(BATCH, end - p);
    const int ahead = min(BATCH, end - p - n);
    for (int j = 0; j < ahead; j++) {  // of the next batch: the work on this one hides the misses
      // A record lies in one or two cache lines.
      const int splat = intersections[p + n + j];
      PREFETCH(record + (size_t)RECORD * splat);
      PREFETCH(record + (size_t)RECORD * splat + RECORD - 1);
      PREFETCH(tile_bounds + splat);
      PREFETCH(first_slot + splat);
    }
    int slot[BATCH];  // ahead of use, as the records
    for (int j = 0; j < n; j++) {
      const int splat = intersections[p + j];
      copy_record(record, splat, splats + RECORD * j);
      slot[j] = first_slot[splat] + rank_of_tile(tile_bounds[splat], tile_x, tile_y);
    }
    for (int j = 0; j < n; j++) {
      const float* s = splats + RECORD * j;
      const float mx = s[MEAN_X] - x0, my = s[MEAN_Y] - y0;
      // As in the forward pass, to the bit: the same exponents, so the same decisions.
      const float A = s[CONIC_A], B = s[CONIC_B], C = s[CONIC_C];
      EXPONENTS(A, B, C)
      // Sums over the tile's pixels: of the colour, of the power and of its products with dx and
      // dy, from which the gradients of mean and conic follow at the end.
      floatp sum_r = 0, sum_g = 0, sum_b = 0, sum_p = 0, sum_x = 0, sum_y = 0;
      floatp sum_xx = 0, sum_xy = 0, sum_yy = 0, extra_x = 0, extra_y = 0, sum_w = 0;
#ifdef SURFACE
      const float8 f = vload8(intersections[p + j], surface);
      floatp by_z = 0, by_l = 0, by_u = 0, by_v = 0, by_x = 0, by_y = 0;
      floatp by_uu = 0, by_uv = 0, by_vv = 0, by_low = 0, by_high = 0;
#endif
      // The same blocks in the same order as in the forward pass, so the same T.
      for (uint left = drawn_blocks[p + j]; left; left &= left - 1) {
        const int k = lowest(left);
        POWER_IN(k)
        // Before 0.99 holds it, for the gradient below.
        const floatp raw = s[OPACITY] * exp2p(power);
        const floatp alpha = select((floatp)(0), fmin(raw, MAX_ALPHA), power >= least);
        // T before this splat: dL/dalpha needs what light reached it.
        const floatp before = T[k];
        const floatp w = alpha * before;
#ifdef SURFACE
        const Depths d = depth_under(f, dx, dy);
        const floatp z = fmin(fmax(d.z, f.s6), f.s7);
        const floatp given = fma(grad_z[k], z, fma(grad_r[k], s[RED],
                                 fma(grad_g[k], s[GREEN], grad_b[k] * s[BLUE])));
        // Where the depth is held at LOW or HIGH, the gradient goes to that bound instead.
        const floatp all = w * grad_z[k], none = 0;
        by_low += select(none, all, isless(d.z, (floatp)(f.s6)));
        by_high += select(none, all, isgreater(d.z, (floatp)(f.s7)));
        const intp free = isgreaterequal(d.z, (floatp)(f.s6)) & islessequal(d.z, (floatp)(f.s7));
        const floatp h = select(none, all, free);
        by_z = fma(h, d.ahead * d.per, by_z);
        // The derivatives of Z (1 + l) / (1 + 2 l + q) by l and by q.
        const floatp by_ahead = h * f.s0 * d.per * (1.0f - 2.0f * d.ahead * d.per);
        const floatp by_q = -h * d.z * d.per, qu = by_q * dx, qv = by_q * dy;
        by_l += by_ahead;
        by_u = fma(by_ahead, dx, by_u);
        by_v = fma(by_ahead, dy, by_v);
        by_x += qu;
        by_y += qv;
        by_uu = fma(qu, dx, by_uu);
        by_uv = fma(qu, dy, by_uv);
        by_vv = fma(qv, dy, by_vv);
#else
        const floatp given = fma(grad_r[k], s[RED], fma(grad_g[k], s[GREEN], grad_b[k] * s[BLUE]));
#endif
        // What is behind this splat gets the rest of the gradient.
        const floatp behind = fma(-w, given, rest[k]);
        rest[k] = behind;
        T[k] = before - w;
        // dL/dc = alpha T dL/dC.
        sum_r = fma(w, grad_r[k], sum_r);
        sum_g = fma(w, grad_g[k], sum_g);
        sum_b = fma(w, grad_b[k], sum_b);
        // More alpha shows more of c and hides more of what is behind.
        const floatp grad_alpha = fma(before, given, -behind / (1.0f - alpha));
        // d alpha / d power = alpha; none where the 0.99 holds it.
        const floatp g = select(alpha * grad_alpha, (floatp)(0), raw > MAX_ALPHA);
        // d ln alpha / d mean = Q d with Q the conic, d ln alpha / d Q = -d d^T / 2: what is summed
        // is g d and g d d^T, and Q and the factors follow after the sum.
        const floatp gx = g * dx, gy = g * dy;  // first moments
        sum_p += g;
        sum_x += gx;
        sum_y += gy;
        sum_xx = fma(gx, dx, sum_xx);  // second moments
        sum_xy = fma(gx, dy, sum_xy);
        sum_yy = fma(gy, dy, sum_yy);
#ifdef ABSOLUTE
        // AbsGS: gradients of a large splat's two sides cancel, their absolute values do not.
        extra_x += fabs(fma(B, gy, A * gx));
        extra_y += fabs(fma(C, gy, B * gx));
#endif
#ifdef SHARE
        extra_x = fma(w, pixel_error[k], extra_x);
#endif
#ifdef WEIGHT
        sum_w += w;  // in pixels
#endif
      }
      // Nobody else writes to this slot, so the sums need no atomics.
      __global float* out = slots + (size_t)RECORD * slot[j];
      // Then the factors that all pixels share: the conic turns sums of g d into the gradient of
      // the mean, and dalpha / dopacity = alpha / opacity.
      const float16 one = sums12(sum_x, sum_y, sum_xx, sum_xy, sum_yy, sum_p, sum_r, sum_g, sum_b,
                                 extra_x, extra_y, sum_w);
      vstore8((float8)(A * one.s0 + B * one.s1, B * one.s0 + C * one.s1, -0.5f * one.s2, -one.s3,
                       -0.5f * one.s4, one.s5 / s[OPACITY], one.s6, one.s7),
              0, out);
      vstore4(one.s89ab, 0, out + 8);
#ifdef SURFACE
      // The mean on the screen moves u and v the other way.
      // Sums of what d Z is by the eight numbers of the fraction, and by l, x and y of the mean.
      const float16 by = sums12(by_z, by_u, by_v, by_uu, by_uv, by_vv, by_low, by_high, by_l, by_x,
                                by_y, by_y);
      out[MEAN_X] -= f.s1 * by.s8 + 2 * (f.s3 * by.s9 + f.s4 * by.sa);
      out[MEAN_Y] -= f.s2 * by.s8 + 2 * (f.s4 * by.s9 + f.s5 * by.sa);
      vstore8(by.lo * (float8)(1, 1, 1, 1, 2, 1, 1, 1), slot[j], depth_slots);
#endif
    }
  }
  // Slots are not cleared beforehand: every intersection writes its own.
  for (int p = end; p < last_intersection; p++) {  // behind the early stop: nothing is felt there
    const int splat = intersections[p];
    const int slot = first_slot[splat] + rank_of_tile(tile_bounds[splat], tile_x, tile_y);
    __global float* out = slots + (size_t)RECORD * slot;
    vstore8((float8)(0), 0, out);
#ifdef SURFACE
    vstore8((float8)(0), slot, depth_slots);
#endif
    vstore4((float4)(0), 0, out + 8);
  }
}
