// What densification decides on, summed over steps.  Defined by densify.py: SPLATS.
// Reads:   rows of the step; record and grad_record (N, 12), opacity (N,) of these.
// Writes:  sums over steps: grad2d (N, 2), opacity_sum (A, 2), contribution (A, 2).
// Units:   gradients times `unit`; opacity 0..1; alpha T summed over pixels.

// One work-item an anchor that the step ran: records, gradients, opacities are of these alone, in
// the order of `rows`.  grad2d (N, 2): sum of a splat's absolute screen gradient (slots 9 and 10)
// times `unit`, and the steps in which it was on screen.  opacity_sum (A, 2): sum of its splats'
// opacity above zero, and the steps it ran.  contribution (A, 2), of the step's stop: sum of what
// its splats give to the picture (slot 11: alpha T, pixels), and the steps that had any of them.
__kernel void accumulate(int rows_count, float unit, __global const int *rows,
                         __global const float *record, __global const float *grad_record,
                         __global const float *opacity, __global float *grad2d,
                         __global float *opacity_sum, __global float *contribution) {
  int row = get_global_id(0);
  if (!(row < rows_count)) return;
  int a = rows[row];
  float sum = 0, share = 0, watched = 0;
  for (int k = 0; k < SPLATS; k++) {
    int i = row * SPLATS + k, to = 2 * (a * SPLATS + k);
    sum += fmax(opacity[i], 0.0f);
    if (!(record[12 * i + 9] > 0)) continue;  // culled
    float x = grad_record[12 * i + 9], y = grad_record[12 * i + 10];
    grad2d[to] += sqrt(x * x + y * y) * unit;
    grad2d[to + 1] += 1;
    share += grad_record[12 * i + 11];
    watched = 1;
  }
  opacity_sum[2 * a] += sum;
  opacity_sum[2 * a + 1] += 1;
  contribution[2 * a] += share;
  contribution[2 * a + 1] += watched;
}
