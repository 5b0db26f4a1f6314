// What projection leaves of a splat: 12 floats.  Everything in pixels, row 0 on top.
#define RECORD 12
#define MEAN_X 0
#define MEAN_Y 1
#define CONIC_A 2  // r = A dx^2 + 2 B dx dy + C dy^2
#define CONIC_B 3
#define CONIC_C 4
#define OPACITY 5
#define RED 6
#define GREEN 7
#define BLUE 8
#define EXTENT_X 9  // half size of the box where alpha reaches the least alpha; <= 0: culled
#define EXTENT_Y 10
#define POWER_THRESHOLD 11  // 2 ln(opacity / least alpha): the r at which alpha reaches the least alpha

#define CULLED_DEPTH 1e30f
#define MAX_ALPHA 0.99f
