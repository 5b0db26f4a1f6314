// heads_shared: what both forms of the heads share: sizes, the folded bias, the ends of the
// backward pass.
//
// A head's weights lie as W1 [FEATURES + CONTROL + 3][HIDDEN], b1 [HIDDEN], W2 [HIDDEN][OUT],
// b2 [OUT]; the last three rows of W1 meet the view direction, which only the last head (colour)
// takes, and that only with VIEW_COLOR.  CONDITIONED has a bit for each head that sees Psi.  Rows
// that nothing meets and padding are zero, get zero gradients and so stay zero.
//
// Psi is one vector a head for all anchors (paper eq. 6 and 7), so W1_control . Psi + b1 is folded
// into one bias a step; that is exact and halves the first layer.
// Needs:   of networks.py FEATURES, HIDDEN (padded to 8), CONTROL, RAW (row of all raw
//          outputs) and for each head m OUTm (padded width), OUT_ATm (its place in a raw row),
//          WEIGHTS_ATm.
// Reads:   weights, control (Psi a head); grad_chunks.
// Writes:  bias and the transposed layers; grad, the gradient of all weights.
// Units:   anchors in metres; features, Psi and units have none.

#include "direction.cl"
#define DIRECTION_ROW (FEATURES + CONTROL)
#define INPUTS (FEATURES + CONTROL + 3)
#define HIDDEN8 (HIDDEN / 8)
#define FEATURES8 (FEATURES / 8)
// The heads in their order: offset, scale, rotation, opacity, colour.
#define COLOR 4
#define LAST_AT ((INPUTS + 1) * HIDDEN)  // W2 in a head's weights
#define UNITS_OF(a, m) (((long)(a) * 5 + (m)) * HIDDEN)  // in `hidden`
// The arguments of both forms of heads_forward, in this order.
#define HEADS_FORWARD_TAKES                                                                  \
  int anchors_count, float eye_x, float eye_y, float eye_z, __global const float *weights,   \
      __global const float *bias, __global const float *anchors,                             \
      __global const float *features, __global float *hidden, __global float *raw

__constant int OUT[5] = {OUT0, OUT1, OUT2, OUT3, OUT4};
__constant int OUT_AT[5] = {OUT_AT0, OUT_AT1, OUT_AT2, OUT_AT3, OUT_AT4};
__constant int WEIGHTS_AT[5] = {WEIGHTS_AT0, WEIGHTS_AT1, WEIGHTS_AT2, WEIGHTS_AT3, WEIGHTS_AT4};

// One work-item a hidden unit of a head: the folded bias, and both layers transposed, so that the
// backward kernel never sums across a vector.
__kernel void prepare_weights(__global const float *weights, __global const float *control,
                              __global float *bias, __global float *first_t,
                              __global float *second_t) {
  int m = get_global_id(0) / HIDDEN, j = get_global_id(0) % HIDDEN;
  __global const float *first = weights + WEIGHTS_AT[m];
  __global const float *second = first + LAST_AT;
  // b1 + W1_control . Psi.
  float sum = first[INPUTS * HIDDEN + j];
  if (CONDITIONED >> m & 1)
    for (int d = 0; d < CONTROL; d++)
      sum += control[m * CONTROL + d] * first[(FEATURES + d) * HIDDEN + j];
  bias[m * HIDDEN + j] = sum;
  // Transposed: neighbouring inputs of one unit lie side by side.
  for (int i = 0; i < FEATURES; i++)
    first_t[(m * HIDDEN + j) * FEATURES + i] = first[i * HIDDEN + j];
  for (int c = 0; c < OUT[m]; c++)
    second_t[OUT_AT[m] * HIDDEN + c * HIDDEN + j] = second[j * OUT[m] + c];
}

// The shares of a weight's gradient, always in the same order.
__kernel void sum_chunks(int chunks, __global const float *grad_chunks, __global float *grad) {
  int i = get_global_id(0);
  if (!(i < WEIGHTS)) return;
  float sum = 0;
  for (int c = 0; c < chunks; c++) sum += grad_chunks[(long)c * WEIGHTS + i];
  grad[i] = sum;
}

// The rows of W1 that meet Psi: each is Psi[d] times the gradient of the bias it was folded into.
__kernel void control_gradient(__global const float *control, __global float *grad) {
  int m = get_global_id(0) / HIDDEN, j = get_global_id(0) % HIDDEN;
  __global float *first = grad + WEIGHTS_AT[m];
  for (int d = 0; d < CONTROL; d++)
    first[(FEATURES + d) * HIDDEN + j] =
        CONDITIONED >> m & 1 ? control[m * CONTROL + d] * first[INPUTS * HIDDEN + j] : 0.0f;
}
