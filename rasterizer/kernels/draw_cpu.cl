// draw: raster for the screen, CPU form: no gradients, premultiplied RGBA, one or two views. One
// work-item a tile of 16x16 pixels; a block is 4x4 of them, one vector of sixteen floats.
// Intersections are taken in batches.  Per batch every block gets the bits of the splats whose
// ellipse reaches it, and walks them with its pixels in registers: one unforeseen branch a block
// and batch, not one a splat, and nothing of a pixel is read or written in between. Blending is
// 3DGS's, front to back (paper eq. 2): C += c alpha T, T *= 1 - alpha.
// Reads:   the lists of bin (starts, intersections) and the records (N, 12) of each view; with HEAT
//          = 1 value and weight of each splat (float4 x and w); with FOVEATED = 1 the kind of each
//          tile, a byte; where there is one `only` (tiles,): 0 leaves a tile as it is.
// Writes:  image (H, W, 4), alpha = 1 - T; where there is one ends (tiles, 2): the last splat that
//          a tile took in and that of a batch more, -1 where it would have taken a longer list;
//          with HEAT heat_image (H, W, 2), blended as the colours are.  With FOVEATED the same at
//          half the width and height (rounded up): samples at the corner that four pixels share,
//          or their mean; the image has no pixels of coarse tiles then, which foveate.cl fills.
// Units:   pixels, row 0 on top; display sRGB; transmittance T in 0..1.
#define SIDE 4     // pixels of a block, and blocks of a tile
#define BLOCKS 16  // bits of a ushort
#define BATCH 32   // bits of a uint
#include "common/draw_batch.cl"
// Kinds of tiles with FOVEATED: those between, 0, have all their pixels and no samples.
#define COARSE 1   // samples alone
#define SEAM 2     // both

// A kernel's arguments and those of its calls, with and without the heat of value stops.
#ifdef HEAT
#define AND_HEAT , __global const float4* heat, __global float2* heat_image
#define AND_HEAT_OF(view) , __global const float4* heat_##view, __global float2* heat_image_##view
#define GIVE_HEAT(view) , heat_##view, heat_image_##view
#define GIVE_HEAT_IN , heat
#else
#define AND_HEAT
#define AND_HEAT_OF(view)
#define GIVE_HEAT(view)
#define GIVE_HEAT_IN
#endif
#if defined(FOVEATED) && defined(HEAT)
#define AND_FINE , __global const uchar* kinds, __global float* halved, __global float2* hot_halved
#define AND_FINE_OF(v)                                                 \
  , __global const uchar* kinds_##v, __global float* halved_##v,      \
      __global float2* hot_halved_##v
#define GIVE_FINE(v) , kinds_##v, halved_##v, hot_halved_##v
#elif defined(FOVEATED)
#define AND_FINE , __global const uchar* kinds, __global float* halved
#define AND_FINE_OF(v) , __global const uchar* kinds_##v, __global float* halved_##v
#define GIVE_FINE(v) , kinds_##v, halved_##v
#else
#define AND_FINE
#define AND_FINE_OF(v)
#define GIVE_FINE(v)
#endif

// 2^x as in raster_blocks.cl, with a relative error of 2.6e-6: minimax of degree 4.
inline float16 exp2_16(float16 x) {
  const float16 shifted = x + 12582912.0f;
  const float16 f = x - (shifted - 12582912.0f);
  // Far below a step of 8 bits, with a term less than for gradients.
  float16 p = 9.570096662e-3f;
  p = fma(p, f, (float16)(5.591785991e-2f));
  p = fma(p, f, (float16)(2.402474496e-1f));
  p = fma(p, f, (float16)(6.931218148e-1f));
  p = fma(p, f, (float16)(9.999992614e-1f));
  return as_float16(as_int16(p) + (as_int16(shifted) << 23));
}

