// shown: an eye's display-encoded picture, or a part of it, into another framebuffer.
// FRAMEBUFFER_SRGB is off, so values arrive as they are written: an sRGB image of the runtime wants
// them encoded, as they are; for a linear one they are decoded here, the one conversion there is.
// Reads:   image, part, linear.
// Writes:  shown, premultiplied as the image is.
// Units:   display sRGB, or light where linear.
in vec2 place;
uniform sampler2D image;  // display sRGB
uniform vec4 part;        // left, bottom, width, height of the image, 0..1
uniform bool linear;      // the framebuffer holds light, not display values
out vec4 shown;
#include "srgb.glsl"

void main() {
    vec4 color = texture(image, part.xy + part.zw * place);
    shown = vec4(linear ? linear_from_srgb(color.rgb) : color.rgb, color.a);
}
