// min_opacity: the gradient of share * max(MIN_OPACITY - opacity, 0) a splat: see losses.py.
// Reads:   opacity.
// Writes:  adds to grad_opacity.
// Units:   opacity 0..1.
#define MIN_OPACITY 0.02f  // below it a splat is so faint that the picture hardly moves it any more

__kernel void min_opacity(int splats, float share, __global const float *opacity,
                          __global float *grad_opacity) {
  int i = get_global_id(0);
  if (!(i < splats)) return;
  // The loss falls as the opacity rises.
  if (opacity[i] < MIN_OPACITY) grad_opacity[i] -= share;
}
