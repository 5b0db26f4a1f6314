// draw_command: how many splats are in the order -> the indirect draw of their triangles.
// Reads:   counts, of project.
// Writes:  command[0]; so the number of triangles never travels to the CPU.
// Units:   vertices.
layout(local_size_x = 1) in;

layout(std430, binding = SLOT_COUNTS) readonly buffer Counts { uint counts[]; };
layout(std430, binding = SLOT_COMMAND) writeonly buffer Command { uint command[]; };

void main() {
    command[0] = 3u * counts[COUNT_SORTED];  // vertices: a triangle a splat; the rest stays 1 0 0
}
