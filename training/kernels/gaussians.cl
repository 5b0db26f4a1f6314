// Raw outputs of the heads -> Gaussians, forward and backward: the activations of each head.
//
// Defined by networks.py: SPLATS (k an anchor), RAW and OUT_AT0..4 in the order of the heads
// offset, scale, rotation, opacity, colour; FRAMES and BASE_COLORS (1: anchors have such); LIGHT
// (channels of their light: 0, 1 or 3).
// offset = reach * tanh(h) metres     (bounded: culling boxes can rely on it)
// scale  = unit * exp(clip(h, -6, 3)) metres, one sigma
// opacity = tanh(h), below zero absent; colour = sigmoid(h + c + l) with the anchor's base colour c
// and what its light l adds, logits; rotation is left as it comes, wxyz.
// A frame (A, 7) is an anchor's own sizes, as logarithms s, and axes, as a quaternion q of any
// length: mean = anchor + R(q) (exp(s) * offset), scale = exp(s) * scale, rotation = q times it.
// Light (A, LIGHT, 8) changes an anchor's colour by the direction d from the eye to it:
// coefficients of the spherical harmonics of degrees 1 and 2, in units of those of degree 1, so
// that these are x, y and z:  l_c = sum of light_cj Y_j(d), of one channel the same for all three.
// Reads:   raw (A, RAW), anchors (A, 3), frames, base colours, light, the eye; backward the
//          Gaussians' gradients.
// Writes:  means, scales, wxyz, opacity, color; backward grad_raw and gradients of what it read.
// Units:   metres; one sigma; opacity and display sRGB in 0..1.

#include "direction.cl"
#define LOWEST -6.0f
#define HIGHEST 3.0f
#define FRAME 7

typedef struct {
  float3 size;
  float4 turn;  // w, x, y, z of length 1
} Frame;

inline Frame frame_of(int a, __global const float *frames) {
  Frame f = {1.0f, (float4)(1.0f, 0.0f, 0.0f, 0.0f)};
#if FRAMES
  f.size = exp(vload3(0, frames + FRAME * a));
  f.turn = vload4(0, frames + FRAME * a + 3);
  f.turn /= fmax(sqrt(dot(f.turn, f.turn)), 1e-12f);
#endif
  return f;
}

// v turned by a unit quaternion.
inline float3 turned(float4 q, float3 v) {
  float3 u = q.yzw;
  return (q.x * q.x - dot(u, u)) * v + 2.0f * dot(u, v) * u + 2.0f * q.x * cross(u, v);
}

// The rotation b, then a.
inline float4 product(float4 a, float4 b) {
  return (float4)(a.x * b.x - dot(a.yzw, b.yzw),
                  a.x * b.yzw + b.x * a.yzw + cross(a.yzw, b.yzw));
}

inline float4 inverse(float4 q) { return (float4)(q.x, -q.yzw); }

inline float3 base_color(int a, __global const float *colors) {
#if BASE_COLORS
  return vload3(a, colors);
#else
  return 0.0f;
#endif
}

#define HARMONICS 8

// Y_j(d): x, y, z; sqrt(5) (xy, yz, zx); sqrt(5/12) (2 z^2 - x^2 - y^2); sqrt(5/4) (x^2 - y^2).
inline float8 harmonics(float3 d) {
  float3 two = 2.2360680f * d * d.yzx;
  float3 square = d * d;
  return (float8)(d, two, 0.6454972f * (2.0f * square.z - square.x - square.y),
                  1.1180340f * (square.x - square.y));
}

// What the gradient by l is by d, for an anchor's light.
inline float3 harmonics_backward(float8 light, float3 d) {
  float3 two = 2.2360680f * light.s345;
  return light.s012 + two * d.yzx + (two * d).zxy +
         1.2909944f * light.s6 * (float3)(-d.x, -d.y, 2.0f * d.z) +
         2.2360680f * light.s7 * (float3)(d.x, -d.y, 0.0f);
}

inline float sum8(float8 v) {
  float4 half_of = v.lo + v.hi;
  return half_of.x + half_of.y + half_of.z + half_of.w;
}

