// depth: the depth loss and its gradients: one work-item a row of pixels. A pixel with a known
// depth d counts |metres - (1 - T) d| / d + hole T: what is seen lies elsewhere by so large a part
// of d, and something has to be there.
// Reads:   depth (H, W), 0 where none is known; metres, the sum of alpha T z as drawn, and
//          transmittance T.
// Writes:  grad_metres and grad_transmittance (H, W); rows, the loss a row.
// Units:   metres along the view.
__kernel void compare_depth(int width, float scale, float hole, __global const float *depth,
                            __global const float *metres, __global const float *transmittance,
                            __global float *grad_metres, __global float *grad_transmittance,
                            __global float *rows) {
  int row = get_global_id(0);
  // A row a work-item, and rows summed in order: the same loss every time.
  float sum = 0;
  for (int x = 0; x < width; x++) {
    int at = row * width + x;
    float d = depth[at], T = transmittance[at];
    // A share of 1 - T of the pixel is splats: the depth times that share is what they should sum
    // up to.
    float away = metres[at] - (1.0f - T) * d;
    float sign = away > 0 ? 1.0f : away < 0 ? -1.0f : 0.0f;
    bool known = d > 0;
    // d|away| / d metres = sign; by T it is sign d, and the division by d leaves the sign.
    grad_metres[at] = known ? scale * sign / d : 0.0f;
    // `hole` draws splats to where depth is known and nothing is.
    grad_transmittance[at] = known ? scale * (sign + hole) : 0.0f;
    sum += known ? fabs(away) / d + hole * T : 0.0f;
  }
  rows[row] = sum;
}
