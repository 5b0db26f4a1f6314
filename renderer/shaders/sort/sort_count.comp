// sort_count: how often each digit occurs in a group's keys.  First of the three steps of a pass of
// a radix sort: least significant digit first, stable.
// Reads:   keys.
// Writes:  histogram [group][digit].
// Units:   none.
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_KEYS) readonly buffer Keys { uint keys[]; };
layout(std430, binding = SLOT_HISTOGRAM) writeonly buffer Histogram { uint histogram[]; };
uniform uint count;
uniform uint shift;  // bits; the digit is 8 bits from here

shared uint occurrences[RADIX];

void main() {
    uint local = gl_LocalInvocationID.x, group = gl_WorkGroupID.x;
    occurrences[local] = 0u;
    barrier();
    uint first = group * SORT_BLOCKS * WORKGROUP;
    for (uint block = 0u; block < SORT_BLOCKS; block++) {
        uint i = first + block * WORKGROUP + local;
        // The digits of a group's keys add up to the same in any order.
        if (i < count) atomicAdd(occurrences[(keys[i] >> shift) & 255u], 1u);
    }
    barrier();
    histogram[group * RADIX + local] = occurrences[local];
}
