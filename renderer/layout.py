"""Every number that Python and GLSL share: slots, work groups, limits; GLSL sees #defines."""

WORKGROUP = 256  # invocations; the radix sort counts one 8-bit digit an invocation
DECODE_WORKGROUP = 64  # an invocation of the networks keeps whole layers; few fit at a time
SORT_BLOCKS = 16  # blocks of WORKGROUP keys that one group of the sort walks through
RADIX = 256  # values of a digit
CULLED_KEY = 0xFFFFFFFF  # sorts behind every depth

RECORD_VECS = 2  # uvec4 a projected splat
COVARIANCE_VECS = 2  # vec4 a splat: xx xy xz yy | yz zz 0 0
MOST_VIEWS = 2  # that one dispatch of project handles

MAX_ALPHA = 0.99  # 3DGS: one splat never hides everything behind it
JACOBIAN_MARGIN = 1.3  # 3DGS: beyond 1.3 times the widest tangents the projection counts as flat
HALF_MAX = 60000.0  # below 65504, where packHalf2x16 turns to infinity
HUGE = 1e18  # stands for "no limit"; its square is still a float

# Storage slots, below 8 because GL promises no more; each pass binds its own before it runs.
SLOTS = {
    # project
    "MEAN_OPACITY": 0,  # vec4 (N,)      xyz metres in the object, w opacity
    "COVARIANCE": 1,  # vec4 (N, 2)    m^2, in the object
    "COLOR": 2,  # vec4 (N,)      display sRGB
    "SECOND_COLOR": 3,  # vec4 (N,)      of the second of two views, where it has its own
    "PAGES": 4,  # uvec4          poses, then where the last rows lie: see common/pages.glsl
    "RECORDS": 5,  # uvec4 (V, N, 2)   screen ellipses
    "KEYS": 6,  # uint (N,)      depth or distance as float bits, or CULLED_KEY
    "COUNTS": 7,  # uint (20,)     as COUNTS below
    # sort
    "KEYS_OUT": 0,
    "ORDER_SPARE": 2,  # uint (N,)      takes turns with ORDER
    "HISTOGRAM": 3,  # uint (RADIX, groups + 1)
    "COMMAND": 4,  # uint (5,)      one indirect draw
    "DISPATCH": 5,  # uint (21,)     work groups of the sort's passes after the first
    # splat
    "ORDER": 1,  # uint (N,)      indices, near to far
    # surface
    "SURFACES": 3,  # vec4 (N, 3)    depth around the mean, and a normal
    # decode
    "ANCHORS": 2,  # vec4 (A,)      metres in the object
    "FRAMES": 3,  # vec4 (A, 2)    factors along an anchor's axes, and its unit quaternion wxyz
    "FEATURES": 3,  # vec4 (A, F / 4)
    "OUTPUT": 4,  # float          a head's numbers
    "WEIGHTS": 5,  # vec4           of a head that does not fit a uniform block
    "STAGING": 4,  # float          means or offsets, scales, rotations, opacities
    "SH": 3,  # float (M * 3, n)
    "LISTED": 1,  # uint (n,)      pages of which colours are made
    "LAYER": 4,  # uint (n,)      which layer a plain splat is of
    "LAYER_WEIGHTS": 5,  # float          how much of each layer there is
    "OWN_OPACITY": 6,  # float (n,)     before the weight
    "CONTROL": 6,  # vec4 (A, d / 4)  Psi of a control an anchor
    "LIGHT": 7,  # vec4 (A, 2 C)  light by direction: harmonics of degree 1 and 2
    "PALETTE": 3,  # vec4 (256,)    display sRGB
    "TINT": 4,  # float (A,)     weight of a value stop
    "HEAT": 0,  # vec4 (N,)      value times weight 0 0 weight: what is thermal of a splat
}
WEIGHTS_BLOCK = 0  # uniform block

# Rows of the counts buffer.  Those of view v start at v * COUNTS_STRIDE and are the reasons of
# settings.CULL_REASONS; the first gate that a splat fails counts it.  What is drawn is the rest.
COUNTS_STRIDE = 8
COUNTS = {
    "DRAWN": 0,  # not counted
    "OPACITY": 1,
    "DISTANCE": 2,
    "FRUSTUM": 3,
    "SIZE": 4,
    "FOOTPRINT": 5,
    "FADED": 6,
    # of all views together
    "SORTED": MOST_VIEWS * COUNTS_STRIDE,  # keys that are not CULLED_KEY
    "NEAREST": MOST_VIEWS * COUNTS_STRIDE + 1,  # least of them: float bits of metres
    "FARTHEST": MOST_VIEWS * COUNTS_STRIDE + 2,
}
COUNTS_SIZE = MOST_VIEWS * COUNTS_STRIDE + 4

# The dispatch buffer: for each of three later passes of the sort its groups of keys, by 1 by 1, and
# of digits, by 1 by 1, none where the pass is not needed; then what the shaders read.
MOST_LATER = 3
DISPATCH = {
    "PASSES": 6 * MOST_LATER,  # in all, 1 to 4
    "BASE": 6 * MOST_LATER + 1,  # what keys are counted from
    "LATER": 6 * MOST_LATER + 2,  # groups of keys of a later pass
}
DISPATCH_SIZE = 6 * MOST_LATER + 3


def defines() -> dict[str, object]:
    """What every shader is compiled with."""
    numbers: dict[str, object] = {
        "WORKGROUP": WORKGROUP, "DECODE_WORKGROUP": DECODE_WORKGROUP, "SORT_BLOCKS": SORT_BLOCKS,
        "RADIX": RADIX, "MOST_LATER": f"{MOST_LATER}u", "CULLED_KEY": f"{CULLED_KEY:#x}u",
        "MAX_ALPHA": MAX_ALPHA, "HALF_MAX": HALF_MAX, "WEIGHTS_BLOCK": WEIGHTS_BLOCK,
        "COUNTS_STRIDE": f"{COUNTS_STRIDE}u",
    }  # fmt: skip
    slots = {f"SLOT_{name}": slot for name, slot in SLOTS.items()}
    counts = {f"COUNT_{name}": f"{row}u" for name, row in COUNTS.items()}
    dispatch = {f"DISPATCH_{name}": f"{row}u" for name, row in DISPATCH.items()}
    return numbers | slots | counts | dispatch
