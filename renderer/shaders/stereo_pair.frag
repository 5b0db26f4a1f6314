// stereo_pair: splat.frag for two images at once; where a splat does not reach, nothing is blended.
// Reads:   sigmas in both ellipses, colours and opacities of stereo_pair.vert; min_alpha.
// Writes:  left and right, premultiplied.
// Units:   display sRGB over the target's unit; alpha 0..1.
in vec4 sigmas;
flat in vec3 left_color;
flat in vec3 right_color;
flat in vec2 opacities;
uniform float min_alpha;
layout(location = 0) out vec4 left;
layout(location = 1) out vec4 right;

void main() {
    vec2 r = vec2(dot(sigmas.xy, sigmas.xy), dot(sigmas.zw, sigmas.zw));
    // alpha = min(0.99, o exp(-r / 2)) in both views, r the squared Mahalanobis distance.
    vec2 alpha = min(vec2(MAX_ALPHA), opacities * exp(-0.5 * r));
    // No discard: the other view may still be drawn.  Alpha 0 blends nothing.
    alpha.x = alpha.x >= min_alpha ? alpha.x : 0.0;
    alpha.y = alpha.y >= min_alpha ? alpha.y : 0.0;
    left = vec4(left_color * alpha.x, alpha.x);
    right = vec4(right_color * alpha.y, alpha.y);
}
