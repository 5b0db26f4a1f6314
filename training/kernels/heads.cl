// heads: the five heads, forward and backward: anchor features -> raw outputs (paper section 3.2,
// eq. 5). CPU form: vectors of LANES (16 or 8) units, a few anchors at a time; heads_gpu.cl is the
// other.
//  unit = ReLU(W1^T (f, delta, Psi) + b1), raw = W2^T unit + b2
// Reads:   weights, bias, anchors (A, 3), features (A, FEATURES), the eye; backward hidden and
//          grad_raw.
// Writes:  raw (A, RAW), hidden (A, 5, HIDDEN); backward grad_features, grad_anchors and
//          grad_chunks, the weights' gradients of each chunk.
// Units:   anchors and eye in metres; features, Psi and units have none.
#include "heads_shared.cl"
#define BLOCK LANES  // anchors that share one pass over the weights in the backward kernel

// Loops over a block's anchors are unrolled: only then are their sums kept in registers.  A sum in
// memory is stored and loaded again for every multiply-add, which takes three times as long.
#define UNROLL _Pragma("unroll")
// Anchors of a work-item of the forward kernel: as many as give eight sums of a register each, so
// that no multiply-add waits for the one before.
#define ROWS (LANES / 2)
// BODY(16) or BODY(8) for vectors of `count` neighbours (a multiple of 8) from `at` on.  No lane
// meets another, so the same bits come of either.
#if LANES == 16
#define IN_VECTORS(BODY, count)                           \
  {                                                       \
    int at = 0;                                           \
    for (; at + 16 <= (count); at += 16) { BODY(16) }     \
    for (; at < (count); at += 8) { BODY(8) }             \
  }
#else
#define IN_VECTORS(BODY, count) \
  for (int at = 0; at < (count); at += 8) { BODY(8) }
#endif

// A layer of ROWS anchors: what `takes` inputs add to sixteen outputs of each.
inline void add_wide(float16 *sum, const float *in, int stride, int takes,
                     __global const float *weights, int gives) {
  for (int i = 0; i < takes; i++) {
    // One row of weights serves all anchors.
    const float16 w = vload16(0, weights + i * gives);
    UNROLL for (int b = 0; b < ROWS; b++) sum[b] += in[b * stride + i] * w;
  }
}

// The last vector of a layer with an odd number of eights.
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

// Hidden units of head m: sixteen from 8 j on where `pair`, else eight.
inline void first_layer(Rows *k, int m, int j, int pair, __global const float *weights,
                        __global const float *bias, __global float *hidden) {
  // Columns 8 j and on of the rows of W1 that meet the features, and of those that meet delta.
  __global const float *by_feature = weights + WEIGHTS_AT[m] + 8 * j;
  __global const float *by_direction = by_feature + DIRECTION_ROW * HIDDEN;
  const int looks = m == COLOR && VIEW_COLOR ? 3 : 0;  // only the colour looks at the direction
  // b1 with W1_control . Psi in it: Psi costs nothing an anchor.
  __global const float *biases = bias + m * HIDDEN + 8 * j;
#define FIRST_LAYER(N, ADD)                                                              \
  {                                                                                      \
    float##N sum[ROWS];                                                                  \
    UNROLL for (int b = 0; b < ROWS; b++) sum[b] = vload##N(0, biases);                  \
    ADD(sum, k->feature[0], FEATURES, FEATURES, by_feature, HIDDEN);                     \
    ADD(sum, k->direction[0], 3, looks, by_direction, HIDDEN);                           \
    UNROLL for (int b = 0; b < ROWS; b++) {                                              \
      const float##N y = fmax(sum[b], (float##N)(0.0f));                                 \
      vstore##N(y, 0, k->unit[b] + 8 * j);                                               \
      vstore##N(y, 0, hidden + UNITS_OF(k->anchor[b], m) + 8 * j);                       \
    }                                                                                    \
  }
  if (pair) FIRST_LAYER(16, add_wide)
  else FIRST_LAYER(8, add_one)
}

// Raw outputs of head m, linear in its units: sixteen from 8 c on where `pair`, else eight.
inline void second_layer(const Rows *k, int m, int c, int pair, __global const float *weights,
                         __global float *raw) {
  const int outs = OUT[m];
  // A head's weights: W1, b1, W2, b2 (heads_shared.cl).
  __global const float *second = weights + WEIGHTS_AT[m] + LAST_AT;
  __global const float *biases = second + HIDDEN * outs + 8 * c;
#define SECOND_LAYER(N, ADD)                                                             \
  {                                                                                      \
    float##N sum[ROWS];                                                                  \
    UNROLL for (int b = 0; b < ROWS; b++) sum[b] = vload##N(0, biases);                  \
    ADD(sum, k->unit[0], HIDDEN, HIDDEN, second + 8 * c, outs);                          \
    UNROLL for (int b = 0; b < ROWS; b++)                                                \
      vstore##N(sum[b], 0, raw + k->anchor[b] * RAW + OUT_AT[m] + 8 * c);                \
  }
  if (pair) SECOND_LAYER(16, add_wide)
  else SECOND_LAYER(8, add_one)
}

