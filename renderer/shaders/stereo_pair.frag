// pair: splat.frag for two images at once; where a splat does not reach, nothing is blended.
in vec4 sigmas;
flat in vec3 left_color;
flat in vec3 right_color;
flat in vec2 opacities;
uniform float min_alpha;
layout(location = 0) out vec4 left;
layout(location = 1) out vec4 right;

void main() {
    vec2 r = vec2(dot(sigmas.xy, sigmas.xy), dot(sigmas.zw, sigmas.zw));
    vec2 alpha = min(vec2(MAX_ALPHA), opacities * exp(-0.5 * r));
    alpha.x = alpha.x >= min_alpha ? alpha.x : 0.0;
    alpha.y = alpha.y >= min_alpha ? alpha.y : 0.0;
    left = vec4(left_color * alpha.x, alpha.x);
    right = vec4(right_color * alpha.y, alpha.y);
}
