// splat_edges: which splat is in front at a pixel, where all are shown as what they are: filled
// ellipses, points, or rings.  One work-item a splat of the order.
// Needs:   KIND = 0 ellipses, 1 points, 2 rings.
// Reads:   record (N, 12) of project_arena; order (n,), splats from near to far.
// Writes:  front (H, W): the place in the order, least where several are; begins as INT_MAX.
// Units:   pixels, row 0 on top; powers are squared sigmas.
#include "common/box.cl"

__kernel void splat_edges(int count, int width, int height, float edge_power, float radius,
                          float band, __global const float* record, __global const uint* order,
                          __global int* front) {
  const int k = get_global_id(0);
  if (k >= count) return;
  __global const float* r = record + (size_t)RECORD * order[k];
  BOX_OF(r)
  // A faint splat ends before the edge of the others: where its alpha does.
  const float power_edge = fmin(edge_power, r[POWER_THRESHOLD]);
  for (int y = y0; y < y1; y++) {
    const float dy = y + 0.5f - r[MEAN_Y];
    for (int x = x0; x < x1; x++) {
      const float dx = x + 0.5f - r[MEAN_X];
      const float gx = r[CONIC_A] * dx + r[CONIC_B] * dy, gy = r[CONIC_B] * dx + r[CONIC_C] * dy;
      const float power = gx * dx + gy * dy;
      if (!(power <= power_edge)) continue;
#if KIND == 1
      if (!(dx * dx + dy * dy <= radius * radius)) continue;
#elif KIND == 2
      // To the edge it is so many pixels: the way of sqrt(power) over how fast that rises.
      const float root = sqrt(power), rise = sqrt(gx * gx + gy * gy);
      if (!((sqrt(power_edge) - root) * root <= band * rise)) continue;
#endif
      atomic_min(front + y * width + x, k);
    }
  }
}
