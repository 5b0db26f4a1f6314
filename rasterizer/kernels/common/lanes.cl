// lanes: the same formulas for one splat a work-item (WIDTH 1, a GPU) and for eight as vectors
// (WIDTH 8, a CPU).
// Reads:   WIDTH; in the kernel `first`, the work-item's first splat, and `n`, how many it has.
// Defines: floatn, intn, floatn3 and its arithmetic; LOAD and STORE of columns of row-major arrays.
// Units:   those of the arrays.
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

// Three columns, as a float3 a lane: OpenCL has no vectors of vectors.
typedef struct {
  floatn x, y, z;
} floatn3;

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
#define LOAD3(array) make3(LOAD(array, 3, 0), LOAD(array, 3, 1), LOAD(array, 3, 2))
#define STORE3(array, v)       \
  STORE(array, 3, 0, (v).x);   \
  STORE(array, 3, 1, (v).y);   \
  STORE(array, 3, 2, (v).z)
