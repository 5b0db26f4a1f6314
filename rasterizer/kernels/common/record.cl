// record: what projection leaves of a splat: 12 floats, the input of bin and raster.
// Reads:   nothing.
// Defines: the columns of a record; CULLED_DEPTH and MAX_ALPHA.
// Units:   pixels, row 0 on top; colour is display sRGB.
#define RECORD 12
// The 2D mean: where the centre of the splat is projected to.
#define MEAN_X 0
#define MEAN_Y 1
// The conic is the inverse of the screen covariance Sigma'; for d = (dx, dy) from the mean
// power = d^T Sigma'^-1 d = A dx^2 + 2 B dx dy + C dy^2
// alpha = opacity exp(-power / 2)                          (3DGS, eq. 4)
#define CONIC_A 2
#define CONIC_B 3
#define CONIC_C 4
#define OPACITY 5  // o in 0..1, after whatever filter the projection has
#define RED 6
#define GREEN 7
#define BLUE 8
// Half the size of the box where alpha reaches the least alpha; at most 0: culled.
#define EXTENT_X 9
#define EXTENT_Y 10
// The power, a squared Mahalanobis distance, at which alpha reaches the least alpha: 2 ln(o / min
// alpha).  The test against it is that of alpha, without an exponential.
#define POWER_THRESHOLD 11

#define CULLED_DEPTH 1e30f  // metres: behind every depth, and still a float to sort by
#define MAX_ALPHA 0.99f  // 3DGS: one splat never hides all, so no gradient divides by 1 - alpha = 0
