// resolve: a float image over a background, palette applied -> 8 bits a channel.
// A work-item takes a row.  Twin: renderer/colors/palette.py and Renderer.resolved.
// Reads:   image (H, W, 4), premultiplied, row 0 on top; a palette; heat (H, W, 2) or none; a sky's
//          rows or none.
// Writes:  pixels (H, W, 4) bytes: red first and row 0 at the bottom, as GL wants it, or blue first
//          and row 0 on top, as the memory of a window has it.
// Units:   display sRGB; a palette's places are luminance 0..1.
#define STEPS 256  // colours of a palette

// + 0.5: to the nearest step, as GL does when it writes to an 8-bit target.
inline uchar4 eight_bits(float4 color, int as_window) {
  const float4 ordered = as_window ? color.zyxw : color;
  return convert_uchar4(convert_int4(clamp(ordered, 0.0f, 1.0f) * 255.0f + 0.5f));
}

// What is behind pixel (x, y): one colour, or a sky, as resolve.py lays out its rows.
inline float4 behind(int x, int y, float4 plain, __global const float4* sky) {
  if (!sky) return plain;
  const float4 direction = sky[3] + (float4)(x * sky[4].x, y * sky[4].y, 0, 0);
  const float sine = dot(sky[2], direction) * rsqrt(dot(direction, direction));
  return plain + fmax(sine, 0.0f) * sky[0] + fmax(-sine, 0.0f) * sky[1];
}

// palette: STEPS colours (alpha 0), then how each differs from the next.
// image: premultiplied, row 0 on top.  mixed 0: its colours are final, else the palette makes them
// of its luminance; or adds those of its heat (value, weight), where there is one.
__kernel void resolve(int width, int height, float red, float green, float blue, int mixed,
                      __global const float4* image, __global const float4* palette,
                      __global uchar4* pixels, __global const float2* heat,
                      __global const float4* sky, int as_window) {
  const int y = get_global_id(0);
  __global const float4* row = image + (size_t)y * width;
  __global uchar4* out = pixels + (size_t)(as_window ? y : height - 1 - y) * width;
  const float4 plain = (float4)(red, green, blue, 1);  // the 1 makes what is shown opaque
  if (!mixed && !sky) {
    for (int x = 0; x < width; x++) out[x] = eight_bits(row[x] + (1 - row[x].w) * plain, as_window);
    return;
  }
  if (!mixed) {
    for (int x = 0; x < width; x++)
      out[x] = eight_bits(row[x] + (1 - row[x].w) * behind(x, y, plain, sky), as_window);
    return;
  }
  for (int x = 0; x < width; x++) {
    const float4 color = row[x];
    // What of the pixel's value is of how much of it: the palette colours what is there, not the
    // background.
    const float luminance = 0.2126f * color.x + 0.7152f * color.y + 0.0722f * color.z;
    const float2 of = heat ? heat[(size_t)y * width + x] : (float2)(luminance, color.w);
    // 1e-6: a pixel that nothing covers has no value to look up.
    const float place = clamp(of.x / fmax(of.y, 1e-6f), 0.0f, 1.0f) * (STEPS - 1);
    const int below = min((int)place, STEPS - 2);
    // Linear between two entries; the second table holds the differences, ready made.
    const float4 false_color = palette[below] + (place - below) * palette[STEPS + below];
    const float4 final = heat ? color : (float4)(0, 0, 0, color.w);
    const float4 shown = final + false_color * of.y + (1 - color.w) * behind(x, y, plain, sky);
    out[x] = eight_bits(shown, as_window);
  }
}