// One work-item ROWS anchors: every weight row is loaded once for them.
__kernel void heads_forward(HEADS_FORWARD_TAKES) {
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
  float d_input[BLOCK][FEATURES];
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
    for (int i = 0; i < FEATURES; i++) k->d_input[b][i] = 0;
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
  __global float *biases = grad + HIDDEN * outs;
  // db2 = sum of d, dW2 = sum of unit d, over the block's anchors.  Row j of W2, for all of them:
  // one load and store of the gradient for all.
#define OUTPUTS(N)                                                                       \
  float##N d[BLOCK], sum = vload##N(0, biases + at);                                     \
  UNROLL for (int b = 0; b < BLOCK; b++) { d[b] = vload##N(0, k->d_out[b] + at); sum += d[b]; } \
  vstore##N(sum, 0, biases + at);                                                        \
  for (int j = 0; j < HIDDEN; j++) {                                                     \
    float##N g = vload##N(0, grad + j * outs + at);                                      \
    UNROLL for (int b = 0; b < BLOCK; b++) g += k->unit[b][j] * d[b];                    \
    vstore##N(g, 0, grad + j * outs + at);                                               \
  }
  IN_VECTORS(OUTPUTS, outs)
}

// Through the last layer and the ReLU into the hidden units.
inline void units_gradient(Block *k, int m, __global const float *second_t) {
  // d_unit = W2 d_out; row c of W2^T: how output c moves the units.  ReLU lets nothing back where
  // it was 0.
#define UNITS(N)                                                                         \
  float##N d[BLOCK];                                                                     \
  UNROLL for (int b = 0; b < BLOCK; b++) d[b] = 0;                                       \
  for (int c = 0; c < OUT[m]; c++) {                                                     \
    const float##N w = vload##N(0, second_t + c * HIDDEN + at);                          \
    UNROLL for (int b = 0; b < BLOCK; b++) d[b] += k->d_out[b][c] * w;                   \
  }                                                                                      \
  UNROLL for (int b = 0; b < BLOCK; b++) {                                               \
    const float##N unit = vload##N(0, k->unit[b] + at), none = 0;                        \
    vstore##N(select(none, d[b], isgreater(unit, none)), 0, k->d_unit[b] + at);          \
  }
  IN_VECTORS(UNITS, HIDDEN)
}

// b1 and W1 of the features (and of the direction).
inline void first_layer_gradient(const Block *k, int m, __global float *grad) {
  __global float *biases = grad + INPUTS * HIDDEN;
  // Only the colour head has seen the direction: the three rows that meet it.
  const int looks = m == COLOR && VIEW_COLOR;
  // db1 (the gradient of the folded bias) and the features' rows of dW1; Psi's rows follow from
  // db1 at the end (control_gradient).
#define INPUTS_OF(N)                                                                     \
  float##N d[BLOCK], sum = vload##N(0, biases + at);                                     \
  UNROLL for (int b = 0; b < BLOCK; b++) { d[b] = vload##N(0, k->d_unit[b] + at); sum += d[b]; } \
  vstore##N(sum, 0, biases + at);                                                        \
  for (int i = 0; i < FEATURES; i++) {                                                   \
    float##N g = vload##N(0, grad + i * HIDDEN + at);                                    \
    UNROLL for (int b = 0; b < BLOCK; b++) g += k->input[b][i] * d[b];                   \
    vstore##N(g, 0, grad + i * HIDDEN + at);                                             \
  }                                                                                      \
  if (looks) {                                                                           \
    __global float *by_direction = grad + DIRECTION_ROW * HIDDEN + at;                   \
    float##N x = vload##N(0, by_direction), y = vload##N(0, by_direction + HIDDEN);      \
    float##N z = vload##N(0, by_direction + 2 * HIDDEN);                                 \
    UNROLL for (int b = 0; b < BLOCK; b++) {                                             \
      x += k->direction[b].x * d[b];                                                     \
      y += k->direction[b].y * d[b];                                                     \
      z += k->direction[b].z * d[b];                                                     \
    }                                                                                    \
    vstore##N(x, 0, by_direction);                                                       \
    vstore##N(y, 0, by_direction + HIDDEN);                                              \
    vstore##N(z, 0, by_direction + 2 * HIDDEN);                                          \
  }
  IN_VECTORS(INPUTS_OF, HIDDEN)
}

// dL / d feature = W1 d, summed over heads.
inline void add_input_gradient(Block *k, __global const float *first_t) {
  // Row j of W1^T: how unit j moves the features.
#define FEATURES_OF(N)                                                                   \
  float##N sum[BLOCK];                                                                   \
  UNROLL for (int b = 0; b < BLOCK; b++) sum[b] = vload##N(0, k->d_input[b] + at);       \
  for (int j = 0; j < HIDDEN; j++) {                                                     \
    const float##N w = vload##N(0, first_t + j * FEATURES + at);                         \
    UNROLL for (int b = 0; b < BLOCK; b++) sum[b] += k->d_unit[b][j] * w;                \
  }                                                                                      \
  UNROLL for (int b = 0; b < BLOCK; b++) vstore##N(sum[b], 0, k->d_input[b] + at);
  IN_VECTORS(FEATURES_OF, FEATURES)
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
        vstore8(vload8(i, k.d_input[b]), i, grad_features + (base + b) * FEATURES);
  }
}
