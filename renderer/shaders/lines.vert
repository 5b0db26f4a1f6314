// lines: ends of line segments over a picture; see renderer/gl/over_picture.py.
// Reads:   place, clip_from_object.
// Writes:  gl_Position.
// Units:   metres in the object's frame.
in vec3 place;  // metres, object frame
uniform mat4 clip_from_object;

void main() {
    gl_Position = clip_from_object * vec4(place, 1.0);
}
