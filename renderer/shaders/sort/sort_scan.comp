// sort_scan: digit counts of all groups -> where each group's first key of a digit goes. One group,
// one invocation a digit: digits in order, within a digit groups in order.
// Reads:   histogram [group][digit]; how many groups the later passes have in dispatch.
// Writes:  histogram.
// Units:   keys.
layout(local_size_x = RADIX) in;

layout(std430, binding = SLOT_HISTOGRAM) buffer Histogram { uint histogram[]; };
layout(std430, binding = SLOT_DISPATCH) readonly buffer Dispatch { uint dispatch[]; };
uniform uint group_count;  // of the first pass
uniform uint shift;

shared uint totals[RADIX];

void main() {
    uint digit = gl_LocalInvocationID.x, groups = shift == 0u ? group_count : dispatch[0];
    uint total = 0u;
    for (uint group = 0u; group < groups; group++) total += histogram[group * RADIX + digit];
    totals[digit] = total;
    barrier();
    // Inclusive prefix sum (Hillis and Steele).
    for (uint reach = 1u; reach < RADIX; reach <<= 1) {
        uint before = digit >= reach ? totals[digit - reach] : 0u;
        barrier();
        totals[digit] += before;
        barrier();
    }
    // Exclusive: where the digit begins; then from group to group.
    uint next = totals[digit] - total;
    for (uint group = 0u; group < groups; group++) {
        uint here = histogram[group * RADIX + digit];
        histogram[group * RADIX + digit] = next;
        next += here;
    }
}
