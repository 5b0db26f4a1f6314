// sum_slots: the end of the backward pass, both forms: gradients of intersections -> those of
// splats.
// Reads:   slots (count, 12), tile_bounds (N, 2), first_slot (N,).
// Writes:  grad_record (N, 12); clear_boxes zeros in slots.
// Units:   those of the loss by those of the record (common/record.cl).
#include "common/tiles.cl"

// Of a box some tiles are in no list: their slots have to be 0 before the backward pass fills the
// others.
__kernel void clear_boxes(int count, int columns, __global const uint2* tile_bounds,
                          __global const int* first_slot, __global float* slots) {
  const int i = get_global_id(0);
  if (i >= count || !(tile_bounds[i].x & BOX)) return;
  const size_t first = first_slot[i], last = first + tiles_at(tile_bounds[i]);
  for (size_t k = first * columns; k < last * columns; k++) slots[k] = 0;
}

// A splat's slots lie side by side: their sum in a fixed order is its gradient.
__kernel void sum_slots(int count, __global const uint2* tile_bounds,
                        __global const int* first_slot, __global const float* slots,
                            __global float* grad_record) {
  const int i = get_global_id(0);
  if (i >= count) return;
  const int n = tiles_at(tile_bounds[i]);
  __global const float* slot = slots + (size_t)RECORD * first_slot[i];
  // Twelve floats as eight and four.
  float8 lo = 0;
  float4 hi = 0;
  for (int k = 0; k < n; k++, slot += RECORD) {
    lo += vload8(0, slot);
    hi += vload4(0, slot + 8);
  }
  vstore8(lo, 0, grad_record + (size_t)RECORD * i);
  vstore4(hi, 0, grad_record + (size_t)RECORD * i + 8);
}
