"""Every number that a training run can be asked for: what `train` offers, and what a run keeps."""

import math
import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from shapeshift.scene.captures.capture import Capture
from shapeshift.training.heads.networks import HeadLayout
from shapeshift.training.photos import choose_downscale

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Poses = Literal["stated", "refine"]
Masks = Literal["auto", "object", "valid", "ignore"]
Background = Literal["auto", "random", "black", "white", "gray"]


@dataclass(frozen=True)
class Rates:
    """Adam's learning rates at the start.  Anchors move in voxels, so theirs is in voxels too."""

    offset: float
    scale: float
    rotation: float
    opacity: float
    color: float
    feature: float
    anchor: float
    frame: float  # of logarithms of sizes, and of quaternions
    decay: float  # what is left of every rate at the end of the run, exponentially


# Ten seconds to minutes on a CPU: 5 times the rates that Scaffold-GS uses for 30,000 iterations.
# Twice as much ends 0.9 and 1.2 dB lower on two scenes after 2,000 steps, half as much the same on
# one; long runs end a little finer.
SHORT = Rates(0.02, 0.02, 0.02, 0.01, 0.04, 0.0375, 0.01, 0.02, decay=0.1)
LONG = replace(SHORT, decay=0.03)
SHORT_RUN = 4000  # iterations


def parameter_rates(layout: HeadLayout, rates: Rates, voxel: float) -> dict[str, np.ndarray]:
    """Rates as the optimiser takes them: one a weight, one for each group of what anchors have."""
    flat = np.zeros(layout.weights_at[-1], np.float32)
    heads = (rates.offset, rates.scale, rates.rotation, rates.opacity, rates.color)
    for start, stop, rate in zip(layout.weights_at, layout.weights_at[1:], heads, strict=False):
        flat[start:stop] = rate
    each = {
        "anchors": rates.anchor * voxel, "features": rates.feature, "frames": rates.frame,
        "light": rates.color,
    } | dict.fromkeys(("colors", *layout.color_groups), rates.color)  # fmt: skip
    shared = {name: np.array([rate], np.float32) for name, rate in each.items()}
    return {"weights": flat * layout.rate_shares()} | shared


def check_numbers(
    settings: object, least: dict[str, float], most: dict[str, tuple[float, str]]
) -> None:
    """Raises ValueError naming the first number below its least, not finite, or beyond its most,
    with what that is; and the first word that is none of its field's.
    """
    hints = get_type_hints(type(settings))
    for name, low in least.items():
        value = getattr(settings, name)
        if value is None and type(None) in get_args(hints[name]):
            continue
        if not isinstance(value, int | float | np.number):
            raise ValueError(f"{name} is {value!r}; a number is wanted.")
        if not low <= value < float("inf"):
            raise ValueError(f"{name} is {value}; it has to be at least {low}.")
        if float not in (hints[name], *get_args(hints[name])) and value != int(value):
            raise ValueError(f"{name} is {value}; a whole number is wanted.")
    for name, hint in hints.items():
        if get_origin(hint) is Literal and getattr(settings, name) not in get_args(hint):
            words = ", ".join(map(str, get_args(hint)))
            raise ValueError(f"{name} is {getattr(settings, name)!r}; choose {words}.")
    for name, (high, meaning) in most.items():
        if not getattr(settings, name) <= high:
            raise ValueError(f"{name} is {getattr(settings, name)}; it is {meaning}, 0 to {high}.")


# Beyond it 32-bit floats or all other terms of the loss are lost.
WEIGHT = (1000, "a weight beside the colours' 1")
MOST: dict[str, tuple[float, str]] = {
    "blended_shapes": (1, "a share"), "depth_share": WEIGHT, "normal_share": WEIGHT,
    "min_scale_px": (1000, "a number of pixels"),
}  # fmt: skip


