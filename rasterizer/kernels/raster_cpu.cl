// raster, CPU form, for training (draw_cpu.cl is for the screen): one work-item a tile of 16x16
// pixels, kept in registers and the first cache.
// A block is eight pixels, BLOCK_W x BLOCK_H, one vector.  Columns of blocks are numbered first
// down, then right, so that a column's blocks are neighbouring bits of a mask.
// Reads: tile_start (tiles + 1), intersections, record.  Early stop: blocks whose transmittance is
// below STOP everywhere are dropped from the mask every BATCH intersections; a tile ends with its last.
#include "common/vector.cl"
#include "common/raster.cl"
#define BLOCK_W 4  // 8 x 1 touches a sixth more blocks
#define BLOCK_H 2
#define DOWN (TILE / BLOCK_H)   // blocks in a column
#define ACROSS (TILE / BLOCK_W)  // columns
#define BLOCKS (DOWN * ACROSS)   // 32: one bit each
#define COLUMN_BITS (0xffffffffu >> (32 - DOWN))
#define SHIFT_H 1                // log2 of BLOCK_H
#define BATCH 32

#define LANE_X (float8)(0.5f, 1.5f, 2.5f, 3.5f, 0.5f, 1.5f, 2.5f, 3.5f)
#define LANE_Y (float8)(0.5f, 0.5f, 0.5f, 0.5f, 1.5f, 1.5f, 1.5f, 1.5f)

// A batch of intersections of one tile.
typedef struct {
  float splats[BATCH * RECORD];
  uint blocks[BATCH];  // those that the splat's ellipse touches
} Batch;

// What of a batch the masks are made of, a column each.
typedef struct {
  float x[BATCH], y[BATCH], a[BATCH], b[BATCH], c[BATCH], half_x[BATCH], half_y[BATCH], power_threshold[BATCH];
} Columns;

// Bit k of each block that the ellipse touches, for eight splats from 8 g on: in every column of
// blocks the interval of y while the ellipse is, in x, between its first and last pixel centres.
//   y = tilt x +- sqrt((power_threshold - x^2 / covariance_xx) / c), largest at x = lean
// With room for what float rounding does to a pixel's own test, as in span_of_row of tiles.cl: no
// pixel is lost, so every bit of the image is that of a test of all blocks.
inline uint8 blocks_of_eight(const Columns* e, int g, int x0, int y0) {
  const float8 x = vload8(g, e->x) - (x0 + 0.5f), y = vload8(g, e->y) - (y0 + 0.5f);
  const float8 a = vload8(g, e->a), b = vload8(g, e->b), c = vload8(g, e->c);
  const float8 ex = vload8(g, e->half_x), ey = vload8(g, e->half_y), power_threshold = vload8(g, e->power_threshold);
  const float8 per_c = 1.0f / c, tilt = -b * per_c, lean = -b / a * ey;
  const float8 most = (1.0001f * power_threshold + 5e-7f * (a * ex * ex + c * ey * ey)) * per_c;
  const float8 per_xx = power_threshold / fmax(ex * ex, FLT_MIN) * per_c;
  const float8 spare = 1e-6f * (fabs(tilt) * (ex + fabs(x)) + ey + fabs(y));
  const float8 above = y - spare, below = y + spare, low = -1, high = TILE;
  float8 left = -x;
  uint8 mask = 0;
  for (int column = 0; column < ACROSS; column++) {
    const float8 right = left + (BLOCK_W - 1);
    const float8 up = fmin(fmax(-lean, left), right), down = fmin(fmax(lean, left), right);
    const float8 highest = above + tilt * up - sqrt(fmax(most - up * up * per_xx, 0.0f));
    const float8 lowest = below + tilt * down + sqrt(fmax(most - down * down * per_xx, 0.0f));
    const int8 top = convert_int8(ceil(fmin(fmax(highest, 0.0f), high))) / BLOCK_H;
    const int8 bottom = convert_int8(floor(fmin(fmax(lowest, low), high - 1))) >> SHIFT_H;
    const uint8 rows = ((uint8)(COLUMN_BITS) << as_uint8(top)) &
                       ((uint8)(COLUMN_BITS) >> as_uint8(DOWN - 1 - bottom)) & COLUMN_BITS;
    const int8 meets = (left <= ex) & (right >= -ex);
    mask |= (rows & as_uint8(meets)) << (uint8)(DOWN * column);
    left += BLOCK_W;
  }
  return mask;
}

