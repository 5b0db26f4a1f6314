// full: one triangle that covers the viewport.
// Reads:   nothing.
// Writes:  gl_Position, place.
// Units:   place in 0..1 from lower left.
out vec2 place;  // 0..1 from lower left

void main() {
    place = vec2(gl_VertexID == 1 ? 2.0 : 0.0, gl_VertexID == 2 ? 2.0 : 0.0);
    gl_Position = vec4(2.0 * place - 1.0, 0.0, 1.0);
}
