// pack: means, scales, quaternions -> what project_arena reads of a splat.  One work-item a splat.
// Sigma = R S S^T R^T, stored as xx xy xz yy yz zz 0 0 (square metres, object frame).

__kernel void pack(int count, int start, __global const float* means, __global const float* scales,
                   __global const float* wxyz, __global const float* opacity,
                   __global float4* mean_opacity, __global float8* covariance) {
  const int i = get_global_id(0);
  if (i >= count) return;
  const float4 given = vload4(i, wxyz);
  // By the largest entry first: neither tiny nor huge quaternions lose their length.
  const float4 size = fabs(given);
  const float largest = fmax(fmax(size.x, size.y), fmax(size.z, size.w));
  // One without a length is no turn; NaN stays NaN, and project drops it.
  const float4 scaled = given / largest;
  const float4 q = all(given == 0) ? (float4)(1, 0, 0, 0) : scaled / sqrt(dot(scaled, scaled));
  const float w = q.x, x = q.y, y = q.z, z = q.w;
  const float3 s = vload3(i, scales);
  const float3 row_x = (float3)(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)) * s;
  const float3 row_y = (float3)(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)) * s;
  const float3 row_z = (float3)(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)) * s;
  mean_opacity[start + i] = (float4)(vload3(i, means), opacity[i]);
  covariance[start + i] = (float8)(dot(row_x, row_x), dot(row_x, row_y), dot(row_x, row_z),
                                   dot(row_y, row_y), dot(row_y, row_z), dot(row_z, row_z), 0, 0);
}