// Fills a batch from the list [p, end) and returns how many it got.  Records are copied first:
// independent loads, so that their misses overlap.  The masks are made eight at a time and ahead of
// use: a mask that is late makes every mispredicted end of a block loop dear.
inline int fetch(int p, int end, int x0, int y0, __global const int* intersections,
                 __global const float* record, Batch* batch) {
  const int n = min(BATCH, end - p);
  Columns e;
  for (int j = 0; j < n; j++) {
    __global const float* from = record + (size_t)RECORD * intersections[p + j];
    float* s = batch->splats + RECORD * j;
    vstore8(vload8(0, from), 0, s);
    vstore4(vload4(0, from + 8), 0, s + 8);
    e.x[j] = s[MEAN_X];
    e.y[j] = s[MEAN_Y];
    e.a[j] = s[CONIC_A];
    e.b[j] = s[CONIC_B];
    e.c[j] = s[CONIC_C];
    e.half_x[j] = s[EXTENT_X];
    e.half_y[j] = s[EXTENT_Y];
    e.power_threshold[j] = s[POWER_THRESHOLD];
  }
  for (int g = 0; g * LANES < n; g++)
#ifdef EVERY_BLOCK  // what a test compares with
    vstore8((uint8)(0xffffffffu), g, batch->blocks);
#else
    vstore8(blocks_of_eight(&e, g, x0, y0), g, batch->blocks);
#endif
  return n;
}

// 1 on the pixels of block k that lie in the image: those outside need nothing and stop nothing.
inline float8 inside(int k, int x0, int y0, int width, int height) {
  const float8 x = LANE_X + (float)(x0 + k / DOWN * BLOCK_W);
  const float8 y = LANE_Y + (float)(y0 + k % DOWN * BLOCK_H);
  return select((float8)(0), (float8)(1), isless(x, (float8)(width)) & isless(y, (float8)(height)));
}

inline int lowest(uint bits) { return popcount(~bits & (bits - 1)); }  // number of the lowest bit

inline uint still_open(uint open, const float8* T) {
  for (int k = 0; k < BLOCKS; k++)
    if (!(max8(T[k]) >= STOP)) open &= ~(1u << k);
  return open;
}

#ifdef SURFACE
// The fraction of surface.cl: depth under pixels (dx, dy) from the mean, before it is held.
typedef struct {
  float8 z, ahead, per;  // metres; 1 + l; 1 / (1 + 2 l + q)
} Depth8;

inline Depth8 depth_under(const float8 f, float8 dx, float8 dy) {
  Depth8 d;
  const float8 l = fma(f.s1, dx, f.s2 * dy);
  const float8 q = fma(dx, fma(f.s3, dx, 2 * f.s4 * dy), f.s5 * dy * dy);
  d.ahead = 1.0f + l;
  d.per = 1.0f / fmax(fma((float8)(2.0f), l, 1.0f + q), SURFACE_LEAST);
  d.z = f.s0 * d.ahead * d.per;
  return d;
}
#endif

