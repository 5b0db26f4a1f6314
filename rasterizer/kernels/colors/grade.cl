// grade: the appearance of an object, on colours that were just decoded: (gain c) ^ power, channel
// by channel.
// Reads:   color (N, 4).
// Writes:  color (N, 4).
// Units:   display sRGB.
__kernel void grade(int count, int start, float red, float green, float blue, float power,
                    __global float4* color) {
  const int i = get_global_id(0);
  if (i >= count) return;
  float4 lit = color[start + i] * (float4)(red, green, blue, 1);
  // A power of what is below 0 is no number; project must see what is none already.
  if (power != 1 && isfinite(lit.x + lit.y + lit.z)) lit = pow(fmax(lit, 0.0f), power);
  color[start + i] = lit;
}
