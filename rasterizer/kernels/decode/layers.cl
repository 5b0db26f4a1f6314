// layers: the two layers of a head and its activation, for a block of WIDTH anchors at a time.
// Reads:   WIDTH, TILE, ROWS, UNITS, LIGHTS (numbers of a channel of light by direction).
// Defines: floatn, intn, LOADN, STOREN, TO_FLOATN, ALL, UNROLL; Head, wake, first_layer,
//          light_along, second_layer, exp2n.
// Units:   none; a head's gain gives metres or display values.
// A comparison of floatn gives intn: 0 or 1 of a scalar, 0 or -1 a lane; select() takes both.
#if WIDTH == 1  // a GPU
typedef float floatn;
typedef int intn;
#define LOADN(p) (*(p))
#define STOREN(v, p) (*(p) = (v))
#define AS_FLOATN as_float
#define AS_INTN as_int
#define TO_FLOATN (float)  // fma() takes no number for a vector
#define ALL(lanes) (lanes)  // all() looks at the sign bit, which a scalar 1 lacks
#else  // a CPU: one register of AVX-512, or two of AVX2
typedef float16 floatn;
typedef int16 intn;
#define LOADN(p) vload16(0, p)
#define STOREN(v, p) vstore16(v, 0, p)
#define AS_FLOATN as_float16
#define AS_INTN as_int16
#define TO_FLOATN (float16)
#define ALL(lanes) all_lanes(lanes)
#endif
#define UNROLL _Pragma("unroll")
#define DIRECTION 3  // inputs
#define LOG2E 1.44269504f  // log2(e): e^z = 2^(z log2(e))
#define MOST 126.0f  // the largest exponent of 2
// Activations, numbered as decode_heads.py has them.
#define NONE 0
#define TANH 1
#define SIGMOID 2
#define SOFTPLUS 3
#define EXP 4

// Where a head's numbers begin in the flat arrays, and what becomes of its outputs.
typedef struct {
  int hidden;    // units, a multiple of UNITS
  int unit_at;   // the first of them among those of all heads
  int first_at;  // W1 in the weights, a row a unit
  int last_at;   // b2, then W2
  int tiles;     // of TILE outputs
  int activation;
  float low, high;  // the clip before it
  float gain;       // after it
} Head;

// Whether a comparison holds in all lanes; all() asks one after the other, with a branch for each.
inline int all_lanes(int16 a) {
  const int8 b = a.lo & a.hi;
  const int4 c = b.lo & b.hi;
  const int2 d = c.lo & c.hi;
  return d.x & d.y;
}

// Unlike clamp(), NaN stays NaN: an instruction each, which gives its second operand then.
inline floatn within(floatn z, float low, float high) {
  z = TO_FLOATN low > z ? TO_FLOATN low : z;
  return TO_FLOATN high < z ? TO_FLOATN high : z;
}

