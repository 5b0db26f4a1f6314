"""Options of train, those that fit and table share with it, and the settings they ask for.

A command derives its Options from these.  Python puts the fields of the last base first, so bases
stand in the reverse order of --help.
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import EXPERT, MODALITY, POSITIONAL, Opt

if TYPE_CHECKING:
    from shapeshift.training.settings import TrainSettings


@dataclass(frozen=True, kw_only=True)
class ModelOptions:
    """How large an anchor model is and what its networks see."""

    max_anchors: int | None = None
    """Most anchors; as far as there are points, a run starts with that many."""
    own: Annotated[str | None, EXPERT] = None
    """What each anchor has of its own beside its features: frame (sizes and axes), color (a base
    colour), both as frame,color, or nothing as ''."""
    splats_per_anchor: Annotated[int | None, EXPERT] = None
    """Splats that the networks predict for each anchor: k in the paper."""
    features: Annotated[int | None, EXPERT] = None
    """Numbers that each anchor stores for the networks: the length of its feature vector."""
    hidden: Annotated[int | None, EXPERT] = None
    """Neurons in each hidden layer of the five networks."""
    layers: Annotated[int | None, EXPERT] = None
    """Hidden layers of each of the five networks, 1 to 3."""
    fixed: Annotated[str | None, EXPERT] = None
    """Networks that do not see x, as offset,scale,rotation: all stops share what they predict."""
    view_dependent: Annotated[bool | None, EXPERT] = None
    """Let colours depend on the direction from which one looks; --no-view-dependent: the same from
    everywhere."""


@dataclass(frozen=True, kw_only=True)
class SizeOptions:
    """How large the photos are."""

    downscale: int | None = None
    """Divide the photos' sides by this number.  Default: such that neither exceeds 640 pixels."""


@dataclass(frozen=True, kw_only=True)
class PhotoOptions:
    """What else counts of the photos, and what computes."""

    masks: Literal["object", "valid", "ignore"] | None = None
    """What a mask means: object, nothing is outside it; valid, what is outside is unknown; ignore,
    masks are not used."""
    background: Literal["auto", "random", "black", "white", "gray"] | None = None
    """Colour behind everything.  auto: the capture's own, else random where photos have masks."""
    device: Literal["cpu", "gpu"] | None = None
    """Kind of OpenCL device that must be used.  Default: the fastest that there is."""
    memory: Annotated[float | None, EXPERT] = None
    """GB of memory that files may take: photos half of it, for as long as the training lasts.
    Default: three quarters of this machine's."""


@dataclass(frozen=True)
class RunOptions:
    """The run: of what, into what, how long, and how the anchors grow."""

    capture: Annotated[Path, POSITIONAL]
    """A folder of posed photos: COLMAP, transforms.json or cameras.json (docs/capture.md)."""
    out: Path
    """The package to write: NAME.shift or a folder.  NAME.checkpoint.npz is written beside it."""
    seconds: float | None = None
    """Train for so many seconds of one core: processor time of all threads, so that nothing else
    that runs takes from it, and two cores take half as long.  On a GPU, seconds by the clock.
    Loading, compiling and looking at held-out photos do not count.  Learning rates follow it."""
    iterations: int | None = None
    """Train for this many steps; the same number gives the same bits."""
    preset: Literal["fast", "paper"] = "fast"
    """fast: minutes on a CPU.  paper: the numbers of the paper."""
    resume: bool = False
    """Continue from the checkpoint with its settings; --iterations or --seconds may be larger."""
    max_mb: float | None = None
    """Most megabytes of the package on disk, from the start on."""
    points: Annotated[str | None, Opt(metavar="WHERE")] = None
    """Where the first anchors stand: capture (COLMAP's points or the capture's own), depth (its
    depth photos), hull (of masks or a known background), random, or a point cloud in the capture's
    world (PLY, LAS, LAZ, NPZ).  auto: the first of these that there is."""
    model: Annotated[Literal["anchors", "splats"], EXPERT] = "anchors"
    """splats: plain 3DGS splats, one set for each modality, to compare with; --out is a folder of
    PLY files, and the modalities share the budget."""
    separate: Annotated[bool, EXPERT] = False
    """Train one anchor model for each modality, to compare with; --out is a folder of packages, and
    the modalities share the budget."""
    sh_degree: Annotated[int | None, EXPERT] = None
    """Degree of the spherical harmonics of plain splats, 0 to 3."""
    splats: Annotated[int | None, EXPERT] = None
    """Most plain splats that a modality starts with."""
    max_splats: Annotated[int | None, EXPERT] = None
    """Most plain splats that growing may reach, for each modality."""
    seed: Annotated[int | None, EXPERT] = None
    """Seed of all random numbers."""
    grow: Annotated[bool | None, EXPERT] = None
    """Add anchors and move the least useful ones to where pictures need them, up to 80 % of the
    run; --no-grow: keep the first ones."""


