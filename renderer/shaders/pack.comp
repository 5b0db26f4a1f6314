// pack: staged means, scales, rotations and opacities -> the arena.  One invocation a splat. Sigma
// = R S S^T R^T (paper eq. 1), in the object's frame: once a change of x, not once a frame.
// Reads:   the staging buffer; anchors, where means are offsets (paper eq. 3).
// Writes:  mean_opacity, covariance.
// Units:   metres and square metres in the object; scales are one sigma.
#include "common/rotation.glsl"
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_STAGING) readonly buffer Staging { float staged[]; };
layout(std430, binding = SLOT_ANCHORS) readonly buffer Anchors { vec4 anchors[]; };
layout(std430, binding = SLOT_FRAMES) readonly buffer Frames { vec4 frames[]; };  // two an anchor
layout(std430, binding = SLOT_MEAN_OPACITY) writeonly buffer MeanOpacity { vec4 mean_opacity[]; };
layout(std430, binding = SLOT_COVARIANCE) writeonly buffer Covariance { vec4 covariance[]; };

uniform uint count;         // splats staged
uniform uint start;         // arena row of the first
uniform uint capacity;      // splats that the staging buffer has room for
uniform uint first_anchor;  // anchor of the first
uniform bool is_offset;     // staged means are offsets from anchors
uniform bool has_frames;    // staged splats are in their anchor's own axes and size

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (!(i < count)) return;
    // Regions of the staging buffer: means (3 a splat), scales (3), rotations (4), opacities (1).
    uint at_scale = 3u * capacity + 3u * i;
    uint at_wxyz = 6u * capacity + 4u * i;
    vec3 mean = vec3(staged[3u * i], staged[3u * i + 1u], staged[3u * i + 2u]);
    vec3 scale = vec3(staged[at_scale], staged[at_scale + 1u], staged[at_scale + 2u]);
    vec4 wxyz = vec4(staged[at_wxyz], staged[at_wxyz + 1u], staged[at_wxyz + 2u],
                     staged[at_wxyz + 3u]);
    float opacity = staged[10u * capacity + i];
    mat3 axes = rotation(wxyz);
    if (is_offset) {
        // mu = anchor + offset, the offset already in metres; an anchor's own size and axes first.
        uint anchor = first_anchor + i / floatBitsToUint(anchors[0].w);  // k splats an anchor
        if (has_frames) {
            mat3 object_from_anchor = rotation(frames[2u * anchor + 1u]);
            vec3 size = frames[2u * anchor].xyz;
            mean = object_from_anchor * (size * mean);
            axes = object_from_anchor * axes;
            scale *= size;
        }
        mean += anchors[anchor].xyz;
    }
    // R S; columns are the ellipsoid's half axes.
    mat3 half_axes = axes * mat3(scale.x, 0, 0, 0, scale.y, 0, 0, 0, scale.z);
    mat3 sigma = half_axes * transpose(half_axes);
    mean_opacity[start + i] = vec4(mean, opacity);
    covariance[2u * (start + i)] = vec4(sigma[0][0], sigma[0][1], sigma[0][2], sigma[1][1]);
    covariance[2u * (start + i) + 1u] = vec4(sigma[1][2], sigma[2][2], 0.0, 0.0);
}
