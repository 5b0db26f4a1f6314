// panel: four samples a pixel on a turned grid, each from a level finer than its size asks for:
// small letters stay crisp and do not crawl when the head moves.
in vec2 place;
uniform sampler2D picture;  // display sRGB, premultiplied
out vec4 shown;

const float FINER = -1.0;  // levels
const vec2 GRID[4] =
    vec2[](vec2(0.125, 0.375), vec2(-0.375, 0.125), vec2(0.375, -0.125), vec2(-0.125, -0.375));

void main() {
    vec2 right = dFdx(place), up = dFdy(place);
    shown = vec4(0.0);
    for (int i = 0; i < 4; ++i) {
        shown += 0.25 * texture(picture, place + GRID[i].x * right + GRID[i].y * up, FINER);
    }
}
