// surface: splats of one posed object -> how deep they lie around their means, and normals. One
// invocation a splat.  A ray through a pixel is halfway through the ellipsoid at the depth
//  Z (1 + l) / (1 + 2 l + q),  l = a . d,  q = quadratic form of d, d pixels from the mean;
// with M the inverse of the covariance up to a factor, b = M p, beta = p . b:
//  a = Z b.xy / (f beta),  q = Z^2 M / (f f beta).  The normal is b, towards the eye.
// Same formula as in rasterizer/kernels/surface_arena.cl.
// Reads:   mean_opacity, covariance; the object's pose, the lens; pages, where rows are of these.
// Writes:  surfaces, three vec4 a splat.
// Units:   metres; x right, y up, z forward; slopes in 1/pixel; pixels count from lower left.
#include "common/pages.glsl"
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_MEAN_OPACITY) readonly buffer MeanOpacity { vec4 mean_opacity[]; };
layout(std430, binding = SLOT_COVARIANCE) readonly buffer Covariance { vec4 covariance[]; };
layout(std430, binding = SLOT_SURFACES) writeonly buffer Surfaces { vec4 surfaces[]; };

uniform uint first;    // splats of this object, or in pages: rows first to last - 1
uniform uint last;
#if PAGED
vec4 rows[3];          // eye_from_object
#else
uniform vec4 rows[3];
#endif
uniform vec2 focal;    // pixels
uniform float near;    // metres

const float REACH = 6.0;  // sigmas along the view within which depth is held

void main() {
    uint i = first + gl_GlobalInvocationID.x;
    if (!(i < last)) return;
    uint at = i;
#if PAGED
    Page page = page_of(i - first);
    at = page.row;
    for (uint k = 0u; k < 3u; k++) rows[k] = pose_row(page.pose + k);
#endif
    vec4 s0 = covariance[2u * at], s1 = covariance[2u * at + 1u];  // xx xy xz yy | yz zz
    vec4 mean = vec4(mean_opacity[at].xyz, 1.0);
    mat3 sigma = mat3(s0.x, s0.y, s0.z, s0.y, s0.w, s1.x, s0.z, s1.x, s1.y);
    mat3 w = transpose(mat3(rows[0].xyz, rows[1].xyz, -rows[2].xyz));  // columns by columns
    vec3 p = vec3(dot(rows[0], mean), dot(rows[1], mean), -dot(rows[2], mean));
    mat3 w_sigma_wt = w * sigma * transpose(w);
    float reach = REACH * sqrt(max(w_sigma_wt[2][2], 0.0));
    // Cofactors instead of the inverse: their largest is exact of a flat splat, too.
    mat3 c = w_sigma_wt / (w_sigma_wt[0][0] + w_sigma_wt[1][1] + w_sigma_wt[2][2]);
    float xx = c[1][1] * c[2][2] - c[1][2] * c[1][2], xy = c[0][2] * c[1][2] - c[0][1] * c[2][2];
    float xz = c[0][1] * c[1][2] - c[0][2] * c[1][1], yy = c[0][0] * c[2][2] - c[0][2] * c[0][2];
    float yz = c[0][1] * c[0][2] - c[0][0] * c[1][2], zz = c[0][0] * c[1][1] - c[0][1] * c[0][1];
    mat3 m = mat3(xx, xy, xz, xy, yy, yz, xz, yz, zz) / max(xx + yy + zz, 1e-37);
    vec3 b = m * p;
    // Never 0: a plane through the eye shows nothing, and nothing of it may be NaN.
    float beta = max(dot(p, b), 1e-12 * dot(p, p)), per = p.z / beta;
    vec2 slope = b.xy * per / focal;
    vec3 square = vec3(m[0][0], m[0][1], m[1][1]) * per * p.z /
                  vec3(focal.x * focal.x, focal.x * focal.y, focal.y * focal.y);
    float size = length(b);
    vec3 normal = size > 0.0 ? vec3(-b.xy, b.z) / size : vec3(0.0);  // eye axes
    surfaces[3u * i] = vec4(p.z, slope, max(p.z - reach, near));
    surfaces[3u * i + 1u] = vec4(square, p.z + reach);
    surfaces[3u * i + 2u] = vec4(normal, 0.0);
}
