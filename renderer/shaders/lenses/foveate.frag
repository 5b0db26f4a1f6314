// foveate: a picture that is sharp within a circle, and of a quarter of the pixels beyond.
// Needs:   HEAT (1: a second image beside it).
// Reads:   sharp; halved, of half the width and height (rounded up), linear; with HEAT both
//          of the heat, too; the circles.
// Writes:  color, to the bit that of `sharp` within the inner circle; with HEAT heat.
// Units:   pixels from lower left; radii in tangents.
uniform sampler2D sharp, halved;
#if HEAT
uniform sampler2D sharp_heat, halved_heat;
layout(location = 1) out vec4 heat;
#endif
uniform vec2 centre;   // pixels
uniform vec2 unit;     // tangents a pixel
uniform vec2 circles;  // inner and outer radius
layout(location = 0) out vec4 color;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    float r = length(unit * (gl_FragCoord.xy - centre));
    vec2 place = 0.5 * gl_FragCoord.xy / vec2(textureSize(halved, 0));
    if (r <= circles.x) {
        color = texelFetch(sharp, at, 0);
#if HEAT
        heat = texelFetch(sharp_heat, at, 0);
#endif
    } else {
        float soft = smoothstep(circles.x, circles.y, r);
        color = mix(texelFetch(sharp, at, 0), texture(halved, place), soft);
#if HEAT
        heat = mix(texelFetch(sharp_heat, at, 0), texture(halved_heat, place), soft);
#endif
    }
}
