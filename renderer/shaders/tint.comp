// tint: colours mixed towards palette[luminance], each splat by the weight of its anchor.
// What resolve does to a whole picture, for scenes of which a part alone shows a thermal stop.
#include "common/finite.glsl"
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_COLOR) buffer Color { vec4 color[]; };
layout(std430, binding = SLOT_PALETTE) readonly buffer Palette { vec4 palette[]; };  // 256
layout(std430, binding = SLOT_TINT) readonly buffer Tint { float weights[]; };       // an anchor
uniform uint count;
uniform uint start;              // arena row of the first
uniform uint splats_per_anchor;

const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);  // Rec. 709, on display values

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (!(i < count)) return;
    vec3 rgb = color[start + i].rgb;
    float weight = weights[i / splats_per_anchor];
    if (!(weight > 0.0) || !finite(rgb)) return;  // project must see what is no number
    float at = clamp(dot(rgb, LUMINANCE), 0.0, 1.0) * 255.0;
    uint below = uint(at);
    vec3 tinted = mix(palette[below].rgb, palette[min(below + 1u, 255u)].rgb, at - float(below));
    color[start + i].rgb = mix(rgb, tinted, weight);
}
