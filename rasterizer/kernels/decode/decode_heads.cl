// decode_heads: the five heads of a package, anchors -> rows of the arena (paper eq. 5), a block of
// WIDTH anchors at a time (16 on a CPU, a vector; 1 on a GPU, a work-item):
//   z = W2 ReLU(W1 (f, delta) + b1) + b2,   y = gain * activation(clip(z))
// b1 has Psi(x) in it, which is the same for all anchors.
// A hidden unit that no anchor of a block wakes adds nothing to it, so neither of its rows of
// weights is read: exact, and most units of trained heads sleep in most blocks.
// Reads:   features, places and frames in blocks (blocks, columns, WIDTH), the last one filled up;
//          the heads' weights; of a control value b1 and what each unit's bound has to exceed.
// Writes:  rows `start` and after of mean_opacity (N, 4) and covariance (N, 8), or of color (N, 4).
// Units:   metres in the object's frame; colours are display sRGB; features and units have none.
#if WIDTH == 1
typedef float floatn;
typedef int intn;
#define LOADN(p) (*(p))
#define AS_FLOATN as_float
#define AS_INTN as_int
#define TO_FLOATN (float)
#define ALL(lanes) (lanes)
#else
typedef float16 floatn;
typedef int16 intn;
#define LOADN(p) vload16(0, p)
#define AS_FLOATN as_float16
#define AS_INTN as_int16
#define TO_FLOATN (float16)
#define ALL(lanes) all(lanes)
#endif
#include "common/vector.cl"

#define UNROLL _Pragma("unroll")
#define OPACITY_HEAD 3
#define COLOR_HEAD 4
#define LOG2E 1.44269504f
#define MOST 126.0f  // the largest exponent of 2
#define NONE 0
#define TANH 1
#define SIGMOID 2
#define SOFTPLUS 3
#define EXP 4

// Where a head's numbers begin in the flat arrays, and what becomes of its outputs.
typedef struct {
  int hidden, unit_at, first_at, last_at, tiles, activation;
  float low, high, gain;
} Head;

inline floatn within(floatn z, float low, float high) {  // unlike clamp(), NaN stays NaN
  z = select(z, TO_FLOATN low, z < low);
  return select(z, TO_FLOATN high, z > high);
}

// 2^t, relative error 2e-7; beyond +-most, at most 126, it stays at what it is there.
// exp2_8 of vector.cl with a polynomial a degree shorter (least largest error, not Taylor's).
inline floatn exp2n(floatn t, float most) {
  t = within(t, -most, most);
  const floatn shifted = t + 12582912.0f;
  const floatn f = t - (shifted - 12582912.0f);
  floatn p = 1.327647152e-3f;
  p = fma(p, f, TO_FLOATN 9.675541331e-3f);
  p = fma(p, f, TO_FLOATN 5.550713275e-2f);
  p = fma(p, f, TO_FLOATN 2.402211972e-1f);
  p = fma(p, f, TO_FLOATN 6.931469671e-1f);
  p = fma(p, f, TO_FLOATN 1.000000072f);
  return AS_FLOATN(AS_INTN(p) + (AS_INTN(shifted) << 23));
}

