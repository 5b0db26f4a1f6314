// A pinhole camera as 20 floats: camera_from_world rows (12), fx, fy, cx, cy, four tangent limits.
// OpenCV axes: x right, y down, z forward.
#define CAMERA_FX 12
#define CAMERA_FY 13
#define CAMERA_CX 14
#define CAMERA_CY 15
#define MIN_TAN_X 16  // x/z and y/z are clamped to these in the Jacobian: project.py, Camera.limits
#define MAX_TAN_X 17
#define MIN_TAN_Y 18
#define MAX_TAN_Y 19
