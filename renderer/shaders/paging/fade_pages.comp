// fade_pages: how much of a run of splats is left out while a level fades.  One invocation a splat.
// Reads:   nothing.
// Writes:  covariance: the third number of a splat's second vector, which project reads.
// Units:   a part of the splat: 0 where all of it is drawn, as every splat begins.
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_COVARIANCE) writeonly buffer Covariance { vec4 covariance[]; };
uniform uint count;
uniform uint start;      // arena row of the first
uniform float left_out;  // 0 to 1

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (!(i < count)) return;
    // A swizzle writes this number alone; its neighbours are the splat's shape.
    covariance[2u * (start + i) + 1u].z = left_out;
}