// What an anchor adds to the logits of all its splats.
inline float3 own_color(int a, float3 eye, __global const float *anchors,
                        __global const float *colors, __global const float *light) {
  float3 sum = base_color(a, colors);
#if LIGHT
  float8 there = harmonics(direction_and_inverse(eye, anchors + 3 * a).xyz);
  float along[LIGHT];
  for (int c = 0; c < LIGHT; c++) along[c] = sum8(vload8(LIGHT * a + c, light) * there);
  sum += (float3)(along[0], along[LIGHT / 2], along[LIGHT - 1]);
#endif
  return sum;
}

__kernel void activate(int splats, float reach, float unit, float eye_x, float eye_y, float eye_z,
                       __global const float *raw, __global const float *anchors,
                       __global const float *frames, __global const float *colors,
                       __global const float *light, __global float *means, __global float *scales,
                       __global float *wxyz, __global float *opacity, __global float *color) {
  int i = get_global_id(0);
  if (!(i < splats)) return;
  int a = i / SPLATS, k = i % SPLATS;
  __global const float *h = raw + a * RAW;
  Frame f = frame_of(a, frames);
  float3 offset = reach * tanh(vload3(k, h + OUT_AT0));
  vstore3(vload3(a, anchors) + turned(f.turn, f.size * offset), i, means);
  vstore3(f.size * unit * exp(clamp(vload3(k, h + OUT_AT1), LOWEST, HIGHEST)), i, scales);
  vstore4(product(f.turn, vload4(k, h + OUT_AT2)), i, wxyz);
  float3 own = own_color(a, (float3)(eye_x, eye_y, eye_z), anchors, colors, light);
  vstore3(1.0f / (1.0f + exp(-(vload3(k, h + OUT_AT4) + own))), i, color);
  opacity[i] = tanh(h[OUT_AT3 + k]);
}

#define PADDED(n) (((n) + 7) / 8 * 8)

// The same for a CPU, one work-item an anchor: its row of raw outputs in vectors of eight.
__kernel void activate_rows(int anchors_count, float reach, float unit, float eye_x, float eye_y,
                            float eye_z, __global const float *raw,
                            __global const float *anchors, __global const float *frames,
                            __global const float *colors, __global const float *light,
                            __global float *means, __global float *scales, __global float *wxyz,
                            __global float *opacity, __global float *color) {
  int a = get_global_id(0);
  if (!(a < anchors_count)) return;
  __global const float *h = raw + a * RAW;
  float3 anchor = vload3(a, anchors);
  Frame f = frame_of(a, frames);
  float offset[PADDED(3 * SPLATS)], scale[PADDED(3 * SPLATS)], shade[PADDED(3 * SPLATS)];
  float solid[PADDED(SPLATS)], base[PADDED(3 * SPLATS)];
  for (int c = 0; c < PADDED(3 * SPLATS) / 8; c++) vstore8(0.0f, c, base);
  float3 own = own_color(a, (float3)(eye_x, eye_y, eye_z), anchors, colors, light);
  for (int k = 0; k < SPLATS * (BASE_COLORS || LIGHT); k++) vstore3(own, k, base);
  for (int c = 0; c < PADDED(3 * SPLATS) / 8; c++) {
    vstore8(reach * tanh(vload8(c, h + OUT_AT0)), c, offset);
    vstore8(unit * exp(clamp(vload8(c, h + OUT_AT1), LOWEST, HIGHEST)), c, scale);
    vstore8(1.0f / (1.0f + exp(-(vload8(c, h + OUT_AT4) + vload8(c, base)))), c, shade);
  }
  for (int c = 0; c < PADDED(SPLATS) / 8; c++) vstore8(tanh(vload8(c, h + OUT_AT3)), c, solid);
  for (int k = 0; k < SPLATS; k++) {
    int i = a * SPLATS + k;
    vstore3(anchor + turned(f.turn, f.size * vload3(k, offset)), i, means);
    vstore3(f.size * vload3(k, scale), i, scales);
    vstore4(product(f.turn, vload4(k, h + OUT_AT2)), i, wxyz);
    opacity[i] = solid[k];
  }
  for (int c = 0; c < 3 * SPLATS; c++) color[3 * SPLATS * a + c] = shade[c];
}

// What the gradient by v turned by a unit quaternion q is by q.
inline float4 turned_backward(float4 q, float3 v, float3 grad) {
  float3 u = q.yzw;
  return (float4)(2.0f * (q.x * dot(v, grad) + dot(cross(u, v), grad)),
                  2.0f * (dot(u, grad) * v + dot(u, v) * grad - dot(v, grad) * u +
                          q.x * cross(v, grad)));
}

