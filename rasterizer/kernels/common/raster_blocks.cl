// raster_blocks: the blocks of pixels that raster_cpu.cl keeps a tile in, and the batches of
// intersections that it takes.  A block is one vector of PIXELS pixels.  Blocks are numbered down
// their column first, then to the right, so that a column's blocks are neighbouring bits of a mask.
// Reads:   STOP (common/raster.cl), RECORD (common/record.cl); PIXELS; EVERY_BLOCK, for a test.
// Defines: floatp, intp, their loads, stores and some(); BLOCK_W, BLOCK_H, BLOCKS, ALL_BLOCKS,
//          BATCH; exp2p(), sums12(); copy_record(); Batch and fetch(); inside(), lowest(),
//          still_open(); BLOCK_CENTRES, OPEN_TILE, EXPONENTS and POWER_IN, which every pass takes
//          that walks over a tile: the same operations, so the same decisions.
// Units:   pixels, row 0 on top; exponents are of 2.
#include "common/vector.cl"
#include "common/raster.cl"
#ifndef PIXELS  // of a block: the lanes of the processor's widest vectors, 8 or 16
#define PIXELS 8
#endif
#define BLOCK_W 4  // 8 x 1 touches a sixth more blocks than 4 x 2
#define BLOCK_H (PIXELS / BLOCK_W)
#define DOWN (TILE / BLOCK_H)    // blocks in a column
#define ACROSS (TILE / BLOCK_W)  // columns
#define BLOCKS (DOWN * ACROSS)   // 32 or 16: one bit each
#define COLUMN_BITS (0xffffffffu >> (32 - DOWN))
#define ALL_BLOCKS (0xffffffffu >> (32 - BLOCKS))
#define BATCH 32

// One number of each pixel of a block.  LANE_X and LANE_Y: pixel centres, from its corner.
#if PIXELS == 16
// Four rows of four: where vectors have sixteen lanes, a splat touches half as many blocks.
#define SHIFT_H 2  // log2 of BLOCK_H
typedef float16 floatp;
typedef int16 intp;
#define AS_FLOATP as_float16
#define AS_INTP as_int16
#define LOAD_PIXELS vload16
#define STORE_PIXELS vstore16
#define LANE_X FOUR_BY_FOUR_X
#define LANE_Y FOUR_BY_FOUR_Y
// Whether some lane of a comparison is true: its bytes as two words.
inline int some(intp mask) {
  const ulong2 bytes = as_ulong2(convert_char16(mask));
  return (bytes.x | bytes.y) != 0;
}
#else
// Two rows of four.  As halves of wider vectors, sixteen would take all registers twice.
#define SHIFT_H 1
typedef float8 floatp;
typedef int8 intp;
#define AS_FLOATP as_float8
#define AS_INTP as_int8
#define LOAD_PIXELS vload8
#define STORE_PIXELS vstore8
#define LANE_X (float8)(0.5f, 1.5f, 2.5f, 3.5f, 0.5f, 1.5f, 2.5f, 3.5f)
#define LANE_Y (float8)(0.5f, 0.5f, 0.5f, 0.5f, 1.5f, 1.5f, 1.5f, 1.5f)
inline int some(intp mask) { return as_ulong(convert_char8(mask)) != 0; }
#endif

// 2^x for the exponents that a splat's falloff has, [-126, 0.1]; relative error 2e-7.
// Outside that range the bits are garbage but never a trap: mask them.
// Splitting into an integer and a fraction in -0.5 .. 0.5 leaves a polynomial for 2^f, and the
// integer goes straight to the exponent bits: exp() of a CPU's library takes several times as long.
inline floatp exp2p(floatp x) {
  // Adding 1.5 * 2^23 rounds to the nearest integer and leaves it in the low bits.
  const floatp shifted = x + 12582912.0f;
  const floatp f = x - (shifted - 12582912.0f);
  // Horner, minimax of degree 5, but for exactly 1 at 0: its own error is 1e-7.
  floatp p = 1.327647152e-3f;
  p = fma(p, f, (floatp)(9.675541331e-3f));
  p = fma(p, f, (floatp)(5.550713275e-2f));
  p = fma(p, f, (floatp)(2.402211972e-1f));
  p = fma(p, f, (floatp)(6.931469671e-1f));
  p = fma(p, f, (floatp)(1.0f));
  // Bit 23 is the exponent's lowest, so this multiplies by 2^integer.
  return AS_FLOATP(AS_INTP(p) + (AS_INTP(shifted) << 23));
}

