// update: what does not learn while a part of a scene is trained anew.
//
// Reads:   rows (R,) the anchors of the step, or all in order where there is no table.
// Writes:  grad (R, width), in place: 0 for anchors before `fixed`, and from column `learned` on.
// A gradient that is 0 from the first step on leaves Adam's moments 0 and the value as it is.

__kernel void still_rows(int count, int width, int learned, int fixed, int has_rows,
                         __global const int *rows, __global float *grad) {
  int i = get_global_id(0);
  if (!(i < count)) return;
  int row = i / width;
  int anchor = has_rows ? rows[row] : row;
  if (anchor < fixed || i % width >= learned) grad[i] = 0.0f;
}