@dataclass(frozen=True)
class TrainSettings:
    """One run of the shape-shifting model.

    The fields are the options of `train`, their texts its help (app/training/train_options.py says
    which are offered).  They are written into a package's provenance and compared when a run is
    resumed.
    """

    seconds: float | None = None
    """Train for so many seconds of one core: processor time of all threads, so that nothing else
    that runs takes from it, and two cores take half as long.  On a GPU, seconds by the clock.
    The start (first points, hulls) counts, at most half of them; reading photos, compiling and
    looking at held-out photos do not.  Learning rates follow it.
    Default: no limit, --iterations decides."""
    iterations: int | None = 2000
    """Train for this many steps; the same number gives the same bits."""
    max_anchors: int = 12000
    """Most anchors; as far as there are points, a run starts with that many.  A capture of one
    modality with 16 or more training photos has 30000 of 2 splats with light by direction instead,
    layers with shapes of their own have 12000 a shape, where none of max_anchors,
    splats_per_anchor, anchor_attributes and max_mb is given."""
    max_by_shape: bool = False
    """Whether max_anchors is of each shape that the modalities' hulls are, beside triangulated
    points."""
    max_mb: float | None = None
    """Most megabytes of the package on disk, from the start on.  Default: no limit."""
    points: str = "auto"
    """Where the first anchors stand: capture (COLMAP's points or the capture's own), depth (its
    depth photos), hull (of masks or a known background), triangulated (out of the photos), random,
    or a point cloud in the capture's world (PLY, LAS, LAZ, NPZ).  auto: the first of these that
    there is."""
    downscale: int | None = None
    """Divide the photos' sides by this number.  Default: such that neither exceeds 640 pixels."""
    masks: Masks = "auto"
    """What a mask means: object, nothing is outside it; valid, what is outside is unknown; ignore,
    masks are not used.  auto: what the capture says, else what the masks' shapes do (valid where
    they are white along the photos' edges, or all the same)."""
    background: Background = "auto"
    """Colour behind everything.  auto: the capture's own, else random where photos have masks."""
    poses: Poses = "stated"
    """refine: each training photo's camera is turned and shifted a little while the scene is
    learned, for poses that are not exact; NAME.shift.cameras.json gets them.  stated: they are
    right."""
    seed: int = 0
    """Seed of all random numbers."""
    splats_per_anchor: int = 5
    """Splats that the networks predict for each anchor: k in the paper.  Several modalities of
    photos with fewer than 60,000 pixels have fewer, as many as pixels by 12,000 anchors, at least
    2, where none of max_anchors, splats_per_anchor, anchor_attributes and max_mb is given."""
    features: int = 16
    """Numbers that each anchor stores for the networks: the length of its feature vector."""
    hidden: int = 32
    """Neurons in the hidden layer of each of the five networks."""
    fixed: str = ""
    """Networks that do not see x, as offset,scale,rotation: all stops share what they predict.
    Default: none, all five see x."""
    depth_share: float = 0.3
    """Weight of the depth loss where photos have depth photos; 0: those are not used."""
    normal_share: float = 0.1
    """Weight of the loss of directions where photos have normal maps; 0: those are not used."""
    min_scale_px: float = 0.0
    """Splats are not made smaller than so many pixels (one sigma) of the photo that sees a place
    finest.  0.45 is for scenes that are looked at from closer than they were photographed;
    0: no bound."""
    blended_shapes: float = 0.0
    """Share of the steps, 0 to 1, in which a photo is drawn with its stop's colours on shapes
    between its stop and a neighbouring one (docs/between.md).  For scenes with a value stop: 0.5
    makes the picture between two stops their cross-fade."""
    view_dependent: bool = True
    """Let colours depend on the direction from which one looks."""
    anchor_attributes: str = "frame,stop_color"
    """What each anchor has besides its features, as frame,stop_color,light: sizes and axes; a base
    colour, one for all stops (color) or one for each (stop_color); light by direction, which
    changes its colour by the side it is seen from, or its brightness alone (gray_light)."""
    grow: bool = True
    """Add anchors and move the least useful ones to where pictures need them."""
    grow_every: int = 100
    """Steps between two changes of the anchors."""
    rig: str = ""
    """Offsets of cameras that were found: JSON, a modality -> 16 numbers (training/calibration)."""

    def __post_init__(self) -> None:
        """Raises ValueError naming the first number that cannot be."""
        least = {
            "iterations": 1, "seconds": 0.1, "seed": 0, "splats_per_anchor": 1, "features": 1,
            "hidden": 1, "max_anchors": 1, "grow_every": 1, "downscale": 1, "depth_share": 0,
            "normal_share": 0, "max_mb": 1e-6, "blended_shapes": 0, "min_scale_px": 0,
        }  # fmt: skip
        check_numbers(self, least, MOST)
        self.layout(2)
        if self.iterations is None and self.seconds is None:
            raise ValueError("A run needs an end: give iterations or seconds.")

    def layout(self, units: int, stops: int = 1) -> HeadLayout:
        """The networks that are asked for, for so many units of the control encoding and stops.

        Raises ValueError where there are none such.
        """
        fixed, attributes = (
            tuple(name.strip() for name in names.split(",") if name.strip())
            for names in (self.fixed, self.anchor_attributes)
        )
        gray = "gray_light" in attributes and "light" not in attributes
        return HeadLayout(
            self.splats_per_anchor, self.features, self.hidden, units, fixed, self.view_dependent,
            attributes, stops, light_channels=1 if gray else 3,
        )  # fmt: skip

    def rates(self, iterations: int) -> Rates:
        """The learning rates of a run of so many iterations."""
        return SHORT if iterations <= SHORT_RUN else LONG

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


# A scene that never changes: the networks have nothing to share between stops, so more anchors with
# fewer splats each, and light of their own, gain 0.4 to 1 dB for three times the bytes.
ONE_MODALITY: dict[str, Any] = {
    "splats_per_anchor": 2, "max_anchors": 30000, "anchor_attributes": "frame,color,light",
}  # fmt: skip
MANY_PHOTOS = 16  # to train on: twelve do not hold so much freedom, docs/bench/sparse.csv
SIZES = (*ONE_MODALITY, "max_mb")  # who gives one of these means all of them


