"""What a frame may be asked for and what it tells afterwards: RenderSettings in, FrameStats out."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class RenderSettings:
    """The quality of a frame.  Defaults are the exact setting: nothing is left out."""

    min_alpha: float = 1 / 255  # a pixel's alpha below this is not drawn (3DGS)
    max_pixels: float = float("inf")  # tau_lambda: largest screen axis of a splat, pixels
    max_distance: float = float("inf")  # tau_dist: metres from the eye
    low_pass: float = 0.3  # px^2 added to the screen covariance (EWA, as 3DGS)
    key_bits: int = 32  # depth order: 32 exact, 16 over the tight range of the frame
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)  # display sRGB


@dataclass
class FrameStats:
    """Counters of one `Renderer.draw` and of the `update` before it."""

    ms: dict[str, float] = field(default_factory=dict)  # per named pass: decode, project, ...
    splats: int = 0
    drawn: int = 0
    culled: dict[str, int] = field(default_factory=dict)  # opacity, size, distance, frustum
    geometry_runs: int = 0  # objects whose four geometry networks ran for this frame
    color_runs: int = 0  # objects whose colour network ran for this frame
