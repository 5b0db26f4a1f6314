// layer: a premultiplied layer, to be blended over a picture.
// Reads:   layer, row 0 at the bottom, each texel as it is.
// Writes:  shown, premultiplied.
// Units:   display sRGB.
in vec2 place;
uniform sampler2D layer;
out vec4 shown;

// A bare texture(), from and into textures laid out as windows are: llvmpipe has a way of its own
// for that, at a third of what texelFetch takes.
void main() {
    shown = texture(layer, place);
}
