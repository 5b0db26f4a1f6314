// resolve: a premultiplied image over a background, its colour mixed towards palette[luminance].
// The palette colours what is there and not the background: colour is divided by alpha first.
in vec2 place;
uniform sampler2D image;
uniform sampler2D palette;   // 256 x 1, display sRGB, linear between entries
uniform float weight;        // 0: colours as they are, 1: palette alone
uniform vec3 background;     // display sRGB
uniform bool top_first;      // the image's first row is the upper one
out vec4 shown;

const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);  // Rec. 709, on display values

void main() {
    vec4 rgba = texture(image, top_first ? vec2(place.x, 1.0 - place.y) : place);
    if (weight > 0.0) {
        float luminance = clamp(dot(rgba.rgb, LUMINANCE) / max(rgba.a, 1e-6), 0.0, 1.0);
        vec3 color = texture(palette, vec2((luminance * 255.0 + 0.5) / 256.0, 0.5)).rgb;
        rgba.rgb = mix(rgba.rgb, color * rgba.a, weight);
    }
    shown = vec4(rgba.rgb + (1.0 - rgba.a) * background, 1.0);
}
