// bin: splats -> the list of intersections (splat, tile) of every tile, near to far.  CPU form. A
// work-item owns a contiguous chunk of splats, counts into a table of its own, and scatters from
// its row of the scanned table: parallel, stable, and the same list for any number of chunks.  3DGS
// sorts intersections by tile and depth at once; here splats are sorted by depth before they are
// spread over tiles, which sorts several times fewer keys and gives the same lists.
// Reads:   record (N, 12) and depth (N,) of project.
// Writes:  tile_bounds (N, 2), order, and starts (tiles + 1) and intersections: the lists, tile by
//          tile.
// Units:   pixels and tiles; depths in metres, sorted as the bits of floats above 0.
#include "common/tile_bounds_of_lanes.cl"
// How many splats ahead memory is asked for, each the best of a row of doubled distances:
#define AHEAD 96     // the next tile bounds, while these are counted
#define SOON 12      // the ends of lists, while these are written: they move meanwhile
#define DIGITS 128   // the places of keys of an order, which are farther apart
#define SPARE 16  // ints of a cache line: chunks must not write to the same one

// What a chunk gathers: its visible splats, packed at its start, and a histogram of low digits.
typedef struct {
  __global uint2* tile_bounds;
  __global uint2* pairs;  // splat, depth key
  __global int* bins;
  int next;               // where its next visible splat goes
  int8 intersections;     // of each lane, summed at the end; so with the range of keys
  uint8 min_key, max_key;
} Chunk;

// A chunk's slice of the pairs begins where its splats do, so that chunks need no common counter.
inline Chunk open_chunk(int first, __global uint2* tile_bounds, __global uint2* pairs,
                        __global int* bins) {
  const Chunk chunk = {tile_bounds, pairs, bins, first, 0, 0xffffffffu, 0};
  for (int b = 0; b < LOW_BINS; b++) bins[b] = 0;
  return chunk;
}

// The status of a chunk: visible splats, intersections, least and largest key.
inline uint4 close_chunk(const Chunk* chunk, int first) {
  return (uint4)(chunk->next - first, sum_ints(chunk->intersections), min_uints(chunk->min_key),
                 max_uints(chunk->max_key));
}

// Enters `n` splats from number i on; depth: their eight depths.
inline void enter_eight(Chunk* chunk, int i, int n, const TileBoundsV* p, float8 depth) {
  // Depths are above 0, and such floats sort as their bits do.
  const uint8 c = p->corner, m = p->mask, key = as_uint8(depth);
  const int8 visible = p->count > 0;
  chunk->intersections += p->count;
  // Lanes that are not visible give all ones and zeros: neither least nor largest.
  chunk->min_key = min(chunk->min_key, key | ~as_uint8(visible));
  chunk->max_key = max(chunk->max_key, key & as_uint8(visible));
  if (n == LANES && all(visible)) {
    // The common case, eight visible splats: whole vectors of pairs and bounds are stored.
    vstore16((uint16)(i, key.s0, i + 1, key.s1, i + 2, key.s2, i + 3, key.s3, i + 4, key.s4, i + 5,
                      key.s5, i + 6, key.s6, i + 7, key.s7),
             0, (__global uint*)(chunk->pairs + chunk->next));
    vstore16((uint16)(c.s0, m.s0, c.s1, m.s1, c.s2, m.s2, c.s3, m.s3, c.s4, m.s4, c.s5, m.s5, c.s6,
                      m.s6, c.s7, m.s7), 0, (__global uint*)(chunk->tile_bounds + i));
    chunk->next += LANES;
    // The histogram of the first digit is counted here, so the sort's first pass reads nothing
    // twice.
    uint low[LANES];
    vstore8(key & (LOW_BINS - 1), 0, low);
    for (int lane = 0; lane < LANES; lane++) chunk->bins[low[lane]]++;
    return;
  }
  uint keys[LANES], corner[LANES], mask[LANES];
  vstore8(key, 0, keys);
  vstore8(c, 0, corner);
  vstore8(m, 0, mask);
  for (int lane = 0; lane < n; lane++) {
    chunk->tile_bounds[i + lane] = (uint2)(corner[lane], mask[lane]);
    // Written over by the next one unless visible.
    chunk->pairs[chunk->next] = (uint2)(i + lane, keys[lane]);
    // MASKED and BOX lie above all columns and rows, a culled splat's word is 0.
    const int here = corner[lane] >= MASKED;
    chunk->next += here;
    chunk->bins[keys[lane] & (LOW_BINS - 1)] += here;
  }
}

