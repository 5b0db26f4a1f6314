// sort_scatter: keys and indices to where their digit belongs, order kept among equal digits. A
// group walks through its blocks of WORKGROUP keys; within a block, a bit set a digit says which
// invocations hold it, and the bits below one's own are one's rank.
// The order of the last pass is `order`, whatever the number of passes, so it and its spare take
// turns from there backwards.
// Reads:   keys, order or its spare, histogram; how many are sorted in counts, and how often in
//          dispatch.
// Writes:  keys_out, the other of the two orders.
// Units:   none.
#include "common/prefix.glsl"
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_KEYS) readonly buffer Keys { uint keys[]; };
layout(std430, binding = SLOT_ORDER) buffer Order { uint order[]; };
layout(std430, binding = SLOT_ORDER_SPARE) buffer OrderSpare { uint order_spare[]; };
layout(std430, binding = SLOT_KEYS_OUT) writeonly buffer KeysOut { uint keys_out[]; };
layout(std430, binding = SLOT_HISTOGRAM) readonly buffer Histogram { uint histogram[]; };
layout(std430, binding = SLOT_COUNTS) readonly buffer Counts { uint counts[]; };
layout(std430, binding = SLOT_DISPATCH) readonly buffer Dispatch { uint dispatch[]; };
uniform uint group_count;  // of the first pass
uniform uint count;   // of the first pass, which leaves culled keys behind
uniform uint culled;  // those
uniform uint shift;   // bits; at 0 the indices are in no order yet but 0, 1, 2, ...

const uint WORDS = WORKGROUP / 32;
shared uint next[RADIX];              // where the group's next key of a digit goes
shared uint holders[WORDS * RADIX];   // [word][digit]

void main() {
    uint local = gl_LocalInvocationID.x, group = gl_WorkGroupID.x;
    uint base = dispatch[DISPATCH_BASE];
    bool into_order = ((dispatch[DISPATCH_PASSES] - 1u - (shift >> 3)) & 1u) == 0u;
    // A digit's keys begin where those of all digits before it end; RADIX is WORKGROUP.
    uint begin = sum_before(histogram[RADIX * group_count + local]);
    next[local] = begin + histogram[local * group_count + group];
    uint own_word = local >> 5, own_bit = 1u << (local & 31u);
    uint first = group * SORT_BLOCKS * WORKGROUP, end = shift == 0u ? count : counts[COUNT_SORTED];
    for (uint block = 0u; block < SORT_BLOCKS; block++) {
        // A digit's bit set is cleared by the invocation of its number.
        for (uint word = 0u; word < WORDS; word++) holders[word * RADIX + local] = 0u;
        barrier();
        uint i = first + block * WORKGROUP + local;
        uint key = i < end ? keys[i] : culled, digit = 0u, to = 0u;
        bool valid = key != culled;
        if (valid) {
            digit = (key - base >> shift) & 255u;
            to = next[digit];
            // Bits may be set in any order: the set is the same, so the sort is stable.
            atomicOr(holders[own_word * RADIX + digit], own_bit);
        }
        barrier();
        if (valid) {
            uint rank = 0u, total = 0u;
            for (uint word = 0u; word < WORDS; word++) {
                uint bits = holders[word * RADIX + digit];
                total += uint(bitCount(bits));
                uint before =
                    word < own_word ? bits : word == own_word ? bits & (own_bit - 1u) : 0u;
                rank += uint(bitCount(before));
            }
            keys_out[to + rank] = key;
            uint splat = shift == 0u ? i : into_order ? order_spare[i] : order[i];
            if (into_order) order[to + rank] = splat;
            else order_spare[to + rank] = splat;
            // The last holder moves the group's next place on, after everybody has read it.
            if (rank == total - 1u) next[digit] = to + total;
        }
        barrier();
    }
}
