// sort_scatter: keys and indices to where their digit belongs, order kept among equal digits. A
// group walks through its blocks of WORKGROUP keys; within a block, a bit set a digit says which
// invocations hold it, and the bits below one's own are one's rank.
// Reads:   keys, order_in, histogram; how many are sorted in counts.
// Writes:  keys_out, order_out.
// Units:   none.
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_KEYS) readonly buffer Keys { uint keys[]; };
layout(std430, binding = SLOT_ORDER_IN) readonly buffer OrderIn { uint order_in[]; };
layout(std430, binding = SLOT_KEYS_OUT) writeonly buffer KeysOut { uint keys_out[]; };
layout(std430, binding = SLOT_ORDER_OUT) writeonly buffer OrderOut { uint order_out[]; };
layout(std430, binding = SLOT_HISTOGRAM) readonly buffer Histogram { uint histogram[]; };
layout(std430, binding = SLOT_COUNTS) readonly buffer Counts { uint counts[]; };
uniform uint count;   // of the first pass, which leaves culled keys behind
uniform uint culled;  // those
uniform uint shift;   // bits; at 0 the indices are not in order_in yet but 0, 1, 2, ...

const uint WORDS = WORKGROUP / 32;
shared uint next[RADIX];              // where the group's next key of a digit goes
shared uint holders[WORDS * RADIX];   // [word][digit]

void main() {
    uint local = gl_LocalInvocationID.x, group = gl_WorkGroupID.x;
    next[local] = histogram[group * RADIX + local];
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
            digit = (key >> shift) & 255u;
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
            order_out[to + rank] = shift == 0u ? i : order_in[i];
            // The last holder moves the group's next place on, after everybody has read it.
            if (rank == total - 1u) next[digit] = to + total;
        }
        barrier();
    }
}
