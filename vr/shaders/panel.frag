// panel: TAPS samples a pixel on a turned grid, each from a level finer than its size asks for:
// small letters stay crisp and, with four, do not crawl when the head moves.
// Reads:   picture, premultiplied; opacity; half_size, corner; the splats' depth.
// Writes:  shown, premultiplied.
// Units:   display sRGB; place in 0..1 of the picture; metres.
#include "scene_depth.glsl"
in vec2 place;
in vec2 aside;              // metres from the middle
uniform sampler2D picture;  // display sRGB, premultiplied
uniform float opacity;      // 0..1
uniform vec2 half_size;     // metres
uniform float corner;       // metres, radius; 0: the picture has its own
uniform bool cut;           // only where it is, as alpha: a layer of its own has the picture
uniform vec2 size;          // pixels of the target
out vec4 shown;

const float FINER = TAPS > 1 ? -1.0 : -0.5;  // levels
const vec2 GRID[4] =
    vec2[](vec2(0.125, 0.375), vec2(-0.375, 0.125), vec2(0.375, -0.125), vec2(-0.125, -0.375));

void main() {
    vec2 right = dFdx(place), up = dFdy(place);
    shown = vec4(0.0);
    if (cut) shown.a = 1.0;
    for (int i = 0; i < TAPS && !cut; ++i) {
        vec2 aside = TAPS > 1 ? GRID[i].x * right + GRID[i].y * up : vec2(0.0);
        shown += texture(picture, place + aside, FINER) / float(TAPS);
    }
    shown *= opacity * seen_before(gl_FragCoord.xy / size, 1.0 / gl_FragCoord.w);
    if (corner > 0.0) {
        // Signed distance to the rounded rectangle, negative inside; its edge is a pixel wide.
        vec2 beyond = max(abs(aside) - half_size + corner, 0.0);
        float outside = length(beyond) - corner;
        shown *= clamp(0.5 - outside / max(fwidth(outside), 1e-6), 0.0, 1.0);
    }
    if (!(shown.a > 1.0 / 512.0)) discard;  // it would leave its depth
}
