// vector: eight floats of a CPU's vector register at once.
// Reads:   nothing.
// Defines: LANES, PREFETCH, PREFETCH_TO_WRITE, exp2_8, max8, sum8, sums8, max_int8.
// Units:   none; exponents are of 2, since exp(-power / 2) = 2^(-power log2(e) / 2).
#define LANES 8
#define HALF_LOG2E 0.72134752044f  // log2(e) / 2: exponents of 2 out of halves of squares
#ifdef __has_builtin  // clang, which PoCL and other CPU drivers are made of
#define PREFETCH(address) __builtin_prefetch(address)
#define PREFETCH_TO_WRITE(address) __builtin_prefetch(address, 1)
#else
#define PREFETCH(address)
#define PREFETCH_TO_WRITE(address)
#endif

// 2^x for the exponents that a splat's falloff has, [-126, 0.1]; relative error 1e-7.
// Outside that range the bits are garbage but never a trap: mask them.
// Splitting into an integer and a fraction in -0.5 .. 0.5 leaves a polynomial of degree 6 for 2^f,
// and the integer goes straight to the exponent bits: exp() of a CPU's library takes several times
// as long.
inline float8 exp2_8(float8 x) {
  // Adding 1.5 * 2^23 rounds to the nearest integer and leaves it in the low bits.
  const float8 shifted = x + 12582912.0f;
  const float8 f = x - (shifted - 12582912.0f);
  // Horner, with the Taylor coefficients ln(2)^k / k! from k = 6 down.
  float8 p = 1.5403530e-4f;
  p = fma(p, f, (float8)(1.3333558e-3f));
  p = fma(p, f, (float8)(9.6181291e-3f));
  p = fma(p, f, (float8)(5.5504109e-2f));
  p = fma(p, f, (float8)(2.4022651e-1f));
  p = fma(p, f, (float8)(6.9314718e-1f));
  p = fma(p, f, (float8)(1.0f));
  // Bit 23 is the exponent's lowest, so this multiplies by 2^integer.
  return as_float8(as_int8(p) + (as_int8(shifted) << 23));
}

// Trees of halves: three steps instead of the seven of a running sum, and the same order always.
inline float max8(float8 a) {
  const float4 b = fmax(a.lo, a.hi);
  const float2 c = fmax(b.lo, b.hi);
  return fmax(c.x, c.y);
}

inline float sum8(float8 a) {
  const float4 b = a.lo + a.hi;
  const float2 c = b.lo + b.hi;
  return c.x + c.y;
}

// (sum of a, sum of b, ..., sum of h): one tree for eight vectors instead of eight.
inline float8 sums8(float8 a, float8 b, float8 c, float8 d, float8 e, float8 f, float8 g,
                    float8 h) {
  const float16 ab = (float16)(a.lo + a.hi, b.lo + b.hi, c.lo + c.hi, d.lo + d.hi);
  const float16 eh = (float16)(e.lo + e.hi, f.lo + f.hi, g.lo + g.hi, h.lo + h.hi);
  const float16 pairs = (float16)(ab.even + ab.odd, eh.even + eh.odd);
  return pairs.even + pairs.odd;
}

inline int max_int8(int8 a) {
  const int4 b = max(a.lo, a.hi);
  const int2 c = max(b.lo, b.hi);
  return max(c.x, c.y);
}
