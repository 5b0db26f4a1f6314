// pack: what the networks staged -> means, opacities and covariances of the arena.  One fragment a
// splat.  Sigma = R S S^T R^T (paper eq. 1), in the object's frame, once a change of x.

const ROTATION = `
mat3 rotation(vec4 q) {  // w x y z, of any length
    float square = dot(q, q);
    q = square > 0.0 ? q * inversesqrt(square) : vec4(1.0, 0.0, 0.0, 0.0);
    float w = q.x, x = q.y, y = q.z, z = q.w;
    return mat3(
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
        2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
        2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
}`;

// In programs with a fragment a splat: which splat j of which anchor a.
export const SPLAT_OF_FRAGMENT = `
    int i = (int(gl_FragCoord.y) - first_row) * WIDTH + int(gl_FragCoord.x);
    int a = i / per_anchor, j = i - a * per_anchor;`;

export const PACK = `
uniform sampler2DArray staged;   // offsets, scales, quaternions, opacities of an anchor's splats, side by side
uniform sampler2D anchors;       // plain splats: their means
uniform sampler2D frames;        // scales and quaternion: an anchor's own, or a plain splat's
uniform sampler2D opacities;     // of plain splats
uniform int per_anchor, count, first_anchor, first_row;
uniform int source;              // 0: networks; 1: networks, in each anchor's own axes and size; 2: plain splats
uniform float swell;             // a coarse sample of a scene has larger splats
layout(location = 0) out vec4 mean_opacity;
layout(location = 1) out vec4 covariance0;   // xx xy xz yy, m^2
layout(location = 2) out vec4 covariance1;   // yz zz
${ROTATION}
ivec3 here;  // of the anchor

float number(int first, int n) { return texelFetch(staged, here + ivec3(0, 0, first + (n >> 2)), 0)[n & 3]; }
vec3 triple(int first, int j) { return vec3(number(first, 3 * j), number(first, 3 * j + 1), number(first, 3 * j + 2)); }

void main() {${SPLAT_OF_FRAGMENT}
    mean_opacity = vec4(0.0, 0.0, 0.0, -1.0);
    covariance0 = covariance1 = vec4(0.0);
    if (a >= count) return;
    vec3 mean = texelFetch(anchors, at(a), 0).xyz, scale;
    float opacity;
    mat3 axes;
    if (source == 2) {
        scale = texelFetch(frames, at(2 * a), 0).xyz;
        axes = rotation(texelFetch(frames, at(2 * a + 1), 0));
        opacity = texelFetch(opacities, at(a), 0).x;
    } else {
        here = ivec3(at(a - first_anchor), 0);
        int triples = (3 * per_anchor + 3) / 4;  // vectors
        vec3 offset = triple(0, j);
        scale = triple(triples, j);
        axes = rotation(texelFetch(staged, here + ivec3(0, 0, 2 * triples + j), 0));
        opacity = number(2 * triples + per_anchor, j);
        if (source == 1) {
            mat3 object_from_anchor = rotation(texelFetch(frames, at(2 * a + 1), 0));
            vec3 size = texelFetch(frames, at(2 * a), 0).xyz;
            offset = object_from_anchor * (size * offset);
            axes = object_from_anchor * axes;
            scale *= size;
        }
        mean += offset;
    }
    scale *= swell;
    mat3 half_axes = mat3(axes[0] * scale.x, axes[1] * scale.y, axes[2] * scale.z);  // R S
    mat3 sigma = half_axes * transpose(half_axes);
    // What is no number is absent: blended once, it would stay for good.
    bool sound = finite(mean.x + mean.y + mean.z) && finite(sigma[0][0] + sigma[1][1] + sigma[2][2]) && finite(opacity);
    if (!sound) return;
    mean_opacity = vec4(mean, opacity);
    covariance0 = vec4(sigma[0][0], sigma[0][1], sigma[0][2], sigma[1][1]);
    covariance1 = vec4(sigma[1][2], sigma[2][2], 0.0, 0.0);
}`;
