// blocks: a block of anchors <-> rows of the arena: fetched ahead, turned, stored.
// Reads:   layers.cl.
// Defines: FETCH, FETCH_TO_WRITE, STORE_BLOCK; Quaternion, held, squares, turned; Triple, dotn,
//          scaled_rows.
// Units:   those of the arrays.
// Numbers that are soon read, and rows that are soon written, come into the cache while others are
// worked on: a store that waits for its row holds up all behind it.
#define LINE 16  // floats
#define FETCH(from, floats) \
  for (int i = 0; i < (floats); i += LINE) PREFETCH((from) + i);
#define FETCH_TO_WRITE(from, floats) \
  for (int i = 0; i < (floats); i += LINE) PREFETCH_TO_WRITE((from) + i);

// Four columns of the rows of a block's splats, `stride` floats from anchor to anchor; n anchors.
#if WIDTH == 1
#define STORE_BLOCK(rows, stride, at, a, b, c, d) vstore4((float4)(a, b, c, d), 0, (rows) + (at));
#else
// A transpose within each quarter of a vector: what a CPU shuffles fastest.
#define STORE_QUARTERS(rows, stride, first, v)                            \
  vstore4((v).s0123, 0, (rows) + (size_t)(stride) * (first));              \
  vstore4((v).s4567, 0, (rows) + (size_t)(stride) * ((first) + 4));        \
  vstore4((v).s89ab, 0, (rows) + (size_t)(stride) * ((first) + 8));        \
  vstore4((v).scdef, 0, (rows) + (size_t)(stride) * ((first) + 12));
inline void store_block(__global float* rows, int stride, int n, float16 a, float16 b, float16 c,
                        float16 d) {
  if (n == WIDTH) {
    // Pairs of two columns: anchors 0 and 1 of each four, then 2 and 3 (upper case).
    const float16 ab = (float16)(a.s0, b.s0, a.s1, b.s1, a.s4, b.s4, a.s5, b.s5, a.s8, b.s8, a.s9,
                                 b.s9, a.sc, b.sc, a.sd, b.sd);
    const float16 AB = (float16)(a.s2, b.s2, a.s3, b.s3, a.s6, b.s6, a.s7, b.s7, a.sa, b.sa, a.sb,
                                 b.sb, a.se, b.se, a.sf, b.sf);
    const float16 cd = (float16)(c.s0, d.s0, c.s1, d.s1, c.s4, d.s4, c.s5, d.s5, c.s8, d.s8, c.s9,
                                 d.s9, c.sc, d.sc, c.sd, d.sd);
    const float16 CD = (float16)(c.s2, d.s2, c.s3, d.s3, c.s6, d.s6, c.s7, d.s7, c.sa, d.sa, c.sb,
                                 d.sb, c.se, d.se, c.sf, d.sf);
    // Two pairs make a row; r0 holds those of anchors 0, 4, 8 and 12, r1 those of 1, 5, 9 and 13.
    const float16 r0 = (float16)(ab.s01, cd.s01, ab.s45, cd.s45, ab.s89, cd.s89, ab.scd, cd.scd);
    const float16 r1 = (float16)(ab.s23, cd.s23, ab.s67, cd.s67, ab.sab, cd.sab, ab.sef, cd.sef);
    const float16 r2 = (float16)(AB.s01, CD.s01, AB.s45, CD.s45, AB.s89, CD.s89, AB.scd, CD.scd);
    const float16 r3 = (float16)(AB.s23, CD.s23, AB.s67, CD.s67, AB.sab, CD.sab, AB.sef, CD.sef);
    STORE_QUARTERS(rows, stride, 0, r0)
    STORE_QUARTERS(rows, stride, 1, r1)
    STORE_QUARTERS(rows, stride, 2, r2)
    STORE_QUARTERS(rows, stride, 3, r3)
    return;
  }
  // The last block: put together aside, so that nothing behind it is written.
  float columns[4][WIDTH];
  vstore16(a, 0, columns[0]);
  vstore16(b, 0, columns[1]);
  vstore16(c, 0, columns[2]);
  vstore16(d, 0, columns[3]);
  for (int lane = 0; lane < n; lane++)
    for (int k = 0; k < 4; k++) rows[(size_t)stride * lane + k] = columns[k][lane];
}
#define STORE_BLOCK(rows, stride, at, a, b, c, d) store_block((rows) + (at), stride, n, a, b, c, d);
#endif

// A quaternion of each anchor.
typedef struct {
  floatn w, x, y, z;
} Quaternion;

// A quaternion that tiny and huge entries do not cost its length, but where it is `fine` as it is;
// one without a length is no turn; NaN stays NaN, and project drops it.
inline Quaternion held(Quaternion q, intn fine) {
  const floatn largest = fmax(fmax(fabs(q.w), fabs(q.x)), fmax(fabs(q.y), fabs(q.z)));
  const intn none = (q.w == 0.0f) & (q.x == 0.0f) & (q.y == 0.0f) & (q.z == 0.0f);
  const floatn by = 1.0f / select(largest, TO_FLOATN 1.0f, none | fine);
  const Quaternion r = {select(q.w * by, TO_FLOATN 1.0f, none), q.x * by, q.y * by, q.z * by};
  return r;
}

// The length squared.
inline floatn squares(Quaternion q) { return q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z; }

// p then q, as rotations: the Hamilton product q p.
inline Quaternion turned(Quaternion q, Quaternion p) {
  const Quaternion r = {q.w * p.w - q.x * p.x - q.y * p.y - q.z * p.z,
                        q.w * p.x + q.x * p.w + q.y * p.z - q.z * p.y,
                        q.w * p.y - q.x * p.z + q.y * p.w + q.z * p.x,
                        q.w * p.z + q.x * p.y - q.y * p.x + q.z * p.w};
  return r;
}

// Three numbers of each anchor: a place, factors, a row of a matrix.
typedef struct {
  floatn x, y, z;
} Triple;

// a . b
inline floatn dotn(Triple a, Triple b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// The rows of R S of a quaternion and three factors; twice: 2 over its length squared.
inline void scaled_rows(Quaternion q, floatn twice, Triple s, Triple* rows) {
  // R has 1 - 2 (yy + zz) / |q|^2 and so on: no root, and no unit quaternion.
  const floatn w = q.w * twice, x = q.x * twice, y = q.y * twice, z = q.z * twice;
  const floatn xx = q.x * x, yy = q.y * y, zz = q.z * z, xy = q.x * y, xz = q.x * z;
  const floatn yz = q.y * z, wx = q.x * w, wy = q.y * w, wz = q.z * w;
  const Triple a = {(1 - yy - zz) * s.x, (xy - wz) * s.y, (xz + wy) * s.z};
  const Triple b = {(xy + wz) * s.x, (1 - xx - zz) * s.y, (yz - wx) * s.z};
  const Triple c = {(xz - wy) * s.x, (yz + wx) * s.y, (1 - xx - yy) * s.z};
  rows[0] = a;
  rows[1] = b;
  rows[2] = c;
}
