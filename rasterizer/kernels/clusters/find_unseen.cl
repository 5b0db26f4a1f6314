// find_unseen: which clusters of an arena no view sees, by their boxes alone.
// Out of view: said only where each of their splats fails project_arena's gate "frustum", or the
// near plane, and passes the one before: with half extents sqrt(T (u Sigma u + low pass)), u = fx /
// z (1, 0, -tangent), all of left of a picture:
//  fx x + (cx + sqrt(T low pass)) z + fx sqrt(T variance (1 + tangent^2)) < 0
// and so on for its other sides: planes, whatever z is, so that a box needs its farthest corner
// alone.  The root of a sum is at most the sum of the roots.
// Hidden: all of a box comes, in the order, behind the limits of all tiles that it may reach.
// These are guesses; where a tile was not done before the nearest box that it hides, it is drawn
// again.
// Reads:   frame as project_arena has it (limits, views, poses), bounds of bound_clusters.cl; of
//          each view limit (tiles,), how deep in the order a tile is thought to be done, or none.
// Writes:  unseen (clusters,): 0 where a view may see one, else from bit 1 on, one more than the
//          splats that pass the gate "opacity"; bit 0 where it was not 0 before and `again` is 1.
//          With limits nearest (tiles,) of each view: the bits of infinity less those of the least
//          depth that is hidden there, 0 as it is given where none is; reached (views, clusters),
//          columns from and to and rows from and to; hidden (clusters,): splats that are hidden
//          and not out of view.
// Units:   metres in the object and in the camera, pixels, tiles.
#include "common/camera.cl"
#include "common/limits.cl"
#define TILE 16  // pixels
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

// A box in a camera, and how far its splats reach beyond their means.
typedef struct {
  Interval x, y, z;
  float blur;          // pixels
  float per_x, per_y;  // pixels of a metre aside, at a depth of one
  float aside;         // metres
  float variance;      // m^2
} Box;

inline void middle_of(__global const float* bounds, float3* middle, float3* extent) {
  const float3 low = vload3(0, bounds), high = vload3(1, bounds);
  *middle = 0.5f * (low + high);
  *extent = 0.5f * (high - low) + ROUNDING * fabs(*middle);
}

inline Box box_of(__global const float* limits, __global const float* view,
                  __global const float* pose, __global const float* bounds) {
  float3 middle, extent;
  middle_of(bounds, &middle, &extent);
  // The Jacobian's tangent is held by these (camera.cl): it stretches a splat that lies aside.
  const float tan_x = fmax(-view[MIN_TAN_X], view[MAX_TAN_X]),
              tan_y = fmax(-view[MIN_TAN_Y], view[MAX_TAN_Y]);
  // Poses are rigid; the factor is for those that are nearly so.
  const float variance = 1.001f * bounds[6];
  const float reach = sqrt(2 * log(fmax(bounds[7] * limits[PER_MIN_ALPHA], 1.0f))) + ROUNDING;
  const Box box = {along(pose, middle, extent),
                   along(pose + 4, middle, extent),
                   along(pose + 8, middle, extent),
                   reach * sqrt(limits[LOW_PASS]),
                   view[CAMERA_FX] * sqrt(1 + tan_x * tan_x),
                   view[CAMERA_FY] * sqrt(1 + tan_y * tan_y),
                   reach * sqrt(variance),
                   variance};
  return box;
}

inline bool outside(__global const float* limits, __global const float* view, const Box* box) {
  const Interval x = box->x, y = box->y, z = box->z;
  const float far_x = fabs(x.middle) + x.extent, far_y = fabs(y.middle) + y.extent,
              far_z = fabs(z.middle) + z.extent;
  const float square = far_x * far_x + far_y * far_y + far_z * far_z;
  // Positive, so that NaN and what is too far for a gate are no reason to leave anything out.
  if (!(square * (1 + ROUNDING) < limits[MAX_DISTANCE_2])) return false;
  // Behind the near plane nothing is projected, and the gate "frustum" counts it.
  if (z.middle + z.extent < view[NEAR]) return true;
  // Where rounding may make Sigma' negative the gates say "size": such a box is left to them.
  const float zoom = fmax(box->per_x, box->per_y) / fmax(z.middle - z.extent, view[NEAR]);
  if (!(LOST * box->variance * zoom * zoom < limits[LOW_PASS])) return false;
  const float aside = box->aside, blur = box->blur;
  return beside(x, z, view[CAMERA_FX], view[CAMERA_CX], view[IMAGE_WIDTH], blur,
                box->per_x * aside) ||
         beside(y, z, view[CAMERA_FY], view[CAMERA_CY], view[IMAGE_HEIGHT], blur,
                box->per_y * aside);
}

