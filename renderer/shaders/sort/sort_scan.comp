// sort_scan: digit counts of all groups -> how many keys of the digit the groups before have.  A
// group a digit, WORKGROUP counts at a time.
// Reads:   histogram [digit][group]; how many groups the later passes have in dispatch.
// Writes:  histogram; behind it how many keys each digit has.
// Units:   keys.
#include "common/prefix.glsl"
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_HISTOGRAM) buffer Histogram { uint histogram[]; };
layout(std430, binding = SLOT_DISPATCH) readonly buffer Dispatch { uint dispatch[]; };
uniform uint group_count;  // of the first pass
uniform uint shift;

void main() {
    uint local = gl_LocalInvocationID.x, digit = gl_WorkGroupID.x;
    uint groups = shift == 0u ? group_count : dispatch[DISPATCH_LATER], carry = 0u;
    for (uint first = 0u; first < groups; first += WORKGROUP) {
        uint group = first + local, at = digit * group_count + group;
        uint here = group < groups ? histogram[at] : 0u;
        uint before = sum_before(here);
        if (group < groups) histogram[at] = carry + before;
        carry += prefix_total();
    }
    if (local == 0u) histogram[RADIX * group_count + digit] = carry;
}
