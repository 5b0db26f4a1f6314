// hidden: triangles that a headset's lens does not show, nearest of all.
// Reads:   tangents, of a corner: to the right and up.
// Writes:  gl_Position.
// Units:   tangents of an eye's picture.
in vec2 tangents;
uniform vec2 low;   // left and down
uniform vec2 high;  // right and up

void main() {
    gl_Position = vec4(2.0 * (tangents - low) / (high - low) - 1.0, -1.0, 1.0);
}
