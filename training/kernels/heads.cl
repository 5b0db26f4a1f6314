// heads: the five heads, forward and backward: anchor features -> raw outputs (paper section 3.2,
// eq. 5). CPU form: vectors of eight units, a few anchors at a time; heads_gpu.cl is the other.
//  unit = ReLU(W1^T (f, delta, Psi) + b1), raw = W2^T unit + b2
// Reads:   weights, bias, anchors (A, 3), features (A, FEATURES), the eye; backward hidden and
//          grad_raw.
// Writes:  raw (A, RAW), hidden (A, 5, HIDDEN); backward grad_features, grad_anchors and
//          grad_chunks, the weights' gradients of each chunk.
// Units:   anchors and eye in metres; features, Psi and units have none.
#include "heads_shared.cl"
#define BLOCK 8  // anchors that share one pass over the weights in the backward kernel

// Loops over a block's anchors are unrolled: only then are their sums kept in registers.  A sum in
// memory is stored and loaded again for every multiply-add, which takes three times as long.
#define UNROLL _Pragma("unroll")
#define ROWS 4  // anchors of a work-item of the forward kernel

// A layer of ROWS anchors: what `takes` inputs add to two vectors of outputs of each.  With two
// there are enough sums on their way to hide how long each multiply-add takes.
inline void add_pair(float8 *low, float8 *high, const float *in, int stride, int takes,
                     __global const float *weights, int gives) {
  for (int i = 0; i < takes; i++) {
    // One row of weights serves all anchors.
    const float8 w_low = vload8(0, weights + i * gives), w_high = vload8(1, weights + i * gives);
    UNROLL for (int b = 0; b < ROWS; b++) {
      low[b] += in[b * stride + i] * w_low;
      high[b] += in[b * stride + i] * w_high;
    }
  }
}

// The last vector of a layer with an odd number of them.
inline void add_one(float8 *sum, const float *in, int stride, int takes,
                    __global const float *weights, int gives) {
  for (int i = 0; i < takes; i++) {
    const float8 w = vload8(0, weights + i * gives);
    UNROLL for (int b = 0; b < ROWS; b++) sum[b] += in[b * stride + i] * w;
  }
}

// What a work-item of the forward kernel knows of its anchors: read again for every head.
typedef struct {
  int anchor[ROWS];
  float feature[ROWS][FEATURES], direction[ROWS][3], unit[ROWS][HIDDEN];
} Rows;

// Hidden units of head m: vectors j and, where `pair`, j + 1.
inline void first_layer(Rows *k, int m, int j, int pair, __global const float *weights,
                        __global const float *bias, __global float *hidden) {
  // Columns 8 j and on of the rows of W1 that meet the features, and of those that meet delta.
  __global const float *by_feature = weights + WEIGHTS_AT[m] + 8 * j;
  __global const float *by_direction = by_feature + DIRECTION_ROW * HIDDEN;
  const int looks = m == COLOR && VIEW_COLOR ? 3 : 0;  // only the colour looks at the direction
  float8 low[ROWS], high[ROWS];
  // b1 with W1_control . Psi in it: Psi costs nothing an anchor.
  UNROLL for (int b = 0; b < ROWS; b++) low[b] = vload8(j, bias + m * HIDDEN);
  if (pair) {
    UNROLL for (int b = 0; b < ROWS; b++) high[b] = vload8(j + 1, bias + m * HIDDEN);
    add_pair(low, high, k->feature[0], FEATURES, FEATURES, by_feature, HIDDEN);
    add_pair(low, high, k->direction[0], 3, looks, by_direction, HIDDEN);
    UNROLL for (int b = 0; b < ROWS; b++) {
      const float8 y = fmax(high[b], (float8)(0.0f));
      vstore8(y, j + 1, k->unit[b]);
      vstore8(y, j + 1, hidden + UNITS_OF(k->anchor[b], m));
    }
  } else {
    add_one(low, k->feature[0], FEATURES, FEATURES, by_feature, HIDDEN);
    add_one(low, k->direction[0], 3, looks, by_direction, HIDDEN);
  }
  UNROLL for (int b = 0; b < ROWS; b++) {
    const float8 y = fmax(low[b], (float8)(0.0f));
    vstore8(y, j, k->unit[b]);
    vstore8(y, j, hidden + UNITS_OF(k->anchor[b], m));
  }
}

