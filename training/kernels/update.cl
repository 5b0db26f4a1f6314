// update: what does not learn while a part of a scene is trained anew.
//
// A gradient that is 0 from the first step on leaves Adam's moments 0 and the value as it is.
// Reads:   rows (R,) the anchors of the step; all in order where has_rows is 0.
// Writes:  grad (R, width), in place: 0 for anchors before `fixed`, and from column `learned` on.
// Units:   those of the gradient; rows and columns are counted from 0.

// One work-item a number.
__kernel void still_rows(int count, int width, int learned, int fixed, int has_rows,
                         __global const int *rows, __global float *grad) {
  int i = get_global_id(0);
  if (!(i < count)) return;
  int row = i / width;
  // The table tells which anchor a row of the gradient is of.
  int anchor = has_rows ? rows[row] : row;
  if (anchor < fixed || i % width >= learned) grad[i] = 0.0f;
}
