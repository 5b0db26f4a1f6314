// heads_gpu: the five heads for many small work-items; inputs and outputs are those of heads.cl.
// Neighbouring items are neighbouring anchors of one head, so that they read the same weight at
// once.  Gradients of weights are matrix products over all anchors: a group owns SIDE x SIDE
// weights and one of `splits` shares of the anchors ("split K"), and sum_chunks adds up the shares
// in a fixed order. No atomics, no subgroups, the same bits for any number of compute units.
// Reads:   weights, bias, anchors (A, 3), features (A, FEATURES), the eye; backward hidden and
//          grad_raw.
// Writes:  raw (A, RAW), hidden (A, 5, HIDDEN); backward gradients of units, features,
//          anchors and, a split each, of weights.
// Units:   anchors and eye in metres; features, Psi and units have none.
#include "heads_shared.cl"
#define SIDE 16

// One work-item a head of an anchor: F of (f, delta, Psi), paper eq. 5.
__kernel void heads_forward(HEADS_FORWARD_TAKES) {
  const int m = get_global_id(0) / anchors_count, a = get_global_id(0) % anchors_count;
  if (!(m < 5)) return;
  __global const float *layer = weights + WEIGHTS_AT[m];
  float unit[HIDDEN];
  // From the bias, which Psi is folded into, on: one row of W1 an input.
  for (int j = 0; j < HIDDEN; j++) unit[j] = bias[m * HIDDEN + j];
  for (int i = 0; i < FEATURES; i++) {
    // One feature, times its row of W1.
    const float value = features[(long)a * FEATURES + i];
    for (int j = 0; j < HIDDEN; j++) unit[j] += value * layer[i * HIDDEN + j];
  }
  // Only colour depends on where it is seen from.
  if (m == COLOR && VIEW_COLOR) {
    const float4 d = direction_and_inverse((float3)(eye_x, eye_y, eye_z), anchors + 3 * a);
    __global const float *rows = layer + DIRECTION_ROW * HIDDEN;
    for (int j = 0; j < HIDDEN; j++)
      unit[j] += d.x * rows[j] + d.y * rows[HIDDEN + j] + d.z * rows[2 * HIDDEN + j];
  }
  for (int j = 0; j < HIDDEN; j++) {
    // ReLU; kept for the backward pass.
    unit[j] = fmax(unit[j], 0.0f);
    hidden[UNITS_OF(a, m) + j] = unit[j];
  }
  // The last layer is linear: activations are those of gaussians.cl.
  __global const float *last = weights + WEIGHTS_AT[m] + LAST_AT;
  const int outs = OUT[m];
  for (int c = 0; c < outs; c++) {
    // b2, then a column of W2.
    float y = last[HIDDEN * outs + c];
    for (int j = 0; j < HIDDEN; j++) y += unit[j] * last[j * outs + c];
    raw[(long)a * RAW + OUT_AT[m] + c] = y;
  }
}

// Gradients by what goes into each ReLU, laid out as `hidden`.  grad_anchors already holds the
// gradient through the means and gets that of the colour's view direction added.
__kernel void units_gradient(int anchors_count, float eye_x, float eye_y, float eye_z,
                             __global const float *weights, __global const float *second_t,
                             __global const float *anchors,
                             __global const float *hidden, __global const float *grad_raw,
                             __global float *grad_units, __global float *grad_anchors) {
  const int m = get_global_id(0) / anchors_count, a = get_global_id(0) % anchors_count;
  if (!(m < 5)) return;
  float d[HIDDEN];
  for (int j = 0; j < HIDDEN; j++) d[j] = 0;
  // dL / d unit = W2 dL / d raw, by the transposed W2.
  for (int c = 0; c < OUT[m]; c++) {
    const float by = grad_raw[(long)a * RAW + OUT_AT[m] + c];
    for (int j = 0; j < HIDDEN; j++) d[j] += by * second_t[(OUT_AT[m] + c) * HIDDEN + j];
  }
  for (int j = 0; j < HIDDEN; j++) {
    // ReLU lets nothing back where it was 0.
    if (!(hidden[UNITS_OF(a, m) + j] > 0)) d[j] = 0;
    // What the weights' gradients are made of, and the features'.
    grad_units[UNITS_OF(a, m) + j] = d[j];
  }
  if (!(m == COLOR && VIEW_COLOR)) return;
  // The direction turns when its anchor moves: d direction / d anchor = (I - u u^T) / r.
  const float4 u = direction_and_inverse((float3)(eye_x, eye_y, eye_z), anchors + 3 * a);
  __global const float *rows = weights + WEIGHTS_AT[m] + DIRECTION_ROW * HIDDEN;
  // dL / d direction by the three rows of W1.
  float3 by_direction = 0;
  for (int j = 0; j < HIDDEN; j++)
    by_direction += d[j] * (float3)(rows[j], rows[HIDDEN + j], rows[2 * HIDDEN + j]);
  // Then through the direction's length: what is along it changes nothing.
  const float3 flow = (by_direction - u.xyz * dot(by_direction, u.xyz)) * u.w;
  vstore3(vload3(a, grad_anchors) + flow, a, grad_anchors);
}

