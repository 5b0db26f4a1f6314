// What growing and pruning decide on, summed over steps.  Defined by density.py: SPLATS, and
// PULL, what draws newcomers: 0 the gradient of the mean, 1 the sum of its absolute values (slots 9
// and 10), 2 the splat's share of the pixels' error (slot 9).
// Reads:   record and grad_record (N, 12), opacity (N,); image and target for error_map.
// Writes:  sums over steps: gradient (N, 2), opacity_sum (A,), seen (A, 2); error (H, W).
// Units:   gradients times `unit`; opacity 0..1; pixels; display sRGB.

// One work-item an anchor.  gradient (N, 2): sum of a splat's pull times `unit`, and the steps in
// which it was on screen.  opacity (A,): sum of its splats' opacity above zero.
// SEEN defined: seen (A, 2): sum of what its splats give to the picture (slot 11: alpha T, pixels),
// and the steps in which any of them was on screen.
__kernel void accumulate(int anchors_count, float unit, __global const float *record,
                         __global const float *grad_record, __global const float *opacity,
                         __global float *gradient, __global float *opacity_sum
#ifdef SEEN
                         , __global float *seen
#endif
                         ) {
  int a = get_global_id(0);
  if (!(a < anchors_count)) return;
  float sum = 0;
#ifdef SEEN
  float given = 0, watched = 0;
#endif
  for (int k = 0; k < SPLATS; k++) {
    int i = a * SPLATS + k;
    sum += fmax(opacity[i], 0.0f);
    if (!(record[12 * i + 9] > 0)) continue;  // culled
#if PULL == 2
    gradient[2 * i] += grad_record[12 * i + 9] * unit;
#else
    float x = grad_record[12 * i + 9 * PULL], y = grad_record[12 * i + 9 * PULL + 1];
    gradient[2 * i] += sqrt(x * x + y * y) * unit;
#endif
    gradient[2 * i + 1] += 1;
#ifdef SEEN
    given += grad_record[12 * i + 11];
    watched = 1;
#endif
  }
  opacity_sum[a] += sum;
#ifdef SEEN
  seen[2 * a] += given;
  seen[2 * a + 1] += watched;
#endif
}

// The error of a pixel: mean |drawn - photo| of its channels, as far as the pixel counts.
// image [3][H][W], target [3][H][STRIDE], weight [H][W] where masked.  One work-item a row.
__kernel void error_map(int width, int height, int stride, int masked,
                        __global const float *image, __global const float *target,
                        __global const float *weight, __global float *error) {
  int y = get_global_id(0);
  if (!(y < height)) return;
  for (int x = 0; x < width; x++) {
    float sum = 0;
    for (int c = 0; c < 3; c++)
      sum += fabs(image[(c * height + y) * width + x] - target[(c * height + y) * stride + x]);
    error[y * width + x] = sum / 3 * (masked ? weight[y * width + x] : 1.0f);
  }
}
