// foveate: fills what draw_cpu.cl with FOVEATED left out from the samples of half the width and
// height, and softens the seam.  A work-item takes two rows, those of a row of samples.
// Reads:   halved ((H + 1) / 2, (W + 1) / 2, CHANNELS); the fovea's centre and the radii of its
//          sharp middle and of its end, with their units a pixel across and along.
// Writes:  image (H, W, CHANNELS): sharp within the inner radius, to the bit as it was; samples,
//          linear between four, from the outer one on; a smooth step between the two.
// Units:   pixels, row 0 on top; radii in tangents.
#if CHANNELS == 4
typedef float4 pixel_t;
typedef float8 pair_t;
#define STORE_PAIR vstore8
#else
typedef float2 pixel_t;
typedef float4 pair_t;
#define STORE_PAIR vstore4
#endif

// Of samples i of two rows, what lies a quarter of the way from the nearer one to the other.
#define DOWN(i) (0.75f * near_row[i] + 0.25f * far_row[i])

// Pixels 2 i and 2 i + 1 of samples i from `first` to `last`: each lies a quarter aside.
inline void fill(int first, int last, int width, __global const pixel_t* near_row,
                 __global const pixel_t* far_row, __global pixel_t* row) {
  if (first > last) return;
  const int end = (width + 1) / 2 - 1;
  pixel_t before = DOWN(max(first - 1, 0)), here = DOWN(first);
  const int both = min(last, width / 2 - 1);
  for (int i = first; i <= both; i++) {
    const pixel_t after = DOWN(min(i + 1, end));
    const pair_t soft = 0.75f * (pair_t)(here, here) + 0.25f * (pair_t)(before, after);
    STORE_PAIR(soft, 0, (__global float*)(row + 2 * i));
    before = here;
    here = after;
  }
  if (both < last) row[2 * last] = 0.75f * here + 0.25f * before;  // the last of an odd number
}

// The same where the two circles are near, blended with what is there; r2 of a pixel is the square
// of its distance from the centre.
inline void blend(int first, int last, int width, float y, float centre_x, float across,
                  float inner, float outer, __global const pixel_t* near_row,
                  __global const pixel_t* far_row, __global pixel_t* row) {
  const int end = (width + 1) / 2 - 1;
  for (int x = 2 * first; x <= min(2 * last + 1, width - 1); x++) {
    const float dx = (x + 0.5f - centre_x) * across, r2 = dx * dx + y * y;
    if (r2 <= inner * inner) continue;
    const int i = x / 2, beside = clamp(i + (x & 1 ? 1 : -1), 0, end);
    const pixel_t soft = 0.75f * DOWN(i) + 0.25f * DOWN(beside);
    if (r2 >= outer * outer) {
      row[x] = soft;
      continue;
    }
    row[x] = mix(row[x], soft, smoothstep(inner, outer, sqrt(r2)));
  }
}

__kernel void foveate(int width, int height, float centre_x, float centre_y, float across,
                      float along, float inner, float outer, __global const pixel_t* halved,
                      __global pixel_t* image) {
  const int j = get_global_id(0);
  const int half_w = (width + 1) / 2, half_h = (height + 1) / 2, end = half_w - 1;
  __global const pixel_t* near_row = halved + (size_t)j * half_w;
  for (int k = 0; k < min(2, height - 2 * j); k++) {
    __global const pixel_t* far_row =
        halved + (size_t)clamp(j + 2 * k - 1, 0, half_h - 1) * half_w;
    __global pixel_t* row = image + (size_t)(2 * j + k) * width;
    const float y = (2 * j + k + 0.5f - centre_y) * along;
    // Columns of samples that the outer circle may touch, with one to spare; and within the inner
    // one, with one less.
    const float reach = sqrt(fmax(outer * outer - y * y, 0.0f)) / across;
    const float within = sqrt(fmax(inner * inner - y * y, 0.0f)) / across;
    const int left = (int)clamp((centre_x - reach) / 2 - 2, 0.0f, (float)half_w);
    const int right = (int)clamp((centre_x + reach) / 2 + 2, -1.0f, (float)end);
    const int sharp_left = (int)clamp((centre_x - within) / 2 + 2, (float)left, (float)half_w);
    const int sharp_right = (int)clamp((centre_x + within) / 2 - 2, -1.0f, (float)end);
    fill(0, left - 1, width, near_row, far_row, row);
    fill(max(right + 1, left), end, width, near_row, far_row, row);
    const int until = sharp_left <= sharp_right ? sharp_left - 1 : right;
    blend(left, until, width, y, centre_x, across, inner, outer, near_row, far_row, row);
    blend(max(sharp_right + 1, until + 1), right, width, y, centre_x, across, inner, outer,
          near_row, far_row, row);
  }
}
