// lanes: the same formulas for one splat a work-item (WIDTH 1, a GPU) and for eight as vectors
// (WIDTH 8, a CPU).
// Reads:   WIDTH; in the kernel `first`, the work-item's first splat, and `n`, how many it has.
// Defines: floatn, intn, floatn3 and its arithmetic, floatn4; LOAD and STORE of columns of arrays
//          of rows, of three (LOAD3, STORE3) and of four (LOAD4, STORE4) at a time.
// Units:   those of the arrays.
#include "common/eight_rows.cl"
#ifndef WIDTH
#define WIDTH 1
#endif

#if WIDTH == 1
// A comparison of floatn gives intn: 0 or 1 of a scalar, 0 or -1 a lane; select() takes both.
typedef float floatn;
typedef int intn;
#define LOAD(array, stride, column) (array)[(size_t)(stride) * first + (column)]
#define STORE(array, stride, column, value) (array)[(size_t)(stride) * first + (column)] = (value)
#else
typedef float8 floatn;
typedef int8 intn;
// Rows of a few floats lie side by side, so a column is gathered: lane k is row first + k.
inline floatn load_column(__global const float* array, int stride, int column, int first, int n) {
  float lanes[WIDTH];
  // The last few: the last one again for those that are missing.
  for (int lane = 0; lane < WIDTH; lane++)
    lanes[lane] = array[(size_t)stride * (first + min(lane, n - 1)) + column];
  return vload8(0, lanes);
}
inline void store_column(__global float* array, int stride, int column, int first, int n,
                         floatn value) {
  float lanes[WIDTH];
  vstore8(value, 0, lanes);
  for (int lane = 0; lane < n; lane++)
    array[(size_t)stride * (first + lane) + column] = lanes[lane];
}
#define LOAD(array, stride, column) load_column(array, stride, column, first, n)
#define STORE(array, stride, column, value) store_column(array, stride, column, first, n, value)
#endif

// Three and four columns, as a float3 and a float4 a lane: OpenCL has no vectors of vectors.
typedef struct {
  floatn x, y, z;
} floatn3;
typedef struct {
  floatn x, y, z, w;
} floatn4;

inline floatn3 make3(floatn x, floatn y, floatn z) {
  const floatn3 v = {x, y, z};
  return v;
}
inline floatn dot3(floatn3 a, floatn3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline floatn3 scale3(floatn s, floatn3 a) { return make3(s * a.x, s * a.y, s * a.z); }
// s a + t b
inline floatn3 blend3(floatn s, floatn3 a, floatn t, floatn3 b) {
  return make3(s * a.x + t * b.x, s * a.y + t * b.y, s * a.z + t * b.z);
}
// (N, 3) arrays: means and scales in metres, colours.
// Four neighbouring columns of wider ones: quaternions, and the thirds of a record.
#if WIDTH == 1
#define LOAD3(array) make3(LOAD(array, 3, 0), LOAD(array, 3, 1), LOAD(array, 3, 2))
#define STORE3(array, v)       \
  STORE(array, 3, 0, (v).x);   \
  STORE(array, 3, 1, (v).y);   \
  STORE(array, 3, 2, (v).z)
inline floatn4 four_of(float4 v) {
  const floatn4 four = {v.x, v.y, v.z, v.w};
  return four;
}
// `column` is the first of the four; rows are `stride` floats.
#define LOAD4(array, stride, column) \
  four_of(vload4(0, (array) + (size_t)(stride) * first + (column)))
#define STORE4(array, stride, column, a, b, c, d) \
  vstore4((float4)(a, b, c, d), 0, (array) + (size_t)(stride) * first + (column))
#else
// Whole rows, turned in registers; columns where the last few rows are not all there.
// Three vectors hold eight rows of three: no gather, no store that a load has to wait for.
inline floatn3 load_threes(__global const float* array, int first, int n) {
  floatn3 v;
  if (n == WIDTH)
    LOAD_THREES(v, , array + (size_t)3 * first)
  else
    v = make3(load_column(array, 3, 0, first, n), load_column(array, 3, 1, first, n),
              load_column(array, 3, 2, first, n));
  return v;
}

inline void store_threes(__global float* array, int first, int n, floatn3 v) {
  if (n == WIDTH) {
    const floatn x = v.x, y = v.y, z = v.z;
    __global float* rows = array + (size_t)3 * first;
    // x y z of splats 0, 1 and most of 2 ...
    vstore8((float8)(x.s0, y.s0, z.s0, x.s1, y.s1, z.s1, x.s2, y.s2), 0, rows);
    vstore8((float8)(z.s2, x.s3, y.s3, z.s3, x.s4, y.s4, z.s4, x.s5), 1, rows);
    vstore8((float8)(y.s5, z.s5, x.s6, y.s6, z.s6, x.s7, y.s7, z.s7), 2, rows);
  } else {  // nothing behind the last row may be written
    store_column(array, 3, 0, first, n, v.x);
    store_column(array, 3, 1, first, n, v.y);
    store_column(array, 3, 2, first, n, v.z);
  }
}

// Eight rows of four are read one by one, then every fourth of their floats is taken.
inline floatn4 load_fours(__global const float* array, int stride, int column, int first, int n) {
  float4 rows[WIDTH];
  // The last few: the last one again for those that are missing.
  for (int lane = 0; lane < WIDTH; lane++)
    rows[lane] = vload4(0, array + (size_t)stride * (first + min(lane, n - 1)) + column);
  const float16 a = (float16)(rows[0], rows[1], rows[2], rows[3]);
  const float16 b = (float16)(rows[4], rows[5], rows[6], rows[7]);
  const floatn4 v = {(float8)(a.s048c, b.s048c), (float8)(a.s159d, b.s159d),
                     (float8)(a.s26ae, b.s26ae), (float8)(a.s37bf, b.s37bf)};
  return v;
}

// The way back: a row of four a splat, straight to where it belongs.
inline void store_fours(__global float* array, int stride, int column, int first, int n, floatn a,
                        floatn b, floatn c, floatn d) {
  if (n == WIDTH) {
    STORE_COLUMNS(array + (size_t)stride * first, stride, column, a, b, c, d)
  } else {  // as above
    store_column(array, stride, column, first, n, a);
    store_column(array, stride, column + 1, first, n, b);
    store_column(array, stride, column + 2, first, n, c);
    store_column(array, stride, column + 3, first, n, d);
  }
}
#define LOAD3(array) load_threes(array, first, n)
#define STORE3(array, v) store_threes(array, first, n, v)
#define LOAD4(array, stride, column) load_fours(array, stride, column, first, n)
#define STORE4(array, stride, column, a, b, c, d) \
  store_fours(array, stride, column, first, n, a, b, c, d)
#endif
