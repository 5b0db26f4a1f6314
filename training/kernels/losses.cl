// losses: image losses and their gradient: (1 - lambda) L1 + lambda (1 - SSIM), both fused (paper
// eq. 8; lambda as in 3DGS, the share of D-SSIM). CPU form: a work-item walks a row in vectors of
// eight pixels; losses_gpu.cl is the other.
//
// Images are planar: the drawn image and its gradient [3][H][W] as the rasterizer has them, every
// map of ours [3][H][STRIDE] with STRIDE = W padded to 8, so that whole vectors can be written for
// any width.  What lies in the padding is never read as image and counts for nothing. SSIM with an
// 11 x 11 Gaussian window, sigma 1.5, zeros beyond the border, as 3DGS has it:
//  S = (2 a b + C1)(2 cov + C2) / ((a^2 + b^2 + C1)(var_a + var_b + C2))  of windowed means a, b.
// A window is separable: one pass along rows, one along columns, forward and again backward. A
// weight map (a photo's mask) draws the pixel towards its target, a = t + w (p - t): what a mask
// leaves out counts as right, in L1 and in every SSIM window that sees it.
// Needs:   ROW, the longest padded row plus the window, as private memory for a row.
// Reads:   image, target (photo bytes over a background), weight where masked.
// Writes:  grad_image; ssim_rows and l1_rows, sums a row; maps between.
// Units:   display sRGB in 0..1.

#include "losses_shared.cl"

#define UNROLL _Pragma("unroll")  // a window's taps: their weights become constants

// Over the lanes, by halves: the same order always.
inline float sum8(float8 v) {
  float4 a = v.lo + v.hi;
  float2 b = a.lo + a.hi;
  return b.x + b.y;
}

// 1 in the lanes of columns x .. x+7 that lie inside the image, else 0.
inline float8 inside(int x, int width) {
  float8 lane = (float8)(0, 1, 2, 3, 4, 5, 6, 7) + (float)x;
  return select((float8)(0.0f), (float8)(1.0f), isless(lane, (float8)((float)width)));
}

// Eight pixels' windows at once, along a padded copy of the row: no test of borders.
inline float8 along_row(const float *row, int x) {
  float8 sum = 0;
  UNROLL for (int k = 0; k < TAPS; k++) sum += WINDOW[k] * vload8(0, row + x + k);
  return sum;
}

// Rows beyond the image count as zeros: they are left out of the sum.
inline float8 along_column(__global const float *plane, int x, int y, int height, int stride) {
  float8 sum = 0;
  plane += x;
  if (y >= REACH && y + REACH < height) {  // nearly all rows: the whole window, unrolled
    UNROLL for (int k = 0; k < TAPS; k++)
      sum += WINDOW[k] * vload8(0, plane + (y + k - REACH) * stride);
    return sum;
  }
  for (int k = max(0, REACH - y); k < min(TAPS, height + REACH - y); k++)
    sum += WINDOW[k] * vload8(0, plane + (y + k - REACH) * stride);
  return sum;
}

// Photo bytes (H, W, 4), each channel times a number, over a background -> target planes.
// One work-item a row of a channel.
__kernel void compose_target(int width, int height, int stride, float red, float green,
                             float blue, float times_red, float times_green, float times_blue,
                             __global const uchar *rgba, __global float *target) {
  // A work-item is a row of one channel.
  int channel = get_global_id(0) / height, y = get_global_id(0) % height;
  float behind = channel == 0 ? red : channel == 1 ? green : blue;
  float times = channel == 0 ? times_red : channel == 1 ? times_green : times_blue;
  __global float *row = target + get_global_id(0) * stride;
  for (int x = 0; x < stride; x++) {
    if (x < width) {
      __global const uchar *p = rgba + 4 * (y * width + x);
      // Photos with a transparent background are composed over the one that is drawn.
      float alpha = p[3] / 255.0f;
      // Bytes -> 0..1, over the background's channel.
      row[x] = alpha * (times * (p[channel] / 255.0f)) + (1.0f - alpha) * behind;
    } else {
      // Padding: written once, so that whole vectors can be read.
      row[x] = 0;
    }
  }
}

