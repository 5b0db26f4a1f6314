// Which anchors a view can show: see step.py.  One work-item an anchor.
// Reads:   anchors (A, 3), their splats' means, scales and opacity; camera (common/camera.cl).
// Writes:  reach (A,) of what a step ran; seen (A,) bytes.
// Units:   metres; one sigma; opacity 0..1; pixels.
#include "common/camera.cl"

// How far from its anchor the splats that are not absent are drawn, metres; -1: all are absent.
// A splat of opacity o ends at sqrt(2 ln(o / least_alpha)) of its sigmas.
__kernel void measure_reach(int rows_count, int splats, float least_alpha,
                            __global const int *rows, __global const float *anchors,
                            __global const float *means, __global const float *scales,
                            __global const float *opacity, __global float *reach) {
  int i = get_global_id(0);
  if (!(i < rows_count)) return;
  float3 anchor = vload3(i, anchors);
  float farthest = -1;
  for (int k = i * splats; k < (i + 1) * splats; k++) {
    if (!(opacity[k] > least_alpha)) continue;
    float3 away = vload3(k, means) - anchor, s = vload3(k, scales);
    float sigma = fmax(s.x, fmax(s.y, s.z));
    farthest = fmax(farthest, sqrt(dot(away, away)) +
                                  sigma * sqrt(2.0f * log(opacity[k] / least_alpha)));
  }
  reach[rows[i]] = farthest;
}

// seen (A,): 1 where the sphere of an anchor's reach may touch the picture.  What touches is drawn
// by EWA's affine approximation, whose extent is at most that of the plane test with the Jacobian's
// clamped slopes (camera.cl: MIN_TAN_X ... MAX_TAN_Y); low_pass_px is what the screen filter adds.
__kernel void find_visible(int anchors_count, int width, int height, float near,
                           float low_pass_px, __constant float *camera,
                           __global const float *anchors, __global const float *reach,
                           __global uchar *seen) {
  int a = get_global_id(0);
  if (!(a < anchors_count)) return;
  float3 p = vload3(a, anchors);
  float x = camera[0] * p.x + camera[1] * p.y + camera[2] * p.z + camera[3];
  float y = camera[4] * p.x + camera[5] * p.y + camera[6] * p.z + camera[7];
  float z = camera[8] * p.x + camera[9] * p.y + camera[10] * p.z + camera[11];
  float fx = camera[CAMERA_FX], fy = camera[CAMERA_FY];
  float left = camera[CAMERA_CX] + low_pass_px, right = width - camera[CAMERA_CX] + low_pass_px;
  float top = camera[CAMERA_CY] + low_pass_px, bottom = height - camera[CAMERA_CY] + low_pass_px;
  float slope_x = fmax(fabs(camera[MIN_TAN_X]), fabs(camera[MAX_TAN_X]));
  float slope_y = fmax(fabs(camera[MIN_TAN_Y]), fabs(camera[MAX_TAN_Y]));
  float r = reach[a];
  float wide_x = fx * sqrt(1.0f + slope_x * slope_x) * r;
  float wide_y = fy * sqrt(1.0f + slope_y * slope_y) * r;
  // Not seen only where a test says so: of a NaN nothing is known.
  int out = r < 0.0f || z + r < near;
  out |= fx * x + left * z < -wide_x || fx * x - right * z > wide_x;
  out |= fy * y + top * z < -wide_y || fy * y - bottom * z > wide_y;
  seen[a] = !out;
}
