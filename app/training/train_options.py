"""Options of train, those that fit and table share with it, and the settings they ask for."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from shapeshift.app.cluster.open_cluster import ClusterOptions
from shapeshift.app.command_line import EXPERT, MODALITY, POSITIONAL, FieldsOf
from shapeshift.training.baselines.plain_settings import PlainSettings
from shapeshift.training.left_options import LEFT
from shapeshift.training.settings import TrainSettings, adjusted, resumed

# Fields of TrainSettings that are typed; the others are set by fit, by --calibrate and from Python.
USUAL = (
    "seconds", "iterations", "max_anchors", "max_mb", "points", "downscale", "masks", "background",
    "poses",
)  # fmt: skip
EXPERTS = (
    "seed", "splats_per_anchor", "features", "hidden", "fixed", "depth_share", "normal_share",
    "blended_shapes", "min_scale_px", "anchor_attributes",
)  # fmt: skip
OF_SPLATS = ("max_splats", "sh_degree")  # of PlainSettings
Asked = dict[str, Any]  # settings that were given, by name


@dataclass(frozen=True, kw_only=True)
class MachineOptions:
    """What computes, and how much memory it takes."""

    device: Literal["cpu", "gpu"] | None = None
    """Kind of OpenCL device that must be used.  Default: the fastest that there is."""
    memory: Annotated[float | None, EXPERT] = None
    """GB of memory that files may take: photos half of it, for as long as the training lasts.
    Default: three quarters of this machine's."""


@dataclass(frozen=True)
class Options(MachineOptions, ClusterOptions):
    """Train a shape-shifting scene.

    A first run needs only --out.
    """

    capture: Annotated[Path, POSITIONAL]
    """A folder of posed photos: COLMAP, transforms.json or cameras.json (docs/capture.md)."""
    out: Path
    """The package to write: NAME.shift or a folder.  NAME.checkpoint.npz is written beside it."""
    asked: Annotated[Asked, FieldsOf(TrainSettings, USUAL, EXPERTS, LEFT)] = field(
        default_factory=dict
    )
    splats: Annotated[Asked, FieldsOf(PlainSettings, (), OF_SPLATS)] = field(default_factory=dict)
    blocks: str = "1"
    """Train in so many blocks, for captures that one memory cannot hold (docs/training.md,
    "Blocks"): auto, a number, or a grid such as 4x2; --out is a folder NAME.blocks.  1: as a
    whole."""
    coarse_iterations: int | None = None
    """With --blocks: steps of the run of the whole that comes first; each block then has
    --iterations.  Default: 2000."""
    photo_mb: Annotated[float | None, EXPERT] = None
    """MB of memory that photos may take.  What does not fit is kept in NAME.photos beside --out
    until the training is done, and read from there as it is needed: the scene is the same to the
    byte.  Default: half of --memory."""
    resume: bool = False
    """Continue from the checkpoint with its settings; --iterations or --seconds may be larger."""
    calibrate: Annotated[str | None, MODALITY] = None
    """A modality whose cameras all sit a little beside their stated poses, as on a rig: that turn
    and shift is found first, from the photos.  `eval` reads it from the package.  Default: none."""
    model: Annotated[Literal["anchors", "splats"], EXPERT] = "anchors"
    """splats: plain 3DGS splats, one set for each modality, to compare with; --out is a folder of
    PLY files, and the modalities share the budget."""
    block_photos: Annotated[int, EXPERT] = 50
    """With --blocks: a block that fewer training photos show stays as the run of the whole left
    it."""
    cut: Annotated[Path | None, EXPERT] = None
    """One part of --blocks by hand: cut the run of the whole whose package this is; --out is a
    folder with a start for each block.  Default: nothing is cut."""
    block: Annotated[Path | None, EXPERT] = None
    """One part of --blocks by hand: train the block that begins with this file, N.start.npz.
    Default: none."""
    separate: Annotated[bool, EXPERT] = False
    """Train one anchor model for each modality, to compare with; --out is a folder of packages, and
    the modalities share the budget."""


def settings_of(
    asked: Asked, before: dict[str, Any] | None = None, options: Mapping[str, str] | None = None
) -> TrainSettings:
    """The usual settings with those that were asked for; or a checkpoint's, with another budget.

    options: a setting -> the option that gives it, where that has another name.  Raises UsageError,
    also when a resumed run is asked for anything but another budget.
    """
    from shapeshift.app.errors import as_typed
    from shapeshift.app.paths import plain
    from shapeshift.training.first_anchors.initial import SOURCES

    if asked.get("points", SOURCES[0]) not in SOURCES:
        asked = asked | {"points": str(plain(asked["points"]))}
    try:
        if before is not None:
            return resumed(TrainSettings(), before, asked, "--")
        return adjusted(TrainSettings(), asked)
    except ValueError as error:
        raise as_typed(error, TrainSettings, options) from None
