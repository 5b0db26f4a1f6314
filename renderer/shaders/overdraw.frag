// overdraw: one for every fragment that splat.frag would blend.
in vec2 sigmas;
flat in float opacity;
uniform float min_alpha;
out vec4 number;

void main() {
    if (!(opacity * exp(-0.5 * dot(sigmas, sigmas)) >= min_alpha)) discard;
    number = vec4(1.0);
}
