// draw_batch: the batches of intersections that draw_cpu.cl takes, and which blocks of a tile each
// splat reaches.
// Reads:   the records (N, 12) of project and a tile's list; SIDE, BLOCKS and BATCH; with HEAT = 1
//          value and weight of each splat (float4 x and w).
// Defines: Batch and fetch().
// Units:   pixels, row 0 on top; exponents are of 2.
#include "common/tiles.cl"
#include "common/vector.cl"

typedef struct {
  // Conic and threshold times -log2(e) / 2: exp(-power / 2) = 2^(...), with no factor left to
  // apply.
  float splats[BATCH * RECORD];
  uint block_splats[BLOCKS];  // per block: bit j where splat j reaches it
#ifdef HEAT
  float2 heat[BATCH];         // value and weight of each
#endif
} Batch;

// Sixteen words of sixteen bits, turned: bit j of word k becomes bit k of word j.
inline ushort16 transpose_bits(ushort16 a) {
  // Four rounds of a butterfly, as for a matrix: halves of 8, 4, 2 and 1 words change places with
  // halves of as many bits.
  ushort16 other = a.s89abcdef01234567, low, high;
  low = (a & (ushort16)0x00ff) | other << (ushort16)8;
  high = (a & (ushort16)0xff00) | other >> (ushort16)8;
  a = (ushort16)(low.lo, high.hi);
  other = a.s45670123cdef89ab;
  low = (a & (ushort16)0x0f0f) | (other & (ushort16)0x0f0f) << (ushort16)4;
  high = (a & (ushort16)0xf0f0) | (other & (ushort16)0xf0f0) >> (ushort16)4;
  a = (ushort16)(low.s0123, high.s4567, low.s89ab, high.scdef);
  other = a.s23016745ab89efcd;
  low = (a & (ushort16)0x3333) | (other & (ushort16)0x3333) << (ushort16)2;
  high = (a & (ushort16)0xcccc) | (other & (ushort16)0xcccc) >> (ushort16)2;
  a = (ushort16)(low.s01, high.s23, low.s45, high.s67, low.s89, high.sab, low.scd, high.sef);
  other = a.s1032547698badcfe;
  low = (a & (ushort16)0x5555) | (other & (ushort16)0x5555) << (ushort16)1;
  high = (a & (ushort16)0xaaaa) | (other & (ushort16)0xaaaa) >> (ushort16)1;
  return (ushort16)(low.s0, high.s1, low.s2, high.s3, low.s4, high.s5, low.s6, high.s7, low.s8,
                    high.s9, low.sa, high.sb, low.sc, high.sd, low.se, high.sf);
}

// Here x and y of the mean count from the centre of the tile's first pixel.
#include "common/columns.cl"