// columns_of_row() of tiles.cl for eight rows of a BOX from `first` on: the same operations.
IN_PLACE void columns_of_eight_rows(const EllipseRows* s, int first, int* start, int* end) {
  const float8 row = convert_float8((int8)(0, 1, 2, 3, 4, 5, 6, 7) + first);
  const float8 top = s->top + row * (float)TILE, bottom = top + (TILE - 1);
  const float8 y_right = fmin(fmax((float8)(s->y_extreme), top), bottom),
      y_left = fmin(fmax((float8)(-s->y_extreme), top), bottom);
  const float8 half_right = sqrt(
      fmax(fma(-y_right * y_right, (float8)(s->inv_yy), (float8)(s->threshold)), 0.0f) * s->inv_a);
  const float8 half_left = sqrt(
      fmax(fma(-y_left * y_left, (float8)(s->inv_yy), (float8)(s->threshold)), 0.0f) * s->inv_a);
  const float8 slope = s->slope;
  const float8 right = fma(slope, y_right, half_right) - s->left + s->rounding;
  const float8 left = fma(slope, y_left, -half_left) - s->left - s->rounding;
  const float width = (float)(s->columns * TILE);
  // What is not a number leaves nothing out.
  const int8 in_box = right < width;
  const float8 within = select((float8)(0), right, in_box & (right >= 0.0f));
  int8 after = (convert_int8(within) >> 4) + 1;
  after = select(after, (int8)(0), ~(right >= 0.0f));
  after = select((int8)(s->columns), after, in_box);
  const int8 beyond = left > (float)(TILE - 1), meets = left < width;
  const int8 from = convert_int8(ceil(select((float8)(0), left, beyond & meets))) >> 4;
  int8 before = select((int8)(s->columns), from, meets);
  before = select((int8)(0), before, beyond);
  vstore8(min(before, after), 0, start);
  vstore8(after, 0, end);
}

// Per splat its tile bounds; per chunk the (splat, depth key) pairs of its visible splats, packed
// at the chunk's start, and the histogram of their low digits.  status: visible, intersections, key
// range.
__kernel void find_tile_bounds(int count, int chunk, int tiles_x, int tiles_y,
                          __global const float* record, __global const float* depth,
                          __global uint2* tile_bounds, __global uint2* pairs,
                          __global int* histogram, __global uint4* status) {
  const int c = get_global_id(0);
  const int first = c * chunk, last = min(count, first + chunk);
  Chunk mine = open_chunk(first, tile_bounds, pairs, histogram + c * LOW_BINS);
  for (int i = first; i < last; i += LANES) {
    const int n = min(LANES, last - i);
    // Eight records, transposed: means, conics, extents and the threshold, one column a vector.
    float column[8][LANES], z[LANES];
    for (int lane = 0; lane < LANES; lane++) {
      const size_t from = i + min(lane, n - 1);
      __global const float* s = record + RECORD * from;
      for (int k = 0; k < 5; k++) column[k][lane] = s[k];
      // Opacity and colour are not needed: extents and threshold stand behind them.
      for (int k = 5; k < 8; k++) column[k][lane] = s[k + 4];
      z[lane] = depth[from];
    }
    Ellipses e;
    // Columns of the record in their order: mean, conic, half extents, threshold.
    e.x = vload8(0, column[0]);
    e.y = vload8(0, column[1]);
    e.a = vload8(0, column[2]);
    e.b = vload8(0, column[3]);
    e.c = vload8(0, column[4]);
    e.half_x = vload8(0, column[5]);
    e.half_y = vload8(0, column[6]);
    e.power_threshold = vload8(0, column[7]);
    // Positive, so that NaN fails, as everywhere.
    e.seen = (e.half_x > 0.0f) & ((int8)(0, 1, 2, 3, 4, 5, 6, 7) < n);
    const TileBoundsV p = tile_bounds_of_lanes(&e, tiles_x, tiles_y);
    enter_eight(&mine, i, n, &p, vload8(0, z));
  }
  status[c] = close_chunk(&mine, first);
}

// Counts (chunks, bins) -> the position of each chunk's first key of a bin, bin by bin and in it
// chunk by chunk: that order makes the scatter stable.  One work-item: the table is
// a few chunks wide.
__kernel void scan_table(int bins, int chunks, __global int* table, __global int* starts) {
  int sum = 0;
  // An exclusive prefix sum down the chunks of a bin, then on to the next bin.
  for (int b = 0; b < bins; b++) {
    starts[b] = sum;
    for (int c = 0; c < chunks; c++) {
      const int n = table[c * bins + b];
      table[c * bins + b] = sum;
      sum += n;
    }
  }
  starts[bins] = sum;
}