// SURFACE: with a depth a splat (surface.cl), metres become the sum of alpha T z.
__kernel void rasterize(RASTERIZE_TAKES) {
  const int tile = get_global_id(0);
  const int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;
#ifdef SURFACE
  float8 Z[BLOCKS];
  for (int k = 0; k < BLOCKS; k++) Z[k] = 0;
#endif
  float8 T[BLOCKS], R[BLOCKS], G[BLOCKS], B[BLOCKS], block_x[BLOCKS], block_y[BLOCKS];
  for (int k = 0; k < BLOCKS; k++) {
    block_x[k] = LANE_X + (float)(k / DOWN * BLOCK_W);  // pixel centres, from the tile's corner
    block_y[k] = LANE_Y + (float)(k % DOWN * BLOCK_H);
    T[k] = inside(k, x0, y0, width, height);
    R[k] = G[k] = B[k] = 0;
  }
  Batch batch;
  uint open = 0xffffffffu;
  int p = tile_start[tile];
  const int end = tile_start[tile + 1];
  while (p < end && open) {
    const int n = fetch(p, end, x0, y0, intersections, record, &batch);
    for (int j = 0; j < n; j++) {
      const float* s = batch.splats + RECORD * j;
      const float mx = s[MEAN_X] - x0, my = s[MEAN_Y] - y0;
      const float qa = -HALF_LOG2E * s[CONIC_A], qb = -2 * HALF_LOG2E * s[CONIC_B];
      const float qc = -HALF_LOG2E * s[CONIC_C], least = -HALF_LOG2E * s[POWER_THRESHOLD];
#ifdef SURFACE
      const float8 f = vload8(intersections[p + j], surface);
#endif
      for (uint left = open & batch.blocks[j]; left; left &= left - 1) {
        const int k = lowest(left);
        const float8 dx = block_x[k] - mx, dy = block_y[k] - my;
        const float8 power = fma(dx, fma(qa, dx, qb * dy), qc * dy * dy);
        float8 alpha = fmin(s[OPACITY] * exp2_8(power), MAX_ALPHA);
        alpha = select((float8)(0), alpha, power >= least);
        const float8 w = alpha * T[k];
        R[k] = fma(w, s[RED], R[k]);
        G[k] = fma(w, s[GREEN], G[k]);
        B[k] = fma(w, s[BLUE], B[k]);
#ifdef SURFACE
        Z[k] = fma(w, fmin(fmax(depth_under(f, dx, dy).z, f.s6), f.s7), Z[k]);
#endif
        T[k] -= w;
      }
    }
    p += n;
    open = still_open(open, T);
  }
  tile_end[tile] = p;
  const size_t plane = (size_t)width * height;
  for (int k = 0; k < BLOCKS; k++) {
    const float8 t = T[k];
    float r[LANES], g[LANES], b[LANES], a[LANES];
    vstore8(fma(t, red, R[k]), 0, r);
    vstore8(fma(t, green, G[k]), 0, g);
    vstore8(fma(t, blue, B[k]), 0, b);
    vstore8(t, 0, a);
#ifdef SURFACE
    float z[LANES];
    vstore8(Z[k], 0, z);
#endif
    for (int lane = 0; lane < LANES; lane++) {
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
//   dL/dalpha = T (c . dL/dC) - rest / (1 - alpha)
// which needs no division to get T back.  Each intersection writes its 12 numbers to its own slot.
// For growing: ABSOLUTE sums |gradient of the mean| in slots 9 and 10, or SHARE sums alpha T times
// an error of the pixel in 9; WEIGHT sums alpha T in 11.  Each only where it is defined.
__kernel void rasterize_backward(RASTERIZE_BACKWARD_TAKES) {
  const int tile = get_global_id(0);
  const int tile_x = tile % tiles_x, tile_y = tile / tiles_x;
  const int x0 = tile_x * TILE, y0 = tile_y * TILE;
  const size_t plane = (size_t)width * height;
  float8 T[BLOCKS], rest[BLOCKS], grad_r[BLOCKS], grad_g[BLOCKS], grad_b[BLOCKS];
  float8 block_x[BLOCKS], block_y[BLOCKS];
#ifdef SHARE
  float8 pixel_error[BLOCKS];
#endif
#ifdef SURFACE
  float8 grad_z[BLOCKS];
#endif
  for (int k = 0; k < BLOCKS; k++) {
    block_x[k] = LANE_X + (float)(k / DOWN * BLOCK_W);  // pixel centres, from the tile's corner
    block_y[k] = LANE_Y + (float)(k % DOWN * BLOCK_H);
    float r[LANES], g[LANES], b[LANES], d[LANES];
#ifdef SHARE
    float e[LANES];
#endif
#ifdef SURFACE
    float z[LANES];
#endif
    for (int lane = 0; lane < LANES; lane++) {
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
      d[lane] = r[lane] * image[at] + g[lane] * image[at + plane] + b[lane] * image[at + 2 * plane];
      if (with_transmittance) d[lane] += grad_transmittance[at] * transmittance[at];
#ifdef SURFACE
      d[lane] += z[lane] * metres[at];
#endif
    }
    T[k] = inside(k, x0, y0, width, height);
    grad_r[k] = vload8(0, r);
    grad_g[k] = vload8(0, g);
    grad_b[k] = vload8(0, b);
    rest[k] = vload8(0, d);
#ifdef SHARE
    pixel_error[k] = vload8(0, e);
#endif
#ifdef SURFACE
    grad_z[k] = vload8(0, z);
#endif
  }
  Batch batch;
  uint open = 0xffffffffu;
  const int end = tile_end[tile], last_intersection = tile_start[tile + 1];
  for (int p = tile_start[tile]; p < end; p += BATCH) {
    const int n = fetch(p, end, x0, y0, intersections, record, &batch);
    int slot[BATCH];  // ahead of use, so that these misses overlap, too
    for (int j = 0; j < n; j++) {
      const int splat = intersections[p + j];
      slot[j] = first_slot[splat] + rank_of_tile(tile_bounds[splat], tile_x, tile_y);
    }
    for (int j = 0; j < n; j++) {
      const float* s = batch.splats + RECORD * j;
      const float mx = s[MEAN_X] - x0, my = s[MEAN_Y] - y0;
      const float A = s[CONIC_A], B = s[CONIC_B], C = s[CONIC_C];
      const float qa = -HALF_LOG2E * A, qb = -2 * HALF_LOG2E * B;
      const float qc = -HALF_LOG2E * C, least = -HALF_LOG2E * s[POWER_THRESHOLD];
      float8 sum_r = 0, sum_g = 0, sum_b = 0, sum_p = 0, sum_x = 0, sum_y = 0;
      float8 sum_xx = 0, sum_xy = 0, sum_yy = 0, extra_x = 0, extra_y = 0, sum_w = 0;
#ifdef SURFACE
      const float8 f = vload8(intersections[p + j], surface);
      float8 by_z = 0, by_l = 0, by_u = 0, by_v = 0, by_x = 0, by_y = 0;
      float8 by_uu = 0, by_uv = 0, by_vv = 0, by_low = 0, by_high = 0;
#endif
      for (uint left = open & batch.blocks[j]; left; left &= left - 1) {
        const int k = lowest(left);
        const float8 dx = block_x[k] - mx, dy = block_y[k] - my;
        const float8 power = fma(dx, fma(qa, dx, qb * dy), qc * dy * dy);
        const float8 raw = s[OPACITY] * exp2_8(power);
        const float8 alpha = select((float8)(0), fmin(raw, MAX_ALPHA), power >= least);
        const float8 before = T[k];
        const float8 w = alpha * before;
#ifdef SURFACE
        const Depth8 d = depth_under(f, dx, dy);
        const float8 z = fmin(fmax(d.z, f.s6), f.s7);
        const float8 given = fma(grad_z[k], z, fma(grad_r[k], s[RED],
                                 fma(grad_g[k], s[GREEN], grad_b[k] * s[BLUE])));
        const float8 all = w * grad_z[k], none = 0;
        by_low += select(none, all, isless(d.z, (float8)(f.s6)));
        by_high += select(none, all, isgreater(d.z, (float8)(f.s7)));
        const int8 free = isgreaterequal(d.z, (float8)(f.s6)) & islessequal(d.z, (float8)(f.s7));
        const float8 h = select(none, all, free);
        by_z = fma(h, d.ahead * d.per, by_z);
        const float8 by_ahead = h * f.s0 * d.per * (1.0f - 2.0f * d.ahead * d.per);
        const float8 by_q = -h * d.z * d.per, qu = by_q * dx, qv = by_q * dy;
        by_l += by_ahead;
        by_u = fma(by_ahead, dx, by_u);
        by_v = fma(by_ahead, dy, by_v);
        by_x += qu;
        by_y += qv;
        by_uu = fma(qu, dx, by_uu);
        by_uv = fma(qu, dy, by_uv);
        by_vv = fma(qv, dy, by_vv);
#else
        const float8 given = fma(grad_r[k], s[RED], fma(grad_g[k], s[GREEN], grad_b[k] * s[BLUE]));
#endif
        const float8 behind = fma(-w, given, rest[k]);
        rest[k] = behind;
        T[k] = before - w;
        sum_r = fma(w, grad_r[k], sum_r);
        sum_g = fma(w, grad_g[k], sum_g);
        sum_b = fma(w, grad_b[k], sum_b);
        const float8 grad_alpha = fma(before, given, -behind / (1.0f - alpha));
        // d alpha / d power = alpha; none where the 0.99 holds it.
        const float8 g = select(alpha * grad_alpha, (float8)(0), raw > MAX_ALPHA);
        const float8 gx = g * dx, gy = g * dy;
        sum_p += g;
        sum_x += gx;
        sum_y += gy;
        sum_xx = fma(gx, dx, sum_xx);
        sum_xy = fma(gx, dy, sum_xy);
        sum_yy = fma(gy, dy, sum_yy);
#ifdef ABSOLUTE
        extra_x += fabs(fma(B, gy, A * gx));
        extra_y += fabs(fma(C, gy, B * gx));
#endif
#ifdef SHARE
        extra_x = fma(w, pixel_error[k], extra_x);
#endif
#ifdef WEIGHT
        sum_w += w;
#endif
      }
      __global float* out = slots + (size_t)RECORD * slot[j];
      const float8 one = sums8(sum_x, sum_y, sum_xx, sum_xy, sum_yy, sum_p, sum_r, sum_g);
      vstore8((float8)(A * one.s0 + B * one.s1, B * one.s0 + C * one.s1, -0.5f * one.s2, -one.s3,
                       -0.5f * one.s4, one.s5 / s[OPACITY], one.s6, one.s7),
              0, out);
#ifdef SURFACE
      // The mean on the screen moves u and v the other way.
      const float l = sum8(by_l), x = sum8(by_x), y = sum8(by_y);
      out[MEAN_X] -= f.s1 * l + 2 * (f.s3 * x + f.s4 * y);
      out[MEAN_Y] -= f.s2 * l + 2 * (f.s4 * x + f.s5 * y);
      vstore8(sums8(by_z, by_u, by_v, by_uu, 2 * by_uv, by_vv, by_low, by_high), slot[j],
              depth_slots);
#endif
      vstore4((float4)(sum8(sum_b), sum8(extra_x), sum8(extra_y), sum8(sum_w)), 0, out + 8);
    }
    open = still_open(open, T);
  }
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
