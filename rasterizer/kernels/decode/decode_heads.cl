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
#include "common/vector.cl"
#include "layers.cl"
#include "blocks.cl"

// Heads in their order: offset, scale, rotation, opacity, color.
#define OPACITY_HEAD 3
#define COLOR_HEAD 4

// The largest that the features alone give each unit in each block; above all numbers where one of
// the anchors has no number.  Once a model.
__kernel void bound_units(int blocks, int features, int units, int run,
                          __global const float* first, __global const float* feature,
                          __global float* bounds) {
  const int from = get_global_id(0) * run, end = min(blocks, from + run);
  for (int block = from; block < end; block++) {
    for (int u = 0; u < units; u++) {
      floatn sum = 0;
      // W1 f, without b1 and Psi: these are the same in every block.
      for (int i = 0; i < features; i++)
        sum = fma(LOADN(feature + ((size_t)block * features + i) * WIDTH),
                  TO_FLOATN first[u * features + i], sum);
      // max() would lose NaN, and its anchor with it.
      sum = select(sum, TO_FLOATN INFINITY, sum != sum);
#if WIDTH == 1  // an anchor is a block
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
    const int n = min(WIDTH, anchors - block * WIDTH);  // anchors; the rest repeats the last one
    __global const float* woken = bounds + (size_t)block * units;
    __global const float* mine = feature + (size_t)block * features * WIDTH;
    // The block's first splat; those of an anchor lie side by side.
    const size_t row = start + (size_t)block * WIDTH * splats;
    // Numbers of the next block (this one's came while the one before was worked on) and rows that
    // are written at the end of this one, a few at a time: a processor that waits for more of them
    // than it can count stands still.
    const int ahead = WIDTH > 1 && block + 1 < end, whole = WIDTH > 1 && n == WIDTH && shapes;
    const int half_rows = WIDTH * splats * 4;  // floats: half of the covariances
    if (whole) FETCH_TO_WRITE(covariance + 8 * row, half_rows)
    // Units that are awake, head after head: those of head m are ends[m] to ends[m + 1].
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
    // Features are read once for the four heads.
    first_layer(ends[4], live, features, 0, weights, bias, mine, 0, unit);
    if (whole) FETCH_TO_WRITE(covariance + 8 * row + half_rows, half_rows)
    second_layer(heads[3], ends[3], ends[4], live, unit, weights, opacity);
    if (ahead) FETCH(woken + units, units)
    if (!shapes) {  // the rest does not follow x, and is there
      if (ahead) FETCH(mine + features * WIDTH, features * WIDTH)
      for (int j = 0; j < splats; j++) {
        float lanes[WIDTH];
        STOREN(opacity[j], lanes);
        for (int lane = 0; lane < n; lane++)
          mean_opacity[4 * (row + lane * splats + j) + 3] = lanes[lane];
      }
      continue;
    }
    // Offset in metres, scale in metres and one sigma, rotation w x y z of any length.
    second_layer(heads[0], ends[0], ends[1], live, unit, weights, offset);
    if (whole) FETCH_TO_WRITE(mean_opacity + 4 * row, WIDTH * splats * 4)
    second_layer(heads[1], ends[1], ends[2], live, unit, weights, scale);
    if (ahead) FETCH(mine + features * WIDTH, features * WIDTH)
    second_layer(heads[2], ends[2], ends[3], live, unit, weights, rotation);
    __global const float* at = places + (size_t)block * 3 * WIDTH;
    const Triple place = {LOADN(at), LOADN(at + WIDTH), LOADN(at + 2 * WIDTH)};
    Triple axes[3], size;  // rows of the anchor's R S, and its s
    Quaternion own;
    if (frames) {
      // Columns: three factors, then w x y z.
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
    // Splat j of all anchors of the block at a time.
    for (int j = 0; j < splats; j++) {
      Triple mean = {offset[3 * j], offset[3 * j + 1], offset[3 * j + 2]};
      Triple s = {scale[3 * j], scale[3 * j + 1], scale[3 * j + 2]};
      Quaternion q = {rotation[4 * j], rotation[4 * j + 1], rotation[4 * j + 2],
                      rotation[4 * j + 3]};
      // Entries whose squares are no floats, or none at all: hardly ever.
      floatn square = squares(q);
      const intn fine = (square > 1e-30f) & (square < 1e30f);
      if (!ALL(fine)) {
        q = held(q, fine);
        square = squares(q);
      }
      if (frames) {
        // anchor + R (s * offset), s * scale, R times its rotation; |q| stays.
        const Triple turn = {dotn(axes[0], mean), dotn(axes[1], mean), dotn(axes[2], mean)};
        mean = turn;
        s.x *= size.x;
        s.y *= size.y;
        s.z *= size.z;
        q = turned(own, q);
      }
      Triple r[3];  // Sigma's entries are the dot products of the rows of R S
      scaled_rows(q, 2.0f / square, s, r);
      STORE_BLOCK(mean_opacity + 4 * row, 4 * splats, 4 * j, mean.x + place.x, mean.y + place.y,
                  mean.z + place.z, opacity[j])
      // xx xy xz yy | yz zz 0 0
      __global float* to = covariance + 8 * row;
      STORE_BLOCK(to, 8 * splats, 8 * j, dotn(r[0], r[0]), dotn(r[0], r[1]), dotn(r[0], r[2]),
                  dotn(r[1], r[1]))
      STORE_BLOCK(to, 8 * splats, 8 * j + 4, dotn(r[1], r[2]), dotn(r[2], r[2]), TO_FLOATN 0,
                  TO_FLOATN 0)
    }
  }
}

// The fifth -> colours towards an eye; looks: 3 where they follow it, 4 or 6 where anchors have
// light by direction of one channel or three, too, else 0; of the blocks that are wanted, 0: all.
__kernel void decode_colors(int anchors, int start, int run, int splats, int features, int units,
                            int looks, float eye_x, float eye_y, float eye_z,
                            __global const Head* heads, __global const float* weights,
                            __global const float* bias, __global const float* least,
                            __global const float* bounds, __global const float* feature,
                            __global const float* places, __global const float* light,
                            __global const uchar* wanted, __global float* color) {
  const Head head = heads[COLOR_HEAD];
  // Its first row as if units were counted from its own.
  const int first_at = head.first_at - head.unit_at * (features + looks);
  const int channels = looks ? looks - DIRECTION : 0;  // of light
  const int from = get_global_id(0) * run, end = min((anchors + WIDTH - 1) / WIDTH, from + run);
  for (int block = from; block < end; block++) {
    if (wanted && !wanted[block]) continue;  // nobody sees any anchor of it
    const int n = min(WIDTH, anchors - block * WIDTH);
    __global const float* woken = bounds + (size_t)block * units;
    __global const float* mine = feature + (size_t)block * features * WIDTH;
    __global const float* place = places + (size_t)block * 3 * WIDTH;
    __global const float* own = light + (size_t)block * channels * LIGHTS * WIDTH;
    __global float* rows = color + 4 * (start + (size_t)block * WIDTH * splats);
    if (WIDTH > 1 && n == WIDTH) FETCH_TO_WRITE(rows, WIDTH * splats * 4)
    if (WIDTH > 1 && block + 1 < end) {
      // The next block's share of each array.
      FETCH(woken + units + head.unit_at, head.hidden)
      FETCH(mine + features * WIDTH, features * WIDTH)
      FETCH(place + 3 * WIDTH, 3 * WIDTH)
      if (channels) FETCH(own + channels * LIGHTS * WIDTH, channels * LIGHTS * WIDTH)
    }
    int live[MAX_HIDDEN + ROWS];
    floatn look[DIRECTION + 3], unit[MAX_HIDDEN + ROWS], out[3 * MAX_SPLATS + TILE];
    if (looks) {
      // delta of paper eq. 4, from the eye to the anchor, of length 1.
      look[0] = LOADN(place) - eye_x;
      look[1] = LOADN(place + WIDTH) - eye_y;
      look[2] = LOADN(place + 2 * WIDTH) - eye_z;
      const floatn length = sqrt(look[0] * look[0] + look[1] * look[1] + look[2] * look[2]);
      const intn known = (length > 0.0f) & (length < INFINITY);  // else no direction: 0
      UNROLL for (int i = 0; i < 3; i++) look[i] = select(TO_FLOATN 0, look[i] / length, known);
      light_along(own, channels, look);
    }
    // bound_units knows the features alone: `least` allows for any direction.
    const int awake = wake(head.unit_at, head.unit_at + head.hidden, woken, least, 0, live);
    first_layer(awake, live, features, looks, weights + first_at, bias, mine, look, unit);
    second_layer(head, 0, awake, live, unit, weights, out);
    // Red, green, blue, and nothing.
    for (int j = 0; j < splats; j++) {
      STORE_BLOCK(rows, 4 * splats, 4 * j, out[3 * j], out[3 * j + 1], out[3 * j + 2], TO_FLOATN 0)
    }
  }
}