// bins is a power of two, or more than any key needs.
inline uint mask_of(int bins) { return (bins & (bins - 1)) ? 0xffffffffu : (uint)bins - 1; }

// How many keys of each digit a chunk has, for passes after the first.
__kernel void count_digits(int count, int chunk, int bins, uint origin, int shift,
                           __global const uint2* pairs, __global int* table) {
  const int c = get_global_id(0);
  __global int* mine = table + c * bins;
  for (int b = 0; b < bins; b++) mine[b] = 0;
  const int last = min(count, (c + 1) * chunk);
  for (int i = c * chunk; i < last; i++) mine[(pairs[i].y - origin) >> shift & mask_of(bins)]++;
}

// One pass of a stable counting sort.  packed: each chunk's pairs lie at its start, as many as its
// status says.  final: only the splats are wanted.
__kernel void scatter_digits(int count, int chunk, int bins, uint origin, int shift, int packed,
                             int final, __global const uint4* status, __global const uint2* pairs,
                             __global int* table, __global uint2* sorted_pairs,
                             __global int* sorted_splats) {
  const int c = get_global_id(0);
  __global int* next = table + c * bins;
  const int first = c * chunk;
  const int last = packed ? first + (int)status[c].x : min(count, first + chunk);
  for (int i = first; i < last; i++) {
    // Bins lie far apart: the place of a key that comes soon is asked for now.
    const uint2 pair = pairs[i], soon = pairs[min(i + DIGITS, last - 1)];
    const int its_place = next[(soon.y - origin) >> shift & mask_of(bins)];
    if (final)
      PREFETCH_TO_WRITE(sorted_splats + its_place);
    else
      PREFETCH_TO_WRITE(sorted_pairs + its_place);
    // The chunk's own row of the table says where the next key of this digit goes.
    const int to = next[(pair.y - origin) >> shift & mask_of(bins)]++;
    if (final)
      sorted_splats[to] = pair.x;
    else
      sorted_pairs[to] = pair;
  }
}

// For every eight rows of the box of `splat`, whose bounds are `here`.  Both walks of a box take
// the same operations, or a list would overflow.
#define EIGHT_ROWS_OF_BOX                                                             \
  const EllipseRows ellipse = ellipse_rows_of(record + (size_t)RECORD * splat, here); \
  const int rows = here.y >> 16;                                                      \
  for (int first = 0; first < rows; first += LANES)

// HIDDEN = 1: tiles whose `shown` (bins,) is 0 get empty lists, whatever touches them.
#ifdef HIDDEN
#define AND_SHOWN , __global const uchar* shown
#define IF_SHOWN(tile, number) (shown[tile] ? (number) : 0)
#else
#define AND_SHOWN
#define IF_SHOWN(tile, number) (number)
#endif

// One row of a tile mask, at the row's first tile: ones where its tiles begin, taken back behind
// them; an empty row does both at the same place.
inline void count_row(__global int* mine, uint row) {
  const int start = popcount(~(row | 0x100) & ((row | 0x100) - 1));
  mine[start]++;
  mine[start + popcount(row)]--;
}

// table (chunks, bins): how often each tile is touched; some rows of tiles lie beyond them.  Tiles
// of a row follow each other, so that two additions count them: sums along the tiles make the rest.
__kernel void count_tiles(int count, int chunk, int tiles_x, int bins, __global const int* order,
                          __global const float* record, __global const uint2* tile_bounds,
                          __global uint2* sorted_bounds, __global int* table AND_SHOWN) {
  const int c = get_global_id(0);
  __global int* mine = table + c * bins;
  for (int t = 0; t < bins; t++) mine[t] = 0;
  const int last = min(count, (c + 1) * chunk);
  for (int i = c * chunk; i < last; i++) {
    // In depth order, so the loads are scattered: each is asked for before it is needed.
    PREFETCH(tile_bounds + order[min(i + AHEAD, last - 1)]);
    // Near to far.
    const int splat = order[i];
    const uint2 here = tile_bounds[splat];
    sorted_bounds[i] = here;  // side by side for the next pass
    __global int* corner = mine + BOUNDS_ROW(here) * tiles_x + BOUNDS_COLUMN(here);
    if (here.x & MASKED) {
      // No loop over bits, whose end nobody foresees: two rows always, four where there are more.
      count_row(corner, here.y & 0xff);
      count_row(corner + tiles_x, here.y >> 8 & 0xff);
      if (here.y >> 16) {
        count_row(corner + 2 * tiles_x, here.y >> 16 & 0xff);
        count_row(corner + 3 * tiles_x, here.y >> 24);
      }
    } else if (here.x & BOX) {
      EIGHT_ROWS_OF_BOX {
        int start[LANES], end[LANES];
        columns_of_eight_rows(&ellipse, first, start, end);
        for (int k = 0; k < min(LANES, rows - first); k++) {
          corner[(first + k) * tiles_x + start[k]]++;
          corner[(first + k) * tiles_x + end[k]]--;
        }
      }
    }
  }
  // Sums along the tiles turn beginnings and ends into counts; rows end before the next begins.
  int sum = 0;
  for (int t = 0; t < bins; t++) {
    sum += mine[t];
    mine[t] = IF_SHOWN(t, sum);
  }
}

