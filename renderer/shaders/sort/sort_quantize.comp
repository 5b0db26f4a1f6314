// sort_quantize: depth keys (float bits) -> 0..65534 over the frame's own range; culled -> 65535.
// Two passes of 8 bits then sort them; the range is that of the frame, so that a step is small.
// Reads:   keys; the nearest and farthest in counts.
// Writes:  keys.
// Units:   keys are bits of metres before, steps after.
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_KEYS) buffer Keys { uint keys[]; };
layout(std430, binding = SLOT_COUNTS) readonly buffer Counts { uint counts[]; };
uniform uint count;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (!(i < count)) return;
    float nearest = uintBitsToFloat(counts[COUNT_NEAREST]);
    float farthest = uintBitsToFloat(counts[COUNT_FARTHEST]);
    // 1e-30: where all depths are equal, all steps are 0.
    float scale = 65534.0 / max(farthest - nearest, 1e-30);
    uint key = keys[i];
    // Clamped before the conversion: drivers differ about uint() of numbers outside its range.
    float steps = clamp((uintBitsToFloat(key) - nearest) * scale, 0.0, 65534.0);
    keys[i] = key == CULLED_KEY ? 65535u : uint(steps);
}