// The two windowed maps of a target that never change: mean of b and of b^2; first along rows.
__kernel void target_rows(int width, int height, int stride, __global const float *target,
                          __global float *blurred) {
  int at = get_global_id(0) * stride, map = 3 * height * stride;
  // A copy of the row with REACH zeros on either side.
  float plain[ROW], square[ROW];
  for (int x = 0; x < stride + 2 * REACH; x++) plain[x] = square[x] = 0;
  for (int x = 0; x < width; x++) {
    float b = target[at + x];
    plain[x + REACH] = b;
    square[x + REACH] = b * b;
  }
  for (int x = 0; x < stride; x += 8) {
    // The means of b and of b^2, half windowed.
    vstore8(along_row(plain, x), 0, blurred + at + x);
    vstore8(along_row(square, x), 0, blurred + map + at + x);
  }
}

// Then along columns: the target's means are ready for every step.
__kernel void target_columns(int width, int height, int stride, __global const float *blurred,
                             __global float *target_mean, __global float *target_square) {
  // Columns: a work-item is still a row, whose window reaches REACH rows up and down.
  int channel = get_global_id(0) / height, y = get_global_id(0) % height;
  int plane = channel * height * stride, map = 3 * height * stride;
  for (int x = 0; x < stride; x += 8) {
    vstore8(along_column(blurred + plane, x, y, height, stride), 0,
            target_mean + plane + y * stride + x);
    vstore8(along_column(blurred + map + plane, x, y, height, stride), 0,
            target_square + plane + y * stride + x);
  }
}

// Windowed along rows: the image a, a^2 and a b.  masked: 1 when `weight` [H][W] counts.
__kernel void image_rows(int width, int height, int stride, int masked,
                         __global const float *image, __global const float *target,
                         __global const float *weight, __global float *blurred) {
  int row = get_global_id(0), y = row % height;
  // Maps lie one behind the other, three planes each.
  int at = row * stride, map = 3 * height * stride;
  float plain[ROW], square[ROW], product[ROW];
  for (int x = 0; x < stride + 2 * REACH; x++) plain[x] = square[x] = product[x] = 0;
  for (int x = 0; x < width; x++) {
    float a = image[row * width + x], b = target[at + x];
    // a = t + w (p - t).
    if (masked) a = b + weight[y * width + x] * (a - b);
    plain[x + REACH] = a;
    // Three maps of the same window.
    square[x + REACH] = a * a;
    product[x + REACH] = a * b;
  }
  for (int x = 0; x < stride; x += 8) {
    vstore8(along_row(plain, x), 0, blurred + at + x);
    vstore8(along_row(square, x), 0, blurred + map + at + x);
    vstore8(along_row(product, x), 0, blurred + 2 * map + at + x);
  }
}

