// project: splats of one posed object -> screen ellipses, keys to sort by, counts.  The only
// culling gate.  One invocation a splat, for VIEWS (1 or 2) views at once.
//  Sigma' = J W Sigma W^T J^T + low_pass I   (EWA splatting, Zwicker et al. 2001; 3DGS, eq. 5)
// No early returns: on llvmpipe each would mask all that follows (see docs/bench/ideas.md).
// Reads:   mean_opacity, covariance, color of the object's splats; its pose, the views, the limits;
//          pages, and with them splats of all objects that have any.
// Writes:  records (two a splat where there are two views), keys, counts of what was culled and
//          why.
// Units:   metres in the object and the eye, which has y up and looks along -z; pixels from lower
//          left; display sRGB.
#ifndef VIEWS             // the variants, as Projector asks for them
#define VIEWS 1           // views at once
#define SORT_FRAME 0      // 1: the order is made along another frame than the first view's
#define BY_DISTANCE 0     // 1: and by the distance in it
#define FADE 0            // 1: some limit has a ramp
#define ANTIALIASED 0     // 1: what the low pass makes wider becomes fainter
#define KEY_RANGE 0       // 1: the least and largest key are wanted
#define OWN_COLORS 0      // 1: the second view has colours of its own
#endif
#include "common/finite.glsl"
#include "common/record.glsl"
#include "common/pages.glsl"
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_MEAN_OPACITY) readonly buffer MeanOpacity { vec4 mean_opacity[]; };
layout(std430, binding = SLOT_COVARIANCE) readonly buffer Covariance { vec4 covariance[]; };
layout(std430, binding = SLOT_COLOR) readonly buffer Color { vec4 color[]; };
#if OWN_COLORS
layout(std430, binding = SLOT_SECOND_COLOR) readonly buffer SecondColor { vec4 second_color[]; };
#endif
layout(std430, binding = SLOT_RECORDS) writeonly buffer Records { uvec4 records[]; };
layout(std430, binding = SLOT_KEYS) writeonly buffer Keys { uint keys[]; };
layout(std430, binding = SLOT_COUNTS) buffer Counts { uint counts[]; };

uniform uint first;            // splats of this object, or in pages: rows first to last - 1
uniform uint last;
// Rows of eye_from_object of each view, then of the order's frame.
#if PAGED
vec4 frames[3 * (VIEWS + SORT_FRAME)];
bool is_antialiased;
#else
uniform vec4 frames[3 * (VIEWS + SORT_FRAME)];
#endif
uniform vec4 tangents[VIEWS];  // left, right, down, up of the view; left and down negative
uniform vec2 clamps[VIEWS];    // largest tangents that the Jacobian sees, either side of the axis
uniform vec2 size[VIEWS];      // pixels
uniform float near[VIEWS];     // metres
uniform bool keep_outside;     // what this frame culls stays in the order, for other frames
uniform float min_alpha;       // a pixel below this is not drawn
uniform float low_pass;        // px^2
uniform float max_pixels;      // one sigma of the longer axis
uniform float max_distance;    // metres from the eye
uniform float min_pixels;      // from the centre to where alpha is min_alpha, along the longer axis
#if VIEWS == 2
uniform uint count;            // splats of all objects: records of the second view start there
#endif
#if FADE
uniform vec3 fade_ends;        // max_pixels, max_distance, min_pixels: there opacity is 0
uniform vec3 fade_slopes;      // 1 / length of the ramp that ends there
#endif

const float BEHIND = 1e-6;  // metres: depths below are mapped into 0..BEHIND, in order

// One number a view and reason, so that a group adds to the shared counters once.  Atomics are the
// dear part: only what is culled is counted; COUNT_SORTED begins with all splats.
shared uint group_counts[COUNT_FARTHEST + 1];

struct Splat {
    vec3 mean;    // metres in the object
    float opacity;
    mat3 sigma;   // m^2
    vec3 rgb;
    float cutoff_sigmas;  // to where alpha falls to min_alpha
};

struct Projected {
    uint row;         // of counts: COUNT_DRAWN or why not
    uvec4 record[2];
};

// A point of the object in a frame: three rows of a rigid transform.
vec3 point_in_frame(uint frame, vec3 mean) {
    vec4 p = vec4(mean, 1.0);
    uint at = 3u * frame;
    return vec3(dot(frames[at], p), dot(frames[at + 1u], p), dot(frames[at + 2u], p));
}

