"""How much model a scene needs: parts are taken away one by one, and held-out photos decide.

A change is judged by differences of the same photo and seed, so what is hard about a photo falls
out of it.  A part goes where every modality, by its mean change less its standard error, stays
within the tolerance of the model before, and of the largest one: neither may several parts cost
more together, nor one part use up what another happened to win.
"""

from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.model import AnchorModel, Stop
from shapeshift.training.settings import TrainSettings

SHAPE_HEADS = ("offset", "scale", "rotation", "opacity")
UNITS = 2  # of the control encoding: which parts there are does not depend on it
LEAST_HIDDEN, LEAST_FEATURES, LEAST_ANCHORS = 8, 4, 50
DROPPED, KEPT, UNSURE = "dropped", "kept", "kept: not sure"


@dataclass(frozen=True)
class Trial:
    """One choice of settings, trained once a seed, or a stored form of such a model."""

    psnr: dict[str, np.ndarray]  # modality: (seeds, photos) dB
    models: tuple[AnchorModel, ...]  # one a seed, as their packages give them back
    storage: str  # of their features, one of FEATURES
    bytes: int  # of the first, on disk
    decode_ms: float  # of the first, for another x and another eye
    train_s: float  # mean of the seeds

    def as_dict(self) -> dict:
        model = self.models[0]
        return {
            "psnr_db": {n: round(float(v.mean()), 3) for n, v in self.psnr.items()},
            "anchors": len(model.anchors), "splats_per_anchor": model.splats_per_anchor,
            "features": model.features.shape[1], "storage": self.storage, "bytes": self.bytes,
            "networks": {
                name: {"inputs": list(m.inputs), "hidden": [len(b) for b in m.biases[:-1]]}
                for name, m in model.networks.items()
            },
            "decode_ms": round(self.decode_ms, 3), "train_s": round(self.train_s, 2),
        }  # fmt: skip


@dataclass(frozen=True)
class DbChange:
    """Of a modality's PSNR in dB, and the standard error of that over photos and seeds."""

    mean: float
    error: float

    def __str__(self) -> str:
        return f"{self.mean:+.2f} ± {self.error:.2f}"


@dataclass(frozen=True)
class Ablation:
    """What taking a part away did."""

    part: str
    change: dict[str, DbChange]  # to the model before, by modality
    total: dict[str, DbChange]  # to the largest model
    verdict: str  # DROPPED | KEPT | UNSURE
    needed_by: tuple[str, ...]  # modalities that lose more than the tolerance, or may
    bytes: int  # saved
    decode_ms: float
    train_s: float

    def as_dict(self) -> dict:
        def rows(found: dict[str, DbChange]) -> dict:
            return {n: {"db": round(c.mean, 3), "error": finite(c.error)} for n, c in found.items()}

        return {
            "part": self.part, "verdict": self.verdict, "change": rows(self.change),
            "total": rows(self.total), "needed_by": list(self.needed_by),
            "saves_bytes": self.bytes, "saves_decode_ms": round(self.decode_ms, 3),
            "saves_train_s": round(self.train_s, 2),
        }  # fmt: skip


def finite(error: float) -> float | None:
    """What JSON can hold of an error."""
    return round(error, 3) if np.isfinite(error) else None


def change_of(before: np.ndarray, after: np.ndarray) -> DbChange:
    """Of (seeds, photos) dB.  The error is NaN where one photo and one seed tell no spread."""
    difference = np.asarray(after, np.float64) - before
    seeds, photos = difference.shape
    squares = []
    if photos > 1:
        squares.append(difference.mean(axis=0).var(ddof=1) / photos)
    if seeds > 1:
        squares.append(difference.mean(axis=1).var(ddof=1) / seeds)
    error = float(np.sqrt(sum(squares))) if squares else float("nan")
    return DbChange(float(difference.mean()), error)


def changes(before: Trial, after: Trial) -> dict[str, DbChange]:
    return {n: change_of(before.psnr[n], after.psnr[n]) for n in before.psnr}


def decide(part: str, full: Trial, before: Trial, after: Trial, tolerance_db: float) -> Ablation:
    """Whether the part may go: `after` is the model without it, `full` the largest."""
    change, total = changes(before, after), changes(full, after)
    both = {n: (change[n], total[n]) for n in total}
    needed_by = tuple(
        n for n, two in both.items() if not all(c.mean - c.error >= -tolerance_db for c in two)
    )
    likely = all(c.mean >= -tolerance_db for two in both.values() for c in two)
    verdict = DROPPED if not needed_by else UNSURE if likely else KEPT
    return Ablation(
        part, change, total, verdict, needed_by,
        before.bytes - after.bytes, before.decode_ms - after.decode_ms,
        before.train_s - after.train_s,
    )  # fmt: skip


