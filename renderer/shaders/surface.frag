// surface: alpha as in splat.frag; depth (surface.comp) or normal instead of the colour.
// Reads:   sigmas, opacity, centre, depth and normal of surface.vert; min_alpha; output_kind.
// Writes:  premultiplied depth or normal, and alpha.
// Units:   metres; normals have eye axes and length 1.
in vec2 sigmas;
flat in float opacity;
flat in vec2 center;
flat in vec4 depth_slope;
flat in vec4 depth_square;
flat in vec3 normal;
uniform float min_alpha;
uniform vec2 pixels_per_fragment;  // of the view: above 1 where the target is smaller than it
uniform int output_kind;  // 0: depth, metres; 1: normal, eye axes
out vec4 premultiplied;

float depth_under(vec2 d) {
    // z = Z (1 + l) / (1 + 2 l + q): where the pixel's ray is halfway through the ellipsoid.
    float l = dot(depth_slope.yz, d);
    float q = depth_square.x * d.x * d.x + 2.0 * depth_square.y * d.x * d.y +
              depth_square.z * d.y * d.y;
    float z = depth_slope.x * (1.0 + l) / max(1.0 + 2.0 * l + q, 1e-12);
    // Where the ray misses the ellipsoid the fraction may be anything: held to where the splat is.
    return clamp(z, depth_slope.w, depth_square.w);
}

void main() {
    float alpha = min(MAX_ALPHA, opacity * exp(-0.5 * dot(sigmas, sigmas)));
    if (!(alpha >= min_alpha)) discard;
    vec2 at = gl_FragCoord.xy * pixels_per_fragment;
    vec3 value = output_kind == 0 ? vec3(depth_under(at - center), 0.0, 0.0) : normal;
    premultiplied = vec4(value * alpha, alpha);
}
