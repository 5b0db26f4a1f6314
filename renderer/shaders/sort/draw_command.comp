// draw_command: how many splats are in the order -> the indirect draw of their triangles, and how
// many groups the passes of the sort need that come after the first.
// Reads:   counts, of project.
// Writes:  command[0], dispatch[0]; so the number of splats never travels to the CPU.
// Units:   vertices, work groups.
layout(local_size_x = 1) in;

layout(std430, binding = SLOT_COUNTS) readonly buffer Counts { uint counts[]; };
layout(std430, binding = SLOT_COMMAND) writeonly buffer Command { uint command[]; };
layout(std430, binding = SLOT_DISPATCH) writeonly buffer Dispatch { uint dispatch[]; };

void main() {
    command[0] = 3u * counts[COUNT_SORTED];  // vertices: a triangle a splat; the rest stays 1 0 0
    const uint span = SORT_BLOCKS * WORKGROUP;  // keys a group
    dispatch[0] = (counts[COUNT_SORTED] + span - 1u) / span;  // the rest stays 1 1
}