// One work-item an anchor: its splats' gradients become the row of raw gradients, and those of the
// means also add up to the anchor's own.
__kernel void activate_backward(int anchors_count, float reach, float unit, float eye_x,
                                float eye_y, float eye_z, __global const float *raw,
                                __global const float *anchors, __global const float *frames,
                                __global const float *light, __global const float *scales,
                                __global const float *opacity, __global const float *color,
                                __global const float *grad_means,
                                __global const float *grad_scales,
                                __global const float *grad_wxyz,
                                __global const float *grad_opacity,
                                __global const float *grad_color, __global float *grad_raw,
                                __global float *grad_anchors, __global float *grad_frames,
                                __global float *grad_colors, __global float *grad_light) {
  int a = get_global_id(0);
  if (!(a < anchors_count)) return;
  __global const float *h = raw + a * RAW;
  __global float *g = grad_raw + a * RAW;
  for (int c = 0; c < RAW; c++) g[c] = 0;
  Frame f = frame_of(a, frames);
  float3 by_anchor = 0, by_size = 0, by_color = 0;
  float4 by_turn = 0;
  float bends[PADDED(3 * SPLATS)];
  for (int c = 0; c < PADDED(3 * SPLATS) / 8; c++)
    vstore8(tanh(vload8(c, h + OUT_AT0)), c, bends);
  for (int k = 0; k < SPLATS; k++) {
    int i = a * SPLATS + k;
    float3 grad = vload3(i, grad_means), bent = vload3(k, bends);
    float3 offset = f.size * reach * bent, own = turned(inverse(f.turn), grad);
    by_anchor += grad;
    vstore3(own * f.size * reach * (1.0f - bent * bent), k, g + OUT_AT0);
    float3 s = vload3(k, h + OUT_AT1), by_scale = vload3(i, grad_scales) * vload3(i, scales);
    vstore3(select((float3)(0.0f), by_scale, s > LOWEST && s < HIGHEST), k, g + OUT_AT1);
    float4 by_wxyz = vload4(i, grad_wxyz);
    vstore4(product(inverse(f.turn), by_wxyz), k, g + OUT_AT2);
    float3 shade = vload3(i, color), by_logit = vload3(i, grad_color) * shade * (1.0f - shade);
    vstore3(by_logit, k, g + OUT_AT4);
    g[OUT_AT3 + k] = grad_opacity[i] * (1.0f - opacity[i] * opacity[i]);
    by_color += by_logit;
    by_size += own * offset + by_scale;
    by_turn += turned_backward(f.turn, offset, grad);
    by_turn += product(by_wxyz, inverse(vload4(k, h + OUT_AT2)));
  }
#if LIGHT
  float4 look = direction_and_inverse((float3)(eye_x, eye_y, eye_z), anchors + 3 * a);
  float8 there = harmonics(look.xyz), mixed = 0;  // the channels' light by their gradients
#if LIGHT == 1
  float by_channel[LIGHT] = {by_color.x + by_color.y + by_color.z};
#else
  float by_channel[LIGHT] = {by_color.x, by_color.y, by_color.z};
#endif
  for (int c = 0; c < LIGHT; c++) {
    vstore8(by_channel[c] * there, LIGHT * a + c, grad_light);
    mixed += by_channel[c] * vload8(LIGHT * a + c, light);
  }
  float3 by_look = harmonics_backward(mixed, look.xyz);
  // Through the division by the distance: what points along the direction does nothing.
  by_anchor += (by_look - look.xyz * dot(by_look, look.xyz)) * look.w;
#endif
  vstore3(by_anchor, a, grad_anchors);
#if FRAMES
  vstore3(by_size, 0, grad_frames + FRAME * a);
  // Through the division by the length: what points along the quaternion does nothing.
  float4 q = vload4(0, frames + FRAME * a + 3);
  by_turn -= f.turn * dot(by_turn, f.turn);
  vstore4(by_turn / fmax(sqrt(dot(q, q)), 1e-12f), 0, grad_frames + FRAME * a + 3);
#endif
#if BASE_COLORS
  vstore3(by_color, a, grad_colors);
#endif
}
