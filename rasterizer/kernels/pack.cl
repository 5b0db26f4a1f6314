// pack: means, scales, quaternions -> what project_arena reads of a splat, eight at a time:
//   Sigma = R S S^T R^T   (paper eq. 1; 3DGS, eq. 6)
// once a change of x instead of once a frame and view.
// Reads:   means, scales (n, 3), wxyz (n, 4), opacity (n,) as a model decodes them.
// Writes:  rows `start` and after of mean_opacity (N, 4) and covariance (N, 8): xx xy xz yy yz zz
//          and two zeros.
// Units:   metres and square metres in the object's frame; scales are one sigma.
#include "common/eight_rows.cl"

typedef struct {
  float8 x, y, z, opacity;
} Rows;  // of any array, as many columns as it has; of quaternions x is their w, and so on

inline float8 dot3(Rows a, Rows b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// A row of R S: Sigma's entries are the dot products of its rows.
inline Rows scaled_row(float8 x, float8 y, float8 z, Rows by) {
  const Rows row = {x * by.x, y * by.y, z * by.z, 0};
  return row;
}

// Rows of the arena, eight at a time, a column a vector.
#define STORE_MEANS(rows) STORE_COLUMNS(rows, 4, 0, mean.x, mean.y, mean.z, mean.opacity)
#define STORE_COVARIANCES(rows)                                              \
  STORE_COLUMNS(rows, 8, 0, dot3(a, a), dot3(a, b), dot3(a, c), dot3(b, b))  \
  STORE_COLUMNS(rows, 8, 4, dot3(b, c), dot3(c, c), 0, 0)

// A work-item takes `run` splats, a multiple of eight, to rows `start` and after of the arena.
__kernel void pack(int count, int start, int run, __global const float* means,
                   __global const float* scales, __global const float* wxyz,
                   __global const float* opacity, __global float* mean_opacity,
                   __global float* covariance) {
  const int first = get_global_id(0) * run, last = min(count, first + run);
  for (int i = first; i < last; i += LANES) {
    const int n = min(LANES, last - i);
    Rows mean, s, q;
    LOAD_ROWS(LOAD_THREES, mean, means, 3)
    LOAD_ROWS(LOAD_THREES, s, scales, 3)
    LOAD_ROWS(LOAD_MEANS, q, wxyz, 4)
    LOAD_ROWS(LOAD_ONES, mean.opacity, opacity, 1)
    // By the largest entry first: neither tiny nor huge quaternions lose their length.
    const float8 largest = fmax(fmax(fabs(q.x), fabs(q.y)), fmax(fabs(q.z), fabs(q.opacity)));
    // One without a length is no turn; NaN stays NaN, and project drops it.
    const int8 none = (q.x == 0.0f) & (q.y == 0.0f) & (q.z == 0.0f) & (q.opacity == 0.0f);
    const float8 zero = 0;
    float8 w = select(q.x / largest, (float8)(1), none), x = select(q.y / largest, zero, none);
    float8 y = select(q.z / largest, zero, none), z = select(q.opacity / largest, zero, none);
    const float8 per = 1.0f / sqrt(w * w + x * x + y * y + z * z);
    w *= per;
    x *= per;
    y *= per;
    z *= per;
    // The rows of R S, from the unit quaternion.
    const Rows a = scaled_row(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), s);
    const Rows b = scaled_row(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), s);
    const Rows c = scaled_row(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), s);
    // Rows start + i and on: eight at a time, the last few one by one.
    STORE_ROWS(STORE_MEANS, (mean_opacity + 4 * (size_t)start), 4)
    STORE_ROWS(STORE_COVARIANCES, (covariance + 8 * (size_t)start), 8)
  }
}

// The same with other opacities alone: layers come and go, their splats stay.
__kernel void pack_opacity(int count, int start, __global const float* opacity,
                           __global float* mean_opacity) {
  const int i = get_global_id(0);
  if (i < count) mean_opacity[4 * (size_t)(start + i) + 3] = opacity[i];
}

// Colours of three floats -> rows of four.
__kernel void pack_color(int count, int start, __global const float* given,
                         __global float4* color) {
  const int i = get_global_id(0);
  if (i < count) color[start + i] = (float4)(vload3(i, given), 0);
}
