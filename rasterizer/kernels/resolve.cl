// resolve: a float image over a background, palette applied -> 8 bits a channel, bottom row first.
// A work-item takes a row.  Twin: renderer/palette.apply_palette and Renderer.resolved.
#define STEPS 256  // colours of a palette

inline uchar4 eight_bits(float4 color) {
  return convert_uchar4(convert_int4(clamp(color, 0.0f, 1.0f) * 255.0f + 0.5f));
}

// palette: STEPS colours (alpha 0), then how each differs from the next.
// image: premultiplied, row 0 on top.  weight 0: the colours stay; 1: all of them are the palette's.
__kernel void resolve(int width, int height, float red, float green, float blue, float weight,
                      __global const float4* image, __global const float4* palette,
                      __global uchar4* pixels) {
  const int y = get_global_id(0);
  __global const float4* row = image + (size_t)y * width;
  __global uchar4* out = pixels + (size_t)(height - 1 - y) * width;
  const float4 behind = (float4)(red, green, blue, 1);  // the 1 makes what is shown opaque
  if (!(weight > 0)) {
    for (int x = 0; x < width; x++) out[x] = eight_bits(row[x] + (1 - row[x].w) * behind);
    return;
  }
  const float4 kept = (float4)(1 - weight, 1 - weight, 1 - weight, 1);  // alpha stays
  for (int x = 0; x < width; x++) {
    float4 color = row[x];
    // The palette colours what is there, not the background: colour is divided by alpha first.
    const float luminance = 0.2126f * color.x + 0.7152f * color.y + 0.0722f * color.z;
    const float place = clamp(luminance / fmax(color.w, 1e-6f), 0.0f, 1.0f) * (STEPS - 1);
    const int below = min((int)place, STEPS - 2);
    const float4 false_color = palette[below] + (place - below) * palette[STEPS + below];
    color = color * kept + false_color * (color.w * weight);
    out[x] = eight_bits(color + (1 - color.w) * behind);
  }
}
