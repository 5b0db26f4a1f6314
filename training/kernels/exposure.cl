// How much brighter a photo is than what is drawn of it: sums a row of a channel, a work-item each.
// Reads:   image (3, H, W), rgba (H, W, 4), weight (H, W) where masked.
// Writes:  sums (6, 3 * H).
// Units:   display sRGB 0..1; pixels.
//
// image (3, H, W) drawn, rgba (H, W, 4) the photo's bytes, weight (H, W) where masked.  Of what the
// photo shows (its alpha times its weight) and what is not saturated in it, the sums of 1, drawn,
// photo, drawn^2, drawn * photo and photo^2, one after the other in `sums` (6, 3 * H).
#define SATURATED 254  // a byte from which on nobody knows how bright it was

__kernel void exposure_rows(int width, int height, int masked, __global const float *image,
                            __global const uchar *rgba, __global const float *weight,
                            __global float *sums) {
  const int row = get_global_id(0), channel = row / height, y = row % height;
  if (!(row < 3 * height)) return;
  float sum[6] = {0, 0, 0, 0, 0, 0};
  for (int x = 0; x < width; x++) {
    __global const uchar *p = rgba + 4 * (y * width + x);
    const float photo = p[channel] / 255.0f;
    const float drawn = clamp(image[row * width + x], 0.0f, 1.0f);
    float counts = p[3] / 255.0f * (p[0] < SATURATED && p[1] < SATURATED && p[2] < SATURATED);
    if (masked) counts *= weight[y * width + x];
    sum[0] += counts;
    sum[1] += counts * drawn;
    sum[2] += counts * photo;
    sum[3] += counts * drawn * drawn;
    sum[4] += counts * drawn * photo;
    sum[5] += counts * photo * photo;
  }
  for (int i = 0; i < 6; i++) sums[i * 3 * height + row] = sum[i];
}
