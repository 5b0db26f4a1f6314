// project: splats of posed objects -> screen ellipses, depth keys, counts.  The only culling gate.
// One invocation a splat.  Eye space has y up and looks along -z; pixels count from lower left.
// Screen covariance: J W Sigma W^T J^T + low_pass (EWA splatting, as 3DGS).
#include "common/finite.glsl"
#include "common/record.glsl"
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_MEAN_OPACITY) readonly buffer MeanOpacity { vec4 mean_opacity[]; };
layout(std430, binding = SLOT_COVARIANCE) readonly buffer Covariance { vec4 covariance[]; };
layout(std430, binding = SLOT_COLOR) readonly buffer Color { vec4 color[]; };
layout(std430, binding = SLOT_OBJECT) readonly buffer Object { uint object[]; };
layout(std430, binding = SLOT_POSES) readonly buffer Poses { vec4 eye_from_object[]; };
layout(std430, binding = SLOT_RECORDS) writeonly buffer Records { uvec4 records[]; };
layout(std430, binding = SLOT_KEYS) writeonly buffer Keys { uint keys[]; };
layout(std430, binding = SLOT_COUNTS) buffer Counts { uint counts[]; };

uniform uint count;
uniform vec4 tangents;       // left, right, down, up of the view; left and down negative
uniform vec2 size;           // pixels
uniform float near;          // metres
uniform float min_alpha;     // a pixel below this is not drawn
uniform float low_pass;      // px^2
uniform float max_pixels;    // one sigma of the longer axis
uniform float max_distance;  // metres from the eye

// One number a reason and group, so that a group adds to the shared counters once.
shared uint group_counts[COUNT_FARTHEST + 1];

// The row of counts for splat i; where it is COUNT_DRAWN the record is written and depth is set.
uint project(uint i, out float depth) {
    depth = 0.0;
    vec4 splat = mean_opacity[i];
    float opacity = splat.w;
    if (!(finite(opacity) && opacity >= min_alpha)) return COUNT_OPACITY;

    uint pose = 3u * object[i];
    vec4 row_x = eye_from_object[pose], row_y = eye_from_object[pose + 1u];
    vec4 row_z = eye_from_object[pose + 2u];
    vec4 mean = vec4(splat.xyz, 1.0);
    vec3 p = vec3(dot(row_x, mean), dot(row_y, mean), dot(row_z, mean));  // metres
    float distance2 = dot(p, p);
    if (!(finite(distance2) && distance2 <= max_distance * max_distance)) return COUNT_DISTANCE;
    float z = -p.z;
    if (!(z > near)) return COUNT_FRUSTUM;

    // Rows of J W: how the pixel moves with the object's metres.  Beyond JACOBIAN_MARGIN times the
    // view the slope of the projection is held, or a splat beside the eye would cover everything.
    vec2 focal = size / (tangents.yw - tangents.xz);  // pixels
    vec2 tangent = p.xy / z;
    vec2 held = clamp(tangent, JACOBIAN_MARGIN * tangents.xz, JACOBIAN_MARGIN * tangents.yw);
    vec3 u = focal.x / z * (row_x.xyz + held.x * row_z.xyz);
    vec3 v = focal.y / z * (row_y.xyz + held.y * row_z.xyz);

    vec4 s0 = covariance[2u * i], s1 = covariance[2u * i + 1u];  // xx xy xz yy | yz zz
    mat3 sigma = mat3(s0.x, s0.y, s0.z, s0.y, s0.w, s1.x, s0.z, s1.x, s1.y);
    vec3 sigma_u = sigma * u, sigma_v = sigma * v;
    float bare_a = dot(u, sigma_u), b = dot(v, sigma_u), bare_c = dot(v, sigma_v);
    float a = bare_a + low_pass, c = bare_c + low_pass;

    // Opacity-aware cut: alpha falls to min_alpha at k sigma.
    float k = sqrt(max(2.0 * log(opacity / min_alpha), 0.0));
    vec2 center = (tangent - tangents.xz) * focal;  // pixels
    vec2 extent = k * sqrt(vec2(a, c));
    bool inside = all(lessThan(center - extent, size)) && all(greaterThan(center + extent, vec2(0)));
    if (!inside) return COUNT_FRUSTUM;

    // Axes of the ellipse.  The smaller one from the determinant: mid - off cancels for long ones.
    float mid = 0.5 * (a + c), off = 0.5 * (a - c);
    float root = sqrt(off * off + b * b);
    float major = mid + root;  // px^2
    float determinant =
        max(bare_a * bare_c - b * b, 0.0) + low_pass * (bare_a + bare_c) + low_pass * low_pass;
    float minor = determinant / major;
    vec3 rgb = color[i].rgb;
    bool shaped = finite(center) && finite(vec3(major, minor, k)) && minor > 0.0;
    bool colored = finite(rgb) && all(lessThanEqual(abs(rgb), vec3(HALF_MAX)));
    if (!(shaped && colored && major <= max_pixels * max_pixels)) return COUNT_SIZE;
    vec2 along = off >= 0.0 ? vec2(off + root, b) : vec2(b, root - off);
    vec2 direction = root > 1e-12 * mid ? along / max(length(along), 1e-30) : vec2(1.0, 0.0);

    Ellipse ellipse;
    ellipse.center = center;
    ellipse.major = direction * min(sqrt(major), HALF_MAX);
    ellipse.minor = vec2(-direction.y, direction.x) * min(sqrt(minor), HALF_MAX);
    ellipse.color = rgb;
    ellipse.opacity = opacity;
    ellipse.cut = k;
    uvec4 rows[2] = pack_record(ellipse);
    records[2u * i] = rows[0];
    records[2u * i + 1u] = rows[1];
    depth = z;
    return COUNT_DRAWN;
}

void main() {
    uint i = gl_GlobalInvocationID.x, local = gl_LocalInvocationIndex;
    if (local <= COUNT_FARTHEST) group_counts[local] = local == COUNT_NEAREST ? CULLED_KEY : 0u;
    barrier();
    if (i < count) {
        float depth;
        uint row = project(i, depth);
        bool drawn = row == COUNT_DRAWN;
        uint key = drawn ? floatBitsToUint(depth) : CULLED_KEY;  // bits of floats > 0 keep order
        keys[i] = key;
        atomicAdd(group_counts[row], 1u);
        if (drawn) {
            atomicMin(group_counts[COUNT_NEAREST], key);
            atomicMax(group_counts[COUNT_FARTHEST], key);
        }
    }
    barrier();
    if (local < COUNT_NEAREST) {
        if (group_counts[local] > 0u) atomicAdd(counts[local], group_counts[local]);
    } else if (local == COUNT_NEAREST) {
        atomicMin(counts[local], group_counts[local]);
    } else if (local == COUNT_FARTHEST) {
        atomicMax(counts[local], group_counts[local]);
    }
}
