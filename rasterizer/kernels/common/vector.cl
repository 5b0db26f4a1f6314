// vector: the floats of a CPU's vector register at once: eight, or sixteen where LANES says so.
// Reads:   LANES, 8 where it is not given.
// Defines: floatv, intv, uintv and their loads, stores, conversions and lane numbers; MAXIMUM,
//          MINIMUM, ANY_OF, ALL_OF; PREFETCH, PREFETCH_TO_WRITE, STREAM; HALF_LOG2E, max8, sum8,
//          sums8, sum_ints, max_ints, min_ints, min_uints, max_uints.
// Units:   none; exponents are of 2, since exp(-power / 2) = 2^(-power log2(e) / 2).
#ifndef LANES
#define LANES 8
#endif
#if LANES == 16
typedef float16 floatv;
typedef int16 intv;
typedef uint16 uintv;
// Which lane each is.
#define LANE_NUMBERS (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
// What a vector is read and written with, its type aside.
#define VLOAD vload16
#define VSTORE vstore16
#define CONVERT_INT convert_int16
#define CONVERT_FLOAT convert_float16
#define AS_INT as_int16
#define AS_UINT as_uint16
// Of masks: any() and all() ask one lane after the other, which takes longer where there are many.
#define ANY_OF(mask) (min_ints(mask) < 0)
#define ALL_OF(mask) (max_ints(mask) < 0)
#else
typedef float8 floatv;
typedef int8 intv;
typedef uint8 uintv;
#define LANE_NUMBERS (int8)(0, 1, 2, 3, 4, 5, 6, 7)
#define VLOAD vload8
#define VSTORE vstore8
#define CONVERT_INT convert_int8
#define CONVERT_FLOAT convert_float8
#define AS_INT as_int8
#define AS_UINT as_uint8
// The lanes of two registers of SSE or one of AVX: asked one by one, mostly the first says all.
#define ANY_OF any
#define ALL_OF all
#endif
// One instruction, b where a is not a number; fmax and fmin, which look at b as well, take three.
#define MAXIMUM(a, b) ((a) > (b) ? (a) : (b))
#define MINIMUM(a, b) ((a) < (b) ? (a) : (b))
#define HALF_LOG2E 0.72134752044f  // log2(e) / 2: exponents of 2 out of halves of squares
// Fetched ahead where clang compiles for the CPU itself, as PoCL does: there __global is plain
// memory.  For a GPU it is an address space, which the builtin's plain pointer refuses.
#if defined(__has_builtin) && (defined(__x86_64__) || defined(__aarch64__))
#define PREFETCH(address) __builtin_prefetch(address)
#define PREFETCH_TO_WRITE(address) __builtin_prefetch(address, 1)
#else
#define PREFETCH(address)
#define PREFETCH_TO_WRITE(address)
#endif
#ifdef __has_builtin
#if __has_builtin(__builtin_nontemporal_store)
#define STREAM(value, to) __builtin_nontemporal_store(value, to)
#endif
#endif
// A store past the caches, of what is larger than they are and read much later: the line that is
// written over is not read first.  `to` is aligned as its type is.
#ifndef STREAM
#define STREAM(value, to) (*(to) = (value))
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

// Of whole numbers, whose sums have no order.
#if LANES == 16
#define EIGHT_OF(combine, a) combine((a).lo, (a).hi)
#else
#define EIGHT_OF(combine, a) (a)
#endif
#define ADDED(a, b) ((a) + (b))
// A tree of halves, the same for whatever combines two.
#define REDUCTION(name, scalar, eight, four, wide, combine)                  \
  inline scalar name(wide a) {                                               \
    const eight b = EIGHT_OF(combine, a);                                    \
    const four c = combine(b.lo, b.hi);                                      \
    return combine(combine(c.x, c.y), combine(c.z, c.w));                    \
  }
REDUCTION(sum_ints, int, int8, int4, intv, ADDED)
REDUCTION(max_ints, int, int8, int4, intv, max)
REDUCTION(min_ints, int, int8, int4, intv, min)
REDUCTION(max_uints, uint, uint8, uint4, uintv, max)
REDUCTION(min_uints, uint, uint8, uint4, uintv, min)