// Sums over the pixels of twelve numbers, (a, b, ..., l) and four more that mean nothing, as one
// tree: each step adds the halves, quarters ... of several of them at a time.
#if PIXELS == 16
// (a, b) with eight lanes each that are left of sixteen.
inline float16 add_halves(float16 a, float16 b) {
  return (float16)(a.lo, b.lo) + (float16)(a.hi, b.hi);
}

// (a, b, c, d) with four lanes each.
inline float16 sums_of_four(float16 a, float16 b, float16 c, float16 d) {
  const float16 ab = add_halves(a, b), cd = add_halves(c, d);
  return (float16)(ab.s0123, ab.s89ab, cd.s0123, cd.s89ab) +
         (float16)(ab.s4567, ab.scdef, cd.s4567, cd.scdef);
}

inline float16 sums12(float16 a, float16 b, float16 c, float16 d, float16 e, float16 f, float16 g,
                      float16 h, float16 i, float16 j, float16 k, float16 l) {
  const float16 one = sums_of_four(a, b, c, d), two = sums_of_four(e, f, g, h);
  const float16 three = sums_of_four(i, j, k, l);
  // Neighbours twice: two lanes each, then the sums.
  const float16 first = (float16)(one.even, two.even) + (float16)(one.odd, two.odd);
  const float8 last = three.even + three.odd;
  return (float16)(first.even + first.odd, last.even + last.odd, (float4)(0));
}
#else
// The first eight as one tree (vector.cl), four by themselves.
inline float16 sums12(float8 a, float8 b, float8 c, float8 d, float8 e, float8 f, float8 g,
                      float8 h, float8 i, float8 j, float8 k, float8 l) {
  return (float16)(sums8(a, b, c, d, e, f, g, h), sum8(i), sum8(j), sum8(k), sum8(l), (float4)(0));
}
#endif

// A batch of intersections of one tile; the records as they are.
typedef struct {
  float splats[BATCH * RECORD];
  uint blocks[BATCH];  // those that the splat's ellipse touches
} Batch;

#include "common/columns.cl"

// The tile walk of tiles.cl, turned: columns of blocks instead of rows of tiles.  Bit k of each
// block that the ellipse touches, for eight splats from 8 g on: in every column of blocks the
// interval of y while the ellipse is, in x, between its first and last pixel centres.
// y = slope x +- sqrt((T - x^2 / Sigma'_xx) / C), slope = -B / C, lowest at x = x_extreme
// With room for what float rounding does to a pixel's own test, as in columns_of_row(): no pixel is
// lost, so every bit of the image is that of a test of all blocks.
inline uint8 blocks_of_eight(const Columns* e, int g, int x0, int y0) {
  const float8 x = vload8(g, e->x) - (x0 + 0.5f), y = vload8(g, e->y) - (y0 + 0.5f);
  const float8 a = vload8(g, e->a), b = vload8(g, e->b), c = vload8(g, e->c);
  const float8 ex = vload8(g, e->half_x), ey = vload8(g, e->half_y),
      power_threshold = vload8(g, e->power_threshold);
  const float8 inv_c = 1.0f / c, slope = -b * inv_c, x_extreme = -b / a * ey;
  const float8 threshold =
      (1.0001f * power_threshold + 5e-7f * (a * ex * ex + c * ey * ey)) * inv_c;
  const float8 inv_xx = power_threshold / MAXIMUM(ex * ex, (float8)(FLT_MIN)) * inv_c;
  const float8 rounding = 1e-6f * (fabs(slope) * (ex + fabs(x)) + ey + fabs(y));
  // The room for rounding, added to the two ends once.
  const float8 above = y - rounding, below = y + rounding, zero = 0, low = -1, high = TILE;
  float8 left = -x;
  uint8 mask = 0;
  for (int column = 0; column < ACROSS; column++) {
    const float8 right = left + (BLOCK_W - 1);
    const float8 x_top = MINIMUM(MAXIMUM(-x_extreme, left), right),
        x_bottom = MINIMUM(MAXIMUM(x_extreme, left), right);
    const float8 highest =
        above + slope * x_top - sqrt(MAXIMUM(threshold - x_top * x_top * inv_xx, zero));
    const float8 lowest =
        below + slope * x_bottom + sqrt(MAXIMUM(threshold - x_bottom * x_bottom * inv_xx, zero));
    // Rows of blocks: from the one that holds the first pixel centre to the one that holds the
    // last.
    const int8 top = convert_int8(ceil(MINIMUM(MAXIMUM(highest, zero), high))) / BLOCK_H;
    const int8 bottom = convert_int8(floor(MINIMUM(MAXIMUM(lowest, low), high - 1))) >> SHIFT_H;
    // Ones from top to bottom; a shift by more than the column empties it.
    const uint8 rows = ((uint8)(COLUMN_BITS) << as_uint8(top)) &
                       ((uint8)(COLUMN_BITS) >> as_uint8(DOWN - 1 - bottom)) & COLUMN_BITS;
    // Columns left or right of the ellipse: their roots were held at 0 and mean nothing.
    const int8 meets = (left <= ex) & (right >= -ex);
    mask |= (rows & as_uint8(meets)) << (uint8)(DOWN * column);
    left += BLOCK_W;
  }
  return mask;
}

