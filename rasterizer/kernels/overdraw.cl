// overdraw: adds one to every pixel that a splat is blended into.  One work-item a splat.
// Reads:   record (N, 12) of project or project_arena.
// Writes:  number (H, W), which begins as zeros.
// Units:   pixels, row 0 on top; splats.
#include "common/box.cl"

__kernel void overdraw(int count, int width, int height, __global const float* record,
                       __global int* number) {
  const int i = get_global_id(0);
  if (i >= count) return;
  __global const float* r = record + (size_t)RECORD * i;
  BOX_OF(r)
  // The very test of raster: no tiles, no early stop, so this counts what each pixel could blend.
  for (int y = y0; y < y1; y++) {
    const float dy = y + 0.5f - r[MEAN_Y];
    for (int x = x0; x < x1; x++) {
      const float dx = x + 0.5f - r[MEAN_X];
      const float q = r[CONIC_A] * dx * dx + 2.0f * r[CONIC_B] * dx * dy + r[CONIC_C] * dy * dy;
      // Splats overlap, so the count is atomic; integers add up to the same in any order.
      if (q <= r[POWER_THRESHOLD]) atomic_inc(number + y * width + x);
    }
  }
}
