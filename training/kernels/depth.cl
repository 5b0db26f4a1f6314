// The depth loss and its gradients: one work-item a row of pixels.
//
// depth (H, W) metres along the view, 0 where none is known; drawn are metres, the sum of alpha T z,
// and transmittance T.  A pixel with a known depth d counts |metres - (1 - T) d| / d + hole T: what
// is seen lies elsewhere by so large a part of d, and something has to be there.
__kernel void compare_depth(int width, float scale, float hole, __global const float *depth,
                            __global const float *metres, __global const float *transmittance,
                            __global float *grad_metres, __global float *grad_transmittance,
                            __global float *rows) {
  int row = get_global_id(0);
  float sum = 0;
  for (int x = 0; x < width; x++) {
    int at = row * width + x;
    float d = depth[at], through = transmittance[at];
    float away = metres[at] - (1.0f - through) * d;
    float sign = away > 0 ? 1.0f : away < 0 ? -1.0f : 0.0f;
    bool known = d > 0;
    grad_metres[at] = known ? scale * sign / d : 0.0f;
    grad_transmittance[at] = known ? scale * (sign + hole) : 0.0f;
    sum += known ? fabs(away) / d + hole * through : 0.0f;
  }
  rows[row] = sum;
}
