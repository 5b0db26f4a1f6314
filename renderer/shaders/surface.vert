// surface: the triangles of splat.vert, with the depth and the normal of their splats.
// Reads:   order, records, counts, surfaces.
// Writes:  gl_Position, sigmas, opacity, centre, depth and normal.
// Units:   pixels from lower left; metres.
#include "common/sorted.glsl"
layout(std430, binding = SLOT_SURFACES) readonly buffer Surfaces { vec4 surfaces[]; };
uniform vec2 size;   // pixels
uniform uint first;  // record of splat 0 in this view

out vec2 sigmas;  // place in the ellipse's own axes
flat out float opacity;
flat out vec2 center;  // pixels
flat out vec4 depth_slope;   // Z, slope, least depth
flat out vec4 depth_square;  // uu uv vv, largest depth
flat out vec3 normal;

void main() {
    uint triangle = uint(gl_VertexID) / 3u, corner = uint(gl_VertexID) % 3u;
    uint i = order[counts[COUNT_SORTED] - 1u - triangle];  // the farthest first
    uint record = first + i;
    Ellipse e = unpack_record(records[2u * record], records[2u * record + 1u]);
    sigmas = e.cutoff_sigmas * TRIANGLE[corner];
    opacity = e.opacity;
    center = e.center;
    depth_slope = surfaces[3u * i];
    depth_square = surfaces[3u * i + 1u];
    normal = surfaces[3u * i + 2u].xyz;
    vec2 pixel = e.center + sigmas.x * e.major + sigmas.y * e.minor;
    gl_Position = vec4(2.0 * pixel / size - 1.0, 0.0, 1.0);
}
