// panel: its picture as a rectangle in the room.
// Reads:   clip_from_panel, half_size, top_first.
// Writes:  gl_Position, place, aside.
// Units:   metres; place in 0..1 of the picture.
uniform mat4 clip_from_panel;
uniform vec2 half_size;  // metres
uniform bool top_first;  // row 0 of the picture is on top; else below
out vec2 place;          // 0..1 of the picture
out vec2 aside;          // metres from the middle

void main() {
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    place = vec2(corner.x, top_first ? 1.0 - corner.y : corner.y);
    aside = (2.0 * corner - 1.0) * half_size;
    gl_Position = clip_from_panel * vec4(aside, 0.0, 1.0);
}