// Pixels of a block, (4 rows) of (4 pixels) of rgba, to the image.
inline void store_block(float16 r, float16 g, float16 b, float16 a, int x0, int y0, int width,
                        int height, __global float* image) {
  // Four vectors of one channel each -> rows of four pixels of rgba.
  float rows[16 * SIDE];
#define ROW(i, p, q, u, v)                                                                       \
  vstore16((float16)(r.p, g.p, b.p, a.p, r.q, g.q, b.q, a.q, r.u, g.u, b.u, a.u, r.v, g.v, b.v,  \
                     a.v), i, rows)
  ROW(0, s0, s1, s2, s3);
  ROW(1, s4, s5, s6, s7);
  ROW(2, s8, s9, sa, sb);
  ROW(3, sc, sd, se, sf);
#undef ROW
  // At the right and lower edge a block may lie partly outside the image.
  const int columns = min(SIDE, width - x0);
  for (int i = 0; i < SIDE && y0 + i < height; i++) {
    __global float* to = image + 4 * ((size_t)(y0 + i) * width + x0);
    if (columns == SIDE && width % SIDE == 0)  // a cache line, aligned
      STREAM(vload16(i, rows), (__global float16*)to);
    else if (columns == SIDE)
      vstore16(vload16(i, rows), 0, to);
    else
      for (int j = 0; j < columns; j++) vstore4(vload4(SIDE * i + j, rows), j, to);
  }
}

// Pixels of a tile that no splat reaches: nothing, straight to the image.
inline void clear_tile(int x0, int y0, int width, int height, __global float* image) {
  const int columns = min(TILE, width - x0);
  for (int i = 0; i < TILE && y0 + i < height; i++) {
    __global float* to = image + 4 * ((size_t)(y0 + i) * width + x0);
    if (columns == TILE && width % SIDE == 0)  // cache lines, as below
      for (int j = 0; j < SIDE; j++) STREAM((float16)(0), (__global float16*)to + j);
    else
      for (int j = 0; j < columns; j++) vstore4((float4)(0), j, to);
  }
}

#ifdef HEAT
inline void store_heat(float16 hot, float16 weight, int x0, int y0, int width, int height,
                       __global float2* heat_image) {
  // Two channels, so rows of two floats; written pixel by pixel, since heat is rare.
  float h[16], w[16];
  vstore16(hot, 0, h);
  vstore16(weight, 0, w);
  for (int i = 0; i < SIDE && y0 + i < height; i++)
    for (int j = 0; j < min(SIDE, width - x0); j++)
      heat_image[(size_t)(y0 + i) * width + x0 + j] = (float2)(h[SIDE * i + j], w[SIDE * i + j]);
}
#endif

#ifdef FOVEATED
// Of one channel of a block the means of four pixels each: (0, 0), (1, 0), (0, 1) and (1, 1).
inline float4 means_of(float16 c) {
  return 0.25f * (c.s028a + c.s139b + c.s46ce + c.s57df);
}

// Where a picture of half the width and height ends, a block has fewer of them.
inline void store_means(float16 r, float16 g, float16 b, float16 a, int x0, int y0, int width,
                        int height, __global float* image) {
  const float4 red = means_of(r), green = means_of(g), blue = means_of(b), alpha = means_of(a);
  const float16 four = (float16)(red.s0, green.s0, blue.s0, alpha.s0, red.s1, green.s1, blue.s1,
                                 alpha.s1, red.s2, green.s2, blue.s2, alpha.s2, red.s3, green.s3,
                                 blue.s3, alpha.s3);
  float to[16];
  vstore16(four, 0, to);
  for (int i = 0; i < 4; i++)
    if (x0 + i % 2 < width && y0 + i / 2 < height)
      vstore4(vload4(i, to), (size_t)(y0 + i / 2) * width + x0 + i % 2, image);
}

#ifdef HEAT
inline void store_heat_means(float16 hot, float16 weight, int x0, int y0, int width, int height,
                             __global float2* heat_image) {
  float h[4], w[4];
  vstore4(means_of(hot), 0, h);
  vstore4(means_of(weight), 0, w);
  for (int i = 0; i < 4; i++)
    if (x0 + i % 2 < width && y0 + i / 2 < height)
      heat_image[(size_t)(y0 + i / 2) * width + x0 + i % 2] = (float2)(h[i], w[i]);
}
#endif
#endif

