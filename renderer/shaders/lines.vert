// lines: ends of line segments over a picture; see renderer/gl/lines.py.
in vec3 place;  // metres, object frame
uniform mat4 clip_from_object;

void main() {
    gl_Position = clip_from_object * vec4(place, 1.0);
}
