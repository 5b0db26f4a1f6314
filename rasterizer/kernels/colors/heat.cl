// heat: what value stops have in the colours of splats, kept apart from the colours of the others
// until a palette is laid over the picture, or made colours of at once.
// Reads:   color (N, 4), of a value stop as decoded: its values are their luminance; a palette of
//          256 colours, or NULL; weights, one for each `per_weight` splats side by side.
// Writes:  heat (N, 4): sum of weight * (value, 0, 0, 1), with a palette of weight * (palette's,
//          1); blend_heat also color.
// Units:   display sRGB; values and weights 0..1.
__kernel void add_heat(int count, int start, int per_weight, int first,
                       __global const float* palette, __global const float* weights,
                       __global const float4* color, __global float4* heat) {
  const int i = get_global_id(0);
  if (i >= count) return;
  const float4 rgb = color[start + i];
  const float weight = weights[i / per_weight];
  float4 sum = first ? (float4)(0) : heat[start + i];
  if (weight > 0) {
    // Rec. 709, on display values: what a thermal camera's grey picture holds in three channels.
    const float luminance = 0.2126f * rgb.x + 0.7152f * rgb.y + 0.0722f * rgb.z;
    float4 value = (float4)(luminance, 0, 0, 1);
    if (palette) {
      // Linear between two of the 256 entries.
      const float at = clamp(luminance, 0.0f, 1.0f) * 255;
      const int below = min((int)at, 254);
      value.xyz = mix(vload3(below, palette), vload3(below + 1, palette), at - below);
    }
    // Project must see what is no number.
    if (!isfinite(rgb.x + rgb.y + rgb.z)) value.x = NAN;
    sum += weight * value;
  }
  heat[start + i] = sum;
}

// Colours, just decoded, of the stops that are not thermal: what is left for them; with
// `into_color` the heat's colours are added, and there is no heat any more.
__kernel void blend_heat(int count, int start, int into_color, __global float4* heat,
                         __global float4* color) {
  const int i = get_global_id(0);
  if (i >= count) return;
  const float4 h = heat[start + i];
  const float kept = 1 - h.w;
  float4 rgb = kept > 0 ? kept * color[start + i] : (float4)(0);
  if (into_color) {
    rgb.xyz += h.xyz;
    heat[start + i] = 0;
  }
  // What is no number goes on to project, which culls it.
  if (!isfinite(h.x)) rgb = NAN;
  color[start + i] = rgb;
}
