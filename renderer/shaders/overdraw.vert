// overdraw: the triangles of splat.vert in the order of the splats, for adding up instead of
// blending.
// Reads:   records and keys, of project.
// Writes:  gl_Position, sigmas, opacity.
// Units:   pixels from lower left; sigmas along the ellipse's own axes.
#include "common/record.glsl"
#include "common/triangle.glsl"

layout(std430, binding = SLOT_RECORDS) readonly buffer Records { uvec4 records[]; };
layout(std430, binding = SLOT_KEYS) readonly buffer Keys { uint keys[]; };
uniform vec2 size;  // pixels

out vec2 sigmas;  // place in the ellipse's own axes
flat out float opacity;

void main() {
    uint i = uint(gl_VertexID) / 3u, corner = uint(gl_VertexID) % 3u;
    Ellipse e = unpack_record(records[2u * i], records[2u * i + 1u]);
    sigmas = e.cutoff_sigmas * TRIANGLE[corner];
    vec2 pixel = e.center + sigmas.x * e.major + sigmas.y * e.minor;
    opacity = e.opacity;
    bool culled = keys[i] == CULLED_KEY;  // nobody wrote its record
    gl_Position = culled ? vec4(-2.0, -2.0, 0.0, 1.0) : vec4(2.0 * pixel / size - 1.0, 0.0, 1.0);
}
