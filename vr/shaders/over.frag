// over: the splats' picture darkened towards its edge (the vignette) or all over (after a jump),
// and over that hands, lines and the panel.  Blended by ONE, ONE_MINUS_SRC_ALPHA.
// Reads:   drawn, premultiplied, within box; tangents, vignette, blink.
// Writes:  shown, premultiplied: its alpha is what is hidden of the splats.
// Units:   pixels; tangents of the eye; display sRGB.
in vec2 place;
uniform sampler2D drawn;   // premultiplied, as large as the target
uniform ivec4 box;         // the pixels of it that hold anything: left, bottom, width, height
uniform vec4 tangents;     // of the eye: left, right, down, up
uniform float vignette;    // 0..1
uniform float blink;       // 0..1
out vec4 shown;

// Tangents from straight ahead: where the dark begins and where it is full, at vignette 0 and 1.
// Both eyes have it around straight ahead, not around their pictures' middles, so that it fuses.
const vec2 WIDE = vec2(1.1, 1.9), NARROW = vec2(0.22, 0.62);

void main() {
    vec2 tangent = mix(tangents.xz, tangents.yw, place);
    vec2 edge = mix(WIDE, NARROW, vignette);
    float dark = smoothstep(edge.x, edge.y, length(tangent)) * smoothstep(0.0, 0.15, vignette);
    dark = max(dark, blink);
    ivec2 pixel = ivec2(gl_FragCoord.xy), inside = pixel - box.xy;
    bool holds = all(greaterThanEqual(inside, ivec2(0))) && all(lessThan(inside, box.zw));
    vec4 above = holds ? texelFetch(drawn, pixel, 0) : vec4(0.0);
    shown = vec4(above.rgb, 1.0 - (1.0 - dark) * (1.0 - above.a));
}
