// limits: what project_arena is given besides the splats, as rasterizer/project_arena.py packs it.
// Reads:   nothing.
// Defines: the places of a frame's limits, of a view, and the numbers of the gates; CLUSTER.
// Units:   pixels and metres; limits with _2 are squared, those with PER_ inverted, on the host.
#define MIN_ALPHA 0      // a pixel below it is not drawn; PER_X: 1 over it
#define PER_MIN_ALPHA 1
#define LOW_PASS 2         // px^2 added to the screen covariance
// The paper's clipping thresholds (section 4.1): tau_lambda for the axis, tau_dist for the
// distance.
#define MAX_PIXELS 3      // one sigma of the longer screen axis; _2: squared
#define MAX_PIXELS_2 4
#define MAX_DISTANCE 5    // metres from the eye
#define MAX_DISTANCE_2 6
#define MIN_PIXELS 7     // of the longer axis where alpha reaches the least
#define MIN_PIXELS_2 8
#define PER_PIXELS 9       // 1 over the width of the band before each limit in which opacity fades
#define PER_DISTANCE 10    // to 0; 0: no band
#define PER_FOOTPRINT 11
#define FADES 12           // above 0: there is a band somewhere

#define LIMITS 13
#define CLUSTER 256  // splats side by side, which may be left out together
#define MAX_COLOR 60000.0f  // what half floats hold with some room: larger is as good as infinite

// Of each view: a camera (camera.cl, 20 floats), then
#define IMAGE_WIDTH 20  // pixels
#define IMAGE_HEIGHT 21
#define NEAR 22         // metres
#define TILES_X 23
#define TILES_Y 24
#define VIEW_SIZE 25

// Gates in their order: a splat counts at the first that it fails.
// An absent splat of another modality has an opacity below 0 (paper, section 4.1), and is
// dropped here, before anything else of it is read.
#define GATE_OPACITY 0
#define GATE_DISTANCE 1
#define GATE_FRUSTUM 2
#define GATE_SIZE 3
#define GATE_FOOTPRINT 4
#define GATE_FADED 5
#define GATES 6
