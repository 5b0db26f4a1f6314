// eight_rows: rows of row-major arrays, one a splat <-> eight splats as vectors, one a column; with
// vectors of sixteen (vector.cl) twice eight.
// Reads:   in the kernel `i`, the first splat, and `n`, how many of LANES there are.
// Defines: LOAD_ROWS and the loads that it takes, STORE_ROWS, STORE_COLUMNS, STREAM_ROWS,
//          PUT_COLUMNS, store_floats, store_pairs.
// Units:   those of the arrays.
#include "common/record.cl"
#include "common/vector.cl"

// LOAD(into, half, rows) of eight rows: `half` picks their lanes out of a vector.
#if LANES == 16
#define LOAD_HALVES(LOAD, into, rows, width) \
  LOAD(into, .lo, rows)                      \
  LOAD(into, .hi, (rows) + 8 * (width))
#else
#define LOAD_HALVES(LOAD, into, rows, width) LOAD(into, , rows)
#endif

// Of splats i to i + n: where fewer than LANES are left, the last one again.
// Whole vectors are read where the array has rows enough left: a transpose in registers, no gather.
#define LOAD_ROWS(LOAD, into, rows, width)                                                         \
  if (n == LANES) {                                                                                \
    LOAD_HALVES(LOAD, into, rows + (size_t)(width) * i, width)                                     \
  } else {                                                                                         \
    float copy[(width) * LANES];                                                                   \
    for (int lane = 0; lane < LANES; lane++)                                                       \
      for (int k = 0; k < (width); k++)                                                            \
        copy[(width) * lane + k] = rows[(size_t)(width) * (i + min(lane, n - 1)) + k];             \
    LOAD_HALVES(LOAD, into, copy, width)                                                           \
  }

// The same for one int a splat: which object it belongs to.
#define LOAD_INDICES(into, array)                                                                  \
  if (n == LANES) {                                                                                \
    into = VLOAD(0, array + i);                                                                    \
  } else {                                                                                         \
    int copy[LANES];                                                                               \
    for (int lane = 0; lane < LANES; lane++) copy[lane] = array[i + min(lane, n - 1)];             \
    into = VLOAD(0, copy);                                                                         \
  }

// (N, 4) rows of mean and opacity: 32 floats in two loads, then every fourth of them.
#define LOAD_MEANS(into, half, rows)                                                               \
  {                                                                                                \
    const float16 rp = vload16(0, rows), rq = vload16(1, rows);                                    \
    into.x half = (float8)(rp.s048c, rq.s048c);                                                    \
    into.y half = (float8)(rp.s159d, rq.s159d);                                                    \
    into.z half = (float8)(rp.s26ae, rq.s26ae);                                                    \
    into.opacity half = (float8)(rp.s37bf, rq.s37bf);                                              \
  }

// (N, 8) rows of the upper triangle of Sigma and two unused floats, so that a row is half a
// cache line: four loads, every eighth float.
#define LOAD_COVARIANCES(into, half, rows)                                                         \
  {                                                                                                \
    const float16 ra = vload16(0, rows), rb = vload16(1, rows);                                    \
    const float16 rc = vload16(2, rows), rd = vload16(3, rows);                                    \
    into.xx half = (float8)(ra.s08, rb.s08, rc.s08, rd.s08);                                       \
    into.xy half = (float8)(ra.s19, rb.s19, rc.s19, rd.s19);                                       \
    into.xz half = (float8)(ra.s2a, rb.s2a, rc.s2a, rd.s2a);                                       \
    into.yy half = (float8)(ra.s3b, rb.s3b, rc.s3b, rd.s3b);                                       \
    into.yz half = (float8)(ra.s4c, rb.s4c, rc.s4c, rd.s4c);                                       \
    into.zz half = (float8)(ra.s5d, rb.s5d, rc.s5d, rd.s5d);                                       \
  }

// (N, 4) rows, the last float unused.
#define LOAD_COLORS(into, half, rows)                                                              \
  {                                                                                                \
    const float16 rg = vload16(0, rows), rh = vload16(1, rows);                                    \
    into.red half = (float8)(rg.s048c, rh.s048c);                                                  \
    into.green half = (float8)(rg.s159d, rh.s159d);                                                \
    into.blue half = (float8)(rg.s26ae, rh.s26ae);                                                 \
  }

// Rows of three, as three vectors side by side.
#define LOAD_THREES(into, half, rows)                                                              \
  {                                                                                                \
    const float8 ra = vload8(0, rows), rb = vload8(1, rows), rc = vload8(2, rows);                 \
    into.x half = (float8)(ra.s0, ra.s3, ra.s6, rb.s1, rb.s4, rb.s7, rc.s2, rc.s5);                \
    into.y half = (float8)(ra.s1, ra.s4, ra.s7, rb.s2, rb.s5, rc.s0, rc.s3, rc.s6);                \
    into.z half = (float8)(ra.s2, ra.s5, rb.s0, rb.s3, rb.s6, rc.s1, rc.s4, rc.s7);                \
  }

// (N,) arrays, as opacities.
#define LOAD_ONES(into, half, rows) into half = vload8(0, rows);

