// resize_records: the same splats in a picture of another number of pixels: ellipses and their
// means are scaled, whatever blurs them, too, so that no other splats take part.
// Reads:   record (N, 12); across and along, pixels of the new picture a pixel of the old one.
// Writes:  resized (N, 12); what is culled stays culled.
// Units:   pixels, row 0 on top.
#include "common/record.cl"

__kernel void resize_records(int count, float across, float along, __global const float* record,
                             __global float* resized) {
  const int i = get_global_id(0);
  if (i >= count) return;
  __global const float* from = record + (size_t)RECORD * i;
  __global float* to = resized + (size_t)RECORD * i;
  // The conic is of lengths to the power of -2, all else of lengths.
  const float8 shape = vload8(0, from);
  const float4 rest = vload4(0, from + 8);
  vstore8(shape * (float8)(across, along, 1 / (across * across), 1 / (across * along),
                           1 / (along * along), 1, 1, 1), 0, to);
  vstore4(rest * (float4)(1, across, along, 1), 0, to + 8);
}
