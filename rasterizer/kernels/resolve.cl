// resolve: a float image over a background, palette applied -> 8 bits a channel.
// A work-item takes a row.  Twin: renderer/colors/palette.py and Renderer.resolved.
// Reads:   image (H, W, 4), premultiplied, row 0 on top; a palette; heat (H, W, 2) or none; a sky's
//          rows or none.
// Writes:  pixels (H, W, 4) bytes: red first and row 0 at the bottom, as GL wants it, or blue first
//          and row 0 on top, as the memory of a window has it; lay_over: an overlay over these.
// Units:   display sRGB; a palette's places are luminance 0..1.
#define STEPS 256  // colours of a palette
#define GROUP 16   // pixels whose values are found at once

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

// Where the values of up to GROUP pixels lie in a palette: those of the heat, else luminance.
inline void values(int count, __global const float4* color, __global const float2* heat,
                   int* below, float* beyond, float* weight) {
  float value[GROUP];
  for (int i = 0; i < GROUP; i++) {
    // What of the pixel's value is of how much of it: the palette colours what is there, not the
    // background.
    const int at = min(i, count - 1);  // a fixed count of steps becomes vectors
    const float4 of = color[at];
    value[i] = heat ? heat[at].x : 0.2126f * of.x + 0.7152f * of.y + 0.0722f * of.z;
    weight[i] = heat ? heat[at].y : of.w;
  }
  for (int i = 0; i < GROUP; i++) {
    // 1e-6: a pixel that nothing covers has no value to look up.
    const float place = clamp(value[i] / fmax(weight[i], 1e-6f), 0.0f, 1.0f) * (STEPS - 1);
    below[i] = min((int)place, STEPS - 2);
    beyond[i] = place - below[i];
  }
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
  __global const float2* warm = heat ? heat + (size_t)y * width : 0;
  for (int first = 0; first < width; first += GROUP) {
    const int count = min(width - first, GROUP);
    // Of each pixel which entry of the palette is the last one below its value, how far the value
    // is above it, and how much of the pixel has one: of a group at once, then its colours.
    int below[GROUP];
    float beyond[GROUP], weight[GROUP];
    values(count, row + first, warm ? warm + first : 0, below, beyond, weight);
    for (int i = 0; i < count; i++) {
      const int x = first + i;
      const float4 color = row[x];
      // Linear between two entries; the second table holds the differences, ready made.
      const float4 false_color = palette[below[i]] + beyond[i] * palette[STEPS + below[i]];
      const float4 final = heat ? color : (float4)(0, 0, 0, color.w);
      const float4 back = sky ? behind(x, y, plain, sky) : plain;
      const float4 shown = final + false_color * weight[i] + (1 - color.w) * back;
      out[x] = eight_bits(shown, as_window);
    }
  }
}

// Four pixels of a premultiplied layer over a picture; products to the nearest in steps of 8 bits,
// as llvmpipe's blending has them, to the bit.
inline uchar16 over(uchar16 layer, uchar16 picture) {
  const ushort16 upper = convert_ushort16(layer);
  const ushort16 seen = (ushort16)(255) - upper.s33337777bbbbffff;
  const ushort16 product = convert_ushort16(picture) * seen;  // up to 255 * 255
  const ushort16 lower = (product + (product >> 8) + (ushort16)(128)) >> 8;
  // At most white: a layer that was rounded often may have a step more colour than alpha.
  return convert_uchar16(min(upper + lower, (ushort16)(255)));
}

// pixels (H, W) += the layer over them, premultiplied, in boxes (left, top, right, low) that share
// no pixel.  A work-item takes a row.
__kernel void lay_over(int width, int count, __global const int4* boxes,
                       __global const uchar4* layer, __global uchar4* pixels) {
  const int y = get_global_id(0);
  __global const uchar4* from = layer + (size_t)y * width;
  __global uchar4* row = pixels + (size_t)y * width;
  for (int i = 0; i < count; i++) {
    const int4 box = boxes[i];
    if (y < box.y || y >= box.w) continue;
    int x = box.x;
    for (; x + 4 <= box.z; x += 4) {
      const uchar16 four = over(vload16(0, (__global const uchar*)(from + x)),
                                vload16(0, (__global const uchar*)(row + x)));
      vstore16(four, 0, (__global uchar*)(row + x));
    }
    // What is left of a row's end: by the same steps, as one of four alike.
    for (; x < box.z; x++) row[x] = over((uchar16)(from[x], from[x], from[x], from[x]),
                                         (uchar16)(row[x], row[x], row[x], row[x])).s0123;
  }
}