inline void copy_record(__global const float* record, int splat, float* to) {
  __global const float* from = record + (size_t)RECORD * splat;
  vstore8(vload8(0, from), 0, to);
  vstore4(vload4(0, from + 8), 0, to + 8);
}

// Fills a batch from the list [p, end) and returns how many it got.  Records are copied first:
// independent loads, so that their misses overlap.  The masks are made eight at a time and ahead of
// use: a mask that is late makes every mispredicted end of a block loop dear.
inline int fetch(int p, int end, int x0, int y0, __global const int* intersections,
                 __global const float* record, Batch* batch) {
  const int n = min(BATCH, end - p);
  Columns e;
  for (int j = 0; j < n; j++) {
    float* s = batch->splats + RECORD * j;
    copy_record(record, intersections[p + j], s);
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
    vstore8((uint8)(ALL_BLOCKS), g, batch->blocks);
#else
    vstore8(blocks_of_eight(&e, g, x0, y0), g, batch->blocks);
#endif
  return n;
}

// The transmittance at the start.
// 1 on the pixels of block k that lie in the image: those outside need nothing and stop nothing.
inline floatp inside(int k, int x0, int y0, int width, int height) {
  const floatp x = LANE_X + (float)(x0 + k / DOWN * BLOCK_W);
  const floatp y = LANE_Y + (float)(y0 + k % DOWN * BLOCK_H);
  return select((floatp)(0), (floatp)(1), isless(x, (floatp)(width)) & isless(y, (floatp)(height)));
}

inline int lowest(uint bits) { return popcount(~bits & (bits - 1)); }  // number of the lowest bit

// 3DGS stops a pixel; here a block stops when all of its pixels do.  A positive test: what is not a
// number stops it, too.
inline uint still_open(uint open, const floatp* T) {
  for (int k = 0; k < BLOCKS; k++)
    if (!some(T[k] >= STOP)) open &= ~(1u << k);
  return open;
}

// Of block k of the tile: its pixel centres, from the tile's corner.
#define BLOCK_CENTRES(k)                             \
  block_x[k] = LANE_X + (float)(k / DOWN * BLOCK_W); \
  block_y[k] = LANE_Y + (float)(k % DOWN * BLOCK_H);

// A tile's list, near to far: p, its next intersection, and its end; the blocks that are open.
#define OPEN_TILE           \
  Batch batch;              \
  uint open = ALL_BLOCKS;   \
  int p = tile_start[tile]; \
  const int end = tile_start[tile + 1];

// Of splat s: its conic (A, B, C) and threshold times -log2(e) / 2, exponents of 2.
#define EXPONENTS(A, B, C)                                    \
  const float qa = -HALF_LOG2E * A, qb = -2 * HALF_LOG2E * B; \
  const float qc = -HALF_LOG2E * C, least = -HALF_LOG2E * s[POWER_THRESHOLD];

// In the pixels of block k, log2 of exp(-power / 2): largest at the mean (mx, my), `least` at the
// threshold.
#define POWER_IN(k)                                        \
  const floatp dx = block_x[k] - mx, dy = block_y[k] - my; \
  const floatp power = fma(dx, fma(qa, dx, qb * dy), qc * dy * dy);
