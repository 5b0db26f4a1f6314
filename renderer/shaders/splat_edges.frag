// splat_edges: splats as filled ellipses, points or rings instead of what they blend to; drawn from
// far to near without blending, so the nearest stays.
// Needs:   KIND = 0 ellipses, 1 points, 2 rings.
// Reads:   sigmas and colours of splat.vert; min_alpha, edge_power, radius, band.
// Writes:  shown, opaque.
// Units:   display sRGB; pixels; powers are squared sigmas.
in vec2 sigmas;
flat in vec4 color_opacity;
uniform float min_alpha, edge_power, radius, band;
out vec4 shown;

void main() {
    float power = dot(sigmas, sigmas);
    // A faint splat ends before the edge of the others: where its alpha does.
    float power_edge = min(edge_power, 2.0 * log(color_opacity.a / min_alpha));
    // How the place in the ellipse's own axes changes with the pixel: the same all over a splat.
    mat2 by_pixel = mat2(dFdx(sigmas), dFdy(sigmas));
    if (!(power <= power_edge)) discard;
    vec3 color = color_opacity.rgb;
#if KIND == 0
    color *= 1.0 - 0.5 * clamp(power / power_edge, 0.0, 1.0);
#elif KIND == 1
    vec2 away = inverse(by_pixel) * sigmas;  // pixels from the middle
    if (!(dot(away, away) <= radius * radius)) discard;
#else
    // To the edge it is so many pixels: the way of sqrt(power) over how fast that rises.
    float root = sqrt(power), rise = length(sigmas * by_pixel);
    if (!((sqrt(power_edge) - root) * root <= band * rise)) discard;
#endif
    shown = vec4(color, 1.0);
}
