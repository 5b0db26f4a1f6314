// heat: what value stops have in the colours of splats, kept apart from the colours of the others
// until a palette is laid over the picture, or made colours of at once.
// Needs:   BLEND = 0: color (a value stop's, as decoded) -> heat; 1: heat -> color of other
//          stops.
// Reads:   color, palette, weights, or heat.
// Writes:  heat: sum of weight * (value, 0, 0, 1), value 0..1; with a palette of weight * (its
//          colour, 1); or color.
// Units:   display sRGB; weights and values 0..1.
#include "common/finite.glsl"
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_COLOR) buffer Color { vec4 color[]; };
layout(std430, binding = SLOT_HEAT) buffer Heat { vec4 heat[]; };
uniform uint count;
uniform uint start;              // arena row of the first

#if BLEND
uniform bool into_color;         // the heat's colours are added, and there is no heat any more

void main() {
    uint i = start + gl_GlobalInvocationID.x;
    if (!(gl_GlobalInvocationID.x < count)) return;
    vec4 h = heat[i];
    float kept = 1.0 - h.w;
    vec3 rgb = kept > 0.0 ? kept * color[i].rgb : vec3(0.0);
    if (into_color) {
        rgb += h.rgb;
        heat[i] = vec4(0.0);
    }
    if (!finite(h.rgb)) rgb = h.rgb;  // project must see what is no number
    color[i].rgb = rgb;
}
#else
layout(std430, binding = SLOT_PALETTE) readonly buffer Palette { vec4 palette[]; };  // 256
layout(std430, binding = SLOT_TINT) readonly buffer Weights { float weights[]; };
uniform uint per_weight;         // splats side by side that have one weight
uniform bool first;              // what heat there is is of no use
uniform bool colored;            // through the palette
#include "common/luminance.glsl"

void main() {
    uint i = start + gl_GlobalInvocationID.x;
    if (!(gl_GlobalInvocationID.x < count)) return;
    vec3 rgb = color[i].rgb;
    float weight = weights[gl_GlobalInvocationID.x / per_weight];
    vec4 sum = first ? vec4(0.0) : heat[i];
    if (weight > 0.0) {
        float luminance = dot(rgb, LUMINANCE);
        vec4 value = vec4(luminance, 0.0, 0.0, 1.0);
        if (colored) {
            float at = clamp(luminance, 0.0, 1.0) * 255.0;
            uint below = min(uint(at), 254u);
            value.rgb = mix(palette[below].rgb, palette[below + 1u].rgb, at - float(below));
        }
        if (!finite(rgb)) value.rgb = vec3(rgb.r + rgb.g + rgb.b);  // project must see it
        sum += weight * value;
    }
    heat[i] = sum;
}
#endif
