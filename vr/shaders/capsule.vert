// capsule: a line with round ends and a thickness, one instance each; its normals point outward.
// Reads:   a unit ball whose lower half stays at a and whose upper half is moved to b; per capsule
//          its ends, radii and colours; clip_from_play, eye, tangent_px.
// Writes:  gl_Position, normal, towards_eye, color.
// Units:   metres of the room; display sRGB and opacity.
in vec3 ball;    // direction in the capsule's own axes, z along the line
in float upper;  // 1: belongs to the end at b
in vec3 a;       // metres, room
in vec3 b;
in vec2 radii;   // metres, at a and b
in vec4 color_a; // display sRGB, opacity
in vec4 color_b;

uniform mat4 clip_from_play;
uniform vec3 eye;           // metres, room
uniform float tangent_px;   // tangent of a pixel's width

out vec3 normal;
out vec3 towards_eye;
out vec4 color;

const float LEAST_PX = 0.8;  // thinner lines break into dots; they are paler instead

void main() {
    vec3 line = b - a;
    float length_m = length(line);
    vec3 along = length_m > 1e-6 ? line / length_m : vec3(0.0, 0.0, 1.0);
    // Any axis that is not the line's gives two across it.
    vec3 other = abs(along.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0);
    vec3 aside = normalize(cross(other, along));
    normal = ball.x * aside + ball.y * cross(along, aside) + ball.z * along;
    vec3 middle = mix(a, b, upper);
    float radius = mix(radii.x, radii.y, upper);
    // A pixel at this distance, in metres.
    float least = LEAST_PX * tangent_px * distance(eye, middle);
    float wide = max(radius, least);
    color = mix(color_a, color_b, upper);
    color.a *= max(radius / wide, 0.3);
    vec3 place = middle + wide * normal;
    towards_eye = eye - place;
    gl_Position = clip_from_play * vec4(place, 1.0);
}
