// losses_shared: the window of SSIM and its constants, both forms (Wang et al. 2004; 3DGS).
// Reads:   nothing.
// Defines: REACH, TAPS, C1, C2, WINDOW; GRADIENT_COLUMNS_TAKES.
// Units:   pixels; images in 0..1.

#define REACH 5
#define TAPS 11
#define C1 1e-4f  // (0.01)^2, for images in 0..1
#define C2 9e-4f  // (0.03)^2

// A Gaussian of sigma 1.5 over 11 pixels, whose sum is 1; the 2D window is its outer product.
__constant float WINDOW[TAPS] = {0.00102838f, 0.00759876f, 0.03600077f, 0.10936069f,
                                 0.21300554f, 0.26601172f, 0.21300554f, 0.10936069f,
                                 0.03600077f, 0.00759876f, 0.00102838f};

// The arguments of both forms of gradient_columns, in this order; then what each sums the L1 in.
#define GRADIENT_COLUMNS_TAKES                                                                 \
  int width, int height, int stride, int masked, float ssim_share, float scale,                \
      __global const float *blurred, __global const float *image, __global const float *target, \
      __global const float *weight, __global float *grad_image
