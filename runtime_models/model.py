"""The central types of what a scene holds: anchor model, plain splat layers, decoded splats."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import WIDTHS, channels_of
from shapeshift.runtime_models.files.plain_text import one_line
from shapeshift.runtime_models.leaf_levels import LeafSource
from shapeshift.runtime_models.shapes import check
from shapeshift.runtime_models.splat_motion import SplatMotion
from shapeshift.runtime_models.stop import STOP_KINDS as STOP_KINDS
from shapeshift.runtime_models.stop import ControlEncoding, Stop
from shapeshift.runtime_models.stop_weights import Controls, Pace, StopBlend, encode_control

HEADS = ("offset", "scale", "rotation", "opacity", "color")
SIZE_PER_SPLAT = {"offset": 3, "scale": 3, "rotation": 4, "opacity": 1, "color": 3}
SCAFFOLD_HEADS = {"opacity": 1, "covariance": 7, "color": 3}  # numbers a splat
OCTREE_RULES = ("round", "floor", "ceil", "progressive")
BETWEEN_STOPS = ("blend", "encoding")
MOST_LABEL = 254  # of an object; 255 of a label map says nothing of a pixel
FARTHEST_ORIGIN = 1e12  # metres
LONGEST_SENTENCE = 600  # letters of a refusal, whatever of a file's words is in it


class BadFile(ValueError):
    """A file cannot be used.  The message says what was found, what was wanted and what to do.

    It is one line and ends as a sentence does, whatever a file's own words in it are.
    """

    def __init__(self, sentence: str) -> None:
        line = one_line(sentence, LONGEST_SENTENCE)
        super().__init__(line if line.endswith((".", "!", "?")) else line + ".")


@dataclass(frozen=True)
class Finding:
    """What is wrong in a file, and what was done about it: lint, and the word at every opening."""

    what: str  # with its rows: "12 positions are NaN or Inf"
    count: int  # rows it concerns; 0 = the file as a whole
    done: str  # "dropped", "kept, invisible", "read as metres", ...
    rows: tuple[int, ...] = ()  # the first few, counted from 0 in the file
    file: str = ""
    repaired: bool = True  # False: only worth knowing, so that --strict lets it pass


@dataclass(frozen=True)
class Mlp:
    """Fully connected, ReLU between layers, then y = gain * head(clip(z)).

    `inputs` names the concatenated parts in order, out of "feature", "direction", "light" and
    "control"; of a ScaffoldModel out of "feature", "direction", "distance" and "level".
    """

    weights: tuple[np.ndarray, ...]  # each (out, in) float32
    biases: tuple[np.ndarray, ...]  # each (out,) float32
    head: str = "none"  # none | tanh | sigmoid | softplus | exp
    inputs: tuple[str, ...] = ("feature", "control")
    clip: tuple[float, float] | None = None  # applied to z before the head
    gain: float = 1.0

    @property
    def width_in(self) -> int:
        return self.weights[0].shape[1]

    @property
    def width_out(self) -> int:
        return self.weights[-1].shape[0]


@dataclass(frozen=True)
class ObjectLabel:
    """What the anchors of one label show; label 0, the background, has no name."""

    label: int  # 1 to MOST_LABEL
    name: str


@dataclass(frozen=True)
class AnchorFrames:
    """Every anchor's own axes and sizes: a splat is predicted in them, as if all were alike.

    Its mean is anchor + R (s * offset), its scales s * scale, its rotation that of R times its own.
    """

    scales: np.ndarray  # (A, 3) s, factors above 0, along the anchor's axes
    wxyz: np.ndarray  # (A, 4) R, unit quaternions, object from anchor

    def __post_init__(self) -> None:
        check(scales=(self.scales, "A 3"), wxyz=(self.wxyz, "A 4"))


@dataclass(frozen=True)
class CoarserAnchors:
    """A level of detail: fewer anchors, for the networks and stops of the model that has it."""

    anchors: np.ndarray  # (A, 3), as of the model: these, frames, labels and light
    features: np.ndarray  # (A, F)
    frames: "AnchorFrames | None"
    labels: np.ndarray | None
    light: np.ndarray | None
    cell_m: float  # metres: the edge of the cells whose anchors became one
    from_pixels: float  # it is drawn where the model is seen no larger: diameter of its bounds
    error_db: dict[str, float] = field(default_factory=dict)  # of pictures of that size, by where


@dataclass(frozen=True)
class AnchorModel:
    """A trained shape-shifting model: anchors, features and five networks (paper section 3.2)."""

    anchors: np.ndarray  # (A, 3) metres, object frame
    features: np.ndarray  # (A, F)
    networks: dict[str, Mlp]  # keys HEADS; outputs: offset and scale metres, rotation wxyz
    #                           not normalised, opacity in (-1, 1], color display sRGB 0..1
    splats_per_anchor: int  # k; the model draws A * k splats
    encoding: ControlEncoding
    stops: tuple[Stop, ...]
    provenance: dict = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    pace: tuple[Pace, ...] = ()  # of some pairs of stops
    between_stops: str = "blend"  # one of BETWEEN_STOPS: x there is a blend, or encoded as it is
    frames: AnchorFrames | None = None  # None: the object's axes and size 1 for all
    labels: np.ndarray | None = None  # (A,) uint8 object of each anchor; 0 = background
    objects: tuple[ObjectLabel, ...] = ()  # of every label above 0 that there is; maybe more
    light: np.ndarray | None = None  # (A, 8 C) by direction, as light_harmonics.py says: what it
    #                                  gives, C numbers, is the colour network's input "light"
    coarser: tuple[CoarserAnchors, ...] = ()  # levels of detail, for ever smaller pictures ...
    coarser_of: tuple = ()  # ... of a model with these numbers: changed ones have none

    def __post_init__(self) -> None:
        check(anchors=(self.anchors, "A 3"), features=(self.features, "A F"))
        if self.coarser and not self._is_as_levelled():
            object.__setattr__(self, "coarser", ())
        check_light(self)
        check_labels(self.labels, self.objects, len(self.anchors))
        if self.frames is not None:
            check(anchors=(self.anchors, "A 3"), scales=(self.frames.scales, "A 3"))

    @property
    def splat_count(self) -> int:
        return len(self.anchors) * self.splats_per_anchor

    @property
    def origin(self) -> tuple[float, float, float]:
        """Metres, float64: where its zero lies in the world of its capture; zeros nearly always."""
        said = self.provenance.get("origin_m")
        if not (isinstance(said, list | tuple) and len(said) == 3):
            return (0.0, 0.0, 0.0)
        if not all(isinstance(c, int | float) and abs(c) <= FARTHEST_ORIGIN for c in said):
            return (0.0, 0.0, 0.0)
        x, y, z = map(float, said)
        return (x, y, z)

    def with_coarser(self, coarser: tuple[CoarserAnchors, ...]) -> "AnchorModel":
        """The same with levels of detail, the finest of them first.  They are kept by `replace` as
        long as anchors and networks are.
        """
        return replace(self, coarser=coarser, coarser_of=self._numbers())

    @cached_property
    def levels(self) -> tuple["AnchorModel", ...]:
        """This one, and each of its coarser levels as a model of its own."""
        own = [
            replace(
                self, anchors=one.anchors, features=one.features, frames=one.frames,
                labels=one.labels, light=one.light, findings=(), coarser=(), coarser_of=(),
            )
            for one in self.coarser
        ]  # fmt: skip
        return (self, *own)

    def _numbers(self) -> tuple:
        """All that its levels of detail were made from."""
        return (
            self.anchors, self.features, self.frames, self.labels, self.light, self.networks,
            self.encoding, self.splats_per_anchor,
        )  # fmt: skip

    def _is_as_levelled(self) -> bool:
        pairs = zip(self._numbers(), self.coarser_of, strict=False)
        return len(self.coarser_of) == len(self._numbers()) and all(a is b for a, b in pairs)

    @property
    def input_widths(self) -> dict[str, int]:
        """How many numbers each part has that its networks may take."""
        return {
            "feature": self.features.shape[1], "direction": 3,
            "light": 1 if self.light is None else channels_of(self.light),
            "control": self.encoding.d,
        }  # fmt: skip

    @cached_property
    def blend(self) -> StopBlend:
        """What a control means."""
        return StopBlend(self.stops, self.pace, self.between_stops == "encoding")

    def psi(self, control: Controls) -> np.ndarray:
        """(1, d) float32 control encoding, or (A, d) of one control an anchor."""
        return encode_control(self.encoding, self.blend, control)

    def with_anchors(self, rows: np.ndarray | slice) -> "AnchorModel":
        """The same networks for these rows of the anchors, in their order."""
        frames = self.frames
        if frames is not None:
            frames = AnchorFrames(
                np.ascontiguousarray(frames.scales[rows]), np.ascontiguousarray(frames.wxyz[rows])
            )
        return replace(
            self,
            anchors=np.ascontiguousarray(self.anchors[rows]),
            features=np.ascontiguousarray(self.features[rows]),
            frames=frames,
            labels=None if self.labels is None else np.ascontiguousarray(self.labels[rows]),
            light=None if self.light is None else np.ascontiguousarray(self.light[rows]),
        )


def check_light(model: AnchorModel) -> None:
    """ValueError where anchors have light that no colour network takes, or the other way round."""
    takes = [part for part in ("direction", "light") if part in model.networks["color"].inputs]
    if model.light is not None:
        check(anchors=(model.anchors, "A 3"), light=(model.light, "A L"))
        if (width := model.light.shape[1]) not in WIDTHS.values():
            wanted = " or ".join(map(str, WIDTHS.values()))
            raise ValueError(f"anchors have {width} numbers of light each, expected {wanted}")
    if ("light" in takes) != (model.light is not None) or takes == ["light"]:
        has = "no light" if model.light is None else "light"
        raise ValueError(
            f"anchors have {has}, but the colour network takes {' and '.join(takes) or 'neither'}; "
            "light comes with an input 'light' beside 'direction'"
        )


def check_labels(labels: np.ndarray | None, objects: tuple[ObjectLabel, ...], anchors: int) -> None:
    """ValueError, one sentence, where labels of anchors and the names of objects do not fit."""
    if labels is None:
        if objects:
            raise ValueError(f"objects name {len(objects)} labels, but no anchor has labels")
        return
    if labels.dtype != np.uint8 or labels.shape != (anchors,):
        raise ValueError(
            f"labels are {labels.dtype} of shape {labels.shape}, expected uint8 of ({anchors},)"
        )
    numbers, names = [o.label for o in objects], [o.name for o in objects]
    if any(not 1 <= number <= MOST_LABEL for number in numbers):
        raise ValueError(f"objects have the labels {numbers}, expected 1 to {MOST_LABEL}")
    if twice := [number for number in numbers if numbers.count(number) > 1]:
        raise ValueError(f"two objects have the label {twice[0]}")
    if alike := [name for name in names if names.count(name) > 1]:
        raise ValueError(f"two objects have the name {alike[0]}")
    if unnamed := sorted(set(np.unique(labels).tolist()) - {0, *numbers}):
        raise ValueError(f"anchors have the label {unnamed[0]}, which no object has")


@dataclass(frozen=True)
class SplatLayers:
    """Plain trained splats, one set a stop, weighed by x: how 3DGS files come in."""

    means: np.ndarray  # (N, 3) metres, object frame
    scales: np.ndarray  # (N, 3) metres, one sigma
    wxyz: np.ndarray  # (N, 4) unit quaternions
    opacity: np.ndarray  # (N,) 0..1
    sh: np.ndarray  # (N, M, 3) spherical harmonics, M = 1, 4, 9 or 16; colour = 0.5 + sum
    layer: np.ndarray  # (N,) int32, index into stops
    stops: tuple[Stop, ...]
    mode: str = "cumulative"  # cumulative: stop i shows layers 0..i; exclusive: layer i alone
    provenance: dict = field(default_factory=dict)
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)  # metres, float64: what was taken off
    #                                   all means; files far from 0 are re-centred, exports put back
    antialiased: bool = False  # trained with the screen filter that keeps energy (Mip-Splatting)
    labels: np.ndarray | None = None  # (N,) int32 object of each splat; 0 = background
    extra: dict[str, np.ndarray] = field(default_factory=dict)  # (N,) columns kept for export
    findings: tuple[Finding, ...] = ()
    motion: SplatMotion | None = None  # time as x: then all lie in layer 0 and mode is cumulative
    leaves: LeafSource | None = None  # where finer levels of these come from, as they are seen

    def __post_init__(self) -> None:
        check(
            means=(self.means, "N 3"),
            scales=(self.scales, "N 3"),
            wxyz=(self.wxyz, "N 4"),
            opacity=(self.opacity, "N"),
            sh=(self.sh, "N M 3"),
        )

    @property
    def splat_count(self) -> int:
        return len(self.means)

    @cached_property
    def blend(self) -> StopBlend:
        """What a control means."""
        return StopBlend(self.stops, frames="frames" in self.provenance)

    def with_rows(self, rows: np.ndarray | slice) -> "SplatLayers":
        """These splats alone, in their order."""
        return replace(
            self,
            means=np.ascontiguousarray(self.means[rows]),
            scales=np.ascontiguousarray(self.scales[rows]),
            wxyz=np.ascontiguousarray(self.wxyz[rows]),
            opacity=np.ascontiguousarray(self.opacity[rows]),
            sh=np.ascontiguousarray(self.sh[rows]),
            layer=np.ascontiguousarray(self.layer[rows]),
            labels=None if self.labels is None else np.ascontiguousarray(self.labels[rows]),
            extra={name: column[rows] for name, column in self.extra.items()},
            motion=None if self.motion is None else self.motion.with_rows(rows),
            leaves=None,
        )

    def time(self, control: Controls) -> float | np.ndarray:
        """Of splats that move: the place between the stops, 0 to 1; (n,) of n controls."""
        return self.blend.weights(control) @ np.array([stop.x for stop in self.stops])

    def weights(self, control: Controls) -> np.ndarray:
        """(stops,) float32 in 0..1: how much of each layer is there; (stops, n) of n controls.

        Cumulative layers fade in on the way from the stop before and stay; exclusive layers fade
        out again on the way to the next stop.
        """
        rows = np.eye(len(self.stops))
        if self.mode == "cumulative":
            rows = np.tril(np.ones_like(rows))  # row i: what stop i shows
        return (self.blend.weights(control) @ rows).T.astype(np.float32)


@dataclass(frozen=True)
class Octree:
    """Which anchors of an Octree-GS model are drawn from how far: the rule it was trained with."""

    level: np.ndarray  # (A,) float32, 0 = the coarsest
    extra: np.ndarray  # (A,) float32, added to the level that the distance asks for
    places: np.ndarray  # (A, 3) metres: where distances are measured to
    standard_m: float  # from farther away level 0 alone is drawn
    fork: float = 2.0  # so many times nearer, one level finer
    rule: str = "round"  # one of OCTREE_RULES: how the asked level becomes a whole one

    def __post_init__(self) -> None:
        check(level=(self.level, "A"), extra=(self.extra, "A"), places=(self.places, "A 3"))


@dataclass(frozen=True)
class ScaffoldModel:
    """A Scaffold-GS or Octree-GS model: everything but a splat's place depends on the eye."""

    anchors: np.ndarray  # (A, 3) metres, object frame
    features: np.ndarray  # (A, F)
    offsets: np.ndarray  # (A, k, 3) metres, from the anchor
    scales: np.ndarray  # (A, 3) metres, what the scales of its splats are a part of
    networks: dict[str, Mlp]  # keys SCAFFOLD_HEADS, and "bank" where features are mixed by the view
    stops: tuple[Stop, ...] = (Stop("RGB", 0.0),)
    octree: Octree | None = None
    provenance: dict = field(default_factory=dict)
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)  # metres, as of SplatLayers
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        check(
            anchors=(self.anchors, "A 3"),
            features=(self.features, "A F"),
            offsets=(self.offsets, "A K 3"),
            scales=(self.scales, "A 3"),
        )

    @cached_property
    def blend(self) -> StopBlend:
        """What a control means, though nothing depends on it."""
        return StopBlend(self.stops)

    @property
    def splats_per_anchor(self) -> int:
        return self.offsets.shape[1]

    @property
    def splat_count(self) -> int:
        return len(self.anchors) * self.splats_per_anchor


@dataclass(frozen=True)
class Splats:
    """What all kinds decode to at one x and one eye position."""

    means: np.ndarray  # (N, 3) metres
    scales: np.ndarray  # (N, 3) metres, one sigma
    wxyz: np.ndarray  # (N, 4) unit
    opacity: np.ndarray  # (N,), negative = absent
    color: np.ndarray  # (N, 3) display sRGB 0..1


Model = AnchorModel | SplatLayers | ScaffoldModel


def is_antialiased(model: Model) -> bool:
    """Whether it was trained with the screen filter that makes small splats fainter."""
    return isinstance(model, SplatLayers) and model.antialiased
