// overdraw: one for every fragment that splat.frag would blend.
// Reads:   sigmas and opacity of overdraw.vert; min_alpha.
// Writes:  number, to be added up.
// Units:   splats a pixel.
in vec2 sigmas;
flat in float opacity;
uniform float min_alpha;
out vec4 number;

void main() {
    // The very test of splat.frag, so that the count is that of blended fragments.
    if (!(opacity * exp(-0.5 * dot(sigmas, sigmas)) >= min_alpha)) discard;
    number = vec4(1.0);
}
