// Adam (Kingma and Ba, 2015), one work-item a parameter, with decoupled weight decay (AdamW,
// Loshchilov and Hutter, 2019): a part `pull` of the value, times the rate, goes in every step that
// has a gradient of it: what a photo does not show rests, whether it takes the step or not.
// Reads:   grad; rates, one for all or one a parameter; the moments of the steps before.
// Writes:  value, mean and square, in place.
// Units:   those of the parameter; a rate is a step in them.

#define BETA1 0.9f
#define BETA2 0.999f
#define REST1 0.1f  // 1 - BETA; the difference itself is off by 1e-5 of it in float32
#define REST2 0.001f
#define EPSILON 1e-15f  // as 3DGS: gradients of a mean over an image are far below the usual 1e-8

inline void update(int i, float g, float correct1, float correct2, float rate, float pull,
                   __global float *value, __global float *mean, __global float *square) {
  float m = BETA1 * mean[i] + REST1 * g;
  float v = BETA2 * square[i] + REST2 * g * g;
  mean[i] = m;
  square[i] = v;
  float step = rate * (m * correct1) / (sqrt(v * correct2) + EPSILON);
  float kept = g != 0.0f ? 1.0f - rate * pull : 1.0f;
  value[i] = kept * value[i] - step;
}

// rates: one for all (rate_stride 0) or one a parameter (1), times `rate_scale`.
// correct1, correct2 are 1 / (1 - BETA^t).
__kernel void adam(int count, float correct1, float correct2, float rate_scale, int rate_stride,
                   float pull, __global const float *rates, __global const float *grad,
                   __global float *value, __global float *mean, __global float *square) {
  int i = get_global_id(0);
  if (!(i < count)) return;
  float rate = rate_scale * rates[i * rate_stride];
  update(i, grad[i], correct1, correct2, rate, pull, value, mean, square);
}

// The same of some rows of a table: grad has those alone, one after the other; the others rest.
// One work-item a row: an item a number would divide by the width.
__kernel void adam_rows(int rows_count, int width, __global const int *rows, float correct1,
                        float correct2, float rate_scale, float pull,
                        __global const float *rates, __global const float *grad,
                        __global float *value, __global float *mean, __global float *square) {
  int row = get_global_id(0);
  if (!(row < rows_count)) return;
  float rate = rate_scale * rates[0];
  int at = rows[row] * width;
  for (int c = 0; c < width; c++)
    update(at + c, grad[row * width + c], correct1, correct2, rate, pull, value, mean, square);
}

// The rows of a table (A, width) that are there, one after the other.  One work-item a row.
__kernel void gather_rows(int rows_count, int width, __global const int *rows,
                          __global const float *table, __global float *out) {
  int i = get_global_id(0);
  if (!(i < rows_count)) return;
  for (int c = 0; c < width; c++) out[i * width + c] = table[rows[i] * width + c];
}
