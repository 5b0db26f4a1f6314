"""Options that train, fit and table have in common, and the settings that they ask for.

A command derives its Options from these.  Python puts the fields of the last base first, so bases
stand in the reverse order of --help.
"""

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from training.settings import TrainSettings

BUDGET = ("iterations", "seconds")  # what may change when a run is resumed
# What a checkpoint was trained with that does not say it: these were the defaults once.
OLD = {"encoding": "even", "growth": "gradient", "revive": 0.0}


@dataclass(frozen=True, kw_only=True)
class ModelOptions:
    """How large an anchor model is and what its networks see."""

    anchors: int | None = None
    """How many to start with at most, where --voxel is not given; where hulls are carved, for each
    modality's own."""
    voxel: float | None = None
    """Metres between anchors at the start."""
    splats_per_anchor: int | None = None
    """k."""
    features: int | None = None
    """F, numbers an anchor."""
    hidden: int | None = None
    """Width of the five networks."""
    layers: int | None = None
    """Hidden layers of the five networks, 1 to 3."""
    fixed: str | None = None
    """Networks that do not see x, as offset,scale,rotation: all stops share what they give."""
    view_dependent: bool | None = None
    """Whether colour depends on where one looks from."""


@dataclass(frozen=True, kw_only=True)
class SizeOptions:
    """How large the photos are."""

    downscale: int | None = None
    """Divide the photos' sides by this.  Default: until neither exceeds 640 pixels."""


@dataclass(frozen=True, kw_only=True)
class PhotoOptions:
    """What else counts of the photos, and what computes."""

    masks: Literal["object", "valid", "ignore"] | None = None
    """What a mask means: nothing lies outside it, what lies outside is unknown, or no matter."""
    background: Literal["auto", "random", "black", "white", "gray"] | None = None
    """Colour behind everything.  auto: the capture's, else random where photos have masks."""
    device: Literal["cpu", "gpu"] | None = None
    """Insist on one kind of OpenCL device."""


def settings_of(options: ModelOptions, before: dict | None) -> "TrainSettings":
    """The preset with what train or fit was asked for; or a checkpoint's, with another budget.

    Raises UsageError, also when a resumed run is asked for anything but another budget.
    """
    from app.errors import UsageError
    from app.paths import plain
    from training.initial import SOURCES
    from training.settings import TrainSettings, preset

    names = {f.name for f in fields(TrainSettings)} - {"preset"}
    asked = {n: getattr(options, n) for n in names & {f.name for f in fields(options)}}
    asked = {n: value for n, value in asked.items() if value is not None}
    if asked.get("points", SOURCES[0]) not in SOURCES:
        asked["points"] = str(plain(asked["points"]))
    settings = preset(options.preset) if before is None else TrainSettings(**(OLD | before))
    if before is not None:
        known = settings.as_dict()  # an older checkpoint may not have all of them
        other = sorted(n for n in asked if n not in BUDGET and asked[n] != known[n])
        if other:
            raise UsageError(
                f"--resume goes on with the settings of the checkpoint, where {other[0]} is "
                f"{known[other[0]]}, not {asked[other[0]]}; leave it out or start anew."
            )
    if asked.get("encoding") == "stops" and asked.keys() & {"control", "sigma"}:
        raise UsageError("--encoding stops sets --control and --sigma itself; leave them out.")
    if before is None and asked.keys() & {"control", "sigma"}:
        asked["encoding"] = "even"
    if "seconds" in asked and "iterations" not in asked:
        asked["iterations"] = None
    elif "iterations" in asked and "seconds" not in asked:
        asked["seconds"] = None
    try:
        return replace(settings, **asked)
    except ValueError as error:
        raise UsageError(str(error)) from None
