// surface: how deep a splat lies under the pixels around its mean: 8 floats a splat.
// Reads:   nothing.
// Defines: their columns, SURFACE_REACH and SURFACE_LEAST.
// Units:   metres; slopes in 1/pixel, squares in 1/pixel^2.
//
// A ray through a pixel enters an ellipsoid and leaves it; halfway between the two lies the depth.
// With p the mean in the camera, M the inverse of its covariance up to a factor and d the ray with
// d.z = 1, that is z = d^T M p / d^T M d.  For (u, v) pixels from the mean on the screen
//  z = Z (1 + l) / (1 + 2 l + q),  l = AU u + AV v,  q = QUU u^2 + 2 QUV u v + QVV v^2
// which loses no digits.  Where the ray misses the ellipsoid, as it does around small and thin
// ones, z is held between LOW and HIGH: SURFACE_REACH sigmas, and in front of the camera.
#define SURFACE_SIZE 8
#define SURFACE_Z 0  // metres
#define SURFACE_AU 1
#define SURFACE_AV 2
#define SURFACE_QUU 3
#define SURFACE_QUV 4
#define SURFACE_QVV 5
#define SURFACE_LOW 6
#define SURFACE_HIGH 7
#define SURFACE_REACH 6.0f  // sigmas; where alpha ends at 3.3, perspective stretches far halves
#define SURFACE_LEAST 1e-12f  // under the fraction: a plane seen along itself
