// splat: alpha = min(0.99, opacity exp(-r / 2)), premultiplied; blended ONE, ONE_MINUS_SRC_ALPHA,
// which from far to near is the sum of c alpha T (paper eq. 2; 3DGS, eq. 3).
// Reads:   sigmas and colours of splat.vert; min_alpha.
// Writes:  premultiplied; with HEAT heat.
// Units:   display sRGB over the target's unit; alpha 0..1.
in vec2 sigmas;
flat in vec4 color_opacity;
uniform float min_alpha;
layout(location = 0) out vec4 premultiplied;
#if HEAT
flat in vec2 value_weight;
layout(location = 1) out vec4 heat;  // value, weight, 0, alpha: blended as the colours are
#endif

void main() {
    // In the ellipse's own axes the squared Mahalanobis distance r is a plain dot product.
    float alpha = min(MAX_ALPHA, color_opacity.a * exp(-0.5 * dot(sigmas, sigmas)));
    if (!(alpha >= min_alpha)) discard;  // project lets no NaN come here: it would stay for good
    premultiplied = vec4(color_opacity.rgb * alpha, alpha);
#if HEAT
    heat = vec4(value_weight * alpha, 0.0, alpha);
#endif
}
