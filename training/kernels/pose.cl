// What splats' gradients say of a turn of the whole scene about the eye: the sum over all splats.
// Reads:   means (N, 3), wxyz (N, 4) of any length, and the gradients of the loss by both.
// Writes:  sums (ITEMS, 3): a work-item's share of the gradient by a turn, in the world's axes.
// Units:   metres; radians.
//
// Turned by a small w, a mean m moves by w x (m - eye), a quaternion q by half of the product
// (0, w) q: so the gradient by w is (m - eye) x dL/dm, and half of what dL/dq has of that product.
// Culled splats' gradients are zero; their means may be NaN, so they are left out, not multiplied.
__kernel void turn_gradient(int count, int each, float eye_x, float eye_y, float eye_z,
                            __global const float *means, __global const float *wxyz,
                            __global const float *by_means, __global const float *by_wxyz,
                            __global float *sums) {
  const int item = get_global_id(0);
  // A fixed number of items, so that sums are made in one order on every machine.
  const int end = min(count, (item + 1) * each);
  const float3 eye = (float3)(eye_x, eye_y, eye_z);
  float3 turn = 0;
  for (int i = item * each; i < end; i++) {
    const float3 by_mean = vload3(i, by_means);
    const float4 by = vload4(i, by_wxyz);
    if (!(fabs(by_mean.x) + fabs(by_mean.y) + fabs(by_mean.z) + fabs(by.x) + fabs(by.y) +
              fabs(by.z) + fabs(by.w) > 0))
      continue;
    const float4 q = vload4(i, wxyz);
    turn += cross(vload3(i, means) - eye, by_mean);
    turn += 0.5f * (q.x * by.yzw - by.x * q.yzw + cross(q.yzw, by.yzw));
  }
  vstore3(turn, item, sums);
}
