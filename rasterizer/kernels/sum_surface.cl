// sum_surface: gradients of intersections' depths (common/surface.cl) -> those of splats.
// Reads:   slots (count, 8), tile_bounds (N, 2), first_slot (N,).
// Writes:  grad_surface (N, 8).
// Units:   those of the loss by those of common/surface.cl.
#include "common/tiles.cl"

// A splat's slots lie side by side: their sum in a fixed order is its gradient.
__kernel void sum_surface(int count, __global const uint2* tile_bounds,
                          __global const int* first_slot,
                          __global const float* slots, __global float* grad_surface) {
  const int i = get_global_id(0);
  if (i >= count) return;
  const int n = tiles_at(tile_bounds[i]);
  float8 sum = 0;
  for (int k = 0; k < n; k++) sum += vload8(first_slot[i] + k, slots);
  vstore8(sum, i, grad_surface);
}
