"""Splats of a Scaffold-GS or Octree-GS model from one eye: its networks by onnxruntime.

As generate_neural_gaussians and set_anchor_mask of city-super/Scaffold-GS and Octree-GS do it: the
networks take an anchor's features and the direction from the eye to it, some the distance and the
octree level, too.  A splat whose opacity is not above 0 is absent.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.model import SCAFFOLD_HEADS, Mlp, Octree, ScaffoldModel
from shapeshift.runtime_models.package.package_files import write_onnx
from shapeshift.runtime_models.rotation import normalize
from shapeshift.runtime_models.session import open_session

BLOCK = 4096  # anchors at a time: stays in the cache; threads gained nothing on two cores
BANKS = (4, 2, 1)  # every 4th feature, every 2nd, all of them: mixed by the bank's three weights
WIDTHS = {"direction": 3, "distance": 1, "level": 1}  # inputs; "feature" is as wide as the model's
Rows = np.ndarray | slice  # all anchors as a slice: nothing is copied


def drawn_anchors(octree: Octree, eye: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(A,) bool: drawn from an eye (3,); (A,) float32: the part of their opacity that is shown."""
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        away = np.linalg.norm(octree.places - np.asarray(eye, np.float32), axis=1)
        asked = np.log2(octree.standard_m / away) / np.log2(octree.fork) + octree.extra
    last = float(np.ptp(octree.level)) if len(octree.level) else 0.0
    part = np.ones(len(away), np.float32)
    if octree.rule == "progressive":
        asked = np.clip(asked + 1, 0.9999, last + 0.9999)
        whole = np.floor(asked)
        fading = octree.level == whole
        part[fading] = (asked - whole)[fading]
    else:
        to_whole = {"round": np.rint, "floor": np.floor, "ceil": np.ceil}[octree.rule]
        whole = np.clip(to_whole(asked), 0, last)
    return octree.level <= whole, part


