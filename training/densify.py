"""Densification: anchors that show nothing are removed, others come where the gradients are large.

`grad2d` is a splat's screen gradient with every pixel's part taken absolutely (AbsGS): that of a
large splat over fine texture is large, though its pixels disagree about where to go.  At the cap
the anchors of the least contribution move to the largest gradients, as dead splats do in 3DGS-MCMC.
"""

from dataclasses import dataclass

import numpy as np

from shapeshift.rasterizer.project import LEAST_ALPHA
from shapeshift.runtime_models.model import BadFile, ControlEncoding, Stop
from shapeshift.runtime_models.package.package_files import LIGHT
from shapeshift.runtime_models.package.write_package import package_files, zip_files
from shapeshift.training.export import model_of
from shapeshift.training.heads.networks import KERNELS, HeadLayout, initial_weights, padded
from shapeshift.training.settings import TrainSettings

GRAD2D_THRESHOLD = 6e-4  # half image widths; absolute ones are some 3 times 3DGS's 2e-4
SHRINK = 0.5  # size of a new anchor in that of its parent
EXCHANGED = 0.05  # of all anchors, at most: those that make room once the cap is reached
LEAST_OPACITY = 0.005  # mean of an anchor's splats below which it goes
LEAST_VIEWS = 10  # steps that must have shown a splat, or an anchor, for its sums to count
LEAST_STOP_VIEWS = 5  # steps of one stop; fewer count as so many, as chance is large
LEAST_STEPS = 50  # before an anchor can go for its opacity ...
LEAST_RUNS = 3  # ... and of these such as ran it: what is absent runs rarely, see step.py
AXIS_BITS = 21  # of a key of a grid cell


@dataclass(frozen=True)
class NewAnchors:
    """New anchors, those that are wanted most first."""

    anchors: np.ndarray  # (M, 3) float32 metres
    parents: np.ndarray  # (M,) anchor of the splat: all else but the size is copied from it

    def first(self, count: int) -> "NewAnchors":
        return NewAnchors(self.anchors[:count], self.parents[:count])


def transparent_anchors(opacity: np.ndarray, steps: int, splats_per_anchor: int) -> np.ndarray:
    """(A,) bool: anchors whose splats have a mean opacity below LEAST_OPACITY.

    opacity: (A, 2) of DensificationStats over `steps`.
    """
    if steps < LEAST_STEPS:
        return np.zeros(len(opacity), bool)
    total, ran = opacity.T
    return (ran >= LEAST_RUNS) & (total < LEAST_OPACITY * ran * splats_per_anchor)


def mean_contribution(contribution: np.ndarray) -> np.ndarray:
    """(A,) pixels that an anchor gives to a picture that shows it, at the stop where it gives most.

    contribution: (stops, A, 2) of DensificationStats; infinite where fewer than LEAST_VIEWS
    pictures showed the anchor.
    """
    sums, views = contribution[..., 0], contribution[..., 1]
    each = sums / np.maximum(views, 1)
    return np.where(views.sum(0) < LEAST_VIEWS, np.inf, each.max(0))


def least_contributing(contribution: np.ndarray, among: np.ndarray, count: int) -> np.ndarray:
    """Indices of at most `count` anchors `among` (A,) bool that give least to their pictures."""
    gives = np.where(among, mean_contribution(contribution), np.inf)
    order = np.argsort(gives, kind="stable")[:count]
    return order[np.isfinite(gives[order])]


def cell_keys(points: np.ndarray, cell: float, origin: np.ndarray) -> np.ndarray:
    """(P,) int64, one number a cube of side `cell`; origin lies below all points."""
    cells = np.floor((points - origin) / cell).astype(np.int64)
    cells = np.clip(cells, 0, (1 << AXIS_BITS) - 1)  # what lies so far out shares a cell
    return (cells[:, 0] << 2 * AXIS_BITS) | (cells[:, 1] << AXIS_BITS) | cells[:, 2]


def largest_gradient(grad2d: np.ndarray) -> np.ndarray:
    """(N,) mean screen gradient of each splat at the stop where it is largest.

    A mean over all stops would say that a splat does well enough which one of them asks for more
    of.  grad2d: (stops, N, 2) of DensificationStats; 0 where too few steps showed the splat.
    """
    sums, views = grad2d[..., 0], grad2d[..., 1]
    each = sums / np.maximum(views, LEAST_STOP_VIEWS)
    return np.where(views.sum(0) > LEAST_VIEWS, each.max(0), 0)


