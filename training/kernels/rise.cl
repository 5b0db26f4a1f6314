// rise: the gradient of share * max(FAINT - opacity, 0) a splat: see rise.py.
// Reads:   opacity.
// Writes:  adds to grad_opacity.
// Units:   opacity 0..1.
#define FAINT 0.02f  // below it a splat is so faint that the picture hardly moves it any more

__kernel void draw_up(int splats, float share, __global const float *opacity,
                      __global float *grad_opacity) {
  int i = get_global_id(0);
  if (!(i < splats)) return;
  if (opacity[i] < FAINT) grad_opacity[i] -= share;
}
