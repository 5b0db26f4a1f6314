// splat: one triangle a splat, pulled from the records, tight around the ellipse where alpha ends.
// Software GL needs a fifth less time than with a quad of two: its cost is that of the triangles.
// Needs:   HEAT (1: what is thermal of a splat is drawn into a second image).
// Reads:   order, records, counts; with HEAT heat.
// Writes:  gl_Position, sigmas, color_opacity; with HEAT value_weight.
// Units:   pixels from lower left; sigmas along the ellipse's own axes.
#include "common/sorted.glsl"
#if HEAT
layout(std430, binding = SLOT_HEAT) readonly buffer Heat { vec4 heat[]; };
flat out vec2 value_weight;   // of a thermal stop: value times weight, weight
#endif
uniform vec2 size;   // pixels
uniform uint first;  // record of splat 0 in this view
uniform float per_unit;  // 1 over the display value that 1 in the picture stands for

out vec2 sigmas;              // place in the ellipse's own axes
flat out vec4 color_opacity;

void main() {
    // The farthest splat is drawn first.
    uint triangle = uint(gl_VertexID) / 3u, corner = uint(gl_VertexID) % 3u;
    uint splat = order[counts[COUNT_SORTED] - 1u - triangle], i = first + splat;
    Ellipse e = unpack_record(records[2u * i], records[2u * i + 1u]);
#if HEAT
    value_weight = heat[splat].xw * vec2(per_unit, 1.0);
#endif
    sigmas = e.cutoff_sigmas * TRIANGLE[corner];
    // Along the half axes, which are one sigma.
    vec2 pixel = e.center + sigmas.x * e.major + sigmas.y * e.minor;
    color_opacity = vec4(e.color * per_unit, e.opacity);
    gl_Position = vec4(2.0 * pixel / size - 1.0, 0.0, 1.0);
}