// A tile of outputs: gain * activation(clip(z)).
inline void activate(Head head, floatn* z) {
  if (head.low > -INFINITY || head.high < INFINITY) {
    UNROLL for (int o = 0; o < TILE; o++) z[o] = within(z[o], head.low, head.high);
  }
  if (head.activation == TANH || head.activation == SIGMOID) {
    // tanh(z) = 1 - 2 / (1 + e^2z), and 1 / (1 + e^-z), both as a + b / (1 + 2^(c z)).
    const int odd = head.activation == TANH;
    const float a = odd ? head.gain : 0, b = odd ? -2 * head.gain : head.gain;
    const float c = odd ? 2 * LOG2E : -LOG2E;
    floatn under[TILE + 1];
    UNROLL for (int o = 0; o < TILE; o++) under[o] = 1.0f + exp2n(c * z[o], 60.0f);
    under[TILE] = 1;
    // Two at a time: one division, which takes as long as ten products.
    UNROLL for (int o = 0; o < TILE; o += 2) {
      const floatn by = b / (under[o] * under[o + 1]);
      z[o] = fma(by, under[o + 1], TO_FLOATN a);
      if (o + 1 < TILE) z[o + 1] = fma(by, under[o], TO_FLOATN a);
    }
    return;
  }
  if (head.activation == EXP) {
    UNROLL for (int o = 0; o < TILE; o++) z[o] = exp2n(LOG2E * z[o], MOST);
  } else if (head.activation == SOFTPLUS) {
    for (int o = 0; o < TILE; o++) {
      const floatn above = select(z[o], TO_FLOATN 0.0f, z[o] < 0.0f);
      z[o] = above + log(1.0f + exp2n(-LOG2E * fabs(z[o]), MOST));
    }
  }
  UNROLL for (int o = 0; o < TILE; o++) z[o] *= head.gain;
}

// Numbers that are soon read, and rows that are soon written, come into the cache while others are
// worked on: a store that waits for its row holds up all behind it.
#define LINE 16  // floats
#ifdef __has_builtin
#define FETCH(from, floats) \
  for (int i = 0; i < (floats); i += LINE) __builtin_prefetch((from) + i);
#define FETCH_TO_WRITE(from, floats) \
  for (int i = 0; i < (floats); i += LINE) __builtin_prefetch((from) + i, 1);
#else
#define FETCH(from, floats)
#define FETCH_TO_WRITE(from, floats)
#endif

// Units first to end (multiples of UNITS) that some anchor of a block wakes -> live from n on;
// returns how many there are then.  Each bound is the largest of the block.
inline int wake(int first, int end, __global const float* bounds, __global const float* least,
                int from, int* live) {
  long n = from;  // int would be widened for each
  for (int u = first; u < end; u += UNITS) {
    int awake[UNITS];
    vstore16(-(vload16(0, bounds + u) > vload16(0, least + u)), 0, awake);
    UNROLL for (int k = 0; k < UNITS; k++) {
      live[n] = u + k;  // without a branch: nobody could guess it
      n += awake[k];
    }
  }
  return n;
}

// The hidden units `live` of one block: ROWS of them share each load of a feature.
inline void first_layer(int n, int* live, int features, int looks, __global const float* weights,
                        __global const float* bias, __global const float* feature,
                        const floatn* look, floatn* unit) {
  const int row = features + looks;
  for (int t = n; t < n + ROWS; t++) live[t] = 0;  // whole tiles, whoever is there
  for (int t = 0; t < n; t += ROWS) {
    floatn sum[ROWS];
    __global const float* w[ROWS];
    UNROLL for (int u = 0; u < ROWS; u++) {
      w[u] = weights + live[t + u] * row;
      sum[u] = bias[live[t + u]];
    }
    for (int i = 0; i < features; i++) {
      const floatn f = LOADN(feature + i * WIDTH);
      UNROLL for (int u = 0; u < ROWS; u++) sum[u] = fma(f, TO_FLOATN w[u][i], sum[u]);
    }
    for (int i = 0; i < looks; i++) {
      UNROLL for (int u = 0; u < ROWS; u++)
        sum[u] = fma(look[i], TO_FLOATN w[u][features + i], sum[u]);
    }
    // Not fmax: NaN has to stay NaN.
    UNROLL for (int u = 0; u < ROWS; u++)
      unit[t + u] = select(sum[u], TO_FLOATN 0.0f, sum[u] < 0.0f);
  }
}

