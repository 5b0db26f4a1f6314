// panel: its picture as a rectangle in the room.
// Reads:   clip_from_panel, half_size.
// Writes:  gl_Position, place.
// Units:   metres; place in 0..1 of the picture, row 0 on top.
uniform mat4 clip_from_panel;
uniform vec2 half_size;  // metres
out vec2 place;          // 0..1 of the picture, row 0 on top

void main() {
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    place = vec2(corner.x, 1.0 - corner.y);
    gl_Position = clip_from_panel * vec4((2.0 * corner - 1.0) * half_size, 0.0, 1.0);
}
