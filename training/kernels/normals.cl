// normals: the loss of a normal map and its gradient by the depth drawn: one work-item a row.
// With z = metres / (1 - T), rays r with r.z = 1 and n the mean of two neighbours' normals, a pair
// of pixels counts |e| / (1 + |e|), e = n . (z2 r2 - z1 r1) / (half (z1 + z2) |r2 - r1|).
// Reads:   normals (H, W) char4: 127 times the direction and 1, 0 where none is known; metres, the
//          sum of alpha T z as drawn, and transmittance T.
// Writes:  grad_metres and grad_transmittance (H, W), or adds to them; rows, the loss a row.
// Units:   metres along the view; directions in eye axes (x right, y up, z towards the eye).
#define ALIKE 14516     // of 127^2: the cosine from which two normals are of one surface
#define COVERED 0.5f    // of a pixel from which it has a depth

typedef struct {
  int4 normal;
  float3 ray;  // x right, y down, z forward
  float z;     // metres; 0 where too little covers the pixel
} Seen;

inline Seen seen_at(int x, int y, int at, float4 camera, __global const char4 *normals,
                    __global const float *metres, __global const float *transmittance) {
  Seen s;
  s.normal = convert_int4(normals[at]);
  s.ray = (float3)((x + 0.5f - camera.z) / camera.x, (y + 0.5f - camera.w) / camera.y, 1.0f);
  float covered = 1.0f - transmittance[at];
  s.z = covered >= COVERED ? metres[at] / covered : 0.0f;
  return s;
}

// (what a pair counts, its gradient by the depth of the first); step: |r2 - r1|.
inline float2 pair(Seen one, Seen two, float step) {
  int3 a = one.normal.xyz, b = two.normal.xyz;
  bool same = one.normal.w > 0 && two.normal.w > 0;
  same = same && a.x * b.x + a.y * b.y + a.z * b.z >= ALIKE && one.z > 0.0f && two.z > 0.0f;
  if (!same) return 0.0f;
  float3 n = convert_float3(a + b) * (float3)(0.5f / 127.0f, -0.5f / 127.0f, -0.5f / 127.0f);
  float below = 0.5f * step * (one.z + two.z);
  float e = dot(n, two.z * two.ray - one.z * one.ray) / below;
  float more = 1.0f + fabs(e);
  float sign = e > 0.0f ? 1.0f : e < 0.0f ? -1.0f : 0.0f;
  float by_z = (-dot(n, one.ray) - 0.5f * step * e) / below;
  return (float2)(fabs(e) / more, sign / (more * more) * by_z);
}

__kernel void compare_normals(int width, int height, float scale, int add, float fx, float fy,
                              float cx, float cy, __global const char4 *normals,
                              __global const float *metres, __global const float *transmittance,
                              __global float *grad_metres, __global float *grad_transmittance,
                              __global float *rows) {
  int y = get_global_id(0);
  float4 camera = (float4)(fx, fy, cx, cy);
  // A row a work-item, and rows summed in order: the same loss every time.
  float sum = 0;
  for (int x = 0; x < width; x++) {
    int at = y * width + x;
    float by_z = 0.0f;
    Seen here = seen_at(x, y, at, camera, normals, metres, transmittance);
    for (int side = 0; side < 4; side++) {  // right, below, left, above
      int i = x + (side == 0) - (side == 2), j = y + (side == 1) - (side == 3);
      if (!(i >= 0 && j >= 0 && i < width && j < height)) continue;
      Seen next = seen_at(i, j, j * width + i, camera, normals, metres, transmittance);
      float2 found = pair(here, next, 1.0f / (side % 2 ? fy : fx));
      sum += side < 2 ? found.x : 0.0f;  // each pair once
      by_z += found.y;
    }
    float covered = 1.0f - transmittance[at];
    bool known = here.z > 0.0f;
    float by_metres = known ? scale * by_z / covered : 0.0f;
    float by_through = known ? by_metres * here.z : 0.0f;
    grad_metres[at] = by_metres + (add ? grad_metres[at] : 0.0f);
    grad_transmittance[at] = by_through + (add ? grad_transmittance[at] : 0.0f);
  }
  rows[y] = sum;
}