Projected project(Splat splat, const uint view) {
    vec4 t = tangents[view];
    // The size of the picture over that of its tangents; off-centre views need no more.
    vec2 focal = size[view] / (t.yw - t.xz);  // pixels
    vec3 row_x = frames[3u * view].xyz, row_y = frames[3u * view + 1u].xyz;
    vec3 row_z = frames[3u * view + 2u].xyz;
    vec3 p = point_in_frame(view, splat.mean);  // metres
    float distance2 = dot(p, p), z = -p.z, inv_z = 1.0 / z;

    // Step 1, J: far beside the view the slope of the projection is held (3DGS), or a splat beside
    // the eye would cover everything.
    vec2 tangent = p.xy * inv_z;
    vec2 held = clamp(tangent, -clamps[view], clamps[view]);
    // Step 2, u and v, the rows of J W: how the pixel moves with the object's metres.
    vec3 u = focal.x * inv_z * (row_x + held.x * row_z);
    vec3 v = focal.y * inv_z * (row_y + held.y * row_z);
    // Step 3, Sigma' = [u.Sigma u, u.Sigma v; ., v.Sigma v] + low pass = [a b; b c], px^2.
    vec3 sigma_u = splat.sigma * u, sigma_v = splat.sigma * v;
    float bare_a = dot(u, sigma_u), b = dot(v, sigma_u), bare_c = dot(v, sigma_v);
    float a = bare_a + low_pass, c = bare_c + low_pass;
    float opacity = splat.opacity, cutoff_sigmas = splat.cutoff_sigmas;
    // Step 4, the determinant: float rounding may take that without the low pass below 0.
    float bare = max(bare_a * bare_c - b * b, 0.0);
    float determinant = bare + low_pass * (bare_a + bare_c) + low_pass * low_pass;  // px^4
#if ANTIALIASED
    float kept = sqrt(bare / determinant);  // Mip-Splatting's 2D filter: the same light in all
#if PAGED
    kept = is_antialiased ? kept : 1.0;
#endif
    opacity *= kept < 1.0 ? kept : 1.0;     // not a number where the splat is too large to draw
    cutoff_sigmas = sqrt(max(2.0 * log(opacity / min_alpha), 0.0));
#endif
    // Step 5: the 2D mean, and the box of alpha >= min alpha: cutoff times one sigma along x and y.
    vec2 center = (tangent - t.xz) * focal;  // pixels
    vec2 extent = cutoff_sigmas * sqrt(vec2(a, c));
    // One by one: with any(greaterThanEqual()) llvmpipe needs 9 % more for the whole pass.
    vec2 low = center - extent, high = center + extent;
    bool outside = low.x >= size[view].x || low.y >= size[view].y || high.x <= 0.0 || high.y <= 0.0;

    // Step 6, the eigenvalues of Sigma': the squared half axes of the ellipse.  The smaller one
    // from the determinant: mid - off cancels for long ones.
    float mid = 0.5 * (a + c), off = 0.5 * (a - c);
    float root = sqrt(off * off + b * b);
    float major = mid + root;  // px^2
    float minor = determinant / major;
    // The paper's quad (section 4.1) ends where alpha does; its tau_lambda is max_pixels.
    float sigma = sqrt(major), reach = cutoff_sigmas * sigma;  // pixels
    // One test for all of them: whatever is not finite makes the sum so.
    bool shaped = finite(center.x + center.y + major + minor + cutoff_sigmas) && minor > 0.0;
    float brightest = max(max(abs(splat.rgb.r), abs(splat.rgb.g)), abs(splat.rgb.b));
    bool colored = finite(splat.rgb.r + splat.rgb.g + splat.rgb.b) && brightest <= HALF_MAX;
#if FADE
    // 1 away from a limit, 0 at it: splats fade out before they are culled instead of popping.
    vec3 ramps = (fade_ends - vec3(sigma, sqrt(distance2), reach)) * fade_slopes;
    ramps = clamp(vec3(ramps.xy, -ramps.z), 0.0, 1.0);
    opacity *= ramps.x * ramps.y * ramps.z;
    cutoff_sigmas = sqrt(max(2.0 * log(opacity / min_alpha), 0.0));
#endif

    // The gates, last one first: the first that a splat fails counts it.
    uint row = COUNT_DRAWN;
    row = opacity >= min_alpha ? row : COUNT_FADED;
    row = reach >= min_pixels ? row : COUNT_FOOTPRINT;
    row = shaped && colored && major <= max_pixels * max_pixels ? row : COUNT_SIZE;
    row = z > near[view] && !(shaped && outside) ? row : COUNT_FRUSTUM;
    row = finite(distance2) && distance2 <= max_distance * max_distance ? row : COUNT_DISTANCE;
    row = finite(splat.opacity) && splat.opacity >= min_alpha ? row : COUNT_OPACITY;

    // Step 7, the eigenvector of the larger eigenvalue, from the row of Sigma' that cancels less.
    // Two roots because their product could leave the floats: |along|^2 = 2 root (root + |off|).
    vec2 along = off >= 0.0 ? vec2(off + root, b) : vec2(b, root - off);
    vec2 direction = along * (inversesqrt(root) * inversesqrt(2.0 * (root + abs(off))));
    // A disc has no direction: any will do.
    if (!(root > 1e-12 * mid)) direction = vec2(1.0, 0.0);
    Ellipse e;
    e.center = center;
    // Half floats hold up to 65504; larger axes are those of splats that no limit culls.
    e.major = direction * min(sigma, HALF_MAX);
    e.minor = vec2(-direction.y, direction.x) * min(sqrt(minor), HALF_MAX);
    e.color = splat.rgb;
    e.opacity = opacity;
    e.cutoff_sigmas = cutoff_sigmas;
    // In the order for another view or frame: a quad without area, beside the image.
    if (row != COUNT_DRAWN) e = Ellipse(vec2(-1e6), vec2(0.0), vec2(0.0), vec3(0.0), 0.0, 0.0);
    return Projected(row, pack_record(e));
}