// Raw outputs of head m, linear in its units: vectors c and, where `pair`, c + 1.
inline void second_layer(const Rows *k, int m, int c, int pair, __global const float *weights,
                         __global float *raw) {
  const int outs = OUT[m];
  // A head's weights: W1, b1, W2, b2 (heads_shared.cl).
  __global const float *second = weights + WEIGHTS_AT[m] + LAST_AT;
  __global const float *biases = second + HIDDEN * outs;
  float8 low[ROWS], high[ROWS];
  UNROLL for (int b = 0; b < ROWS; b++) low[b] = vload8(c, biases);
  if (pair) {
    UNROLL for (int b = 0; b < ROWS; b++) high[b] = vload8(c + 1, biases);
    add_pair(low, high, k->unit[0], HIDDEN, HIDDEN, second + 8 * c, outs);
    UNROLL for (int b = 0; b < ROWS; b++)
      vstore8(high[b], c + 1, raw + k->anchor[b] * RAW + OUT_AT[m]);
  } else {
    add_one(low, k->unit[0], HIDDEN, HIDDEN, second + 8 * c, outs);
  }
  UNROLL for (int b = 0; b < ROWS; b++) vstore8(low[b], c, raw + k->anchor[b] * RAW + OUT_AT[m]);
}

// One work-item four anchors: every weight row is loaded once for the four.
__kernel void heads_forward(int anchors_count, float eye_x, float eye_y, float eye_z,
                            __global const float *weights, __global const float *bias,
                            __global const float *anchors, __global const float *features,
                            __global float *hidden, __global float *raw) {
  int first_anchor = get_global_id(0) * ROWS;
  if (!(first_anchor < anchors_count)) return;
  float3 eye = (float3)(eye_x, eye_y, eye_z);
  Rows k;
  for (int b = 0; b < ROWS; b++) {
    // Beyond the end the last one repeats and writes the same.
    const int a = k.anchor[b] = min(first_anchor + b, anchors_count - 1);
    for (int i = 0; i < FEATURES; i++) k.feature[b][i] = features[a * FEATURES + i];
    // The direction delta of paper eq. 4.
    float4 d = direction_and_inverse(eye, anchors + 3 * a);
    vstore3(d.xyz, 0, k.direction[b]);
  }
  // Offset, scale, rotation, opacity, colour, one after the other: one head's weights at a time
  // are in the cache.
  for (int m = 0; m < 5; m++) {
    for (int j = 0; j < HIDDEN8; j += 2)
      first_layer(&k, m, j, j + 1 < HIDDEN8, weights, bias, hidden);
    for (int c = 0; c < OUT[m] / 8; c += 2)
      second_layer(&k, m, c, c + 1 < OUT[m] / 8, weights, raw);
  }
}

// What a head's backward pass knows of its block of anchors; rows beyond the end add nothing.
// Everything is private: a block's numbers are used for hundreds of weights each.
typedef struct {
  float input[BLOCK][FEATURES], unit[BLOCK][HIDDEN], d_out[BLOCK][MAX_OUT], d_unit[BLOCK][HIDDEN];
  float8 d_input[BLOCK][FEATURES8];
  float4 direction[BLOCK];  // unit vector, 1 / distance
} Block;

// Features and directions are those of all five heads.
inline void load_anchors(Block *k, int base, int count, float3 eye, __global const float *anchors,
                         __global const float *features) {
  for (int b = 0; b < BLOCK; b++) {
    // Beyond the end the last anchor again: it is read, and its gradient is 0.
    int a = base + min(b, count - 1);
    for (int i = 0; i < FEATURES; i++) k->input[b][i] = features[a * FEATURES + i];
    // All five heads add to the gradient of the same features.
    for (int i = 0; i < FEATURES8; i++) k->d_input[b][i] = 0;
    k->direction[b] = direction_and_inverse(eye, anchors + 3 * a);
  }
}

