// Raw outputs of the heads -> Gaussians, forward and backward: the activations of each head.
//
// Defined by networks.py: SPLATS (k an anchor), RAW and OUT_AT0..4 in the order of the heads
// offset, scale, rotation, opacity, colour.
// offset = reach * tanh(h) metres     (bounded: culling boxes can rely on it)
// scale  = unit * exp(clip(h, -6, 3)) metres, one sigma
// opacity = tanh(h), below zero absent; colour = sigmoid(h); rotation is left as it comes, wxyz.
// Reads:   raw (A, RAW), anchors (A, 3); backward the Gaussians and their gradients.
// Writes:  means, scales, wxyz, opacity, color; backward grad_raw and grad_anchors.
// Units:   metres; one sigma; opacity and display sRGB in 0..1.

#define LOWEST -6.0f
#define HIGHEST 3.0f

__kernel void activate(int splats, float reach, float unit, __global const float *raw,
                       __global const float *anchors, __global float *means,
                       __global float *scales, __global float *wxyz, __global float *opacity,
                       __global float *color) {
  int i = get_global_id(0);
  if (!(i < splats)) return;
  int a = i / SPLATS, k = i % SPLATS;
  __global const float *h = raw + a * RAW;
  for (int c = 0; c < 3; c++) {
    means[3 * i + c] = anchors[3 * a + c] + reach * tanh(h[OUT_AT0 + 3 * k + c]);
    scales[3 * i + c] = unit * exp(clamp(h[OUT_AT1 + 3 * k + c], LOWEST, HIGHEST));
    color[3 * i + c] = 1.0f / (1.0f + exp(-h[OUT_AT4 + 3 * k + c]));
  }
  for (int c = 0; c < 4; c++) wxyz[4 * i + c] = h[OUT_AT2 + 4 * k + c];
  opacity[i] = tanh(h[OUT_AT3 + k]);
}

#define PADDED(n) (((n) + 7) / 8 * 8)

// The same for a CPU, one work-item an anchor: its row of raw outputs in vectors of eight.
__kernel void activate_rows(int anchors_count, float reach, float unit, __global const float *raw,
                            __global const float *anchors, __global float *means,
                            __global float *scales, __global float *wxyz,
                            __global float *opacity, __global float *color) {
  int a = get_global_id(0);
  if (!(a < anchors_count)) return;
  __global const float *h = raw + a * RAW;
  float3 anchor = vload3(a, anchors);
  float offset[PADDED(3 * SPLATS)], scale[PADDED(3 * SPLATS)], shade[PADDED(3 * SPLATS)];
  float solid[PADDED(SPLATS)];
  for (int c = 0; c < PADDED(3 * SPLATS) / 8; c++) {
    vstore8(reach * tanh(vload8(c, h + OUT_AT0)), c, offset);
    vstore8(unit * exp(clamp(vload8(c, h + OUT_AT1), LOWEST, HIGHEST)), c, scale);
    vstore8(1.0f / (1.0f + exp(-vload8(c, h + OUT_AT4))), c, shade);
  }
  for (int c = 0; c < PADDED(SPLATS) / 8; c++) vstore8(tanh(vload8(c, h + OUT_AT3)), c, solid);
  for (int k = 0; k < SPLATS; k++) vstore3(anchor + vload3(k, offset), a * SPLATS + k, means);
  for (int c = 0; c < 3 * SPLATS; c++) scales[3 * SPLATS * a + c] = scale[c];
  for (int c = 0; c < 3 * SPLATS; c++) color[3 * SPLATS * a + c] = shade[c];
  for (int c = 0; c < 4 * SPLATS; c++) wxyz[4 * SPLATS * a + c] = h[OUT_AT2 + c];
  for (int k = 0; k < SPLATS; k++) opacity[a * SPLATS + k] = solid[k];
}

// One work-item an anchor: its splats' gradients become the row of raw gradients, and those of the
// means also add up to the anchor's own.
__kernel void activate_backward(int anchors_count, float reach, float unit,
                                __global const float *raw, __global const float *scales,
                                __global const float *opacity, __global const float *color,
                                __global const float *grad_means,
                                __global const float *grad_scales,
                                __global const float *grad_wxyz,
                                __global const float *grad_opacity,
                                __global const float *grad_color, __global float *grad_raw,
                                __global float *grad_anchors) {
  int a = get_global_id(0);
  if (!(a < anchors_count)) return;
  __global const float *h = raw + a * RAW;
  __global float *g = grad_raw + a * RAW;
  for (int c = 0; c < RAW; c++) g[c] = 0;
  float3 anchor = 0;
  float bends[PADDED(3 * SPLATS)];
  for (int c = 0; c < PADDED(3 * SPLATS) / 8; c++)
    vstore8(tanh(vload8(c, h + OUT_AT0)), c, bends);
  for (int k = 0; k < SPLATS; k++) {
    int i = a * SPLATS + k;
    anchor += vload3(i, grad_means);
    for (int c = 0; c < 3; c++) {
      float bent = bends[3 * k + c], s = h[OUT_AT1 + 3 * k + c];
      float shade = color[3 * i + c];
      g[OUT_AT0 + 3 * k + c] = grad_means[3 * i + c] * reach * (1.0f - bent * bent);
      g[OUT_AT1 + 3 * k + c] =
          (s > LOWEST && s < HIGHEST) ? grad_scales[3 * i + c] * scales[3 * i + c] : 0.0f;
      g[OUT_AT4 + 3 * k + c] = grad_color[3 * i + c] * shade * (1.0f - shade);
    }
    for (int c = 0; c < 4; c++) g[OUT_AT2 + 4 * k + c] = grad_wxyz[4 * i + c];
    g[OUT_AT3 + k] = grad_opacity[i] * (1.0f - opacity[i] * opacity[i]);
  }
  vstore3(anchor, a, grad_anchors);
}
