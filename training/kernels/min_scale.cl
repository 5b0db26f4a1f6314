// The least size of splats: what a pixel of the finest photo spans at each anchor, and the slope.
// Reads:   anchors, cameras (V, 18); rows of the step, pixels (A,), scales (N, 3).
// Writes:  pixels; adds to grad_scales (N, 3).
// Units:   metres; one sigma.
#define CAMERA 18  // 3 rows of camera_from_world, then fx fy cx cy in pixels, width and height

// One work-item an anchor: least depth over focal length of all cameras that have it in view.
__kernel void pixel_sizes(int anchors_count, int views, float near,
                          __global const float *cameras, __global const float *anchors,
                          __global float *pixels) {
  int a = get_global_id(0);
  if (!(a < anchors_count)) return;
  float3 p = vload3(a, anchors);
  float least = INFINITY;
  for (int v = 0; v < views; v++) {
    __global const float *c = cameras + CAMERA * v;
    float x = c[0] * p.x + c[1] * p.y + c[2] * p.z + c[3];
    float y = c[4] * p.x + c[5] * p.y + c[6] * p.z + c[7];
    float z = c[8] * p.x + c[9] * p.y + c[10] * p.z + c[11];
    if (!(z > near)) continue;
    float column = c[12] * x / z + c[14], row = c[13] * y / z + c[15];
    if (column >= 0 && column < c[16] && row >= 0 && row < c[17])
      least = fmin(least, z / fmax(c[12], c[13]));
  }
  // What no photo shows has no bound.
  pixels[a] = least < INFINITY ? least : 0.0f;
}

// One work-item a splat: the gradient of slope * max(log(least / scale), 0), of each axis.
__kernel void min_scale(int splats, float least_px, float slope, __global const int *rows,
                        __global const float *pixels, __global const float *scales,
                        __global float *grad_scales) {
  int i = get_global_id(0);
  if (!(i < splats)) return;
  float least = least_px * pixels[rows[i / SPLATS]];
  for (int c = 3 * i; c < 3 * i + 3; c++)
    if (scales[c] > 0 && scales[c] < least) grad_scales[c] -= slope / scales[c];
}
