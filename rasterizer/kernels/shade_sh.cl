// shade_sh: spherical harmonics -> colour towards the eye.  One work-item a splat.
// colour = max(0, 0.5 + sum of basis(direction) * coefficient), the basis and its signs of 3DGS.
// Needs: COEFFICIENTS = 1, 4, 9 or 16.  sh is (COEFFICIENTS * 3, count): neighbouring work-items
// read neighbouring floats.

#define ADD(k, basis) \
  rgb += (basis) * (float3)(sh[(3 * (k)) * stride + i], sh[(3 * (k) + 1) * stride + i], \
                            sh[(3 * (k) + 2) * stride + i])

__kernel void shade_sh(int count, int start, float eye_x, float eye_y, float eye_z,
                       __global const float4* mean_opacity, __global const float* sh,
                       __global float4* color) {
  const size_t i = get_global_id(0), stride = count;
  if (i >= stride) return;
  float3 rgb = 0.5f;
  ADD(0, 0.28209479177387814f);
#if COEFFICIENTS > 1
  const float3 ray = mean_opacity[start + i].xyz - (float3)(eye_x, eye_y, eye_z);
  const float3 d = ray / fmax(sqrt(dot(ray, ray)), 1e-12f);  // finite at the eye itself
  const float x = d.x, y = d.y, z = d.z;
  ADD(1, -0.4886025119029199f * y);
  ADD(2, 0.4886025119029199f * z);
  ADD(3, -0.4886025119029199f * x);
#endif
#if COEFFICIENTS > 4
  const float xx = x * x, yy = y * y, zz = z * z, xy = x * y, yz = y * z, xz = x * z;
  ADD(4, 1.0925484305920792f * xy);
  ADD(5, -1.0925484305920792f * yz);
  ADD(6, 0.31539156525252005f * (2 * zz - xx - yy));
  ADD(7, -1.0925484305920792f * xz);
  ADD(8, 0.5462742152960396f * (xx - yy));
#endif
#if COEFFICIENTS > 9
  ADD(9, -0.5900435899266435f * y * (3 * xx - yy));
  ADD(10, 2.890611442640554f * xy * z);
  ADD(11, -0.4570457994644658f * y * (4 * zz - xx - yy));
  ADD(12, 0.3731763325901154f * z * (2 * zz - 3 * xx - 3 * yy));
  ADD(13, -0.4570457994644658f * x * (4 * zz - xx - yy));
  ADD(14, 1.445305721320277f * z * (xx - yy));
  ADD(15, -0.5900435899266435f * x * (xx - 3 * yy));
#endif
  // fmax(NaN, 0) is 0, and project must see a colour that is not a number: it is told by its bits,
  // since a compiler may turn a comparison into fmax.
  const uint3 bits = as_uint3(rgb) & 0x7fffffffu;
  const bool finite = bits.x < 0x7f800000u && bits.y < 0x7f800000u && bits.z < 0x7f800000u;
  color[start + i] = (float4)(finite ? fmax(rgb, 0.0f) : rgb, 0);
}
