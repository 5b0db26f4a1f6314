// sort_count: how often each digit occurs in a group's keys.  First of the three steps of a pass of
// a radix sort: least significant digit first, stable.  The first pass leaves culled keys behind,
// so that those that follow have as many as are sorted.
// Reads:   keys; how many are sorted in counts, what they are counted from in dispatch.
// Writes:  histogram [digit][group].
// Units:   none.
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_KEYS) readonly buffer Keys { uint keys[]; };
layout(std430, binding = SLOT_HISTOGRAM) writeonly buffer Histogram { uint histogram[]; };
layout(std430, binding = SLOT_COUNTS) readonly buffer Counts { uint counts[]; };
layout(std430, binding = SLOT_DISPATCH) readonly buffer Dispatch { uint dispatch[]; };
uniform uint count;   // of the first pass
uniform uint group_count;  // of the first pass
uniform uint shift;   // bits; the digit is 8 bits from here
uniform uint culled;  // the key that no splat of the order has

shared uint occurrences[RADIX];

void main() {
    uint local = gl_LocalInvocationID.x, group = gl_WorkGroupID.x, base = dispatch[DISPATCH_BASE];
    occurrences[local] = 0u;
    barrier();
    uint first = group * SORT_BLOCKS * WORKGROUP, end = shift == 0u ? count : counts[COUNT_SORTED];
    for (uint block = 0u; block < SORT_BLOCKS; block++) {
        uint i = first + block * WORKGROUP + local;
        uint key = i < end ? keys[i] : culled;
        // The digits of a group's keys add up to the same in any order.
        if (key != culled) atomicAdd(occurrences[(key - base >> shift) & 255u], 1u);
    }
    barrier();
    histogram[local * group_count + group] = occurrences[local];
}
