// direction: where an anchor lies, seen from the eye.
//
// Reads:   an anchor's three numbers.
// Defines: float4 direction_and_inverse(float3 eye, anchor).
// Units:   metres in; the direction is a unit vector, or 0; 1 / metres.

// Unit vector from the eye to an anchor (paper eq. 4) and 1 / distance; finite when they coincide.
inline float4 direction_and_inverse(float3 eye, __global const float *anchor) {
  float3 d = (float3)(anchor[0], anchor[1], anchor[2]) - eye;
  // 1e-8 metres: where eye and anchor coincide, the direction is 0 and nothing is infinite.
  float inverse = 1.0f / fmax(sqrt(dot(d, d)), 1e-8f);
  return (float4)(d * inverse, inverse);
}
