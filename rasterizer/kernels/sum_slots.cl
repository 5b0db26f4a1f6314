// The end of the backward pass, both forms: from gradients of instances to those of splats.
#include "common/tiles.cl"

// A splat's slots lie side by side: their sum in a fixed order is its gradient.
__kernel void sum_slots(int count, __global const uint2* places, __global const int* first_slot,
                        __global const float* slots, __global float* grad_record) {
  const int i = get_global_id(0);
  if (i >= count) return;
  const int n = tiles_at(places[i]);
  __global const float* slot = slots + (size_t)RECORD * first_slot[i];
  float8 lo = 0;
  float4 hi = 0;
  for (int k = 0; k < n; k++, slot += RECORD) {
    lo += vload8(0, slot);
    hi += vload4(0, slot + 8);
  }
  vstore8(lo, 0, grad_record + (size_t)RECORD * i);
  vstore4(hi, 0, grad_record + (size_t)RECORD * i + 8);
}