// One work-item a feature of an anchor: what all heads say, in their order.
__kernel void features_gradient(int anchors_count, __global const float *first_t,
                                __global const float *grad_units,
                                __global float *grad_features) {
  const int a = get_global_id(0) / FEATURES, i = get_global_id(0) % FEATURES;
  if (!(a < anchors_count)) return;
  // All five heads, all hidden units: dL/df = sum of W1 d.
  float sum = 0;
  for (int m = 0; m < 5; m++)
    for (int j = 0; j < HIDDEN; j++)
      sum += grad_units[UNITS_OF(a, m) + j] * first_t[(m * HIDDEN + j) * FEATURES + i];
  grad_features[(long)a * FEATURES + i] = sum;
}

// Input i of layer l (0 or 1) of head m, where the bias stands for a last input of 1.  Psi is left
// out: control_gradient writes its rows.
inline float input_of(int m, int l, int a, int i, float3 eye, __global const float *anchors,
                      __global const float *features, __global const float *hidden) {
  // The last layer takes the hidden units.
  if (l > 0) return i < HIDDEN ? hidden[UNITS_OF(a, m) + i] : i == HIDDEN ? 1.0f : 0.0f;
  if (i < FEATURES) return features[(long)a * FEATURES + i];
  if (i == INPUTS) return 1.0f;
  if (i < DIRECTION_ROW || i > INPUTS || !(m == COLOR && VIEW_COLOR)) return 0.0f;
  // The direction is computed anew instead of stored: three floats an anchor.
  const float4 u = direction_and_inverse(eye, anchors + 3 * a);
  return i == DIRECTION_ROW ? u.x : i == DIRECTION_ROW + 1 ? u.y : u.z;
}

// jobs: head, layer, first input, first output of each block of weights; a group is job * splits +
// split.  grad_chunks (splits, WEIGHTS): every weight of every split is written.
__kernel __attribute__((reqd_work_group_size(SIDE *SIDE, 1, 1))) void weights_gradient(
    int anchors_count, int splits, float eye_x, float eye_y, float eye_z,
    __global const int *jobs, __global const float *anchors, __global const float *features,
    __global const float *hidden, __global const float *grad_units,
    __global const float *grad_raw, __global float *grad_chunks) {
  // A block of SIDE anchors' inputs and of their flows, for SIDE x SIDE products.
  __local float inputs[SIDE * SIDE], flows[SIDE * SIDE];
  const int split = get_group_id(0) % splits, job = get_group_id(0) / splits;
  const int m = jobs[4 * job], l = jobs[4 * job + 1];
  const int row = get_local_id(0) / SIDE, column = get_local_id(0) % SIDE;
  const int first_i = jobs[4 * job + 2], first_j = jobs[4 * job + 3];
  // What the layer takes and gives: the first takes the inputs, the last gives the raw outputs.
  const int takes = l == 0 ? INPUTS : HIDDEN, gives = l == 1 ? OUT[m] : HIDDEN;
  const int from = (long)anchors_count * split / splits;
  const int to = (long)anchors_count * (split + 1) / splits;
  const float3 eye = (float3)(eye_x, eye_y, eye_z);
  float sum = 0;
  for (int base = from; base < to; base += SIDE) {
    const int a = base + row, j = first_j + column;  // here a row is an anchor
    float input = 0, flow = 0;
    if (a < to) {
      input = input_of(m, l, a, first_i + column, eye, anchors, features, hidden);
      if (j < gives)
        flow = l == 1 ? grad_raw[(long)a * RAW + OUT_AT[m] + j] : grad_units[UNITS_OF(a, m) + j];
    }
    // Each item fetches one input and one flow, and uses sixteen of both.
    inputs[row * SIDE + column] = input;
    flows[row * SIDE + column] = flow;
    barrier(CLK_LOCAL_MEM_FENCE);
    // dW = sum over anchors of input times flow.
    for (int k = 0; k < SIDE; k++) sum += inputs[k * SIDE + row] * flows[k * SIDE + column];
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  const int i = first_i + row, j = first_j + column;
  // i == takes is the bias, whose input is 1.
  if (!(i <= takes && j < gives)) return;
  // Where the layer lies in a head's weights (heads_shared.cl).
  const int layer_at = l == 0 ? 0 : LAST_AT;
  grad_chunks[(long)split * WEIGHTS + WEIGHTS_AT[m] + layer_at + i * gives + j] = sum;
}