def suited(settings: TrainSettings, asked: Iterable[str], capture: Capture) -> TrainSettings:
    """New settings of a run as they suit a capture.  asked: fields that somebody gave."""
    photos = sum(photo.split == "train" for photo in capture.photos)
    if not set(asked).isdisjoint(SIZES):
        return settings
    if len(capture.stops) > 1:
        return replace(settings, max_by_shape=True, splats_per_anchor=fewer(settings, capture))
    return replace(settings, **ONE_MODALITY) if photos >= MANY_PHOTOS else settings


def fewer(settings: TrainSettings, capture: Capture) -> int:
    """Splats an anchor such that all anchors have no more of them than the largest photo pixels.

    More cannot be told apart, and each costs its part of a step: docs/bench/ideas.md, "one shape".
    """
    if not capture.photos:
        return settings.splats_per_anchor
    factor = settings.downscale or choose_downscale(capture.photos)
    pixels = max(math.prod(photo.view.divided(factor).size) for photo in capture.photos)
    most = max(pixels // settings.max_anchors, ONE_MODALITY["splats_per_anchor"])
    return min(settings.splats_per_anchor, most)


BUDGET = ("iterations", "seconds")  # what may change when a run is resumed
Kind = TypeVar("Kind", bound="DataclassInstance")  # TrainSettings, or PlainSettings


def adjusted(settings: Kind, asked: dict[str, Any]) -> Kind:
    """The settings with the values that were asked for, by name.

    A budget of one kind takes the place of the other.  Raises ValueError, one sentence.
    """
    given = [name for name in BUDGET if asked.get(name) is not None]
    other = {"seconds": "iterations", "iterations": "seconds"}
    more = {other[given[0]]: None} if len(given) == 1 else {}
    return replace(settings, **(asked | more))


def resumed(usual: Kind, before: dict[str, Any], asked: dict[str, Any], said: str = "") -> Kind:
    """A checkpoint's settings with another budget.  Raises ValueError for anything else, and for a
    checkpoint of another version.

    usual: settings of the kind that it has to be of; said: what stands before a name where it is
    typed, as --.
    """
    if other := sorted(before.keys() ^ {field.name for field in fields(usual)}):
        raise ValueError(
            f"{said}resume: the checkpoint was written by another version of this program, which "
            f"trains in another way ({other[0]}); train anew without {said}resume."
        )
    other = sorted(n for n in asked if n not in BUDGET and asked[n] != before[n])
    if other:
        raise ValueError(
            f"{said}resume goes on with the settings of the checkpoint, where {other[0]} is "
            f"{before[other[0]]}, not {asked[other[0]]}; leave it out or start anew."
        )
    budget = {name: asked[name] for name in BUDGET if name in asked}
    return adjusted(replace(usual, **before), budget)


# Settings that trainings had once, and what does their work now; rows are in docs/bench.

UNITS = "the control encoding has one unit for each place of a stop on the slider; leave it out"
REGULARISERS = "the regularisers of equation 9 changed nothing that could be measured; leave it out"
GROWING = "anchors start as dense as the points and growing moves the least useful; --max-anchors"
SIZE = f"{GROWING} bounds how many there are"
FULL = "photos have all their pixels from the first step on; --downscale makes them smaller"
BLENDED = "--blended-shapes learns what lies between two stops"

# Option without its dashes -> what does its work now, with options as they are typed.
LEFT = {
    "preset": "there is one set of defaults; the paper's sizes are --iterations 30000 "
    "--max-anchors 100000 with the setting splats_per_anchor at 10",
    "encoding": UNITS,
    "control": UNITS,
    "sigma": UNITS,
    "opacity-share": REGULARISERS,
    "scale-share": REGULARISERS,
    "ssim-share": "D-SSIM always has 0.2 of the image loss; leave it out",
    "rate-scale": "learning rates follow the length of the run, and a run that diverges goes on "
    "with half of them",
    "rise": "a run that diverges goes on with a learning-rate warm-up by itself",
    "revive": "the loss that keeps faint splats from vanishing has a fixed weight of 0.05",
    "layers": "each network has one hidden layer, and the setting hidden says how wide it is",
    "coarse": FULL,
    "coarse-until": FULL,
    "thermal-smooth": "thermal pictures did not gain by it; leave it out",
    "balance": "every modality has as many steps as the others; leave it out",
    "between": BLENDED,
    "between-share": BLENDED,
    "between-pull": BLENDED,
    "own": "anchors have sizes, axes and base colours, and `fit` finds out which a scene can spare",
    "grow": "runs always grow, which makes packages smaller and no worse; leave it out",
    "view-dependent": "colours depend on the direction, and `fit` finds out whether a scene can "
    "spare that",
    "splats": "a run of --model splats starts with 10,000 a modality, and the setting max_splats "
    "bounds them",
    **dict.fromkeys(
        (
            "anchors", "voxel", "growth", "grow-threshold", "grow-grids", "grow-each",
            "grow-replace", "prune-opacity", "prune-weight", "prune-views",
        ),
        SIZE,
    ),
}  # fmt: skip


def left_setting(name: str) -> str:
    """What does the work of a setting that Python may have given once; "" for any other name."""
    now = LEFT.get(name.replace("_", "-"), "")
    return re.sub(r"--([a-z-]+)", lambda option: option[1].replace("-", "_"), now)
