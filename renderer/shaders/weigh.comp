// weigh: opacity of plain splats = their own times how much of their layer there is.
// Needs:   OWN_CONTROL (1: each has a control value of its own, so a weight of its own).
// Reads:   own_opacity, layer, layer_weights.
// Writes:  the opacity in mean_opacity.
// Units:   opacities and weights 0..1.
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_MEAN_OPACITY) buffer MeanOpacity { vec4 mean_opacity[]; };
layout(std430, binding = SLOT_LAYER) readonly buffer Layer { uint layer[]; };
layout(std430, binding = SLOT_LAYER_WEIGHTS)
    readonly buffer LayerWeights { float layer_weights[]; };
layout(std430, binding = SLOT_OWN_OPACITY) readonly buffer OwnOpacity { float own_opacity[]; };
uniform uint count;
uniform uint start;  // arena row of the first

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (!(i < count)) return;
#if OWN_CONTROL
    float there = layer_weights[i];
#else
    float there = layer_weights[layer[i]];
#endif
    mean_opacity[start + i].w = own_opacity[i] * there;
}