// 2^t, relative error 2e-7; beyond +-most, at most 126, it stays at what it is there.
// The polynomial is that of exp2p in common/raster_blocks.cl.
inline floatn exp2n(floatn t, float most) {
  t = within(t, -most, most);
  // Adding 1.5 * 2^23 rounds to the nearest integer and leaves it in the low bits.
  const floatn shifted = t + 12582912.0f;
  const floatn f = t - (shifted - 12582912.0f);
  // Horner for 2^f, f in -0.5 .. 0.5.
  floatn p = 1.327647152e-3f;
  p = fma(p, f, TO_FLOATN 9.675541331e-3f);
  p = fma(p, f, TO_FLOATN 5.550713275e-2f);
  p = fma(p, f, TO_FLOATN 2.402211972e-1f);
  p = fma(p, f, TO_FLOATN 6.931469671e-1f);
  p = fma(p, f, TO_FLOATN 1.000000072f);
  // The integer goes straight to the exponent bits.
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
    floatn under[TILE + 1];  // one more, so that there are pairs
    // NaN has to stay with its own splat: fmax drops it, and it is put back.
    UNROLL for (int o = 0; o < TILE; o++)
      under[o] = 1.0f + exp2n(fmax(c * z[o], TO_FLOATN -60.0f), 60.0f);
    // 2^60: the product of two is a float, and either result is 0 or 1 to all of its bits.
    under[TILE] = 1;
    // Two at a time: one division, which takes as long as ten products.
    UNROLL for (int o = 0; o < TILE; o += 2) {
      const floatn by = b / (under[o] * under[o + 1]);
      z[o] = select(fma(by, under[o + 1], TO_FLOATN a), z[o], z[o] != z[o]);
      if (o + 1 < TILE)
        z[o + 1] = select(fma(by, under[o], TO_FLOATN a), z[o + 1], z[o + 1] != z[o + 1]);
    }
    return;
  }
  if (head.activation == EXP) {
    // The bits of a GPU's NaN are others than a CPU's, and exp2n adds to them.
    UNROLL for (int o = 0; o < TILE; o++)
      z[o] = select(exp2n(LOG2E * z[o], MOST), z[o], z[o] != z[o]);
  } else if (head.activation == SOFTPLUS) {  // log(1 + e^z), never e of a large number
    for (int o = 0; o < TILE; o++) {
      const floatn above = select(z[o], TO_FLOATN 0.0f, z[o] < 0.0f);
      z[o] = above + log(1.0f + exp2n(-LOG2E * fabs(z[o]), MOST));
    }
  }
  UNROLL for (int o = 0; o < TILE; o++) z[o] *= head.gain;
}

// Units first to end (multiples of UNITS) that some anchor of a block wakes -> live from n on;
// returns how many there are then.  Each bound is the largest of the block.
inline int wake(int first, int end, __global const float* bounds, __global const float* least,
                int from, int* live) {
  long n = from;  // int would be widened for each
  for (int u = first; u < end; u += UNITS) {
    const int16 awake = vload16(0, bounds + u) > vload16(0, least + u);
    if (all_lanes(awake)) {  // where weights are random, hardly ever anything else
      UNROLL for (int k = 0; k < UNITS; k++) live[n + k] = u + k;
      n += UNITS;
      continue;
    }
    int one[UNITS];  // 1 or 0
    vstore16(-awake, 0, one);
    UNROLL for (int k = 0; k < UNITS; k++) {
      live[n] = u + k;  // without a branch: nobody could guess it
      n += one[k];
    }
  }
  return n;
}

// Inputs `from` to `end` of what looks at the eye; numbers known to the compiler stay in registers.
#define LOOK(from, end)                                              \
  {                                                                  \
    UNROLL for (int i = from; i < (end); i++) {                      \
      UNROLL for (int u = 0; u < ROWS; u++)                          \
        sum[u] = fma(look[i], TO_FLOATN w[u][features + i], sum[u]); \
    }                                                                \
  }

// The hidden units `live` of one block: ROWS of them share each load of a feature.
inline void first_layer(int n, int* live, int features, int looks, __global const float* weights,
                        __global const float* bias, __global const float* feature,
                        const floatn* look, floatn* unit) {
  const int row = features + looks;
  // Tiles are whole: the first unit again, and nobody reads what comes of it.
  for (int t = n; t < n + ROWS; t++) live[t] = live[0];
  for (int t = 0; t < n; t += ROWS) {
    floatn sum[ROWS];               // in registers, since loops over them are unrolled
    __global const float* w[ROWS];  // a row of W1 each
    UNROLL for (int u = 0; u < ROWS; u++) {
      w[u] = weights + live[t + u] * row;
      sum[u] = bias[live[t + u]];
    }
    // A weight is the same for all anchors of the block: read once, for WIDTH products.
    for (int i = 0; i < features; i++) {
      const floatn f = LOADN(feature + i * WIDTH);
      UNROLL for (int u = 0; u < ROWS; u++) sum[u] = fma(f, TO_FLOATN w[u][i], sum[u]);
    }
    // Only the colour looks at the direction: none, three, or four or six with light along it.
    if (looks) LOOK(0, DIRECTION)
    if (looks > DIRECTION) LOOK(DIRECTION, DIRECTION + 1)
    if (looks > DIRECTION + 1) LOOK(DIRECTION + 1, DIRECTION + 3)
    // Not fmax: NaN has to stay NaN.
    UNROLL for (int u = 0; u < ROWS; u++)
      unit[t + u] = select(sum[u], TO_FLOATN 0.0f, sum[u] < 0.0f);
  }
}

