// draw_command: how many splats are in the order -> the indirect draw of their triangles, and how
// many groups the passes of the sort need that come after the first.
// Reads:   counts, of project: how many keys, and their range where it is known.
// Writes:  command[0], dispatch; so neither number travels to the CPU.
// Units:   vertices, work groups.
layout(local_size_x = 1) in;

layout(std430, binding = SLOT_COUNTS) readonly buffer Counts { uint counts[]; };
layout(std430, binding = SLOT_COMMAND) writeonly buffer Command { uint command[]; };
layout(std430, binding = SLOT_DISPATCH) writeonly buffer Dispatch { uint dispatch[]; };
uniform uint key_bits;  // 16: of steps that begin at 0; 32: of floats

void main() {
    uint sorted = counts[COUNT_SORTED];
    uint nearest = counts[COUNT_NEAREST], farthest = counts[COUNT_FARTHEST];
    command[0] = 3u * sorted;  // vertices: a triangle a splat; the rest stays 1 0 0
    // Keys less the nearest have fewer bits: depths within a factor of three or four have 24.
    bool known = key_bits == 32u && nearest <= farthest;
    uint base = known ? nearest : 0u, range = farthest - nearest, passes = key_bits / 8u;
    if (known)
        passes = 1u + uint(range >> 8 > 0u) + uint(range >> 16 > 0u) + uint(range >> 24 > 0u);
    const uint span = SORT_BLOCKS * WORKGROUP;  // keys a group
    for (uint later = 0u; later < MOST_LATER; later++) {
        uint groups = later + 1u < passes ? (sorted + span - 1u) / span : 0u;
        dispatch[6u * later] = groups;  // of keys, by 1 by 1
        dispatch[6u * later + 3u] = groups > 0u ? RADIX : 0u;  // of digits, by 1 by 1
    }
    dispatch[DISPATCH_PASSES] = passes;
    dispatch[DISPATCH_BASE] = base;
    dispatch[DISPATCH_LATER] = (sorted + span - 1u) / span;
}
