// see_through: an eye's picture over black made one over whatever is behind it, in the room.
// What covers half of a pixel is to let half of the light through; pictures are display-encoded, so
// colours are taken apart from their coverage, weighed by it as light, and encoded again.
// Reads:   picture (splats over black), coverage.
// Writes:  shown: its alpha is what is hidden of the room, its colour premultiplied as light.
// Units:   display sRGB; coverage 0..1.
in vec2 place;
uniform sampler2D picture;
uniform sampler2D coverage;  // in alpha
uniform bool top_first;      // row 0 of the coverage is on top
out vec4 shown;
#include "srgb.glsl"

// IEC 61966-2-1
vec3 srgb_from_linear(vec3 c) {
    return mix(c * 12.92, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}

void main() {
    vec2 at = top_first ? vec2(place.x, 1.0 - place.y) : place;
    float alpha = clamp(texture(coverage, at).a, 0.0, 1.0);
    vec3 over_black = texture(picture, place).rgb;
    // Below a step of 8 bits there is no colour to be found, and nobody sees one.
    vec3 color = alpha > 1.0 / 255.0 ? clamp(over_black / alpha, 0.0, 1.0) : vec3(0.0);
    shown = vec4(srgb_from_linear(linear_from_srgb(color) * alpha), alpha);
}