def new_anchors(
    anchors: np.ndarray,  # (A, 3) metres
    sizes: np.ndarray,  # (A,) metres
    means: list[np.ndarray],  # (A * k, 3) metres at every stop; NaN where the splat is absent
    grad2d: np.ndarray,  # (stops, A * k, 2) of DensificationStats
) -> NewAnchors:
    """New anchors at splats of a large gradient, one in each free cube of their size."""
    strength = largest_gradient(grad2d)
    strongest = np.argsort(-strength, kind="stable")
    strongest = strongest[strength[strongest] > GRAD2D_THRESHOLD]
    places = np.stack([mean[strongest] for mean in means], axis=1).reshape(-1, 3)
    splats = np.repeat(strongest, len(means))  # strongest first, its stops one after the other
    there = np.isfinite(places).all(axis=1)
    places, splats = places[there], splats[there]
    parents = splats // (len(strength) // max(len(anchors), 1))
    if not len(places):
        return NewAnchors(np.zeros((0, 3), np.float32), np.zeros(0, np.int64))
    # Sizes in steps of two, so that anchors of one step share a grid.
    level = np.round(np.log2(SHRINK * sizes[parents])).astype(int)
    origin = np.minimum(places.min(0), anchors.min(0))
    kept = []
    for step in np.unique(level):
        mine = np.flatnonzero(level == step)
        keys = cell_keys(places[mine], 2.0**step, origin)
        _, first = np.unique(keys, return_index=True)
        taken = cell_keys(anchors, 2.0**step, origin)
        kept.append(mine[first[~np.isin(keys[first], taken)]])
    order = np.sort(np.concatenate(kept))
    return NewAnchors(places[order].astype(np.float32), parents[order])


def densify_and_prune(
    anchors: np.ndarray, sizes: np.ndarray, means: list[np.ndarray],
    stats: dict[str, np.ndarray], most: int,
) -> tuple[np.ndarray, NewAnchors]:  # fmt: skip
    """(A,) bool which anchors stay, and who comes, so that at most `most` are left.

    anchors, sizes and means as of `new_anchors`; stats: the state of DensificationStats.
    """
    splats = len(means[0]) // len(anchors)
    gone = transparent_anchors(stats["densify.opacity"], int(stats["densify.steps"]), splats)
    if gone.all():
        gone[:] = False
    new = new_anchors(anchors, sizes, means, stats["densify.grad2d"])
    room = max(most - int((~gone).sum()), 0)
    if len(new.anchors) > room:
        swaps = min(len(new.anchors) - room, int(EXCHANGED * len(anchors)))
        among = ~gone
        among[new.parents[: room + swaps]] = False  # who is needed does not make room
        freed = least_contributing(stats["densify.contribution"], among, swaps)
        gone[freed] = True
        room += len(freed)
    return ~gone, new.first(room)


def absent_as_nan(means: np.ndarray, opacity: np.ndarray) -> np.ndarray:
    """(N, 3) means, NaN where a splat's opacity (N,) is not drawn."""
    return np.where(opacity[:, None] > LEAST_ALPHA, means, np.nan)


def resize_optimizer_state(
    state: dict[str, np.ndarray], groups: tuple[str, ...], keep: np.ndarray, new: NewAnchors
) -> dict[str, np.ndarray]:
    """An optimiser's state with some anchors gone and others added at the end, at rest.

    groups: those that have a row for each anchor.
    """
    out = dict(state)
    for name in groups:
        rows = new.anchors if name == "anchors" else state[f"{name}.value"][new.parents]
        if name == "frames":
            rows = rows + np.log([SHRINK] * 3 + [1] * 4)
        for part in ("value", "mean", "square"):
            old = state[f"{name}.{part}"][keep]
            fresh = rows if part == "value" else np.zeros_like(rows)
            out[f"{name}.{part}"] = np.concatenate([old, fresh]).astype(np.float32)
    return out


# How many anchors a budget of megabytes allows: --max-mb is of the package on disk.

POSITION_BYTES, NUMBER_BYTES = 12, 2  # of an anchor, and of each of its other numbers but light
NOTES_BYTES = 4096  # provenance and names in the manifest
GROWN = 1.02  # times the networks of the start: trained weights may compress less