@dataclass(frozen=True)
class Component:
    """Something that settings may do without."""

    name: str
    kind: str
    heads: tuple[str, ...] = ()  # or attributes of anchors
    again: bool = False  # whether there may be more of it

    def without(self, settings: TrainSettings, stops: tuple[Stop, ...]) -> TrainSettings | None:
        """The settings without it, None where it is not there (any more)."""
        return REDUCE[self.kind](self, settings, stops)


def _fix(part: Component, settings: TrainSettings, stops: tuple) -> TrainSettings | None:
    fixed = settings.layout(UNITS).fixed
    more = [name for name in part.heads if name not in fixed]
    if len(stops) < 2 or not more or (len(part.heads) > 1 and len(more) < len(part.heads)):
        return None
    return replace(settings, fixed=",".join([*fixed, *more]))


def _no_view(part: Component, settings: TrainSettings, stops: tuple) -> TrainSettings | None:
    return replace(settings, view_dependent=False) if settings.view_dependent else None


def _hidden(part: Component, settings: TrainSettings, stops: tuple) -> TrainSettings | None:
    half = settings.hidden // 2
    return replace(settings, hidden=half) if half >= LEAST_HIDDEN else None


def _features(part: Component, settings: TrainSettings, stops: tuple) -> TrainSettings | None:
    half = settings.features // 2
    return replace(settings, features=half) if half >= LEAST_FEATURES else None


def _slot(part: Component, settings: TrainSettings, stops: tuple) -> TrainSettings | None:
    fewer = settings.splats_per_anchor - 1
    return replace(settings, splats_per_anchor=fewer) if fewer else None


def _anchors(part: Component, settings: TrainSettings, stops: tuple) -> TrainSettings | None:
    """Two thirds of them at most."""
    most = 2 * settings.max_anchors // 3
    return replace(settings, max_anchors=most) if most >= LEAST_ANCHORS else None


def _attribute(part: Component, settings: TrainSettings, stops: tuple) -> TrainSettings | None:
    layout = settings.layout(UNITS)
    fewer = [name for name in layout.attributes if name not in part.heads]
    less = replace(settings, anchor_attributes=",".join(fewer))
    # Light has gone already where colours do not see the direction.
    return None if less.layout(UNITS).per_anchor == layout.per_anchor else less


def _one_color(part: Component, settings: TrainSettings, stops: tuple) -> TrainSettings | None:
    """One base colour an anchor in the place of one for each stop."""
    layout = settings.layout(UNITS, len(stops))
    if len(layout.color_groups) < 2:
        return None
    names = ("color" if name == "stop_color" else name for name in layout.attributes)
    return replace(settings, anchor_attributes=",".join(dict.fromkeys(names)))


def _gray_light(part: Component, settings: TrainSettings, stops: tuple) -> TrainSettings | None:
    """Light by direction that is the same in red, green and blue."""
    layout = settings.layout(UNITS)
    if "light" not in layout.own or layout.light_channels == 1:
        return None
    names = ("gray_light" if name == "light" else name for name in layout.attributes)
    return replace(settings, anchor_attributes=",".join(dict.fromkeys(names)))


REDUCE = {
    "fix": _fix, "view": _no_view, "hidden": _hidden, "features": _features,
    "slot": _slot, "anchors": _anchors, "attribute": _attribute, "one color": _one_color,
    "gray light": _gray_light,
}  # fmt: skip
# What costs most to run comes first; the shape as a whole before its networks one by one.
COMPONENTS = (
    Component("shape that follows x", "fix", SHAPE_HEADS),
    *(Component(f"{name} that follows x", "fix", (name,)) for name in SHAPE_HEADS),
    Component("colour that follows x", "fix", ("color",)),
    Component("colour that follows the eye", "view"),
    Component("half of the hidden units", "hidden", again=True),
    Component("half of the features", "features", again=True),
    Component("anchors' own axes and sizes", "attribute", ("frame",)),
    Component("anchors' own light by direction", "attribute", ("light", "gray_light")),
    Component("light of red, green and blue each", "gray light"),
    Component("a base colour for each stop", "one color"),
    Component("anchors' own base colours", "attribute", ("color", "stop_color")),
    Component("one splat of every anchor", "slot", again=True),
    Component("a third of the anchors", "anchors", again=True),
)
