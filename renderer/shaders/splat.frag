// splat: alpha = min(0.99, opacity exp(-r / 2)), premultiplied; blended ONE, ONE_MINUS_SRC_ALPHA.
in vec2 sigmas;
flat in vec4 color_opacity;
uniform float min_alpha;
out vec4 premultiplied;

void main() {
    float alpha = min(MAX_ALPHA, color_opacity.a * exp(-0.5 * dot(sigmas, sigmas)));
    if (!(alpha >= min_alpha)) discard;  // project lets no NaN come here: it would stay for good
    premultiplied = vec4(color_opacity.rgb * alpha, alpha);
}
