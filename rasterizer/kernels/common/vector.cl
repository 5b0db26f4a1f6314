// vector: eight floats of a CPU's vector register at once.
// Reads:   nothing.
// Defines: LANES, PREFETCH, PREFETCH_TO_WRITE, HALF_LOG2E, max8, sum8, sums8, max_int8.
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