// Columns or rows of tiles that a box between two depths above 0 may reach: from, and up to.
inline int2 tiles_along(Interval across, float near, float far, float focal, float centre,
                        float side, float room, int tiles) {
  const float low = across.middle - across.extent, high = across.middle + across.extent;
  const float first = focal * low / (low < 0 ? near : far);
  const float last = focal * high / (high > 0 ? near : far);
  const float lost = 1 + room + ROUNDING * (fabs(first) + fabs(last) + fabs(centre) + room);
  // What is no number goes to the side of being everywhere: clamp() of it is not defined.
  const float from = fmin(fmax(first + centre - lost, 0.0f), side);
  const float to = fmax(fmin(last + centre + lost, side), 0.0f);
  return (int2)((int)(from / TILE), min((int)(to / TILE) + 1, tiles));
}

// The same both ways; a box that meets the near plane may be anywhere.
inline int4 tiles_of(__global const float* view, const Box* box) {
  const int across = (int)view[TILES_X], down = (int)view[TILES_Y];
  const float near = box->z.middle - box->z.extent, far = box->z.middle + box->z.extent;
  if (!(near > view[NEAR])) return (int4)(0, across, 0, down);
  const float aside = box->aside / near;
  const int2 columns = tiles_along(box->x, near, far, view[CAMERA_FX], view[CAMERA_CX],
                                   view[IMAGE_WIDTH], box->blur + box->per_x * aside, across);
  const int2 rows = tiles_along(box->y, near, far, view[CAMERA_FY], view[CAMERA_CY],
                                view[IMAGE_HEIGHT], box->blur + box->per_y * aside, down);
  return (int4)(columns, rows);
}

// Whether each of these tiles is thought to be done before a depth in the order.
inline bool behind(__global const float* limit, int across, int4 tiles, float depth) {
  if (!(depth > 0)) return false;
  for (int row = tiles.z; row < tiles.w; row++)
    for (int column = tiles.x; column < tiles.y; column++)
      if (!(limit[row * across + column] < depth)) return false;
  return true;
}

// Positive floats sort as their bits do: infinity's less theirs, so that 0 stands for nothing.
inline void note_nearest(__global int* nearest, int across, int4 tiles, float depth) {
  const int bits = as_int(INFINITY) - as_int(depth);
  for (int row = tiles.z; row < tiles.w; row++)
    for (int column = tiles.x; column < tiles.y; column++) {
      __global int* here = nearest + row * across + column;
      if (bits > *here) atomic_max(here, bits);
    }
}

// pose: floats an object in the frame, of which a view's are twelve each, then an order's.
// orders: one for all views, or one a view; of use with limits alone.
__kernel void find_unseen(int clusters, int views, int orders, int pose, int again,
                          __global const float* frame, __global const float* bounds,
                          __global int* unseen, __global const float* limit_0,
                          __global const float* limit_1, __global int* nearest_0,
                          __global int* nearest_1, __global int4* reached, __global int* hidden) {
  const int c = get_global_id(0);
  if (c >= clusters) return;
  __global const float* mine = bounds + 12 * c;
  __global const float* poses = frame + LIMITS + views * VIEW_SIZE;
  const int object = (int)mine[9], bright = (int)mine[8];
  const bool known = object >= 0;  // else its box says nothing
  poses += pose * max(object, 0);
  bool nowhere = known, covered = known && limit_0;
  int4 tiles[2];
  float depth[2];
  for (int v = 0; v < views && (nowhere || limit_0); v++) {
    __global const float* view = frame + LIMITS + v * VIEW_SIZE;
    const Box box = box_of(frame, view, poses + 12 * v, mine);
    const bool beyond = known && outside(frame, view, &box);
    nowhere = nowhere && beyond;
    if (!limit_0) continue;
    tiles[v] = beyond ? (int4)(0) : tiles_of(view, &box);
    if (!known) tiles[v] = (int4)(0, (int)view[TILES_X], 0, (int)view[TILES_Y]);
    reached[v * clusters + c] = tiles[v];
    float3 middle, extent;
    middle_of(mine, &middle, &extent);
    const Interval order = along(poses + 12 * (views + (orders == 1 ? 0 : v)) + 8, middle, extent);
    depth[v] = order.middle - order.extent;
    covered = covered && (beyond || behind(v ? limit_1 : limit_0, (int)view[TILES_X], tiles[v],
                                           depth[v]));
  }
  if (limit_0) {
    hidden[c] = covered && !nowhere ? bright : 0;
    for (int v = 0; v < views && hidden[c]; v++)
      note_nearest(v ? nearest_1 : nearest_0, (int)frame[LIMITS + v * VIEW_SIZE + TILES_X],
                   tiles[v], depth[v]);
  }
  // Rows of a cluster that was left out in the frame before say so already.
  const int before = again && unseen[c] != 0;
  unseen[c] = nowhere || covered ? (bright + 1) << 1 | before : 0;
}