def views_of(anchors: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """(n, 4) float32: the direction from an eye (3,) to each anchor, unit, and metres between.

    The direction is zero at the anchor itself.
    """
    view = np.empty((len(anchors), 4), np.float32)
    delta = anchors - np.asarray(eye, np.float32)
    view[:, 3] = np.sqrt(np.einsum("ac,ac->a", delta, delta))
    away = view[:, 3:]
    np.divide(delta, away, out=view[:, :3], where=away > 0)
    view[:, :3][~(away[:, 0] > 0)] = 0
    return view


@dataclass(frozen=True)
class EyeInputs:
    """What one eye sees: every anchor's inputs to the networks, every splat's opacity."""

    eye: tuple
    view: np.ndarray  # (A, 4) views_of
    features: np.ndarray | None  # (A, F) as mixed for the view; None: as they are
    opacity: np.ndarray  # (A, k), not above 0 = absent
    there: np.ndarray  # (A,) bool: a splat of it is
    seen: np.ndarray | None  # (A,) bool: anchors that were asked for; None: all

    def inputs(self, rows: Rows) -> dict[str, np.ndarray]:
        """What networks take, of some anchors."""
        view = self.view[rows]
        parts = {"direction": view[:, :3], "distance": view[:, 3:]}
        return parts if self.features is None else parts | {"feature": self.features[rows]}


class ScaffoldEvaluator:
    """The networks of one model, made ready once.

    Where features are not mixed by the view, what they give the first layers is kept: 3 * hidden
    floats an anchor.  Scale, rotation and colour run for anchors alone of which a splat is there.
    keep: geometry() and color() write into the same arrays again; what they gave before is gone.
    """

    def __init__(self, model: ScaffoldModel, keep: bool = False) -> None:
        self.model, self._keep = model, keep
        self._kept: dict[str, np.ndarray] = {}
        fixed = {} if model.octree is None else {"level": model.octree.level[:, None]}
        widths = WIDTHS | {"feature": model.features.shape[1]}
        bank = model.networks.get("bank")
        self._bank = ScaffoldNetwork("bank", bank, fixed, widths) if bank else None
        if bank is None:
            fixed = fixed | {"feature": model.features}
        self._heads = {
            name: ScaffoldNetwork(name, model.networks[name], fixed, widths)
            for name in SCAFFOLD_HEADS
        }
        self._means = (model.anchors[:, None] + model.offsets).reshape(-1, 3)
        self._look: EyeInputs | None = None

    def look(self, eye: np.ndarray | None, seen: np.ndarray | None = None) -> EyeInputs:
        """The opacities seen from an eye (3,), metres in the object's frame; kept until it moves.

        seen: (A,) bool, the rest is absent; None: all, or as looked before from there.
        Raises ValueError for an eye that is not three finite numbers.
        """
        place = np.asarray(eye, np.float64) if eye is not None else np.zeros(0)
        if place.shape != (3,) or not np.isfinite(place).all():
            raise ValueError(f"the eye is {eye}; a Scaffold-GS model is decoded for one place.")
        kept = self._look
        if kept is None or kept.eye != tuple(place) or (seen is not None and seen is not kept.seen):
            kept = self._look = self._look_from(place, seen)
        return kept

    def _look_from(self, eye: np.ndarray, seen: np.ndarray | None) -> EyeInputs:
        model = self.model
        count, k = model.offsets.shape[:2]
        drawn, part = np.ones(count, bool), None
        if model.octree is not None:
            drawn, part = drawn_anchors(model.octree, eye)
        drawn = drawn if seen is None else drawn & seen
        bank = self._bank
        features = None if bank is None else np.zeros_like(model.features)
        opacity = np.full((count, k), -1, np.float32)
        view = np.empty((count, 4), np.float32)
        look = EyeInputs(tuple(eye), view, features, opacity, drawn.copy(), seen)

        def decode(rows: Rows) -> None:
            look.view[rows] = views_of(model.anchors[rows], eye)
            if bank is not None and look.features is not None:
                weights = softmax(bank.run(rows, look.inputs(rows)))  # (n, 3)
                look.features[rows] = mixed(model.features[rows], weights)
            found = self._heads["opacity"].run(rows, look.inputs(rows))
            opacity[rows] = found if part is None else found * part[rows, None]
            look.there[rows] = (opacity[rows] > 0).any(axis=1)

        each_row_of(drawn, decode)
        return look

    def geometry(
        self, eye: np.ndarray | None, unit: bool = True, seen: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """means (N, 3) m, scales (N, 3) m, wxyz (N, 4) unit, opacity (N,), not above 0 = absent.

        unit False: quaternions of any length.  Absent splats may have any scale and rotation.
        seen: (A,) bool; the splats of other anchors are absent, for the colours after it as well.
        """
        if seen is None and self._look is not None and self._look.seen is not None:
            self._look = None  # what was asked for before is not enough
        look, model = self.look(eye, seen), self.model
        scales, wxyz = self._room("scales", 3), self._room("wxyz", 4)

        def decode(rows: Rows) -> None:
            out = self._heads["covariance"].run(rows, look.inputs(rows))
            out = out.reshape(-1, model.splats_per_anchor, 7)
            scales[rows] = model.scales[rows, None] * sigmoid(out[..., :3])
            wxyz[rows] = out[..., 3:]

        each_row_of(look.there, decode)
        wxyz = wxyz.reshape(-1, 4)
        wxyz = normalize(wxyz) if unit else wxyz
        return self._means, scales.reshape(-1, 3), wxyz, look.opacity.reshape(-1)

    def _room(self, name: str, size: int) -> np.ndarray:
        """(A, k, size) to be filled, zeros at first (quaternions: none); with `keep` the same."""
        if name not in self._kept or not self._keep:
            self._kept[name] = np.zeros((*self.model.offsets.shape[:2], size), np.float32)
            if name == "wxyz":
                self._kept[name][..., 0] = 1
        return self._kept[name]

    def color(self, eye: np.ndarray | None) -> np.ndarray:
        """(N, 3) display sRGB seen from an eye (3,); absent splats have any."""
        return self._color_of(self.look(eye))

    def _color_of(self, look: EyeInputs) -> np.ndarray:
        color = self._room("color", 3)

        def decode(rows: Rows) -> None:
            out = self._heads["color"].run(rows, look.inputs(rows))
            color[rows] = out.reshape(-1, *color.shape[1:])

        each_row_of(look.there, decode)
        return color.reshape(-1, 3)

    def color_along(self, eye: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """The same with each anchor looked at along its direction (A, 3), else as from the eye."""
        look = self.look(eye)
        return self._color_of(replace(look, view=np.hstack([direction, look.view[:, 3:]])))


def each_row_of(wanted: np.ndarray, decode: Callable[[Rows], None]) -> None:
    """decode(rows) for the rows where wanted (A,) is true, block by block.

    Numbers beyond float32 become Inf or NaN without a word: such splats pass no gate.
    """
    for start in range(0, len(wanted), BLOCK):
        block = slice(start, min(start + BLOCK, len(wanted)))
        mine = wanted[block]
        with np.errstate(over="ignore", invalid="ignore"):
            if mine.all():
                decode(block)  # nothing is copied
            elif mine.any():
                decode(start + np.flatnonzero(mine))


def mixed(features: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(n, F) features of three resolutions, mixed by weights (n, 3)."""
    out = np.zeros_like(features)
    for step, weight in zip(BANKS, weights.T, strict=True):
        out += np.tile(features[:, ::step], (1, step)) * weight[:, None]
    return out


def sigmoid(z: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-z))


def softmax(z: np.ndarray) -> np.ndarray:
    """Along the rows of (n, m)."""
    e = np.exp(z - z.max(axis=1, keepdims=True, initial=-np.inf))
    return e / e.sum(axis=1, keepdims=True)


class ScaffoldNetwork:
    """One network; the part of its first layer that meets what no eye changes is kept."""

    def __init__(
        self, name: str, mlp: Mlp, fixed: dict[str, np.ndarray], widths: dict[str, int]
    ) -> None:
        part_of = np.repeat(mlp.inputs, [widths[part] for part in mlp.inputs])
        first = mlp.weights[0]
        self._inputs = [part for part in mlp.inputs if part not in fixed]
        rest = replace(mlp, weights=(first[:, ~np.isin(part_of, list(fixed))], *mlp.weights[1:]))
        self._session = open_session(write_onnx(rest, name, "input and rows"), threads=1)
        self._bias = mlp.biases[0][None]  # (1, hidden)
        self._base: np.ndarray | None = None  # (A, hidden)
        for part in set(mlp.inputs) & fixed.keys():
            # By a session as well: numpy's matrix product leaves threads spinning for milliseconds.
            layer = Mlp((first[:, part_of == part],), (np.zeros(len(first), np.float32),))
            session = open_session(write_onnx(layer, part), threads=1)
            given = session.run(["output"], {"input": fixed[part]})[0]
            self._base = given if self._base is None else self._base + given

    def run(self, rows: Rows, parts: dict[str, np.ndarray]) -> np.ndarray:
        """(n, outputs) of some anchors (n,); parts: the inputs that depend on the eye, of these."""
        columns = np.concatenate([parts[name] for name in self._inputs], axis=1)
        if self._base is None:
            base = np.zeros((len(columns), self._bias.shape[1]), np.float32)
        else:
            base = self._base[rows]
        given = {"input": columns, "bias": self._bias, "rows": base}
        return self._session.run(["output"], given)[0]
