// lines: one colour for every line.
// Reads:   ink.
// Writes:  color, straight alpha.
// Units:   display sRGB.
uniform vec4 ink;
layout(location = 0) out vec4 color;

void main() {
    color = ink;
}