@dataclass(frozen=True, kw_only=True)
class LossOptions:
    """What the loss consists of, how fast is learned, and how x is encoded."""

    ssim_share: Annotated[float | None, EXPERT] = None
    """Share of D-SSIM in the image loss: lambda in (1 - lambda) L1 + lambda D-SSIM.  Equation 8 of
    the paper, read literally, has 0.8."""
    opacity_share: Annotated[float | None, EXPERT] = None
    """Weight of the opacity loss, lambda_alpha in equation 9."""
    scale_share: Annotated[float | None, EXPERT] = None
    """Weight of the scale loss, lambda_S in equation 9."""
    depth_share: Annotated[float | None, EXPERT] = None
    """Weight of the depth loss where photos have depth photos; 0: those are not used."""
    rate_scale: Annotated[float | None, EXPERT] = None
    """Factor on every learning rate."""
    rise: Annotated[int | None, EXPERT] = None
    """Steps of learning-rate warm-up for the networks, for scenes of which all splats would vanish
    at once."""
    revive: Annotated[float | None, EXPERT] = None
    """Weight of a loss that keeps absent splats from staying absent; 0: none."""
    control: Annotated[int | None, EXPERT] = None
    """Numbers of the control encoding; the last one stands for x = 1."""
    sigma: Annotated[float | None, EXPERT] = None
    """Width in x of each number of the control encoding; with wide ones, what lies between two
    stops learns from both."""
    encoding: Annotated[Literal["even", "stops"] | None, EXPERT] = None
    """stops: --control and --sigma follow from the capture, one number for each stop, half as wide
    as stops are apart.  even: as --control and --sigma say."""
    between: Annotated[Literal["none", "photos", "pictures", "shapes", "splats"] | None, EXPERT] = (
        None
    )
    """How x between two stops is learned: photos, from blends of photos taken from one place;
    pictures, from blends of the model's own pictures; shapes, from photos on shapes that are on
    their way to the next stop; splats, by keeping splats on the straight way between the stops."""
    between_share: Annotated[float | None, EXPERT] = None
    """Share of the steps, 0 to 1, in which x lies between two stops."""
    between_pull: Annotated[float | None, EXPERT] = None
    """Weight of the loss of --between splats."""
    thermal_smooth: Annotated[float | None, EXPERT] = None
    """Weight of the smoothness loss of thermal pictures; ThermalGaussian uses 0.6."""
    balance: Annotated[str | None, EXPERT] = None
    """Steps of each modality in proportion to the others', as RGB=3,Thermal=1."""


@dataclass(frozen=True, kw_only=True)
class PictureOptions:
    """Which photos, of what size and seen from where."""

    calibrate: Annotated[str | None, MODALITY] = None
    """A modality whose cameras all sit a little beside their stated poses, as on a rig: that turn
    and shift is found first, from the photos.  `eval` reads it from the package.  Default: none."""
    coarse: Annotated[int | None, EXPERT] = None
    """Start with photos of 1/2, 1/4 or 1/8 of the sides; the larger sizes follow step by step."""
    coarse_until: Annotated[float | None, EXPERT] = None
    """Share of the run, 0 to 1, after which the photos have all their pixels."""


@dataclass(frozen=True)
class Options(PhotoOptions, PictureOptions, SizeOptions, LossOptions, ModelOptions, RunOptions):
    """Train a shape-shifting scene.

    A first run needs only --out; options that are left out take the numbers of --preset.
    """


# What --help says where the preset's number is None, or where the capture decides.
DECIDED = {
    "preset": "fast",
    "seconds": "no limit, --iterations decides",
    "max_mb": "no limit",
    "control": "one for each stop, as --encoding stops says; paper: 16",
    "sigma": "half the distance of two stops; paper: 0.04",
    "fixed": "none, all five see x",
    "balance": "as many of each",
}
PLAIN = ("sh_degree", "splats", "max_splats")  # options of --model splats


def preset_defaults() -> dict[str, str]:
    """The numbers of the preset fast, with that of paper where it is another, by option."""
    from shapeshift.training.baselines.plain_settings import PlainSettings
    from shapeshift.training.settings import preset

    fast, paper, plain = preset("fast").as_dict(), preset("paper").as_dict(), PlainSettings()
    told = {name: in_words(value) for name, value in fast.items() if name not in DECIDED}
    for name in told:
        if fast[name] != paper[name]:
            told[name] += f"; paper: {in_words(paper[name])}"
    return told | DECIDED | {name: in_words(getattr(plain, name)) for name in PLAIN}


def in_words(value: object) -> str:
    """A setting as it would be typed."""
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)


def settings_of(options: ModelOptions, before: dict | None) -> "TrainSettings":
    """The preset with what train or fit was asked for; or a checkpoint's, with another budget.

    Raises UsageError, also when a resumed run is asked for anything but another budget.
    """
    from shapeshift.app.errors import UsageError
    from shapeshift.app.paths import plain
    from shapeshift.training.first_anchors.initial import SOURCES
    from shapeshift.training.settings import TrainSettings, adjusted, preset, resumed

    names = {f.name for f in fields(TrainSettings)} - {"preset"}
    asked = {n: getattr(options, n) for n in names & {f.name for f in fields(options)}}
    asked = {n: value for n, value in asked.items() if value is not None}
    if asked.get("points", SOURCES[0]) not in SOURCES:
        asked["points"] = str(plain(asked["points"]))
    try:
        if before is not None:
            return resumed(before, asked, "--")
        return adjusted(preset(options.preset), asked, "--")
    except ValueError as error:
        raise UsageError(str(error)) from None