// Four vectors -> rows of `stride` floats, into their columns from `at` on.  Straight to where they
// belong: a row that is put together in private memory and read back whole waits for its stores.
#define PUT_EIGHT(PUT, rows, stride, at, ca, cb, cc, cd)                                           \
  {                                                                                                \
    const float8 va = ca, vb = cb, vc = cc, vd = cd;                                               \
    const float8 ab_lo = (float8)(va.s0, vb.s0, va.s1, vb.s1, va.s2, vb.s2, va.s3, vb.s3);         \
    const float8 ab_hi = (float8)(va.s4, vb.s4, va.s5, vb.s5, va.s6, vb.s6, va.s7, vb.s7);         \
    const float8 cd_lo = (float8)(vc.s0, vd.s0, vc.s1, vd.s1, vc.s2, vd.s2, vc.s3, vd.s3);         \
    const float8 cd_hi = (float8)(vc.s4, vd.s4, vc.s5, vd.s5, vc.s6, vd.s6, vc.s7, vd.s7);         \
    PUT((float4)(ab_lo.s01, cd_lo.s01), (rows) + (at));                                            \
    PUT((float4)(ab_lo.s23, cd_lo.s23), (rows) + (at) + (stride));                                 \
    PUT((float4)(ab_lo.s45, cd_lo.s45), (rows) + (at) + 2 * (stride));                             \
    PUT((float4)(ab_lo.s67, cd_lo.s67), (rows) + (at) + 3 * (stride));                             \
    PUT((float4)(ab_hi.s01, cd_hi.s01), (rows) + (at) + 4 * (stride));                             \
    PUT((float4)(ab_hi.s23, cd_hi.s23), (rows) + (at) + 5 * (stride));                             \
    PUT((float4)(ab_hi.s45, cd_hi.s45), (rows) + (at) + 6 * (stride));                             \
    PUT((float4)(ab_hi.s67, cd_hi.s67), (rows) + (at) + 7 * (stride));                             \
  }
// The second eight lie eight rows further on.
#if LANES == 16
#define PUT_COLUMNS(PUT, rows, stride, at, ca, cb, cc, cd)                                         \
  {                                                                                                \
    const floatv wa = ca, wb = cb, wc = cc, wd = cd;                                               \
    PUT_EIGHT(PUT, rows, stride, at, wa.lo, wb.lo, wc.lo, wd.lo)                                   \
    PUT_EIGHT(PUT, (rows) + 8 * (stride), stride, at, wa.hi, wb.hi, wc.hi, wd.hi)                  \
  }
#else
#define PUT_COLUMNS PUT_EIGHT
#endif
// PUT(four, to): how four floats of a row are written.
// Into the caches, or past them.
#define PUT_FOUR(four, to) vstore4(four, 0, to)
#define STREAM_FOUR(four, to) STREAM(four, (__global float4*)(to))
#define STORE_COLUMNS(rows, stride, at, ca, cb, cc, cd) \
  PUT_COLUMNS(PUT_FOUR, rows, stride, at, ca, cb, cc, cd)

// STORE(rows) for splats i to i + n of global rows of `width` floats.
// Fewer than LANES are left only at the end of an array: put together aside, so that nothing behind
// it is written.
#define STORE_ROWS(STORE, rows, width)                                                             \
  if (n == LANES) {                                                                                \
    STORE(rows + (size_t)(width) * i)                                                              \
  } else {                                                                                         \
    float copy[(width) * LANES];                                                                   \
    STORE(copy)                                                                                    \
    for (int k = 0; k < (width) * n; k++) rows[(size_t)(width) * i + k] = copy[k];                 \
  }

// STORE(PUT, rows) likewise, past the caches; a row is a multiple of four floats.
#define STREAM_ROWS(STORE, rows, width)                                                            \
  if (n == LANES) {                                                                                \
    STORE(STREAM_FOUR, (rows + (size_t)(width) * i))                                               \
  } else {                                                                                         \
    float copy[(width) * LANES];                                                                   \
    STORE(PUT_FOUR, copy)                                                                          \
    for (int k = 0; k < (width) * n; k++) rows[(size_t)(width) * i + k] = copy[k];                 \
  }

// One float a splat, such as its depth.
inline void store_floats(floatv values, int i, int n, __global float* array) {
  if (n == LANES) {
    VSTORE(values, 0, array + i);
    return;
  }
  // Nothing behind the last may be written.
  float one[LANES];
  VSTORE(values, 0, one);
  for (int lane = 0; lane < n; lane++) array[i + lane] = one[lane];
}

// Eight pairs of uints side by side.
inline void store_eight_pairs(uint8 a, uint8 b, __global uint2* array) {
  vstore16((uint16)(a.s0, b.s0, a.s1, b.s1, a.s2, b.s2, a.s3, b.s3, a.s4, b.s4, a.s5, b.s5, a.s6,
                    b.s6, a.s7, b.s7), 0, (__global uint*)array);
}

// As many as a vector has lanes.
inline void store_all_pairs(uintv a, uintv b, __global uint2* array) {
#if LANES == 16
  store_eight_pairs(a.lo, b.lo, array);
  store_eight_pairs(a.hi, b.hi, array + 8);
#else
  store_eight_pairs(a, b, array);
#endif
}

// Two uints a splat, such as its tile bounds.
inline void store_pairs(uintv a, uintv b, int i, int n, __global uint2* array) {
  if (n == LANES) {
    store_all_pairs(a, b, array + i);
    return;
  }
  // Nothing behind the last pair may be written.
  uint first[LANES], second[LANES];
  VSTORE(a, 0, first);
  VSTORE(b, 0, second);
  for (int lane = 0; lane < n; lane++) array[i + lane] = (uint2)(first[lane], second[lane]);
}
