// Rows of row-major arrays, one a splat <-> eight splats as vectors, one a column.
#include "common/record.cl"
#include "common/vector.cl"

// LOAD(into, rows) for splats i to i + n: where fewer than eight are left, the last one again.
#define LOAD_ROWS(LOAD, into, rows, width)                                            \
  if (n == LANES) {                                                                   \
    LOAD(into, rows + (size_t)(width) * i)                                            \
  } else {                                                                            \
    float copy[(width) * LANES];                                                      \
    for (int lane = 0; lane < LANES; lane++)                                          \
      for (int k = 0; k < (width); k++)                                               \
        copy[(width) * lane + k] = rows[(size_t)(width) * (i + min(lane, n - 1)) + k]; \
    LOAD(into, copy)                                                                  \
  }

#define LOAD_INDICES(into, array)                                                     \
  if (n == LANES) {                                                                   \
    into = vload8(0, array + i);                                                      \
  } else {                                                                            \
    int copy[LANES];                                                                  \
    for (int lane = 0; lane < LANES; lane++) copy[lane] = array[i + min(lane, n - 1)]; \
    into = vload8(0, copy);                                                           \
  }

#define LOAD_MEANS(into, rows)                                \
  {                                                           \
    const float16 p = vload16(0, rows), q = vload16(1, rows); \
    into.x = (float8)(p.s048c, q.s048c);                      \
    into.y = (float8)(p.s159d, q.s159d);                      \
    into.z = (float8)(p.s26ae, q.s26ae);                      \
    into.opacity = (float8)(p.s37bf, q.s37bf);                \
  }

#define LOAD_COVARIANCES(into, rows)                          \
  {                                                           \
    const float16 a = vload16(0, rows), b = vload16(1, rows); \
    const float16 c = vload16(2, rows), d = vload16(3, rows); \
    into.xx = (float8)(a.s08, b.s08, c.s08, d.s08);           \
    into.xy = (float8)(a.s19, b.s19, c.s19, d.s19);           \
    into.xz = (float8)(a.s2a, b.s2a, c.s2a, d.s2a);           \
    into.yy = (float8)(a.s3b, b.s3b, c.s3b, d.s3b);           \
    into.yz = (float8)(a.s4c, b.s4c, c.s4c, d.s4c);           \
    into.zz = (float8)(a.s5d, b.s5d, c.s5d, d.s5d);           \
  }

#define LOAD_COLORS(into, rows)                               \
  {                                                           \
    const float16 g = vload16(0, rows), h = vload16(1, rows); \
    into.red = (float8)(g.s048c, h.s048c);                    \
    into.green = (float8)(g.s159d, h.s159d);                  \
    into.blue = (float8)(g.s26ae, h.s26ae);                   \
  }

// Four vectors -> eight rows of four, into column `at` of the records.
inline void store_rows(float* rows, int at, float8 a, float8 b, float8 c, float8 d) {
  const float8 ab_lo = (float8)(a.s0, b.s0, a.s1, b.s1, a.s2, b.s2, a.s3, b.s3);
  const float8 ab_hi = (float8)(a.s4, b.s4, a.s5, b.s5, a.s6, b.s6, a.s7, b.s7);
  const float8 cd_lo = (float8)(c.s0, d.s0, c.s1, d.s1, c.s2, d.s2, c.s3, d.s3);
  const float8 cd_hi = (float8)(c.s4, d.s4, c.s5, d.s5, c.s6, d.s6, c.s7, d.s7);
  vstore4((float4)(ab_lo.s01, cd_lo.s01), 0, rows + at);
  vstore4((float4)(ab_lo.s23, cd_lo.s23), 0, rows + at + RECORD);
  vstore4((float4)(ab_lo.s45, cd_lo.s45), 0, rows + at + RECORD * 2);
  vstore4((float4)(ab_lo.s67, cd_lo.s67), 0, rows + at + RECORD * 3);
  vstore4((float4)(ab_hi.s01, cd_hi.s01), 0, rows + at + RECORD * 4);
  vstore4((float4)(ab_hi.s23, cd_hi.s23), 0, rows + at + RECORD * 5);
  vstore4((float4)(ab_hi.s45, cd_hi.s45), 0, rows + at + RECORD * 6);
  vstore4((float4)(ab_hi.s67, cd_hi.s67), 0, rows + at + RECORD * 7);
}

inline void store_records(const float* rows, int i, int n, __global float* record) {
  for (int lane = 0; lane < n; lane++) {
    vstore8(vload8(0, rows + RECORD * lane), 0, record + (size_t)RECORD * (i + lane));
    vstore4(vload4(0, rows + RECORD * lane + 8), 0, record + (size_t)RECORD * (i + lane) + 8);
  }
}

inline void store_floats(float8 values, int i, int n, __global float* array) {
  if (n == LANES) {
    vstore8(values, 0, array + i);
    return;
  }
  float one[LANES];
  vstore8(values, 0, one);
  for (int lane = 0; lane < n; lane++) array[i + lane] = one[lane];
}

inline void store_pairs(uint8 a, uint8 b, int i, int n, __global uint2* array) {
  if (n == LANES) {
    vstore16((uint16)(a.s0, b.s0, a.s1, b.s1, a.s2, b.s2, a.s3, b.s3, a.s4, b.s4, a.s5, b.s5, a.s6,
                      b.s6, a.s7, b.s7), 0, (__global uint*)(array + i));
    return;
  }
  uint first[LANES], second[LANES];
  vstore8(a, 0, first);
  vstore8(b, 0, second);
  for (int lane = 0; lane < n; lane++) array[i + lane] = (uint2)(first[lane], second[lane]);
}