// The tile walk once more, for blocks in a tile: bit SIDE row + column of each block that the
// ellipse reaches, for sixteen splats from 16 g on.  In every row of blocks the interval of x, with
// the same slope, extremes and roots as in tiles.cl; here divided by A beforehand.
inline ushort16 blocks_of_sixteen(const Columns* e, int g, float x0, float y0) {
  // Means and half axes, relative to the tile's first pixel centre.
  const float16 x = vload16(g, e->x) - x0, y = vload16(g, e->y) - y0;
  const float16 a = vload16(g, e->a), b = vload16(g, e->b),
      power_threshold = vload16(g, e->power_threshold);
  const float16 ey = vload16(g, e->half_y);
  const float16 inv_a = 1.0f / a, slope = -b * inv_a;
  const float16 y_extreme = -b / vload16(g, e->c) * vload16(g, e->half_x);
  // 1.0001: float rounding must not lose a pixel.
  const float16 threshold = 1.0001f * power_threshold * inv_a,
      inv_yy = power_threshold / fmax(ey * ey, FLT_MIN) * inv_a;
  // From the mean to the first row of pixel centres in the strip.
  float16 top = -y;
  uint16 mask = 0;
  const float16 zero = 0, end = TILE;
  for (int row = 0; row < SIDE; row++) {
    const float16 bottom = top + (SIDE - 1);
    const float16 y_right = MINIMUM(MAXIMUM(y_extreme, top), bottom),
        y_left = MINIMUM(MAXIMUM(-y_extreme, top), bottom);
    const float16 right_x =
        x + slope * y_right + sqrt(MAXIMUM(threshold - y_right * y_right * inv_yy, zero));
    const float16 left_x =
        x + slope * y_left - sqrt(MAXIMUM(threshold - y_left * y_left * inv_yy, zero));
    // Clamped before the conversion, since an ellipse may be as wide as any; >> 2 is / SIDE.  Both
    // are shifted so that a conversion, which cuts towards 0, rounds down and up: 4 + floor(right)
    // and 16 - ceil(left).  What the sums round, rounds to the next block's side.
    // The pixels that the strip's ellipse reaches, of the tile's sixteen.
    const float16 last_x = MINIMUM(MAXIMUM(right_x, zero - 1.0f), end - 1.0f),
        first_x = MINIMUM(MAXIMUM(left_x, zero), end);
    const int16 after = convert_int16(last_x + SIDE) >> 2;
    const int16 first = (TILE - convert_int16(end - first_x)) >> 2;
    // Blocks before `after`, less those before `first`.
    const uint16 until = ((uint16)1 << as_uint16(after)) - 1u;
    const uint16 before = ((uint16)1 << as_uint16(first)) - 1u;
    // A strip above or below the ellipse: its roots were held at 0 and mean nothing.
    const int16 meets = (top <= ey) & (bottom >= -ey);
    mask |= (until & ~before & as_uint16(meets)) << (uint16)(SIDE * row);
    top += SIDE;
  }
  return convert_ushort16(mask);
}

#ifdef HEAT
#define OF_HEAT , __global const float4* heat
#else
#define OF_HEAT
#endif

// Fills a batch from the list [p, end) and returns how many it got.
inline int fetch(int p, int end, int x0, int y0, __global const int* intersections,
                 __global const float* record, Batch* batch OF_HEAT) {
  const int n = min(BATCH, end - p), ahead = min(BATCH, end - p - n);
  if (n <= 0) return 0;
  // Records go to the batch scaled for exp2, and their shapes to columns for the masks.
  Columns e;
  const float h = -HALF_LOG2E;
  for (int j = 0; j < n; j++) {
    if (j < ahead) {  // of the next batch: the drawing of this one hides the misses
      __global const float* next = record + (size_t)RECORD * intersections[p + n + j];
      PREFETCH(next);
      PREFETCH(next + RECORD - 1);
    }
    __global const float* from = record + (size_t)RECORD * intersections[p + j];
    const float8 s = vload8(0, from);
    const float4 t = vload4(0, from + 8);
    e.x[j] = s.s0;
    e.y[j] = s.s1;
    e.a[j] = s.s2;
    e.b[j] = s.s3;
    e.c[j] = s.s4;
    e.half_x[j] = t.s1;
    e.half_y[j] = t.s2;
    e.power_threshold[j] = t.s3;
    vstore8(s * (float8)(1, 1, h, 2 * h, h, 1, 1, 1), 0, batch->splats + RECORD * j);
    vstore4(t * (float4)(1, 1, 1, h), 0, batch->splats + RECORD * j + 8);
#ifdef HEAT
    batch->heat[j] = heat[intersections[p + j]].xw;
#endif
  }
  // From "blocks of a splat" to "splats of a block": the bit matrix is transposed.
  const float x = x0 + 0.5f, y = y0 + 0.5f;
  uint16 block_splats = convert_uint16(transpose_bits(blocks_of_sixteen(&e, 0, x, y)));
  if (n > 16)
    block_splats |= convert_uint16(transpose_bits(blocks_of_sixteen(&e, 1, x, y))) << (uint16)16;
  // Bits beyond the n splats of the last batch are cleared.
  vstore16(block_splats & (0xffffffffu >> (BATCH - n)), 0, batch->block_splats);
  return n;
}
