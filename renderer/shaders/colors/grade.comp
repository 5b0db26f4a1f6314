// grade: the appearance of an object, on colours that were just decoded: (gain c) ^ power.
// Reads:   color; which pages, where PAGED.
// Writes:  color.
// Units:   display sRGB.
#include "common/finite.glsl"
#ifndef PAGED
#define PAGED 0       // 1: of pages, PAGE splats each
#endif
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_COLOR) buffer Color { vec4 color[]; };
#if PAGED
layout(std430, binding = SLOT_LISTED) readonly buffer Listed { uint listed[]; };  // pages
#endif
uniform uint count;
uniform uint start;   // arena row of the first; where pages begin
uniform vec3 gain;
uniform float power;  // 1 over the gamma

void main() {
    if (!(gl_GlobalInvocationID.x < count)) return;
    uint i = start + gl_GlobalInvocationID.x;
#if PAGED
    i = start + listed[gl_GlobalInvocationID.x / PAGE] * PAGE + gl_GlobalInvocationID.x % PAGE;
#endif
    vec3 lit = gain * color[i].rgb;
    // A power of what is below 0 is no number; project must see what is none already.
    if (power != 1.0 && finite(lit)) lit = pow(max(lit, vec3(0.0)), vec3(power));
    color[i].rgb = lit;
}
