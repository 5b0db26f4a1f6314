// layer: boxes of a picture whose upper row comes first.
// Reads:   corner.
// Writes:  gl_Position, place.
// Units:   corner in pixels from the upper left; place in 0..1 from the lower left.
in vec2 corner;
uniform vec2 size;
out vec2 place;

void main() {
    vec2 part = corner / size;
    place = vec2(part.x, 1.0 - part.y);
    gl_Position = vec4(2.0 * part - 1.0, 0.0, 1.0);
}
