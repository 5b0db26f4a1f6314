// plain: plain splats: what the optimiser holds -> Gaussians, and back; and what densification
// decides on.  The activations of 3DGS:
//  scale = exp(h) metres, opacity = sigmoid(h), rotation as it comes, wxyz;
//  colour = max(0, 0.5 + sum of basis(mean - eye) * coefficient), basis and signs of 3DGS.
// Needs:   REST = 0, 3, 8 or 15 coefficients after the first, from plain_step.py.  Of those the
//          first `used` count (a degree is switched on after the other); the others get a gradient
//          of 0.
// Reads:   means, log scales, logits, base and rest coefficients; backward the Gaussians and
//          gradients.
// Writes:  scales, opacity, color; backward the gradients in place; stats (N, 2).
// Units:   metres; opacity 0..1; display sRGB from 0 on.

// Constants of the real spherical harmonics, by degree: C0 = 1 / (2 sqrt(pi)), C1 = sqrt(3 / (4
// pi)), and so on.
#define C0 0.28209479177387814f
#define C1 0.4886025119029199f
#define C2 1.0925484305920792f
#define C2_ZZ 0.31539156525252005f
#define C2_XX 0.5462742152960396f
#define C3_A 0.5900435899266435f
#define C3_B 2.890611442640554f
#define C3_D 0.4570457994644658f
#define C3_E 0.3731763325901154f
#define C3_F 1.445305721320277f

// Values of the basis but the first at a unit direction.
inline void basis_at(float x, float y, float z, float *b) {
#if REST > 0
  // Degree 1, in 3DGS's order and with its signs: -y, z, -x.
  b[0] = -C1 * y;
  b[1] = C1 * z;
  b[2] = -C1 * x;
#endif
#if REST > 3
  // Products that several functions share.
  float xx = x * x, yy = y * y, zz = z * z;
  // Degree 2.
  b[3] = C2 * x * y;
  b[4] = -C2 * y * z;
  b[5] = C2_ZZ * (2 * zz - xx - yy);
  b[6] = -C2 * x * z;
  b[7] = C2_XX * (xx - yy);
#endif
#if REST > 8
  // Degree 3.
  b[8] = -C3_A * y * (3 * xx - yy);
  b[9] = C3_B * x * y * z;
  b[10] = -C3_D * y * (4 * zz - xx - yy);
  b[11] = C3_E * z * (2 * zz - 3 * xx - 3 * yy);
  b[12] = -C3_D * x * (4 * zz - xx - yy);
  b[13] = C3_F * z * (xx - yy);
  b[14] = -C3_A * x * (xx - 3 * yy);
#endif
}

// Sum of g[i] * d basis[i] / d (x, y, z); what of it points along the direction means nothing.
inline float3 basis_backward(float x, float y, float z, const float *g) {
  float3 d = 0;
#if REST > 0
  // Each line is the gradient of one or two basis functions by (x, y, z), as polynomials.
  d += (float3)(-C1 * g[2], -C1 * g[0], C1 * g[1]);
#endif
#if REST > 3
  float xx = x * x, yy = y * y, zz = z * z;
  d += C2 * (float3)(y * g[3] - z * g[6], x * g[3] - z * g[4], -y * g[4] - x * g[6]);
  d += 2 * C2_ZZ * g[5] * (float3)(-x, -y, 2 * z) + 2 * C2_XX * g[7] * (float3)(x, -y, 0);
#endif
#if REST > 8
  d += -3 * C3_A * g[8] * (float3)(2 * x * y, xx - yy, 0);
  d += C3_B * g[9] * (float3)(y * z, x * z, x * y);
  d += -C3_D * g[10] * (float3)(-2 * x * y, 4 * zz - xx - 3 * yy, 8 * y * z);
  d += C3_E * g[11] * (float3)(-6 * x * z, -6 * y * z, 6 * zz - 3 * xx - 3 * yy);
  d += -C3_D * g[12] * (float3)(4 * zz - 3 * xx - yy, -2 * x * y, 8 * x * z);
  d += C3_F * g[13] * (float3)(2 * x * z, -2 * y * z, xx - yy);
  d += -3 * C3_A * g[14] * (float3)(xx - yy, -2 * x * y, 0);
#endif
  return d;
}

