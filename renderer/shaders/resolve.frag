// resolve: a premultiplied image over a background, of one colour or a sky.  A palette makes its
// colours of the image's luminance, or adds those of its heat. The palette colours what is there
// and not the background: values are divided by alpha first.
// Reads:   image, palette, heat, at the pixel's place.
// Writes:  shown, opaque.
// Units:   display sRGB; image and heat count in `unit`.
in vec2 place;
uniform sampler2D image;
uniform sampler2D palette;   // 256 x 1, display sRGB
uniform sampler2D heat;      // value, weight: both times alpha
uniform bool use_palette, use_heat;
uniform vec3 background;     // display sRGB; of a sky at the horizon
uniform bool has_sky;
uniform vec3 zenith, ground; // display sRGB
uniform vec4 tangents;       // left, right, down, up of the view
uniform vec3 up;             // the world's +Y along the axes of the eye
uniform float unit;          // the display value that 1 in the image stands for
uniform bool top_first;      // the image's first row is the upper one
out vec4 shown;
#include "common/luminance.glsl"

// By hand: a driver's own filter may keep 8 bits of the place between two entries.
vec3 palette_color(float luminance) {
    float at = luminance * 255.0;
    int below = int(at);
    vec3 lower = texelFetch(palette, ivec2(below, 0), 0).rgb;
    vec3 upper = texelFetch(palette, ivec2(min(below + 1, 255), 0), 0).rgb;
    return mix(lower, upper, at - float(below));
}

// From horizon to zenith or ground evenly with the sine of the elevation.
vec3 sky() {
    vec3 direction = vec3(mix(tangents.xz, tangents.yw, place), -1.0);
    float sine = dot(up, direction) / length(direction);
    return background + max(sine, 0.0) * (zenith - background)
        + max(-sine, 0.0) * (ground - background);
}

void main() {
    vec2 at = top_first ? vec2(place.x, 1.0 - place.y) : place;
    vec4 rgba = texture(image, at);
    rgba.rgb *= unit;
    if (use_heat) {
        vec2 value_weight = texture(heat, at).rg;
        float value = clamp(unit * value_weight.x / max(value_weight.y, 1e-6), 0.0, 1.0);
        rgba.rgb += palette_color(value) * value_weight.y;
    } else if (use_palette) {
        float luminance = clamp(dot(rgba.rgb, LUMINANCE) / max(rgba.a, 1e-6), 0.0, 1.0);
        rgba.rgb = palette_color(luminance) * rgba.a;
    }
    shown = vec4(rgba.rgb + (1.0 - rgba.a) * (has_sky ? sky() : background), 1.0);
}
