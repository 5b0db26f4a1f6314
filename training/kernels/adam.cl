// Adam (Kingma and Ba, 2015), one work-item a parameter.
// Reads:   grad; rates, one for all or one a parameter; the moments of the steps before.
// Writes:  value, mean and square, in place.
// Units:   those of the parameter; a rate is a step in them.

#define BETA1 0.9f
#define BETA2 0.999f
#define REST1 0.1f  // 1 - BETA; the difference itself is off by 1e-5 of it in float32
#define REST2 0.001f
#define EPSILON 1e-15f  // as 3DGS: gradients of a mean over an image are far below the usual 1e-8

// rates: one for all (rate_stride 0) or one a parameter (1), times `rate_scale`.
// correct1, correct2 are 1 / (1 - BETA^t).
__kernel void adam(int count, float correct1, float correct2, float rate_scale, int rate_stride,
                   __global const float *rates, __global const float *grad,
                   __global float *value, __global float *mean, __global float *square) {
  int i = get_global_id(0);
  if (!(i < count)) return;
  float g = grad[i];
  float m = BETA1 * mean[i] + REST1 * g;
  float v = BETA2 * square[i] + REST2 * g * g;
  mean[i] = m;
  square[i] = v;
  value[i] -= rate_scale * rates[i * rate_stride] * (m * correct1) / (sqrt(v * correct2) + EPSILON);
}