__kernel void activate(int count, int used, float eye_x, float eye_y, float eye_z,
                       __global const float *means, __global const float *log_scales,
                       __global const float *logits, __global const float *base,
                       __global const float *rest, __global float *scales,
                       __global float *opacity, __global float *color) {
  int i = get_global_id(0);
  if (!(i < count)) return;
  // exp and the sigmoid keep scales above 0 and opacities within 0..1.
  for (int c = 0; c < 3; c++) scales[3 * i + c] = exp(log_scales[3 * i + c]);
  opacity[i] = 1.0f / (1.0f + exp(-logits[i]));
  // Degree 0: 3DGS stores colours less a half.
  float3 shade = 0.5f + C0 * vload3(i, base);
#if REST > 0
  float3 v = vload3(i, means) - (float3)(eye_x, eye_y, eye_z);
  // Finite where the eye lies in the mean.
  v /= fmax(sqrt(dot(v, v)), 1e-12f);
  float b[REST];
  // Degree by degree, as far as they are in use.
  basis_at(v.x, v.y, v.z, b);
  for (int k = 0; k < used; k++) shade += b[k] * vload3(REST * i + k, rest);
#endif
  // Not fmax: that turns NaN into a fine black, and a broken splat has to be seen to be broken.
  for (int c = 0; c < 3; c++) {
    // One channel; OpenCL C has no index into a float3.
    float value = c == 0 ? shade.x : (c == 1 ? shade.y : shade.z);
    color[3 * i + c] = value < 0 ? 0.0f : value;
  }
}

// In place: what stands in grad_scales, grad_opacity and grad_color are gradients by Gaussians;
// they become those by logarithm, logit and first coefficient, grad_rest is written, and to
// grad_means is added what comes through the direction.
__kernel void activate_backward(int count, int used, float eye_x, float eye_y, float eye_z,
                                __global const float *means, __global const float *rest,
                                __global const float *scales, __global const float *opacity,
                                __global const float *color, __global float *grad_means,
                                __global float *grad_scales, __global float *grad_opacity,
                                __global float *grad_color, __global float *grad_rest) {
  int i = get_global_id(0);
  if (!(i < count)) return;
  // dL/dh = dL/dscale scale, as scale = exp(h).
  for (int c = 0; c < 3; c++) grad_scales[3 * i + c] *= scales[3 * i + c];
  // exp' = exp, sigmoid' = s (1 - s).
  grad_opacity[i] *= opacity[i] * (1.0f - opacity[i]);
  float3 shade = vload3(i, color), g = vload3(i, grad_color);
  // max(0, .) passes a gradient on only where it is above 0.
  g = (float3)(shade.x > 0 ? g.x : 0.0f, shade.y > 0 ? g.y : 0.0f, shade.z > 0 ? g.z : 0.0f);
  // The first coefficient's basis function is the constant C0.
  vstore3(C0 * g, i, grad_color);
#if REST > 0
  float3 v = vload3(i, means) - (float3)(eye_x, eye_y, eye_z);
  // 1 / distance: by as much a step of the mean turns the direction.
  float per = 1.0f / fmax(sqrt(dot(v, v)), 1e-12f);
  v *= per;
  float b[REST], grad_b[REST];
  basis_at(v.x, v.y, v.z, b);
  for (int k = 0; k < REST; k++) {
    // Degrees that are not in use yet neither give nor get.
    float on = k < used ? 1.0f : 0.0f;
    // By the basis function for the direction, and by its coefficient.
    grad_b[k] = on * dot(g, vload3(REST * i + k, rest));
    vstore3(on * b[k] * g, REST * i + k, grad_rest);
  }
  float3 d = basis_backward(v.x, v.y, v.z, grad_b);
  // The mean turns the direction v: dv / dmean = (I - v v^T) / distance.
  vstore3(vload3(i, grad_means) + per * (d - dot(d, v) * v), i, grad_means);
#endif
}

// stats (N, 2): sum of a splat's screen gradient in half image widths, and the steps in which it
// was on screen.
__kernel void accumulate(int count, float half_width, __global const float *record,
                         __global const float *grad_record, __global float *stats) {
  int i = get_global_id(0);
  if (!(i < count)) return;
  // A splat that was not on the screen says nothing about itself.
  if (!(record[12 * i + 9] > 0)) return;  // culled
  // 3DGS's criterion: the norm of the 2D mean's gradient, in units that do not depend on
  // resolution.
  float x = grad_record[12 * i], y = grad_record[12 * i + 1];
  stats[2 * i] += sqrt(x * x + y * y) * half_width;
  // The mean over the steps in which it was seen is what is compared with the threshold.
  stats[2 * i + 1] += 1;
}