// Depth or (BY_DISTANCE) distance as a float above 0, whose bits keep the order.
float sort_value(vec3 mean) {
    vec3 p = point_in_frame(VIEWS * SORT_FRAME, mean);
    float value = BY_DISTANCE == 1 ? length(p) : -p.z;
    // A rational map, so that what lies behind the eye keeps its order in a sliver above 0.
    return value > BEHIND ? value : BEHIND / (1.0 + BEHIND - value);
}

#if PAGED
// The opacity of a part of a splat: why it is this one, project_arena.cl says.
float weighed(float opacity, float part) {
    return opacity > 0.0 ? mix(opacity * part, opacity * pow(part, 0.69), opacity) : opacity;
}
#endif

// Once for all views.
Splat load_splat(uint i) {
    uint row = i;
#if PAGED
    Page page = page_of(i - first);
    row = page.row;
    for (uint k = 0u; k < 3u * uint(VIEWS + SORT_FRAME); k++) frames[k] = pose_row(page.pose + k);
    is_antialiased = page.antialiased;
#endif
    vec4 s0 = covariance[2u * row], s1 = covariance[2u * row + 1u];  // xx xy xz yy | yz zz
    vec4 mean = mean_opacity[row];
#if PAGED
    if (!page.there) mean.w = 0.0;
    if (page.part != 1.0) mean.w = weighed(mean.w, page.part);
#endif
    mat3 sigma = mat3(s0.x, s0.y, s0.z, s0.y, s0.w, s1.x, s0.z, s1.x, s1.y);
    // alpha = o exp(-r / 2) = min_alpha at r = 2 ln(o / min_alpha), the power threshold.
    float cutoff_sigmas = sqrt(max(2.0 * log(mean.w / min_alpha), 0.0));
    return Splat(mean.xyz, mean.w, sigma, color[i].rgb, cutoff_sigmas);
}

void write_record(uint i, Projected projected) {
    records[2u * i] = projected.record[0];
    records[2u * i + 1u] = projected.record[1];
}

void main() {
    uint i = first + gl_GlobalInvocationID.x, local = gl_LocalInvocationIndex;
    if (local <= COUNT_FARTHEST) group_counts[local] = local == COUNT_NEAREST ? CULLED_KEY : 0u;
    // Counters are cleared before anybody adds to them.
    barrier();
    if (i < last) {
        Splat splat = load_splat(i);
        Projected here = project(splat, 0u);
        bool drawn = here.row == COUNT_DRAWN;
        if (!drawn) atomicAdd(group_counts[here.row], 1u);
#if VIEWS == 2
#if OWN_COLORS
        splat.rgb = second_color[i].rgb;
#endif
        Projected there = project(splat, 1u);
        if (there.row != COUNT_DRAWN) atomicAdd(group_counts[COUNTS_STRIDE + there.row], 1u);
        drawn = drawn || there.row == COUNT_DRAWN;
#endif
        float value = sort_value(splat.mean);
        // An order that is kept holds every splat that is there, also those outside the view.
        bool sorted = (keep_outside ? here.row != COUNT_OPACITY : drawn) && finite(value);
        uint key = sorted ? floatBitsToUint(value) : CULLED_KEY;
        keys[i] = key;
        if (!sorted) atomicAdd(group_counts[COUNT_SORTED], 1u);  // here: those that are not
#if KEY_RANGE
        if (sorted) {
            atomicMin(group_counts[COUNT_NEAREST], key);
            atomicMax(group_counts[COUNT_FARTHEST], key);
        }
#endif
        // Nobody looks at the record of a splat that is neither drawn nor in an order.
        if (sorted || keep_outside) {
            write_record(i, here);
#if VIEWS == 2
            write_record(count + i, there);
#endif
        }
    }
    barrier();
    if (local <= COUNT_SORTED) {
        // One addition a group and counter; those of splats that are not sorted are taken off.
        uint culled = group_counts[local];
        if (culled > 0u) atomicAdd(counts[local], local == COUNT_SORTED ? 0u - culled : culled);
    } else if (KEY_RANGE == 1 && local == COUNT_NEAREST) {
        atomicMin(counts[local], group_counts[local]);
    } else if (KEY_RANGE == 1 && local == COUNT_FARTHEST) {
        atomicMax(counts[local], group_counts[local]);
    }
}
