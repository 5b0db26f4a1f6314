// find_unseen: which clusters of an arena no view sees, by their boxes alone. Said only where each
// of their splats fails project_arena's gate "frustum", or the near plane, and passes the one
// before: with half extents sqrt(T (u Sigma u + low pass)), u = fx / z (1, 0, -tangent), all of
// left of a picture:  fx x + (cx + sqrt(T low pass)) z + fx sqrt(T variance (1 + tangent^2)) < 0
// and so on for its other sides: planes, whatever z is, so that a box needs its farthest corner
// alone.  The root of a sum is at most the sum of the roots.
// Reads:   frame as project_arena has it (limits, views, poses), bounds of bound_clusters.cl.
// Writes:  unseen (clusters,): 0 where a view may see one, else from bit 1 on, one more than the
//          splats that pass the gate "opacity"; bit 0 where it was not 0 before and `again` is 1.
// Units:   metres in the object and in the camera, pixels.
#include "common/camera.cl"
#include "common/limits.cl"
// Of the terms of a sum: far more than float32 loses, here and in the gates.
#define ROUNDING 1e-5f
// Of Sigma' in px^2: where rounding may take more than the low pass, gates tell another reason.
#define LOST 4e-6f

typedef struct {
  float middle, extent;  // of an interval
} Interval;

// One row of a pose over a box: where its points lie along an axis of the camera.
inline Interval along(__global const float* row, float3 middle, float3 extent) {
  const float3 turn = (float3)(row[0], row[1], row[2]), size = fabs(turn);
  const float lost = ROUNDING * (dot(size, fabs(middle) + extent) + fabs(row[3]));
  const Interval out = {dot(turn, middle) + row[3], dot(size, extent) + lost};
  return out;
}

// Whether all of a box lies beyond one of two sides of a picture, `side` pixels apart.
inline bool beside(Interval across, Interval depth, float focal, float centre, float side,
                   float blur, float aside) {
  // What float32 may lose of each term, in the gate or here, is on the side of being seen.
  const float far_across = fabs(across.middle) + across.extent;
  const float far_along = fabs(depth.middle) + depth.extent;
  const float lost =
      ROUNDING * (focal * far_across + (fabs(centre) + side + blur) * far_along + aside);
  const float least = centre + blur, most = side - centre + blur;
  // The farthest corner: half of the box along both axes, and how far an ellipse reaches beyond.
  const float room = focal * across.extent + aside + lost;
  const float before = focal * across.middle + least * depth.middle + fabs(least) * depth.extent;
  const float behind = most * depth.middle - focal * across.middle + fabs(most) * depth.extent;
  return before + room < 0 || behind + room < 0;
}

inline bool outside(__global const float* limits, __global const float* view,
                    __global const float* pose, __global const float* bounds) {
  const float3 low = vload3(0, bounds), high = vload3(1, bounds);
  const float3 middle = 0.5f * (low + high), extent = 0.5f * (high - low) + ROUNDING * fabs(middle);
  const Interval x = along(pose, middle, extent), y = along(pose + 4, middle, extent),
                 z = along(pose + 8, middle, extent);
  const float far_x = fabs(x.middle) + x.extent, far_y = fabs(y.middle) + y.extent,
              far_z = fabs(z.middle) + z.extent;
  const float square = far_x * far_x + far_y * far_y + far_z * far_z;
  // Positive, so that NaN and what is too far for a gate are no reason to leave anything out.
  if (!(square * (1 + ROUNDING) < limits[MAX_DISTANCE_2])) return false;
  // Behind the near plane nothing is projected, and the gate "frustum" counts it.
  if (z.middle + z.extent < view[NEAR]) return true;
  // The Jacobian's tangent is held by these (camera.cl): it stretches a splat that lies aside.
  const float tan_x = fmax(-view[MIN_TAN_X], view[MAX_TAN_X]),
              tan_y = fmax(-view[MIN_TAN_Y], view[MAX_TAN_Y]);
  // Poses are rigid; the factor is for those that are nearly so.
  const float variance = 1.001f * bounds[6];
  const float reach = sqrt(2 * log(fmax(bounds[7] * limits[PER_MIN_ALPHA], 1.0f))) + ROUNDING;
  const float blur = reach * sqrt(limits[LOW_PASS]);
  const float per_x = view[CAMERA_FX] * sqrt(1 + tan_x * tan_x),
              per_y = view[CAMERA_FY] * sqrt(1 + tan_y * tan_y);
  // Where rounding may make Sigma' negative the gates say "size": such a box is left to them.
  const float zoom = fmax(per_x, per_y) / fmax(z.middle - z.extent, view[NEAR]);
  if (!(LOST * variance * zoom * zoom < limits[LOW_PASS])) return false;
  const float aside = reach * sqrt(variance);
  return beside(x, z, view[CAMERA_FX], view[CAMERA_CX], view[IMAGE_WIDTH], blur, per_x * aside) ||
         beside(y, z, view[CAMERA_FY], view[CAMERA_CY], view[IMAGE_HEIGHT], blur, per_y * aside);
}

// pose: floats an object in the frame, of which a view's are twelve each.
__kernel void find_unseen(int clusters, int views, int pose, int again,
                          __global const float* frame, __global const float* bounds,
                          __global int* unseen) {
  const int c = get_global_id(0);
  if (c >= clusters) return;
  __global const float* mine = bounds + 12 * c;
  __global const float *view = frame + LIMITS, *poses = view + views * VIEW_SIZE;
  const int object = (int)mine[9];  // -1: its box says nothing
  bool nowhere = object >= 0;
  for (int v = 0; v < views && nowhere; v++)
    nowhere = outside(frame, view + v * VIEW_SIZE, poses + pose * object + 12 * v, mine);
  // Rows of a cluster that was left out in the frame before say so already.
  const int before = again && unseen[c] != 0;
  unseen[c] = nowhere ? ((int)mine[8] + 1) << 1 | before : 0;
}
