// between: what is to be smooth: splats along x (see between.py), pictures of heat (see smooth.py).
// Reads:   values and their neighbours in x or in the picture.
// Writes:  grad, the gradient by each value; add and smooth add to it.
// Units:   those of the values; the loss has none.

// The gradient of share * (value - (1 - w) low - w high)^2 by each value.
__kernel void chord(int values, float share, float w, __global const float *low,
                    __global const float *high, __global const float *value,
                    __global float *grad) {
  int i = get_global_id(0);
  if (!(i < values)) return;
  grad[i] = 2.0f * share * (value[i] - (low[i] + w * (high[i] - low[i])));
}

// Sums two gradients of the same values.
__kernel void add(int values, __global const float *more, __global float *grad) {
  int i = get_global_id(0);
  if (!(i < values)) return;
  grad[i] += more[i];
}

// The derivative of |difference|; 0 at 0, where there is none.
inline float side(float difference) {
  return difference > 0 ? 1.0f : difference < 0 ? -1.0f : 0.0f;
}

// Adds the gradient of share * the sum over all values and their four neighbours of |difference|:
// every pair is in it twice.  Nothing lies beyond the border.
__kernel void smooth(int width, int height, float share, __global const float *image,
                     __global float *grad) {
  int i = get_global_id(0);
  if (!(i < 3 * width * height)) return;
  int x = i % width, y = i / width % height;
  // Total variation, anisotropic: four neighbours, each pair from both sides.
  float value = image[i], sum = 0;
  if (x > 0) sum += side(value - image[i - 1]);
  if (x < width - 1) sum += side(value - image[i + 1]);
  if (y > 0) sum += side(value - image[i - width]);
  if (y < height - 1) sum += side(value - image[i + width]);
  grad[i] += 2.0f * share * sum;
}
