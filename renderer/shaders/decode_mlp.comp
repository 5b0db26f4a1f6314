// decode_mlp: one network F for every anchor (paper eq. 5): feature, direction, light, Psi(x) -> k
// splats.
// One invocation an anchor; a whole layer in registers.  Loops run over uniform counts: unrolled,
// the compiler of a software driver takes a minute. Psi is the same for all anchors and folded into
// the first bias, unless each has its own control.
// Needs:   LAYER_VECS (vec4 of the widest layer), BLOCK_VECS (vec4 of a uniform block),
//          STORED_WEIGHTS (1: too many for a uniform block), OWN_CONTROL (1: Psi of a control an
//          anchor is an input as the others are).
// Reads:   anchors, features, weights; light of anchors that have it; with OWN_CONTROL control.
// Writes:  outputs, a head's numbers of every splat, after its activation.
// Units:   metres in the object; features and Psi have none.
#include "common/activation.glsl"
#include "common/direction.glsl"
#include "common/light.glsl"
layout(local_size_x = DECODE_WORKGROUP) in;

layout(std430, binding = SLOT_ANCHORS) readonly buffer Anchors { vec4 anchors[]; };
layout(std430, binding = SLOT_FEATURES) readonly buffer Features { vec4 features[]; };
layout(std430, binding = SLOT_LIGHT) readonly buffer Light { vec4 light[]; };
layout(std430, binding = SLOT_OUTPUT) writeonly buffer Output { float outputs[]; };
// One row a layer (inputs, outputs, in vec4), then per layer biases and weights: networks.py packs.
#if STORED_WEIGHTS
layout(std430, binding = SLOT_WEIGHTS) readonly buffer Weights { vec4 weights[]; };
#else
layout(std140, binding = WEIGHTS_BLOCK) uniform Weights { vec4 weights[BLOCK_VECS]; };
#endif

#if OWN_CONTROL
layout(std430, binding = SLOT_CONTROL) readonly buffer Control { vec4 control[]; };
uniform uint control_vecs;       // vec4 of Psi, an anchor
#endif

uniform uint first;              // anchor of this run's first invocation
uniform uint count;              // anchors in this run
uniform uint feature_vecs;       // vec4 an anchor
uniform uint layers;
uniform vec3 eye;                // metres in the object; only the colour network looks at it
uniform uint light_channels;     // of the anchors' light by direction: 0, 1 or 3
uniform uint splats_per_anchor;
uniform uint size;               // numbers a splat
uniform uint base, stride;       // splat j of the run goes to outputs[base + stride * j ...]
uniform uint activation;
uniform float low, high;         // clip before the activation
uniform float gain;              // after it

vec4 values[2 * LAYER_VECS];     // a layer's inputs in one half, its outputs in the other

void write(uint anchor, uint output_index, float z) {
    if (!(output_index < splats_per_anchor * size)) return;  // padding
    // clamp() makes a number of NaN, and a splat nobody meant would be drawn.
    float value = isnan(z) ? z : gain * activate(activation, clamp(z, low, high));
    uint splat = anchor * splats_per_anchor + output_index / size;
    outputs[base + stride * splat + output_index % size] = value;
}

void main() {
    uint anchor = gl_GlobalInvocationID.x;
    if (!(anchor < count)) return;
    for (uint v = 0u; v < feature_vecs; v++)
        values[v] = features[(first + anchor) * feature_vecs + v];
    vec4 seen = vec4(direction_from(eye, anchors[first + anchor].xyz), 0.0);
    uint seen_end = feature_vecs + 1u;
    if (light_channels > 0u) {
        uint at = 2u * light_channels * (first + anchor);
        seen.w = light_along(light[at], light[at + 1u], seen.xyz);
        // Red stands beside the direction, green and blue in a vector of their own.
        if (light_channels > 1u)
            values[seen_end++] = vec4(light_along(light[at + 2u], light[at + 3u], seen.xyz),
                                      light_along(light[at + 4u], light[at + 5u], seen.xyz),
                                      0.0, 0.0);
    }
    values[feature_vecs] = seen;
#if OWN_CONTROL
    for (uint v = 0u; v < control_vecs; v++)
        values[seen_end + v] = control[(first + anchor) * control_vecs + v];
#endif

    // Two halves of one array: what a layer takes and what it gives change places.
    uint from = 0u, to = LAYER_VECS, bias = layers;
    for (uint layer = 0u; layer < layers; layer++) {
        uint ins = uint(weights[layer].x), outs = uint(weights[layer].y);
        uint w = bias + outs;
        // Four outputs at once: a vec4 of the bias, then a mat4 of weights for four inputs at a
        // time.
        for (uint o = 0u; o < outs; o++) {
            vec4 sum = weights[bias + o];
            for (uint v = 0u; v < ins; v++, w += 4u)
                sum += mat4(weights[w], weights[w + 1u], weights[w + 2u], weights[w + 3u])
                    * values[from + v];
            if (layer + 1u < layers) {
                // ReLU between layers; the last layer is written through its activation.
                values[to + o] = max(sum, vec4(0.0));
            } else {
                for (uint c = 0u; c < 4u; c++) write(anchor, 4u * o + c, sum[c]);
            }
        }
        bias = w;
        from = to;
        to = LAYER_VECS - to;
    }
}
