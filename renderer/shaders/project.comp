// project: splats of posed objects -> screen ellipses, keys to sort by, counts.  The only culling
// gate.  One invocation a splat, for VIEWS (1 or 2) views at once.
// Eye space has y up and looks along -z; pixels count from lower left.
// Screen covariance: J W Sigma W^T J^T + low_pass (EWA splatting, as 3DGS).
#include "common/finite.glsl"
#include "common/record.glsl"
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_MEAN_OPACITY) readonly buffer MeanOpacity { vec4 mean_opacity[]; };
layout(std430, binding = SLOT_COVARIANCE) readonly buffer Covariance { vec4 covariance[]; };
layout(std430, binding = SLOT_COLOR) readonly buffer Color { vec4 color[]; };
layout(std430, binding = SLOT_OBJECT) readonly buffer Object { uint object[]; };
// Three rows a frame; frames of an object: its views, then (SORT_FRAME 1) that of the order.
layout(std430, binding = SLOT_POSES) readonly buffer Poses { vec4 poses[]; };
layout(std430, binding = SLOT_RECORDS) writeonly buffer Records { uvec4 records[]; };
layout(std430, binding = SLOT_KEYS) writeonly buffer Keys { uint keys[]; };
layout(std430, binding = SLOT_COUNTS) buffer Counts { uint counts[]; };

uniform uint count;
uniform bool by_distance;    // the order: to the eye instead of along the view
uniform bool keep_outside;   // what this frame culls stays in the order, for other frames
uniform vec4 tangents[VIEWS];  // left, right, down, up of the view; left and down negative
uniform vec2 size[VIEWS];      // pixels
uniform float near[VIEWS];     // metres
uniform float min_alpha;     // a pixel below this is not drawn
uniform float low_pass;      // px^2
uniform float max_pixels;    // one sigma of the longer axis
uniform float max_distance;  // metres from the eye
uniform float min_pixels;    // from the centre to where alpha falls to min_alpha, along that axis
// Over these ramps opacity falls to 0 at the ends: one sigma, distance, footprint.
uniform vec3 fade_ends;
uniform vec3 fade_slopes;    // 1 / length of the ramp

const float BEHIND = 1e-6;  // metres: depths below are mapped into 0..BEHIND, in order

// One number a view and reason, so that a group adds to the shared counters once.
shared uint group_counts[COUNT_FARTHEST + 1];

struct Splat {
    vec3 mean;    // metres in the object
    mat3 sigma;   // m^2
    vec3 rgb;
    float opacity;
    float cut;    // sigmas to where alpha falls to min_alpha
};

// Where a splat that is drawn lies; false where a gate stops it, `row` then says which.
uint project(Splat splat, uint pose, uint view, out Ellipse ellipse) {
    // What is in the order but not in this view: a quad without area, beside the image.
    ellipse = Ellipse(vec2(-1e6), vec2(0.0), vec2(0.0), vec3(0.0), 0.0, 0.0);
    if (!(finite(splat.opacity) && splat.opacity >= min_alpha)) return COUNT_OPACITY;

    vec4 row_x = poses[pose], row_y = poses[pose + 1u], row_z = poses[pose + 2u];
    vec4 mean = vec4(splat.mean, 1.0);
    vec3 p = vec3(dot(row_x, mean), dot(row_y, mean), dot(row_z, mean));  // metres
    float distance2 = dot(p, p);
    if (!(finite(distance2) && distance2 <= max_distance * max_distance)) return COUNT_DISTANCE;
    float z = -p.z;
    if (!(z > near[view])) return COUNT_FRUSTUM;

    // Rows of J W: how the pixel moves with the object's metres.  Beyond JACOBIAN_MARGIN times the
    // view the slope of the projection is held, or a splat beside the eye would cover everything.
    vec4 t = tangents[view];
    vec2 focal = size[view] / (t.yw - t.xz);  // pixels
    vec2 tangent = p.xy / z;
    vec2 held = clamp(tangent, JACOBIAN_MARGIN * t.xz, JACOBIAN_MARGIN * t.yw);
    vec3 u = focal.x / z * (row_x.xyz + held.x * row_z.xyz);
    vec3 v = focal.y / z * (row_y.xyz + held.y * row_z.xyz);
    vec3 sigma_u = splat.sigma * u, sigma_v = splat.sigma * v;
    float bare_a = dot(u, sigma_u), b = dot(v, sigma_u), bare_c = dot(v, sigma_v);
    float a = bare_a + low_pass, c = bare_c + low_pass;

    // What is not finite has no place: it counts as too large.
    vec2 center = (tangent - t.xz) * focal;  // pixels
    vec2 extent = splat.cut * sqrt(vec2(a, c));
    bool inside =
        all(lessThan(center - extent, size[view])) && all(greaterThan(center + extent, vec2(0)));
    bool shaped = finite(center) && finite(vec3(a, b, c));
    if (shaped && !inside) return COUNT_FRUSTUM;

    // Axes of the ellipse.  The smaller one from the determinant: mid - off cancels for long ones.
    float mid = 0.5 * (a + c), off = 0.5 * (a - c);
    float root = sqrt(off * off + b * b);
    float major = mid + root;  // px^2
    float determinant =
        max(bare_a * bare_c - b * b, 0.0) + low_pass * (bare_a + bare_c) + low_pass * low_pass;
    float minor = determinant / major;
    shaped = shaped && finite(vec3(major, minor, splat.cut)) && minor > 0.0;
    bool colored = finite(splat.rgb) && all(lessThanEqual(abs(splat.rgb), vec3(HALF_MAX)));
    if (!(shaped && colored && major <= max_pixels * max_pixels)) return COUNT_SIZE;
    float sigma = sqrt(major), reach = splat.cut * sigma;  // pixels
    if (!(reach >= min_pixels)) return COUNT_FOOTPRINT;

    vec3 ramps = (fade_ends - vec3(sigma, sqrt(distance2), reach)) * vec3(fade_slopes.xy, -fade_slopes.z);
    ramps = clamp(ramps, 0.0, 1.0);
    float faded = ramps.x * ramps.y * ramps.z;
    ellipse.opacity = splat.opacity * faded;
    if (!(ellipse.opacity >= min_alpha)) return COUNT_FADED;
    ellipse.cut = splat.cut;
    if (faded < 1.0) ellipse.cut = sqrt(max(2.0 * log(ellipse.opacity / min_alpha), 0.0));

    vec2 along = off >= 0.0 ? vec2(off + root, b) : vec2(b, root - off);
    vec2 direction = root > 1e-12 * mid ? along / max(length(along), 1e-30) : vec2(1.0, 0.0);
    ellipse.center = center;
    ellipse.major = direction * min(sigma, HALF_MAX);
    ellipse.minor = vec2(-direction.y, direction.x) * min(sqrt(minor), HALF_MAX);
    ellipse.color = splat.rgb;
    return COUNT_DRAWN;
}

