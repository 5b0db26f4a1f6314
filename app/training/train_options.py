"""Options that train, fit and table have in common, and the settings that they ask for.

A command derives its Options from these.  Python puts the fields of the last base first, so bases
stand in the reverse order of --help.
"""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import EXPERT

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
