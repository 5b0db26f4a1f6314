// What growing and pruning decide on, summed over steps.  Defined by networks.py: SPLATS.

// One work-item an anchor.  gradient (N, 2): sum of a splat's screen gradient in half image widths,
// and the steps in which it was on screen.  opacity (A,): sum of its splats' opacity above zero.
__kernel void accumulate(int anchors_count, float half_width, __global const float *record,
                         __global const float *grad_record, __global const float *opacity,
                         __global float *gradient, __global float *opacity_sum) {
  int a = get_global_id(0);
  if (!(a < anchors_count)) return;
  float sum = 0;
  for (int k = 0; k < SPLATS; k++) {
    int i = a * SPLATS + k;
    sum += fmax(opacity[i], 0.0f);
    if (!(record[12 * i + 9] > 0)) continue;  // culled
    float x = grad_record[12 * i], y = grad_record[12 * i + 1];
    gradient[2 * i] += sqrt(x * x + y * y) * half_width;
    gradient[2 * i + 1] += 1;
  }
  opacity_sum[a] += sum;
}
