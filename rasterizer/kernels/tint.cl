// tint: colours mixed towards palette[luminance], each splat by the weight of its anchor.
__kernel void tint(int count, int start, int per_weight, __global const float* palette,
                   __global const float* weights, __global float4* color) {
  const int i = get_global_id(0);
  if (i >= count) return;
  const float4 rgb = color[start + i];
  const float weight = weights[i / per_weight];
  const float luminance = 0.2126f * rgb.x + 0.7152f * rgb.y + 0.0722f * rgb.z;
  // Project must see what is no number.
  if (!(weight > 0) || !isfinite(rgb.x + rgb.y + rgb.z)) return;
  const float at = clamp(luminance, 0.0f, 1.0f) * 255;
  const int below = (int)at;
  const float3 low = vload3(below, palette), high = vload3(min(below + 1, 255), palette);
  color[start + i] = mix(rgb, (float4)(mix(low, high, at - below), 0), weight);
}
