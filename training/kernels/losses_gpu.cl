// losses_gpu: image losses for many small work-items: one a pixel of a channel.  Formulas, names
// and maps are those of losses.cl, but for sums a row, which sum_rows makes of two maps when they
// are asked for.  What lies in the padding of a row is neither read nor written.
// Reads:   image, target, weight where masked.
// Writes:  grad_image; ssim_map and difference_map; maps between.
// Units:   display sRGB in 0..1.
#include "losses_shared.cl"

// Where an item works: x, y, its row of all channels; nothing where it lies outside.
// A macro, since it declares and may return: every kernel here begins with it.
#define PIXEL                                                              \
  const int row = get_global_id(0) / stride, x = get_global_id(0) % stride; \
  const int y = row % height, channel = row / height;                      \
  const int first = channel * height * stride, at = row * stride + x;      \
  const int map = 3 * height * stride;                                     \
  if (!(row < 3 * height && x < width)) return;

// Windowed along its row or its column, zeros beyond the border.
// The loop ends at the border, beyond which the values are zeros.
inline float along_row(__global const float *line, int x, int width) {
  float sum = 0;
  for (int k = max(0, REACH - x); k < min(TAPS, width + REACH - x); k++)
    sum += WINDOW[k] * line[x + k - REACH];
  return sum;
}

inline float along_column(__global const float *plane, int x, int y, int height, int stride) {
  float sum = 0;
  for (int k = max(0, REACH - y); k < min(TAPS, height + REACH - y); k++)
    sum += WINDOW[k] * plane[(y + k - REACH) * stride + x];
  return sum;
}

// A drawn value, drawn towards its target as far as the mask leaves it out.
// a = t + w (p - t), as in losses.cl.
inline float counted(float a, float b, int masked, __global const float *weight, int pixel) {
  return masked ? b + weight[pixel] * (a - b) : a;
}

__kernel void compose_target(int width, int height, int stride, float red, float green,
                             float blue, float times_red, float times_green, float times_blue,
                             __global const uchar *rgba, __global float *target) {
  PIXEL
  const float behind = channel == 0 ? red : channel == 1 ? green : blue;
  const float times = channel == 0 ? times_red : channel == 1 ? times_green : times_blue;
  __global const uchar *p = rgba + 4 * (y * width + x);
  // Photos with a transparent background are composed over the one that is drawn.
  const float alpha = p[3] / 255.0f;
  target[at] = alpha * (times * (p[channel] / 255.0f)) + (1.0f - alpha) * behind;
}

__kernel void target_rows(int width, int height, int stride, __global const float *target,
                          __global float *blurred) {
  PIXEL
  __global const float *line = target + row * stride;
  // Means of b and of b^2 along the row; they never change.
  float square = 0;
  for (int k = max(0, REACH - x); k < min(TAPS, width + REACH - x); k++) {
    const float b = line[x + k - REACH];
    square += WINDOW[k] * (b * b);
  }
  blurred[at] = along_row(line, x, width);
  blurred[at + map] = square;
}

__kernel void target_columns(int width, int height, int stride, __global const float *blurred,
                             __global float *target_mean, __global float *target_square) {
  PIXEL
  // The window's second half; with it the two maps are complete.
  target_mean[at] = along_column(blurred + first, x, y, height, stride);
  target_square[at] = along_column(blurred + map + first, x, y, height, stride);
}

__kernel void image_rows(int width, int height, int stride, int masked,
                         __global const float *image, __global const float *target,
                         __global const float *weight, __global float *blurred) {
  PIXEL
  // One walk along the row for a, a^2 and a b.
  float plain = 0, square = 0, product = 0;
  for (int k = max(0, REACH - x); k < min(TAPS, width + REACH - x); k++) {
    // Column of the window's tap.
    const int there = x + k - REACH;
    const float b = target[row * stride + there];
    const float a = counted(image[row * width + there], b, masked, weight, y * width + there);
    plain += WINDOW[k] * a;
    square += WINDOW[k] * (a * a);
    product += WINDOW[k] * (a * b);
  }
  blurred[at] = plain;
  blurred[at + map] = square;
  // Three maps, one behind the other.
  blurred[at + 2 * map] = product;
}

__kernel void ssim_columns(int width, int height, int stride, __global const float *blurred,
                           __global const float *target_mean,
                           __global const float *target_square, __global float *derivative,
                           __global float *ssim_map) {
  PIXEL
  // Windowed a, a^2, a b of the image; b, b^2 of the target.
  const float a = along_column(blurred + first, x, y, height, stride);
  const float aa = along_column(blurred + map + first, x, y, height, stride);
  const float ab = along_column(blurred + 2 * map + first, x, y, height, stride);
  const float b = target_mean[at], bb = target_square[at];
  // S = likeness structure / (power variance), as in losses.cl.
  const float likeness = 2 * a * b + C1, structure = 2 * (ab - a * b) + C2;
  const float power = a * a + b * b + C1, variance = aa - a * a + bb - b * b + C2;
  // Above 0 always: C1 and C2 keep both factors from 0.
  const float inverse = 1.0f / (power * variance), ssim = likeness * structure * inverse;
  ssim_map[at] = ssim;
  // dS by the windowed a, a^2 and a b.
  derivative[at] = 2 * b * (structure - likeness) * inverse -
                   2 * ssim * a * (1.0f / power - 1.0f / variance);
  derivative[at + map] = -ssim / variance;
  derivative[at + 2 * map] = 2 * likeness * inverse;
}

__kernel void derivative_rows(int width, int height, int stride,
                              __global const float *derivative, __global float *blurred) {
  PIXEL
  for (int m = 0; m < 3; m++)
    // The window is symmetric: its derivative is windowing once more.
    blurred[at + m * map] = along_row(derivative + m * map + row * stride, x, width);
}

__kernel void gradient_columns(GRADIENT_COLUMNS_TAKES, __global float *difference_map) {
  PIXEL
  // The chain rule ends: mean a, mean a^2 and mean a b depend on a by 1, 2 a and b.
  const float by_mean = along_column(blurred + first, x, y, height, stride);
  const float by_square = along_column(blurred + map + first, x, y, height, stride);
  const float by_product = along_column(blurred + 2 * map + first, x, y, height, stride);
  const int pixel = y * width + x;
  const float b = target[at], w = masked ? weight[pixel] : 1.0f;
  const float a = counted(image[row * width + x], b, masked, weight, pixel);
  // The derivative of |a - b|; 0 where they are equal.
  const float sign = a > b ? 1.0f : a < b ? -1.0f : 0.0f;
  const float ssim = by_mean + 2 * a * by_square + b * by_product;
  // The L1 part, summed a row only when somebody asks for the loss.
  difference_map[at] = fabs(a - b);
  // Loss = (1 - lambda) |a - b| + lambda (1 - S).
  grad_image[row * width + x] = w * scale * ((1.0f - ssim_share) * sign - ssim_share * ssim);
}

// One work-item a row of a channel.
__kernel void sum_rows(int width, int rows, int stride, __global const float *ssim_map,
                       __global const float *difference_map, __global float *ssim_rows,
                       __global float *l1_rows) {
  // In the order of columns: the same bits every time.
  const int row = get_global_id(0);
  if (!(row < rows)) return;
  float ssim = 0, l1 = 0;
  for (int x = 0; x < width; x++) {
    ssim += ssim_map[row * stride + x];
    l1 += difference_map[row * stride + x];
  }
  ssim_rows[row] = ssim;
  l1_rows[row] = l1;
}