// Outputs of a head out of its units first to end of those that are awake.
inline void second_layer(Head head, int first, int end, const int* live, const floatn* unit,
                         __global const float* weights, floatn* out) {
  __global const float* biases = weights + head.last_at;
  // TILE weights a tile and unit, side by side; units count from the first of all heads.
  __global const float* last = biases + (head.tiles - head.unit_at) * TILE;
  for (int c = 0; c < head.tiles; c++) {
    floatn sum[TILE];
    UNROLL for (int o = 0; o < TILE; o++) sum[o] = biases[c * TILE + o];
    for (int t = first; t < end; t++) {
      __global const float* w = last + (c * head.hidden + live[t]) * TILE;
      const floatn h = unit[t];
      UNROLL for (int o = 0; o < TILE; o++) sum[o] = fma(h, TO_FLOATN w[o], sum[o]);
    }
    activate(head, sum);
    UNROLL for (int o = 0; o < TILE; o++) out[c * TILE + o] = sum[o];
  }
}

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
    const float16 ab = (float16)(a.s0, b.s0, a.s1, b.s1, a.s4, b.s4, a.s5, b.s5, a.s8, b.s8, a.s9,
                                 b.s9, a.sc, b.sc, a.sd, b.sd);
    const float16 AB = (float16)(a.s2, b.s2, a.s3, b.s3, a.s6, b.s6, a.s7, b.s7, a.sa, b.sa, a.sb,
                                 b.sb, a.se, b.se, a.sf, b.sf);
    const float16 cd = (float16)(c.s0, d.s0, c.s1, d.s1, c.s4, d.s4, c.s5, d.s5, c.s8, d.s8, c.s9,
                                 d.s9, c.sc, d.sc, c.sd, d.sd);
    const float16 CD = (float16)(c.s2, d.s2, c.s3, d.s3, c.s6, d.s6, c.s7, d.s7, c.sa, d.sa, c.sb,
                                 d.sb, c.se, d.se, c.sf, d.sf);
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

inline floatn squares(Quaternion q) { return q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z; }

// p then q, as rotations: the Hamilton product q p.
inline Quaternion turned(Quaternion q, Quaternion p) {
  const Quaternion r = {q.w * p.w - q.x * p.x - q.y * p.y - q.z * p.z,
                        q.w * p.x + q.x * p.w + q.y * p.z - q.z * p.y,
                        q.w * p.y - q.x * p.z + q.y * p.w + q.z * p.x,
                        q.w * p.z + q.x * p.y - q.y * p.x + q.z * p.w};
  return r;
}

typedef struct {
  floatn x, y, z;
} Triple;