// A head's block: dL / d raw as it comes from the Gaussians, and its hidden units, which are the
// input of the last layer and say where the ReLU was open.
inline void load_head(Block *k, int m, int base, int count, __global const float *hidden,
                      __global const float *grad_raw) {
  for (int b = 0; b < BLOCK; b++) {
    int a = base + min(b, count - 1);
    // Rows beyond the end: a gradient of 0 adds nothing anywhere.
    float live = b < count ? 1.0f : 0.0f;
    for (int c = 0; c < OUT[m] / 8; c++)
      vstore8(live * vload8(c, grad_raw + a * RAW + OUT_AT[m]), c, k->d_out[b]);
    for (int j = 0; j < HIDDEN8; j++) vstore8(vload8(j, hidden + UNITS_OF(a, m)), j, k->unit[b]);
  }
}

// b2 and W2 of a head with `outs` outputs.
inline void second_layer_gradient(const Block *k, int outs, __global float *grad) {
  for (int c = 0; c < outs / 8; c++) {
    // db2 = sum of d, dW2 = sum of unit d, over the block's anchors.
    float8 d[BLOCK], sum = vload8(c, grad + HIDDEN * outs);
    UNROLL for (int b = 0; b < BLOCK; b++) { d[b] = vload8(c, k->d_out[b]); sum += d[b]; }
    vstore8(sum, c, grad + HIDDEN * outs);
    for (int j = 0; j < HIDDEN; j++) {
      // Row j of W2, for all of the block's anchors: one load and store of the gradient for eight.
      float8 g = vload8(c, grad + j * outs);
      UNROLL for (int b = 0; b < BLOCK; b++) g += k->unit[b][j] * d[b];
      vstore8(g, c, grad + j * outs);
    }
  }
}

// Through the last layer and the ReLU into the hidden units.
inline void units_gradient(Block *k, int m, __global const float *second_t) {
  for (int j = 0; j < HIDDEN8; j++) {
    // Eight hidden units of every anchor in the block.
    float8 d[BLOCK];
    UNROLL for (int b = 0; b < BLOCK; b++) d[b] = 0;
    // d_unit = W2 d_out.
    for (int c = 0; c < OUT[m]; c++) {
      // Row c of W2^T: how output c moves the units.
      const float8 w = vload8(j, second_t + c * HIDDEN);
      UNROLL for (int b = 0; b < BLOCK; b++) d[b] += k->d_out[b][c] * w;
    }
    UNROLL for (int b = 0; b < BLOCK; b++) {
      // ReLU lets nothing back where it was 0.
      d[b] = select((float8)(0.0f), d[b], isgreater(vload8(j, k->unit[b]), (float8)(0.0f)));
      vstore8(d[b], j, k->d_unit[b]);
    }
  }
}

// b1 and W1 of the features (and of the direction).
inline void first_layer_gradient(const Block *k, int m, __global float *grad) {
  for (int j = 0; j < HIDDEN8; j++) {
    // db1 and the features' rows of dW1; Psi's rows follow from db1 at the end (control_gradient).
    float8 d[BLOCK], sum = vload8(j, grad + INPUTS * HIDDEN);
    UNROLL for (int b = 0; b < BLOCK; b++) { d[b] = vload8(j, k->d_unit[b]); sum += d[b]; }
    // The gradient of the folded bias.
    vstore8(sum, j, grad + INPUTS * HIDDEN);
    for (int i = 0; i < FEATURES; i++) {
      float8 g = vload8(j, grad + i * HIDDEN);
      UNROLL for (int b = 0; b < BLOCK; b++) g += k->input[b][i] * d[b];
      vstore8(g, j, grad + i * HIDDEN);
    }
    // Only the colour head has seen the direction.
    if (!(m == COLOR && VIEW_COLOR)) continue;
    // The three rows that meet the direction.
    __global float *by_direction = grad + DIRECTION_ROW * HIDDEN;
    float8 x = vload8(j, by_direction), y = vload8(j, by_direction + HIDDEN);
    float8 z = vload8(j, by_direction + 2 * HIDDEN);
    UNROLL for (int b = 0; b < BLOCK; b++) {
      x += k->direction[b].x * d[b];
      y += k->direction[b].y * d[b];
      z += k->direction[b].z * d[b];
    }
    vstore8(x, j, by_direction);
    vstore8(y, j, by_direction + HIDDEN);
    vstore8(z, j, by_direction + 2 * HIDDEN);
  }
}