def bytes_without_anchors(
    layout: HeadLayout, encoding: ControlEncoding, stops: tuple[Stop, ...]
) -> int:
    """At most, of a package whose networks have this layout."""
    state = {
        "weights.value": initial_weights(layout, np.random.default_rng(0)),
        "anchors.value": np.zeros((1, 3), np.float32),
        "features.value": np.zeros((1, padded(layout.features)), np.float32),
    }
    for name, width in layout.own_widths.items():
        state[f"{name}.value"] = np.ones((1, width), np.float32)
    one = model_of(state, layout, 1.0, encoding, stops, {})
    return int(GROWN * len(zip_files(package_files(one, "float16")))) + NOTES_BYTES


def anchor_cap(
    settings: TrainSettings,
    layout: HeadLayout,
    encoding: ControlEncoding,
    stops: tuple[Stop, ...],
) -> int:
    """The cap of growing, from the number and the megabytes (1,000,000 bytes) that are allowed.

    Raises BadFile where no anchor would fit.
    """
    if settings.max_mb is None:
        return settings.max_anchors
    fixed = bytes_without_anchors(layout, encoding, stops)
    widths = layout.own_widths
    numbers = layout.features + sum(width for name, width in widths.items() if name != LIGHT)
    size = POSITION_BYTES + NUMBER_BYTES * numbers + widths.get(LIGHT, 0)  # light: a byte each
    fits = int((settings.max_mb * 1e6 - fixed) // size)
    if fits < 1:
        raise BadFile(
            f"--max-mb {settings.max_mb:g} leaves no room for anchors: the networks alone take up "
            f"to {fixed / 1e6:.3f} MB; allow more, or make them smaller by the setting hidden."
        )
    return min(settings.max_anchors, fits)


# Densification statistics: sums over the steps since the last change of the anchors.


class DensificationStats:
    """Sums over the steps since the last change.  `stop` says whose step the next one is."""

    def __init__(self, device, layout: HeadLayout, anchors_count: int, stops: int) -> None:
        self.device, self.stop = device, 0
        self.kernel = device.program(KERNELS / "density.cl", SPLATS=layout.splats)["accumulate"]
        self.grad2d = [device.zeros((anchors_count * layout.splats, 2)) for _ in range(stops)]
        self.opacity = device.zeros((anchors_count, 2))
        self.contribution = [device.zeros((anchors_count, 2)) for _ in range(stops)]
        self.everything = device.upload(np.arange(anchors_count, dtype=np.int32))
        self.steps = 0

    def add(self, record, grad_record, opacity, size: tuple[int, int], rows=None) -> None:
        """A step: records (N, 12) and gradients by them, opacities (N,), pixels of the picture.

        The gradients are those of rasterize_backward with `absolute` and `weight`.
        rows: (R,) int32 on the device, where the step ran these anchors alone.
        """
        self.steps += 1
        rows = self.everything if rows is None else rows
        self.device.launch(
            self.kernel, len(rows), 16, len(rows), size[0] / 2, rows, record, grad_record,
            opacity, self.grad2d[self.stop], self.opacity, self.contribution[self.stop],
        )  # fmt: skip

    def state(self) -> dict[str, np.ndarray]:
        """Sums and how many steps make each.

        grad2d (stops, N, 2): absolute gradient by the mean on the screen, in half image widths,
        over the steps of a stop that showed the splat.  opacity (A, 2): of an anchor's splats,
        over the steps that ran it.  contribution (stops, A, 2): alpha times transmittance in
        pixels, over the pictures of a stop that showed any of its splats.
        """
        return {
            "densify.grad2d": np.stack([self.device.download(g) for g in self.grad2d]),
            "densify.opacity": self.device.download(self.opacity),
            "densify.contribution": np.stack([self.device.download(g) for g in self.contribution]),
            "densify.steps": np.array(self.steps),
        }

    def load(self, state: dict[str, np.ndarray]) -> None:
        self.grad2d = [self.device.upload(g) for g in state["densify.grad2d"]]
        self.opacity = self.device.upload(state["densify.opacity"])
        self.contribution = [self.device.upload(c) for c in state["densify.contribution"]]
        self.steps = int(state["densify.steps"])