// Depth or distance of a splat as a float above 0, whose bits keep the order.
float sort_value(vec3 mean, uint pose) {
    vec4 place = vec4(mean, 1.0);
    vec3 p = vec3(dot(poses[pose], place), dot(poses[pose + 1u], place), dot(poses[pose + 2u], place));
    float value = by_distance ? length(p) : -p.z;
    return value > BEHIND ? value : BEHIND / (1.0 + BEHIND - value);
}

void main() {
    uint i = gl_GlobalInvocationID.x, local = gl_LocalInvocationIndex;
    if (local <= COUNT_FARTHEST) group_counts[local] = local == COUNT_NEAREST ? CULLED_KEY : 0u;
    barrier();
    if (i < count) {
        vec4 s0 = covariance[2u * i], s1 = covariance[2u * i + 1u];  // xx xy xz yy | yz zz
        Splat splat;
        splat.mean = mean_opacity[i].xyz;
        splat.opacity = mean_opacity[i].w;
        splat.sigma = mat3(s0.x, s0.y, s0.z, s0.y, s0.w, s1.x, s0.z, s1.x, s1.y);
        splat.rgb = color[i].rgb;
        splat.cut = sqrt(max(2.0 * log(splat.opacity / min_alpha), 0.0));
        uint pose = 3u * (VIEWS + SORT_FRAME) * object[i];
        Ellipse ellipses[VIEWS];
        bool drawn = false;
        bool absent = false;  // by opacity: in no view, whatever its place
        for (uint view = 0u; view < VIEWS; view++) {
            uint row = project(splat, pose + 3u * view, view, ellipses[view]);
            drawn = drawn || row == COUNT_DRAWN;
            absent = row == COUNT_OPACITY;
            atomicAdd(group_counts[view * COUNTS_STRIDE + row], 1u);
        }
        float value = sort_value(splat.mean, pose + 3u * VIEWS * SORT_FRAME);
        bool sorted = (keep_outside ? !absent : drawn) && finite(value);
        uint key = sorted ? floatBitsToUint(value) : CULLED_KEY;
        keys[i] = key;
        if (sorted) {
            atomicAdd(group_counts[COUNT_SORTED], 1u);
            atomicMin(group_counts[COUNT_NEAREST], key);
            atomicMax(group_counts[COUNT_FARTHEST], key);
        }
        if (sorted || keep_outside) {
            for (uint view = 0u; view < VIEWS; view++) {
                uvec4 rows[2] = pack_record(ellipses[view]);
                uint at = 2u * (view * count + i);
                records[at] = rows[0];
                records[at + 1u] = rows[1];
            }
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