// dL / d feature = W1 d, summed over heads.
inline void add_input_gradient(Block *k, __global const float *first_t) {
  for (int i = 0; i < FEATURES8; i++) {
    float8 sum[BLOCK];
    UNROLL for (int b = 0; b < BLOCK; b++) sum[b] = k->d_input[b][i];
    for (int j = 0; j < HIDDEN; j++) {
      // Row j of W1^T: how unit j moves the features.
      const float8 w = vload8(i, first_t + j * FEATURES);
      UNROLL for (int b = 0; b < BLOCK; b++) sum[b] += k->d_unit[b][j] * w;
    }
    UNROLL for (int b = 0; b < BLOCK; b++) k->d_input[b][i] = sum[b];
  }
}

// Over the lanes, by halves: the same order always.
inline float sum8(float8 v) {
  const float4 a = v.lo + v.hi;
  const float2 b = a.lo + a.hi;
  return b.x + b.y;
}

// The colour's view direction turns when its anchor moves:
// d direction / d anchor = (I - u u^T) / r
inline void add_direction_gradient(const Block *k, int base, int count,
                                   __global const float *first, __global float *grad_anchors) {
  __global const float *by_direction = first + DIRECTION_ROW * HIDDEN;
  for (int b = 0; b < count; b++) {
    // dL / d direction by the three rows of W1.
    float8 x = 0, y = 0, z = 0;
    for (int j = 0; j < HIDDEN8; j++) {
      const float8 d = vload8(j, k->d_unit[b]);
      x += d * vload8(j, by_direction);
      y += d * vload8(j, by_direction + HIDDEN);
      z += d * vload8(j, by_direction + 2 * HIDDEN);
    }
    // What is along the direction changes its length alone, and that is always 1.
    const float3 u = k->direction[b].xyz, g = (float3)(sum8(x), sum8(y), sum8(z));
    const float3 flow = (g - u * dot(g, u)) * k->direction[b].w;
    // Added to what came through the means.
    vstore3(vload3(base + b, grad_anchors) + flow, base + b, grad_anchors);
  }
}

// One work-item a chunk of anchors, with weight gradients of its own that sum_chunks adds up in a
// fixed order: no atomics, the same bits for any number of threads.
// grad_anchors already holds the gradient through the means and gets that of the direction added.
__kernel void heads_backward(int anchors_count, int chunks, float eye_x, float eye_y, float eye_z,
                             __global const float *weights, __global const float *first_t,
                             __global const float *second_t, __global const float *anchors,
                             __global const float *features, __global const float *hidden,
                             __global const float *grad_raw, __global float *grad_chunks,
                             __global float *grad_features, __global float *grad_anchors) {
  int chunk = get_global_id(0);
  if (!(chunk < chunks)) return;
  __global float *grad = grad_chunks + (long)chunk * WEIGHTS;
  // A chunk's own gradients, from 0.
  for (int i = 0; i < WEIGHTS; i++) grad[i] = 0;
  float3 eye = (float3)(eye_x, eye_y, eye_z);
  // Chunks of nearly equal size; long, since anchors times chunks may leave 32 bits.
  int from = (long)anchors_count * chunk / chunks, to = (long)anchors_count * (chunk + 1) / chunks;
  Block k;
  for (int base = from; base < to; base += BLOCK) {
    int count = min(BLOCK, to - base);
    // Eight anchors at a time, the last block with fewer.
    load_anchors(&k, base, count, eye, anchors, features);
    // A head at a time, from its outputs down to the features.
    for (int m = 0; m < 5; m++) {
      __global float *g_first = grad + WEIGHTS_AT[m];
      load_head(&k, m, base, count, hidden, grad_raw);
      second_layer_gradient(&k, OUT[m], g_first + LAST_AT);
      units_gradient(&k, m, second_t + OUT_AT[m] * HIDDEN);
      first_layer_gradient(&k, m, g_first);
      add_input_gradient(&k, first_t + m * HIDDEN * FEATURES);
      if (m == COLOR && VIEW_COLOR)
        add_direction_gradient(&k, base, count, weights + WEIGHTS_AT[m], grad_anchors);
    }
    // All heads have added: the features' gradient is complete.
    for (int b = 0; b < count; b++)
      for (int i = 0; i < FEATURES8; i++)
        vstore8(k.d_input[b][i], i, grad_features + (base + b) * FEATURES);
  }
}