// SSIM of every pixel: its sum a row, and its derivatives by the three windowed maps.
__kernel void ssim_columns(int width, int height, int stride, __global const float *blurred,
                           __global const float *target_mean,
                           __global const float *target_square, __global float *derivative,
                           __global float *ssim_rows) {
  int channel = get_global_id(0) / height, y = get_global_id(0) % height;
  int plane = channel * height * stride, map = 3 * height * stride;
  // The sum of S along the row, lane by lane.
  float8 total = 0;
  for (int x = 0; x < stride; x += 8) {
    int at = plane + y * stride + x;
    // Windowed a, a^2, a b of the image; b, b^2 of the target.
    float8 a = along_column(blurred + plane, x, y, height, stride);
    float8 aa = along_column(blurred + map + plane, x, y, height, stride);
    float8 ab = along_column(blurred + 2 * map + plane, x, y, height, stride);
    // The target's two, made once (target_columns).
    float8 b = vload8(0, target_mean + at), bb = vload8(0, target_square + at);
    // The two factors above and the two below the line of S; var = mean of squares - square of
    // mean.
    float8 likeness = 2 * a * b + C1, structure = 2 * (ab - a * b) + C2;
    float8 power = a * a + b * b + C1, variance = aa - a * a + bb - b * b + C2;
    // Above 0 always: C1 and C2 keep both factors from 0.
    float8 inverse = 1.0f / (power * variance), live = inside(x, width);
    float8 ssim = likeness * structure * inverse;
    // Lanes beyond the image count as 0.
    total += live * ssim;
    // dS / d(mean a), dS / d(mean a^2), dS / d(mean a b): what the backward windows carry.
    float8 by_mean = 2 * b * (structure - likeness) * inverse -
                     2 * ssim * a * (1.0f / power - 1.0f / variance);
    // Nothing from the padding.
    vstore8(live * by_mean, 0, derivative + at);
    vstore8(-live * ssim / variance, 0, derivative + map + at);
    vstore8(2 * live * likeness * inverse, 0, derivative + 2 * map + at);
  }
  ssim_rows[get_global_id(0)] = sum8(total);
}

// The window is symmetric, so the derivative of windowing is windowing again; first along rows.
__kernel void derivative_rows(int width, int height, int stride,
                              __global const float *derivative, __global float *blurred) {
  float row[ROW];
  for (int m = 0; m < 3; m++) {
    // The three derivative maps, one after the other.
    int at = m * 3 * height * stride + get_global_id(0) * stride;
    for (int x = 0; x < stride + 2 * REACH; x++) row[x] = 0;
    // The padding of a derivative map is not image: it must not leak into the windows.
    for (int x = 0; x < width; x++) row[x + REACH] = derivative[at + x];
    for (int x = 0; x < stride; x += 8) vstore8(along_row(row, x), 0, blurred + at + x);
  }
}

// Then along columns, joined with L1: the gradient of the whole image loss, and |a - b| a row.
// scale is 1 over the number of values that count (three times the sum of the weights).
__kernel void gradient_columns(GRADIENT_COLUMNS_TAKES, __global float *l1_rows) {
  int row = get_global_id(0), channel = row / height, y = row % height;
  int plane = channel * height * stride, map = 3 * height * stride;
  float l1 = 0;
  for (int x = 0; x < stride; x += 8) {
    // The chain rule ends: mean a, mean a^2 and mean a b depend on a by 1, 2 a and b.
    float by_mean[8], by_square[8], by_product[8];
    vstore8(along_column(blurred + plane, x, y, height, stride), 0, by_mean);
    vstore8(along_column(blurred + map + plane, x, y, height, stride), 0, by_square);
    vstore8(along_column(blurred + 2 * map + plane, x, y, height, stride), 0, by_product);
    // The drawn image has no padding: the last vector of a row is taken apart.
    int lanes = min(8, width - x);
    for (int i = 0; i < lanes; i++) {
      float b = target[row * stride + x + i], a = image[row * width + x + i];
      float w = masked ? weight[y * width + x + i] : 1.0f;
      if (masked) a = b + w * (a - b);
      float difference = a - b;
      // The derivative of |a - b|; 0 where they are equal.
      float sign = difference > 0 ? 1.0f : difference < 0 ? -1.0f : 0.0f;
      // Loss = (1 - lambda) |a - b| + lambda (1 - S): S enters with a minus.
      float ssim = by_mean[i] + 2 * a * by_square[i] + b * by_product[i];
      // |a - b| counts with its weight, since a was drawn towards b.
      l1 += fabs(difference);
      // w, since a = t + w (p - t) moves by w where p moves by 1.
      grad_image[row * width + x + i] =
          w * scale * ((1.0f - ssim_share) * sign - ssim_share * ssim);
    }
  }
  l1_rows[row] = l1;
}