// Writes every splat to the lists of its tiles, in depth order, so that each list is near to far.
// The array is longer than the lists by a cache line a chunk: what touches nothing is written there
// instead of branched around.
__kernel void scatter_tiles(int count, int chunk, int tiles_x, int bins, int total,
                            __global const int* order, __global const float* record,
                            __global const uint2* sorted_bounds, __global int* table,
                            __global int* intersections AND_SHOWN) {
  const int c = get_global_id(0);
  __global int* next = table + c * bins;
  const int spare = total + SPARE * c;
  const int last = min(count, (c + 1) * chunk);
  for (int i = c * chunk; i < last; i++) {
    const int splat = order[i];
#define VISIT(tile, touched)                                 \
  {                                                          \
    const int to = next[tile], in = IF_SHOWN(tile, touched); \
    intersections[in ? to : spare] = splat;                  \
    next[tile] = to + in;                                    \
  }
    const uint2 here = sorted_bounds[i];
    const int tile = BOUNDS_ROW(here) * tiles_x + BOUNDS_COLUMN(here);
    // Stores leave in order, and each list's end is a cache line of its own: those of a splat that
    // comes soon are asked for now, and the record that a box needs.
    const int ahead = min(i + SOON, last - 1);
    const uint2 soon = sorted_bounds[ahead];
    const int its_tile = BOUNDS_ROW(soon) * tiles_x + BOUNDS_COLUMN(soon);
    // Of a splat that is no box the first record, which is there: no branch.
    __global const float* its_box = record + (soon.x & BOX ? (size_t)RECORD * order[ahead] : 0);
    PREFETCH(its_box);
    PREFETCH(its_box + RECORD - 1);
    PREFETCH_TO_WRITE(intersections + next[its_tile]);
    PREFETCH_TO_WRITE(intersections + next[its_tile + 1]);
    PREFETCH_TO_WRITE(intersections + next[its_tile + tiles_x]);
    PREFETCH_TO_WRITE(intersections + next[its_tile + tiles_x + 1]);
    // Branch free where a splat lies within 2 x 2 tiles, as nearly all do; there a tile may lie
    // beyond the last one.  Else bit by bit through the tile mask, or row by row through a box.
    if (here.x & MASKED && !(here.y & ~0x303u)) {
      VISIT(tile, here.y & 1);
      VISIT(tile + 1, here.y >> 1 & 1);
      VISIT(tile + tiles_x, here.y >> 8 & 1);
      VISIT(tile + tiles_x + 1, here.y >> 9 & 1);
    } else if (here.x & MASKED) {
      for (uint mask = here.y; mask; mask &= mask - 1) {
        const int bit = popcount(~mask & (mask - 1));  // number of the lowest
        VISIT(tile + (bit >> 3) * tiles_x + (bit & 7), 1);
      }
    } else if (here.x & BOX) {
      EIGHT_ROWS_OF_BOX {
        int start[LANES], end[LANES];
        columns_of_eight_rows(&ellipse, first, start, end);
        for (int k = 0; k < min(LANES, rows - first); k++)
          for (int column = start[k]; column < end[k]; column++)
            VISIT(tile + (first + k) * tiles_x + column, 1);
      }
    }
#undef VISIT
  }
}

// First slot of every splat: the gradients of its intersections lie side by side from there, and
// are summed in that order (sum_slots.cl).
__kernel void number_slots(int count, __global const uint2* tile_bounds, __global int* first_slot) {
  int sum = 0;
  for (int i = 0; i < count; i++) {
    first_slot[i] = sum;
    sum += tiles_at(tile_bounds[i]);
  }
}
