// shadow: a level rectangle of the world.
// Reads:   clip_from_world, corner, side_m.
// Writes:  gl_Position, place.
// Units:   metres of the world; place in 0..1 along x and z.
uniform mat4 clip_from_world;
uniform vec3 corner;   // its corner of the least x and z
uniform float side_m;
out vec2 place;

void main() {
    place = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    gl_Position = clip_from_world * vec4(corner + side_m * vec3(place.x, 0.0, place.y), 1.0);
}
