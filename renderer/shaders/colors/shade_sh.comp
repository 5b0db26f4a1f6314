// shade_sh: spherical harmonics of degree 0 to 3 -> colour towards the eye.  One invocation a
// splat. colour = max(0, 0.5 + sum of basis(direction) * coefficient), the basis and its signs of
// 3DGS.
// Reads:   sh (coefficients * 3, count), mean_opacity, eye; pages, where PAGED, and which of them.
// Writes:  color.
// Units:   metres in the object; display sRGB, from 0 on.
#include "common/direction.glsl"
#include "common/finite.glsl"
#include "common/pages.glsl"
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_MEAN_OPACITY) readonly buffer MeanOpacity { vec4 mean_opacity[]; };
layout(std430, binding = SLOT_SH) readonly buffer Sh { float sh[]; };  // see coefficient()
layout(std430, binding = SLOT_COLOR) writeonly buffer Color { vec4 color[]; };
uniform uint count;
uniform uint start;         // arena row of the first; where pages begin
uniform uint coefficients;  // 1, 4, 9 or 16
uniform vec3 eye;           // metres in the object

#if PAGED
layout(std430, binding = SLOT_LISTED) readonly buffer Listed { uint listed[]; };  // pages
#endif

vec3 coefficient(uint i, uint k) {
#if PAGED
    // Of stored pages: (pages, coefficients * 3, PAGE).
    uint at = (i / PAGE * 3u * coefficients + 3u * k) * PAGE + i % PAGE;
    return vec3(sh[at], sh[at + PAGE], sh[at + 2u * PAGE]);
#else
    // (coefficients * 3, count), a stream a coefficient and channel: neighbouring invocations read
    // neighbouring floats.
    uint at = 3u * k * count + i;
    return vec3(sh[at], sh[at + count], sh[at + 2u * count]);
#endif
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (!(i < count)) return;
    uint into = start + i, row = into;
#if PAGED
    uint drawn = listed[i / PAGE] * PAGE + i % PAGE;
    into = start + drawn;
    row = page_of(drawn).row;
    i = row - start;  // among the splats that are stored
#endif
    // Degree 0 is the same from everywhere; 3DGS stores colours less a half.
    vec3 rgb = 0.5 + 0.28209479177387814 * coefficient(i, 0u);
    vec3 d = direction_from(eye, mean_opacity[row].xyz);
    float x = d.x, y = d.y, z = d.z, xx = x * x, yy = y * y, zz = z * z;
    // Degree 1, in 3DGS's order: -y, z, -x.
    if (coefficients > 1u) {
        rgb += 0.4886025119029199
            * (z * coefficient(i, 2u) - y * coefficient(i, 1u) - x * coefficient(i, 3u));
    }
    // Degree 2: five real harmonics.
    if (coefficients > 4u) {
        rgb += 1.0925484305920792 * (x * y * coefficient(i, 4u) - y * z * coefficient(i, 5u)
                                     - x * z * coefficient(i, 7u));
        rgb += 0.31539156525252005 * (2.0 * zz - xx - yy) * coefficient(i, 6u);
        rgb += 0.5462742152960396 * (xx - yy) * coefficient(i, 8u);
    }
    // Degree 3: seven more.
    if (coefficients > 9u) {
        rgb -= 0.5900435899266435 * y * (3.0 * xx - yy) * coefficient(i, 9u);
        rgb += 2.890611442640554 * x * y * z * coefficient(i, 10u);
        rgb -= 0.4570457994664658 * y * (4.0 * zz - xx - yy) * coefficient(i, 11u);
        rgb += 0.3731763325901154 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy) * coefficient(i, 12u);
        rgb -= 0.4570457994664658 * x * (4.0 * zz - xx - yy) * coefficient(i, 13u);
        rgb += 1.445305721320277 * z * (xx - yy) * coefficient(i, 14u);
        rgb -= 0.5900435899266435 * x * (xx - 3.0 * yy) * coefficient(i, 15u);
    }
    // max(NaN, 0) is 0, and project must see a colour that is not a number.
    color[into] = vec4(finite(rgb) ? max(rgb, vec3(0.0)) : rgb, 0.0);
}