inline floatn dotn(Triple a, Triple b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// The rows of R S of a quaternion and three factors; twice: 2 over its length squared.
inline void scaled_rows(Quaternion q, floatn twice, Triple s, Triple* rows) {
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

// The largest that the features alone give each unit in each block; above all numbers where one of
// the anchors has no number.  Once a model.
__kernel void bound_units(int blocks, int features, int units, int run,
                          __global const float* first, __global const float* feature,
                          __global float* bounds) {
  const int from = get_global_id(0) * run, end = min(blocks, from + run);
  for (int block = from; block < end; block++) {
    for (int u = 0; u < units; u++) {
      floatn sum = 0;
      for (int i = 0; i < features; i++)
        sum = fma(LOADN(feature + ((size_t)block * features + i) * WIDTH),
                  TO_FLOATN first[u * features + i], sum);
      sum = select(sum, TO_FLOATN INFINITY, sum != sum);
#if WIDTH == 1
      bounds[(size_t)block * units + u] = sum;
#else
      bounds[(size_t)block * units + u] = max8(fmax(sum.lo, sum.hi));
#endif
    }
  }
}

// Four heads -> means, opacities and covariances Sigma = R S S^T R^T; !shapes: opacities alone.
// frames: of every anchor its factors s and its quaternion, which the splats are predicted in.
__kernel void decode_shapes(int anchors, int start, int run, int splats, int features, int units,
                            int shapes, __global const Head* heads, __global const float* weights,
                            __global const float* bias, __global const float* least,
                            __global const float* bounds, __global const float* feature,
                            __global const float* places, __global const float* frames,
                            __global float* mean_opacity, __global float* covariance) {
  const int from = get_global_id(0) * run, end = min((anchors + WIDTH - 1) / WIDTH, from + run);
  for (int block = from; block < end; block++) {
    const int n = min(WIDTH, anchors - block * WIDTH);
    __global const float* woken = bounds + (size_t)block * units;
    __global const float* mine = feature + (size_t)block * features * WIDTH;
    const size_t row = start + (size_t)block * WIDTH * splats;
    if (WIDTH > 1 && n == WIDTH && shapes) {
      FETCH_TO_WRITE(mean_opacity + 4 * row, WIDTH * splats * 4)
      FETCH_TO_WRITE(covariance + 8 * row, WIDTH * splats * 8)
    }
    if (WIDTH > 1 && block + 1 < end) {
      FETCH(woken + units, units)
      FETCH(mine + features * WIDTH, features * WIDTH)
    }
    int live[4 * MAX_HIDDEN + ROWS], ends[5];
    floatn unit[4 * MAX_HIDDEN + ROWS];
    // TILE more than k splats need: heads write whole tiles.
    floatn offset[3 * MAX_SPLATS + TILE], scale[3 * MAX_SPLATS + TILE];
    floatn rotation[4 * MAX_SPLATS + TILE], opacity[MAX_SPLATS + TILE];
    ends[0] = 0;
    for (int m = 0; m < 4; m++) {
      const int first = heads[m].unit_at, end = first + heads[m].hidden;
      ends[m + 1] = ends[m];
      if (shapes || m == OPACITY_HEAD) ends[m + 1] = wake(first, end, woken, least, ends[m], live);
    }
    first_layer(ends[4], live, features, 0, weights, bias, mine, 0, unit);
    second_layer(heads[3], ends[3], ends[4], live, unit, weights, opacity);
    if (!shapes) {
      for (int j = 0; j < splats; j++) {
        float lanes[WIDTH];
        *(floatn*)lanes = opacity[j];
        for (int lane = 0; lane < n; lane++)
          mean_opacity[4 * (row + lane * splats + j) + 3] = lanes[lane];
      }
      continue;
    }
    second_layer(heads[0], ends[0], ends[1], live, unit, weights, offset);
    second_layer(heads[1], ends[1], ends[2], live, unit, weights, scale);
    second_layer(heads[2], ends[2], ends[3], live, unit, weights, rotation);
    __global const float* at = places + (size_t)block * 3 * WIDTH;
    const Triple place = {LOADN(at), LOADN(at + WIDTH), LOADN(at + 2 * WIDTH)};
    Triple axes[3], size;
    Quaternion own;
    if (frames) {
      __global const float* frame = frames + (size_t)block * 7 * WIDTH;
      size.x = LOADN(frame);
      size.y = LOADN(frame + WIDTH);
      size.z = LOADN(frame + 2 * WIDTH);
      own.w = LOADN(frame + 3 * WIDTH);
      own.x = LOADN(frame + 4 * WIDTH);
      own.y = LOADN(frame + 5 * WIDTH);
      own.z = LOADN(frame + 6 * WIDTH);
      scaled_rows(own, TO_FLOATN 2.0f, size, axes);
    }
    for (int j = 0; j < splats; j++) {
      Triple mean = {offset[3 * j], offset[3 * j + 1], offset[3 * j + 2]};
      Triple s = {scale[3 * j], scale[3 * j + 1], scale[3 * j + 2]};
      Quaternion q = {rotation[4 * j], rotation[4 * j + 1], rotation[4 * j + 2],
                      rotation[4 * j + 3]};
      floatn square = squares(q);
      const intn fine = (square > 1e-30f) & (square < 1e30f);
      if (!ALL(fine)) {
        q = held(q, fine);
        square = squares(q);
      }
      if (frames) {
        const Triple turn = {dotn(axes[0], mean), dotn(axes[1], mean), dotn(axes[2], mean)};
        mean = turn;
        s.x *= size.x;
        s.y *= size.y;
        s.z *= size.z;
        q = turned(own, q);
      }
      Triple r[3];
      scaled_rows(q, 2.0f / square, s, r);
      STORE_BLOCK(mean_opacity + 4 * row, 4 * splats, 4 * j, mean.x + place.x, mean.y + place.y,
                  mean.z + place.z, opacity[j])
      __global float* to = covariance + 8 * row;
      STORE_BLOCK(to, 8 * splats, 8 * j, dotn(r[0], r[0]), dotn(r[0], r[1]), dotn(r[0], r[2]),
                  dotn(r[1], r[1]))
      STORE_BLOCK(to, 8 * splats, 8 * j + 4, dotn(r[1], r[2]), dotn(r[2], r[2]), TO_FLOATN 0,
                  TO_FLOATN 0)
    }
  }
}

// The fifth -> colours towards an eye; looks: 3 where they follow it, else 0; of the blocks that
// are wanted, 0: all.
__kernel void decode_colors(int anchors, int start, int run, int splats, int features, int units,
                            int looks, float eye_x, float eye_y, float eye_z,
                            __global const Head* heads, __global const float* weights,
                            __global const float* bias, __global const float* least,
                            __global const float* bounds, __global const float* feature,
                            __global const float* places, __global const uchar* wanted,
                            __global float* color) {
  const Head head = heads[COLOR_HEAD];
  // Its first row as if units were counted from its own.
  const int first_at = head.first_at - head.unit_at * (features + looks);
  const int from = get_global_id(0) * run, end = min((anchors + WIDTH - 1) / WIDTH, from + run);
  for (int block = from; block < end; block++) {
    if (wanted && !wanted[block]) continue;
    const int n = min(WIDTH, anchors - block * WIDTH);
    __global const float* woken = bounds + (size_t)block * units;
    __global const float* mine = feature + (size_t)block * features * WIDTH;
    __global const float* place = places + (size_t)block * 3 * WIDTH;
    __global float* rows = color + 4 * (start + (size_t)block * WIDTH * splats);
    if (WIDTH > 1 && n == WIDTH) FETCH_TO_WRITE(rows, WIDTH * splats * 4)
    if (WIDTH > 1 && block + 1 < end) {
      FETCH(woken + units + head.unit_at, head.hidden)
      FETCH(mine + features * WIDTH, features * WIDTH)
      FETCH(place + 3 * WIDTH, 3 * WIDTH)
    }
    int live[MAX_HIDDEN + ROWS];
    floatn look[3], unit[MAX_HIDDEN + ROWS], out[3 * MAX_SPLATS + TILE];
    if (looks) {  // delta, paper eq. 4
      look[0] = LOADN(place) - eye_x;
      look[1] = LOADN(place + WIDTH) - eye_y;
      look[2] = LOADN(place + 2 * WIDTH) - eye_z;
      const floatn length = sqrt(look[0] * look[0] + look[1] * look[1] + look[2] * look[2]);
      const intn known = (length > 0.0f) & (length < INFINITY);  // else no direction: 0
      UNROLL for (int i = 0; i < 3; i++) look[i] = select(TO_FLOATN 0, look[i] / length, known);
    }
    const int awake = wake(head.unit_at, head.unit_at + head.hidden, woken, least, 0, live);
    first_layer(awake, live, features, looks, weights + first_at, bias, mine, look, unit);
    second_layer(head, 0, awake, live, unit, weights, out);
    for (int j = 0; j < splats; j++) {
      STORE_BLOCK(rows, 4 * splats, 4 * j, out[3 * j], out[3 * j + 1], out[3 * j + 2], TO_FLOATN 0)
    }
  }
}