// min_transmittance: a block is done when less is left in each of its pixels (3DGS's early stop, by
// blocks).
inline void draw_tile(int tile, int width, int height, int tiles_x, __global const int* tile_start,
                      __global const int* intersections, __global const float* record,
                      float min_transmittance, __global float* image, __global int* ends,
                      __global const uchar* only AND_HEAT AND_FINE) {
  if (only && !only[tile]) return;
  if (ends) vstore2((int2)(-1), tile, ends);
  const int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;
  const int begin = tile_start[tile], end = tile_start[tile + 1];
#if !defined(HEAT) && !defined(FOVEATED)
  if (begin == end) {  // most of a picture with one object in it
    clear_tile(x0, y0, width, height, image);
    return;
  }
#endif
#ifdef FOVEATED
  // Pixels from a sample to the next.  A coarse tile has 8 x 8 samples, in its blocks 0, 2, 8 and
  // 10, each of which takes the place of four.
  const int step = kinds[tile] == COARSE ? 2 : 1;
  const uint used = step > 1 ? 0x0505 : 0xffff;
  // A sample of the last of an odd number of pixels has one beyond it.
  const int last_x = width + 1 & ~1, last_y = height + 1 & ~1;
#else
  const int step = 1, last_x = width, last_y = height;
  const uint used = 0xffff;
#endif
  // Pixel centres of the columns and rows of blocks.
  float16 column_x[SIDE], row_y[SIDE];
  for (int k = 0; k < SIDE; k++) {
    column_x[k] = FOUR_BY_FOUR_X * (float)step + (float)(x0 + k * SIDE);
    row_y[k] = FOUR_BY_FOUR_Y * (float)step + (float)(y0 + k * SIDE);
  }
  // T is the transmittance so far, R G B the sum of c alpha T, of all 16 blocks of the tile.
  float16 T[BLOCKS], R[BLOCKS], G[BLOCKS], B[BLOCKS];
  for (int k = 0; k < BLOCKS; k++) {
    const float16 x = column_x[k % SIDE], y = row_y[k / SIDE];
    // Pixels outside the image are done from the start.
    const int16 inside = isless(x, (float16)(last_x)) & isless(y, (float16)(last_y));
    T[k] = select((float16)(0), (float16)(1), inside);
    R[k] = G[k] = B[k] = 0;
  }
#ifdef HEAT
  float16 H[BLOCKS], W[BLOCKS];
  for (int k = 0; k < BLOCKS; k++) H[k] = W[k] = 0;
#endif
  // Bit k: block k still takes splats.
  uint open = used;
  // A batch is made before the one that precedes it is drawn: the processor has its masks by the
  // time that a block asks for them.  The last one is often in vain.
  Batch batches[2];
#define FETCH(p, into) fetch(p, end, x0, y0, intersections, record, into GIVE_HEAT_IN)
  int p = begin, n = FETCH(p, batches);
  for (int which = 0; n && open; which ^= 1) {
    Batch* batch = batches + which;
    p += n;
    n = FETCH(p, batches + (which ^ 1));
#ifdef FOVEATED
    for (int k = 0; k < BLOCKS && step > 1; k++) {
      if (!(used >> k & 1)) continue;
      uint* of = batch->block_splats + k;  // and of the blocks to the right, below and across
      of[0] |= of[1] | of[SIDE] | of[SIDE + 1];
    }
#endif
    for (int k = 0; k < BLOCKS; k++) {
      uint left = open >> k & 1 ? batch->block_splats[k] : 0;
      if (!left) continue;
      const float16 x = column_x[k % SIDE], y = row_y[k / SIDE];
      // One block's pixels, in registers for all of the batch's splats that reach it.
      float16 t = T[k], r = R[k], g = G[k], b = B[k];
#ifdef HEAT
      float16 hot = H[k], weight = W[k];
#endif
      // Bits in order, lowest first: near to far, as the list is.
      for (; left; left &= left - 1) {
        const int lowest = popcount(~left & (left - 1));
        const float* s = batch->splats + RECORD * lowest;
        const float16 dx = x - s[MEAN_X], dy = y - s[MEAN_Y];
        // -log2(e) / 2 times the power, by Horner in dx.
        const float16 power =
            fma(dx, fma(s[CONIC_A], dx, s[CONIC_B] * dy), s[CONIC_C] * dy * dy);
        // 3DGS: alpha = min(0.99, o exp(-power / 2)), not drawn below min alpha, which is where the
        // power exceeds its threshold; both are negated here.
        const float16 alpha = fmin(s[OPACITY] * exp2_16(power), MAX_ALPHA);
        const float16 w = select((float16)(0), alpha, power >= s[POWER_THRESHOLD]) * t;
        // C += c alpha T.
        r = fma(w, s[RED], r);
        g = fma(w, s[GREEN], g);
        b = fma(w, s[BLUE], b);
#ifdef HEAT
        hot = fma(w, batch->heat[lowest].x, hot);
        weight = fma(w, batch->heat[lowest].y, weight);
#endif
        // T (1 - alpha) = T - alpha T.
        t -= w;
      }
#ifdef HEAT
      H[k] = hot;
      W[k] = weight;
#endif
      T[k] = t;
      R[k] = r;
      G[k] = g;
      B[k] = b;
      // A positive test: what is not a number closes the block.  The mask's bytes as two words, in
      // half the instructions of the greatest of sixteen.
      const ulong2 some = as_ulong2(convert_char16(t >= min_transmittance));
      if (!(some.x | some.y)) open &= ~(1u << k);
    }
  }
  // Nothing of the list behind p was looked at; a batch that is not full would have taken more.
  if (ends && !open && (p - begin) % BATCH == 0)
    vstore2((int2)(intersections[p - 1], intersections[min(p + BATCH, end) - 1]), tile, ends);
  // Premultiplied, over nothing: the background is put behind it when it is shown.
#ifdef FOVEATED
  const int half_w = (width + 1) / 2, half_h = (height + 1) / 2;
  for (int k = 0; k < BLOCKS; k++) {
    if (!(used >> k & 1)) continue;
    const int x = x0 + k % SIDE * SIDE, y = y0 + k / SIDE * SIDE;
    if (step > 1) {
      store_block(R[k], G[k], B[k], 1 - T[k], x / 2, y / 2, half_w, half_h, halved);
#ifdef HEAT
      store_heat(H[k], W[k], x / 2, y / 2, half_w, half_h, hot_halved);
#endif
      continue;
    }
    if (kinds[tile] != SEAM) continue;
    store_means(R[k], G[k], B[k], 1 - T[k], x / 2, y / 2, half_w, half_h, halved);
#ifdef HEAT
    store_heat_means(H[k], W[k], x / 2, y / 2, half_w, half_h, hot_halved);
#endif
  }
  if (step > 1) return;
#endif
  for (int k = 0; k < BLOCKS; k++)
    store_block(R[k], G[k], B[k], 1 - T[k], x0 + k % SIDE * SIDE, y0 + k / SIDE * SIDE, width,
                height, image);
#ifdef HEAT
  for (int k = 0; k < BLOCKS; k++)
    store_heat(H[k], W[k], x0 + k % SIDE * SIDE, y0 + k / SIDE * SIDE, width, height, heat_image);
#endif
}

// One view, or the same tile of two views one after the other: eyes share what the caches hold.
__kernel void draw(int width, int height, int tiles_x, float min_transmittance,
                   __global const int* starts_0, __global const int* intersections_0,
                   __global const float* record_0, __global float* image_0, __global int* ends_0,
                   __global const uchar* only_0 AND_HEAT_OF(0) AND_FINE_OF(0),
                   __global const int* starts_1, __global const int* intersections_1,
                   __global const float* record_1, __global float* image_1, __global int* ends_1,
                   __global const uchar* only_1 AND_HEAT_OF(1) AND_FINE_OF(1)) {
  const int tile = get_global_id(0);
  draw_tile(tile, width, height, tiles_x, starts_0, intersections_0, record_0, min_transmittance,
            image_0, ends_0, only_0 GIVE_HEAT(0) GIVE_FINE(0));
  if (image_1)
    draw_tile(tile, width, height, tiles_x, starts_1, intersections_1, record_1, min_transmittance,
              image_1, ends_1, only_1 GIVE_HEAT(1) GIVE_FINE(1));
}
