// sort_quantize: depth keys (float bits) -> 0..65534 over the frame's own range; culled -> 65535.
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = SLOT_KEYS) buffer Keys { uint keys[]; };
layout(std430, binding = SLOT_COUNTS) readonly buffer Counts { uint counts[]; };
uniform uint count;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (!(i < count)) return;
    float nearest = uintBitsToFloat(counts[COUNT_NEAREST]);
    float farthest = uintBitsToFloat(counts[COUNT_FARTHEST]);
    float scale = 65534.0 / max(farthest - nearest, 1e-30);
    uint key = keys[i];
    // Clamped before the conversion: drivers differ about uint() of numbers outside its range.
    float steps = clamp((uintBitsToFloat(key) - nearest) * scale, 0.0, 65534.0);
    keys[i] = key == CULLED_KEY ? 65535u : uint(steps);
}
