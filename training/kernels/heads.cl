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

// What four rows `in` of `takes` numbers add to two vectors of a layer's outputs, and to one: with
// two there are enough sums on their way to hide how long each multiply-add takes.
inline void add_pair(float8 sum[4][2], const float *in, int stride, int takes,
                     __global const float *weights, int gives) {
  for (int i = 0; i < takes; i++) {
    float8 low = vload8(0, weights + i * gives), high = vload8(1, weights + i * gives);
    for (int b = 0; b < 4; b++) {
      sum[b][0] += in[b * stride + i] * low;
      sum[b][1] += in[b * stride + i] * high;
    }
  }
}

// The last vector of a layer with an odd number of them.
inline void add_one(float8 sum[4][2], const float *in, int stride, int takes,
                    __global const float *weights, int gives) {
  for (int i = 0; i < takes; i++) {
    float8 w = vload8(0, weights + i * gives);
    for (int b = 0; b < 4; b++) sum[b][0] += in[b * stride + i] * w;
  }
}

// One work-item four anchors: every weight row is loaded once for the four.
__kernel void heads_forward(int anchors_count, float eye_x, float eye_y, float eye_z,
                            __global const float *weights, __global const float *bias,
                            __global const float *anchors, __global const float *features,
                            __global float *hidden, __global float *raw) {
  int first_anchor = get_global_id(0) * 4;
  if (!(first_anchor < anchors_count)) return;
  float3 eye = (float3)(eye_x, eye_y, eye_z);
  int a[4];
  // Private copies: read again for every pair of output vectors of every head.
  float feature[4][FEATURES], direction[4][3];
  for (int b = 0; b < 4; b++) {
    a[b] = min(first_anchor + b, anchors_count - 1);  // the last ones repeat and write the same
    for (int i = 0; i < FEATURES; i++) feature[b][i] = features[a[b] * FEATURES + i];
    // The direction delta of paper eq. 4.
    float4 d = direction_and_inverse(eye, anchors + 3 * a[b]);
    direction[b][0] = d.x; direction[b][1] = d.y; direction[b][2] = d.z;
  }
  // Offset, scale, rotation, opacity, colour, one after the other: one head's weights at a time
  // are in the cache.
  for (int m = 0; m < 5; m++) {
    __global const float *first = weights + WEIGHTS_AT[m];
    // A head's weights: W1, b1, W2, b2 (heads_shared.cl).
    __global const float *second = first + LAST_AT;
    // Units of four anchors.
    float unit[4][HIDDEN];
    for (int j = 0; j < HIDDEN8; j += 2) {
      // Only the colour looks at the direction.
      int wide = min(2, HIDDEN8 - j), looks = m == COLOR && VIEW_COLOR ? 3 : 0;
      // Columns 8 j and on of the rows of W1 that meet the features, and of those that meet delta.
      __global const float *by_feature = first + 8 * j;
      __global const float *by_direction = by_feature + DIRECTION_ROW * HIDDEN;
      float8 h[4][2];
      for (int b = 0; b < 4; b++)
        // b1 with W1_control . Psi in it: Psi costs nothing an anchor.
        for (int v = 0; v < wide; v++) h[b][v] = vload8(j + v, bias + m * HIDDEN);
      if (wide == 2) {
        add_pair(h, feature[0], FEATURES, FEATURES, by_feature, HIDDEN);
        add_pair(h, direction[0], 3, looks, by_direction, HIDDEN);
      } else {
        add_one(h, feature[0], FEATURES, FEATURES, by_feature, HIDDEN);
        add_one(h, direction[0], 3, looks, by_direction, HIDDEN);
      }
      for (int b = 0; b < 4; b++)
        for (int v = 0; v < wide; v++) {
          float8 y = fmax(h[b][v], (float8)(0.0f));
          vstore8(y, j + v, unit[b]);
          vstore8(y, j + v, hidden + UNITS_OF(a[b], m));
        }
    }
    // The last layer: linear, as wide as the head's outputs of k splats.
    int outs = OUT[m];
    for (int c = 0; c < outs / 8; c += 2) {
      int wide = min(2, outs / 8 - c);
      // From b2 on, which lies behind W2.
      float8 y[4][2];
      for (int b = 0; b < 4; b++)
        for (int v = 0; v < wide; v++) y[b][v] = vload8(c + v, second + HIDDEN * outs);
      if (wide == 2) add_pair(y, unit[0], HIDDEN, HIDDEN, second + 8 * c, outs);
      else add_one(y, unit[0], HIDDEN, HIDDEN, second + 8 * c, outs);
      for (int b = 0; b < 4; b++)
        for (int v = 0; v < wide; v++) vstore8(y[b][v], c + v, raw + a[b] * RAW + OUT_AT[m]);
    }
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
inline void second_layer_gradient(Block *k, int outs, __global float *grad) {
  for (int c = 0; c < outs / 8; c++) {
    // db2 = sum of d, dW2 = sum of unit d, over the block's anchors.
    float8 d[BLOCK], sum = vload8(c, grad + HIDDEN * outs);
    for (int b = 0; b < BLOCK; b++) { d[b] = vload8(c, k->d_out[b]); sum += d[b]; }
    vstore8(sum, c, grad + HIDDEN * outs);
    for (int j = 0; j < HIDDEN; j++) {
      // Row j of W2, for all of the block's anchors: one load and store of the gradient for eight.
      float8 g = vload8(c, grad + j * outs);
      for (int b = 0; b < BLOCK; b++) g += k->unit[b][j] * d[b];
      vstore8(g, c, grad + j * outs);
    }
  }
}

// Through the last layer and the ReLU into the hidden units.
inline void units_gradient(Block *k, int m, __global const float *second_t) {
  for (int j = 0; j < HIDDEN8; j++) {
    // Eight hidden units of every anchor in the block.
    float8 d[BLOCK];
    for (int b = 0; b < BLOCK; b++) d[b] = 0;
    // d_unit = W2 d_out.
    for (int c = 0; c < OUT[m]; c++) {
      // Row c of W2^T: how output c moves the units.
      float8 w = vload8(j, second_t + c * HIDDEN);
      for (int b = 0; b < BLOCK; b++) d[b] += k->d_out[b][c] * w;
    }
    for (int b = 0; b < BLOCK; b++) {
      // ReLU lets nothing back where it was 0.
      d[b] = select((float8)(0.0f), d[b], isgreater(vload8(j, k->unit[b]), (float8)(0.0f)));
      vstore8(d[b], j, k->d_unit[b]);
    }
  }
}

// b1 and W1 of the features (and of the direction).
inline void first_layer_gradient(Block *k, int m, __global float *grad) {
  for (int j = 0; j < HIDDEN8; j++) {
    // db1 and the features' rows of dW1; Psi's rows follow from db1 at the end (control_gradient).
    float8 d[BLOCK], sum = vload8(j, grad + INPUTS * HIDDEN);
    for (int b = 0; b < BLOCK; b++) { d[b] = vload8(j, k->d_unit[b]); sum += d[b]; }
    // The gradient of the folded bias.
    vstore8(sum, j, grad + INPUTS * HIDDEN);
    for (int i = 0; i < FEATURES; i++) {
      float8 g = vload8(j, grad + i * HIDDEN);
      for (int b = 0; b < BLOCK; b++) g += k->input[b][i] * d[b];
      vstore8(g, j, grad + i * HIDDEN);
    }
    // Only the colour head has seen the direction.
    if (!(m == COLOR && VIEW_COLOR)) continue;
    for (int i = 0; i < 3; i++) {
      float8 g = vload8(j, grad + (DIRECTION_ROW + i) * HIDDEN);
      for (int b = 0; b < BLOCK; b++) {
        // The three rows that meet the direction.
        float4 u = k->direction[b];
        g += (i == 0 ? u.x : i == 1 ? u.y : u.z) * d[b];
      }
      vstore8(g, j, grad + (DIRECTION_ROW + i) * HIDDEN);
    }
  }
}

// dL / d feature = W1 d, summed over heads.
inline void add_input_gradient(Block *k, __global const float *first_t) {
  for (int j = 0; j < HIDDEN; j++)
    for (int i = 0; i < FEATURES8; i++) {
      // Row j of W1^T: how unit j moves the features.
      float8 w = vload8(i, first_t + j * FEATURES);
      for (int b = 0; b < BLOCK; b++) k->d_input[b][i] += k->d_unit[b][j] * w;
    }
}

// The colour's view direction turns when its anchor moves:
// d direction / d anchor = (I - u u^T) / r
inline void add_direction_gradient(Block *k, int base, int count, __global const float *first,
                                   __global float *grad_anchors) {
  for (int b = 0; b < count; b++) {
    float g[3];
    for (int i = 0; i < 3; i++) {
      // dL / d direction by the three rows of W1.
      g[i] = 0;
      for (int j = 0; j < HIDDEN; j++)
        g[i] += k->d_unit[b][j] * first[(DIRECTION_ROW + i) * HIDDEN + j];
    }
    // What is along the direction changes its length alone, and that is always 1.
    float3 u = k->direction[b].xyz, by_direction = (float3)(g[0], g[1], g[2]);
    float3 flow = (by_direction - u * dot(by_direction, u)) * k->direction[b].w;
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
