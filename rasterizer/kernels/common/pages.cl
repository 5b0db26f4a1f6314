// pages: where rows that are drawn lie in the arena. With PAGED = 1 a page of PAGE rows lies
// anywhere, and may be drawn for several objects; without it every row is its own.
// Reads:   sources (pages,): the arena's page of each that is drawn, -1: nothing is drawn there.
// Defines: row_of, weighed.
// Units:   rows.
#ifndef PAGED
#define PAGED 0
#define PAGE 32
#endif

// The row of the arena that row i of those drawn is; negative: none.
inline long row_of(int i, __global const int* sources) {
#if PAGED
  return (long)PAGE * sources[i / PAGE] + i % PAGE;
#else
  return i;
#endif
}

// Opacities of a part of what there is.  Of faint splats the part itself; of opaque ones more, since
// two halves, one behind the other, would let through a quarter in the middle, and less than their
// optical depth says, since then their tails would add up to more than the whole: the least squares
// over a splat's area are at opacity * part^0.69 for two halves that are opaque.
inline float8 weighed(float8 opacity, float part) {
  const float8 least = opacity * part, most = opacity * pow(part, 0.69f);
  return select(opacity, least + (most - least) * opacity, opacity > 0.0f);
}
