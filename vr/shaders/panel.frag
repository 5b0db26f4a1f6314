// panel: TAPS samples a pixel on a turned grid, each from a level finer than its size asks for:
// small letters stay crisp and, with four, do not crawl when the head moves.
// Reads:   picture, premultiplied; opacity.
// Writes:  shown, premultiplied.
// Units:   display sRGB; place in 0..1 of the picture.
in vec2 place;
uniform sampler2D picture;  // display sRGB, premultiplied
uniform float opacity;      // 0..1
out vec4 shown;

const float FINER = TAPS > 1 ? -1.0 : -0.5;  // levels
const vec2 GRID[4] =
    vec2[](vec2(0.125, 0.375), vec2(-0.375, 0.125), vec2(0.375, -0.125), vec2(-0.125, -0.375));

void main() {
    vec2 right = dFdx(place), up = dFdy(place);
    shown = vec4(0.0);
    for (int i = 0; i < TAPS; ++i) {
        vec2 aside = TAPS > 1 ? GRID[i].x * right + GRID[i].y * up : vec2(0.0);
        shown += texture(picture, place + aside, FINER) / float(TAPS);
    }
    shown *= opacity;
}
