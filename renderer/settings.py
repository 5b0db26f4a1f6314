"""What a frame may be asked for and what it tells afterwards: RenderSettings in, FrameStats out."""

import math
from dataclasses import dataclass, field

from shapeshift.scene.appearance import Background, Sky, check_color

ORDERS = ("depth", "distance")
KEY_BITS = (16, 32)
STEREO_SORTS = ("shared", "each")
STEREO_COLORS = ("auto", "each", "shared")
FOVEATIONS = ("off", "low", "medium", "high")
TARGETS = ("auto", "rgba8", "rgba16", "rgba16f", "rgba32f")
EDGES = ("ellipses", "points", "rings")
MOST_BUDGET = 1_000_000_000  # splats: no device holds as many
DEBUG_VIEWS = ("", "culls", "birdseye", "overdraw", "depth", "object", *EDGES)
# Why a splat is not drawn, in the order of the gates: the first that it fails counts it.
CULL_REASONS = ("opacity", "distance", "frustum", "size", "footprint", "faded")


@dataclass(frozen=True)
class RenderSettings:
    """The quality of a frame.  Defaults are the exact setting: nothing is left out.

    docs/bench charts what each shortcut saves and what it costs in the picture.
    """

    # The pixel
    min_alpha: float = 1 / 255  # a pixel's alpha below this is not drawn (3DGS)
    low_pass: float = 0.3  # px^2 added to the screen covariance (EWA, as 3DGS)
    background: Background = (0.0, 0.0, 0.0)  # display sRGB, or a sky
    # What quads blend into (renderer/gl/target.py); tiles blend float32 in registers.  auto: 16
    # bits from 0 to the scene's brightest colour, half floats where that is over 64 or not bounded.
    target: str = "auto"
    render_scale: float = 1.0  # of the view's width and height, then shown at full size
    # Sharp where one looks, and a quarter of the pixels farther out (renderer/foveation.py).
    foveation: str = "off"
    min_transmittance: float = 1e-4  # tiles: a pixel with less left is done (3DGS)
    # Depth beside the colours, expected along each ray, at this part of the picture's width and
    # height; 0: none.
    depth_scale: float = 0.0

    # Culls
    max_pixels: float = math.inf  # tau_lambda: one sigma of a splat's longer axis, pixels
    max_distance: float = math.inf  # tau_dist: metres from the eye
    min_pixels: float = 0.0  # footprint: half the quad's longer side, pixels, out to the cutoff
    fade: float = 0.0  # part of each of these three limits over which opacity goes to 0

    # Splats at most, of a scene with models in levels of detail (renderer/streaming); 0: what they
    # were opened with.
    budget: int = 0

    # Order
    order: str = "depth"  # along the view (3DGS) or "distance" to the eye (KHR_gaussian_splatting)
    key_bits: int = 32  # 32 exact, 16 over the tight range of the frame
    stereo_sort: str = "shared"  # one sort for parallel eyes; more than 1 degree apart: "each"
    resort_frames: int = 1  # sort every n-th frame; 0: never because of the number of frames
    resort_degrees: float = 0.0  # and as soon as the view has turned by so much; 0: whenever

    # Colour
    # Of two eyes: each its own; shared, for the middle between them; auto: shared where nobody can
    # tell (renderer/colors/color_cache.py), else each.
    stereo_colors: str = "auto"
    recolor_degrees: float = 0.0  # colours again after the eye has moved so far around an object
    skip_unseen: bool = False  # no colours (Scaffold-GS: nothing) for anchors that no view can see

    # Shares of a value stop's range that the ends of its palette stand for: level and span.  Not
    # where several palettes show at once, which have no one picture of values.
    heat_ends: tuple[float, float] = (0.0, 1.0)
    debug: str = ""  # one of DEBUG_VIEWS instead of the picture

    def __post_init__(self) -> None:
        for name, choices in (
            ("order", ORDERS), ("key_bits", KEY_BITS), ("stereo_sort", STEREO_SORTS),
            ("stereo_colors", STEREO_COLORS), ("target", TARGETS), ("debug", DEBUG_VIEWS),
            ("foveation", FOVEATIONS),
        ):  # fmt: skip
            if getattr(self, name) not in choices:
                text = ", ".join(repr(c) for c in choices)
                raise ValueError(f"{name} is {getattr(self, name)!r}; choose one of {text}.")
        if not isinstance(self.background, Sky):
            check_color(self.background, "background")
        low, high = self.heat_ends
        if not -1e6 <= low < high <= 1e6:
            raise ValueError(f"heat_ends are {low:g} and {high:g}, expected the lower one first.")
        for name, least, most in (
            ("min_alpha", 1e-6, 1.0), ("low_pass", 0.0, 1e6), ("render_scale", 1 / 16, 2.0),
            ("min_transmittance", 1e-6, 0.1), ("depth_scale", 0.0, 1.0),
            ("max_pixels", 0.0, math.inf), ("max_distance", 0.0, math.inf),
            ("min_pixels", 0.0, math.inf), ("fade", 0.0, 1.0), ("resort_frames", 0, 1_000_000),
            ("budget", 0, MOST_BUDGET), ("resort_degrees", 0.0, 180.0),
            ("recolor_degrees", 0.0, 180.0),
        ):  # fmt: skip
            if not least <= getattr(self, name) <= most:
                raise ValueError(f"{name} is {getattr(self, name)}, expected {least} to {most}.")


@dataclass(frozen=True)
class StreamStats:
    """What of models in levels of detail is drawn in a frame, in splats."""

    budget: int
    shown: int  # in the arena
    in_sight: int  # of the finest levels of the leaves in the picture
    whole: int  # of the finest levels of all leaves
    changed: int  # that were uploaded for this frame
    pending: bool  # other levels are on their way
    problem: str  # one sentence: what could not be read


@dataclass
class FrameStats:
    """Counters of one `Renderer.draw` and of the `update` before it."""

    ms: dict[str, float] = field(default_factory=dict)  # per named pass: decode, project, ...
    splats: int = 0
    drawn: int = 0
    culled: dict[str, int] = field(default_factory=dict)  # CULL_REASONS
    hidden: int = 0  # left out with their clusters, behind what is drawn: no gate was asked
    geometry_runs: int = 0  # objects whose four geometry networks ran for this frame
    color_runs: int = 0  # objects whose colours were computed for this frame, once for each eye
    color_sets: int = 1  # 2 where each of two eyes had its own
    sorts: int = 0  # how often this frame sorted: 0 with an order kept, 1, or 1 a view
    order_age: int = 0  # frames since the order in use was made
    age: int = 0  # frames since the one that ms, drawn and culled are of: nobody waits for a GPU
    debug: dict[str, float] = field(default_factory=dict)  # numbers of the debug picture's legend
    streaming: StreamStats | None = None  # of a scene with models in levels of detail
