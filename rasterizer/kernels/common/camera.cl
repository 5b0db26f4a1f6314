// camera: a pinhole camera as 20 floats, as rasterizer/project.py packs it.
// Reads:   nothing.
// Defines: the places of its floats after the twelve of camera_from_world, row by row (W of EWA).
// Units:   pixels, and tangents of the view; OpenCV axes: x right, y down, z forward.
#define CAMERA_FX 12
#define CAMERA_FY 13
#define CAMERA_CX 14
#define CAMERA_CY 15
// The Jacobian is that of a tangent held between these, as 3DGS holds it at 1.3 times the view: far
// beside it the linear approximation of EWA splatting grows without bound.
#define MIN_TAN_X 16
#define MAX_TAN_X 17
#define MIN_TAN_Y 18
#define MAX_TAN_Y 19