inline floatn channel_along(__global const float* light, const floatn* value) {
  floatn sum = 0;
  UNROLL for (int i = 0; i < LIGHTS; i++) sum = fma(LOADN(light + i * WIDTH), value[i], sum);
  return sum;
}

// What the block's light by direction (channels, LIGHTS, WIDTH) gives along unit directions d, or
// along none, written behind them: spherical harmonics of degree 1 and 2 in units of those of
// degree 1, spherical_harmonics.py.
inline void light_along(__global const float* light, int channels, floatn* d) {
  const floatn xx = d[0] * d[0], yy = d[1] * d[1], zz = d[2] * d[2];
  const floatn value[LIGHTS] = {d[0], d[1], d[2],
                                2.2360680f * d[0] * d[1], 2.2360680f * d[1] * d[2],
                                2.2360680f * d[2] * d[0], 0.6454972f * (2 * zz - xx - yy),
                                1.1180340f * (xx - yy)};
  if (channels) d[DIRECTION] = channel_along(light, value);
  if (channels > 1) {
    d[DIRECTION + 1] = channel_along(light + LIGHTS * WIDTH, value);
    d[DIRECTION + 2] = channel_along(light + 2 * LIGHTS * WIDTH, value);
  }
}

// Outputs of `count` tiles from tile c on, all their sums at once: a unit is loaded for fifteen
// products, not five, and no sum waits for the one before.
#define SUM_TILES(count)                                                            \
  {                                                                                 \
    floatn sum[(count) * TILE];                                                     \
    UNROLL for (int o = 0; o < (count) * TILE; o++) sum[o] = biases[c * TILE + o];  \
    for (int t = first; t < end; t++) {                                             \
      __global const float* w = last + (c * head.hidden + live[t]) * TILE;          \
      const floatn h = unit[t];                                                     \
      UNROLL for (int i = 0; i < (count); i++) {                                    \
        UNROLL for (int o = 0; o < TILE; o++)                                       \
          sum[i * TILE + o] = fma(h, TO_FLOATN w[i * step + o], sum[i * TILE + o]); \
      }                                                                             \
    }                                                                               \
    UNROLL for (int o = 0; o < (count) * TILE; o++) out[c * TILE + o] = sum[o];     \
    c += (count);                                                                   \
  }

// Outputs of a head out of its units first to end of those that are awake.  A call, not four copies
// of a head's worth of code: 0.15 s less to compile, and no slower.
__attribute__((noinline)) void second_layer(Head head, int first, int end, const int* live,
                                            const floatn* unit, __global const float* weights,
                                            floatn* out) {
  // b2, one a tile's output.
  __global const float* biases = weights + head.last_at;
  // TILE weights a tile and unit, side by side; units count from the first of all heads.
  __global const float* last = biases + (head.tiles - head.unit_at) * TILE;
  const long step = (long)head.hidden * TILE;  // from a tile's weights to the next one's
  for (int c = 0; c < head.tiles;) {
    const int rest = head.tiles - c;
    // Four are two and two: a tile alone waits for its own sums.
    if (rest == 3 || rest > 4) SUM_TILES(3)
    else if (rest > 1) SUM_TILES(2)
    else SUM_TILES(1)
  }
  for (int c = 0; c < head.tiles; c++) activate(head, out + c * TILE);
}
