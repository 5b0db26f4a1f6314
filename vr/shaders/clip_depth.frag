// clip_depth: the splats' depth as a depth buffer has it, for the runtime's compositor.
// Reads:   scene_depth of an eye; its near and far.
// Writes:  gl_FragDepth, 0 at near and 1 at far.
// Units:   metres of the room.
#include "scene_depth.glsl"
in vec2 place;
uniform float near_m, far_m;

void main() {
    float z = clamp(scene_depth_m(place), near_m, far_m);
    gl_FragDepth = far_m * (z - near_m) / (z * (far_m - near_m));
}
