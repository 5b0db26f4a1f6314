"""Splats of a Scaffold-GS or Octree-GS model from one eye: its networks by onnxruntime.

As generate_neural_gaussians and set_anchor_mask of city-super/Scaffold-GS and Octree-GS do it: the
networks take an anchor's features and the direction from the eye to it, some the distance and the
octree level, too.  A splat whose opacity is not above 0 is absent.
"""

from dataclasses import dataclass, replace

import numpy as np

from runtime_models.model import SCAFFOLD_HEADS, Mlp, Octree, ScaffoldModel
from runtime_models.rotation import normalize
from runtime_models.session import BATCH, open_session
from runtime_models.write_onnx import write_onnx

BANKS = (4, 2, 1)  # every 4th feature, every 2nd, all of them: mixed by the bank's three weights
WIDTHS = {"direction": 3, "distance": 1, "level": 1}  # inputs; "feature" is as wide as the model's
Rows = np.ndarray | slice  # all anchors as a slice: nothing is copied


def drawn_anchors(octree: Octree, eye: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(A,) bool: drawn from an eye (3,); (A,) float32: the part of their opacity that is shown."""
    away = np.linalg.norm(octree.places - np.asarray(eye, np.float32), axis=1)
    with np.errstate(divide="ignore"):
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
class Look:
    """What one eye sees: the anchors that show something, and every splat's opacity."""

    eye: tuple
    rows: Rows  # (n,) anchors of which a splat is there
    parts: dict[str, np.ndarray]  # "direction" (n, 3), "distance" (n, 1), "feature" where mixed
    opacity: np.ndarray  # (A, k), not above 0 = absent


class ScaffoldEvaluator:
    """The networks of one model, made ready once.

    Where features are not mixed by the view, what they give the first layers is kept: 3 * hidden
    floats an anchor.  Scale, rotation and colour run for anchors alone of which a splat is there.
    keep: geometry() writes into the same arrays again; what it gave before is gone.
    """

    def __init__(self, model: ScaffoldModel, threads: int = 1, keep: bool = False) -> None:
        self.model, self._keep = model, keep
        self._kept: tuple[np.ndarray, np.ndarray] | None = None
        fixed = {} if model.octree is None else {"level": model.octree.level[:, None]}
        widths = WIDTHS | {"feature": model.features.shape[1]}
        bank = model.networks.get("bank")
        self._bank = Network("bank", bank, fixed, widths, threads) if bank else None
        if bank is None:
            fixed = fixed | {"feature": model.features}
        self._heads = {
            name: Network(name, model.networks[name], fixed, widths, threads)
            for name in SCAFFOLD_HEADS
        }
        self._means = (model.anchors[:, None] + model.offsets).reshape(-1, 3)
        self._look: Look | None = None

    def look(self, eye: np.ndarray | None) -> Look:
        """The opacities seen from an eye (3,), metres in the object's frame; kept until it moves.

        Raises ValueError for an eye that is not three finite numbers.
        """
        place = np.asarray(eye, np.float64) if eye is not None else np.zeros(0)
        if place.shape != (3,) or not np.isfinite(place).all():
            raise ValueError(f"the eye is {eye}; a Scaffold-GS model is decoded for one place.")
        if self._look is None or self._look.eye != tuple(place):
            self._look = self._look_from(place)
        return self._look

    def _look_from(self, eye: np.ndarray) -> Look:
        model = self.model
        opacity = np.full((len(model.anchors), model.splats_per_anchor), -1, np.float32)
        rows, shown = slice(None), None
        if model.octree is not None:
            drawn, part = drawn_anchors(model.octree, eye)
            rows = np.flatnonzero(drawn)
            shown = part[rows, None]
        parts = self._parts(rows, eye)
        found = self._heads["opacity"].run(rows, parts)
        if shown is not None:
            found *= shown
        opacity[rows] = found
        there = (found > 0).any(axis=1)
        if not there.all():
            rows = np.flatnonzero(there) if isinstance(rows, slice) else rows[there]
            parts = {name: part[there] for name, part in parts.items()}
        return Look(tuple(eye), rows, parts, opacity)

    def _parts(self, rows: Rows, eye: np.ndarray) -> dict[str, np.ndarray]:
        """The inputs that depend on the eye, of some anchors."""
        view = views_of(self.model.anchors[rows], eye)
        parts = {"direction": view[:, :3], "distance": view[:, 3:]}
        if self._bank is None:
            return parts
        weights = softmax(self._bank.run(rows, parts))  # (n, 3)
        features = self.model.features[rows]
        mixed = np.zeros_like(features)
        for step, weight in zip(BANKS, weights.T, strict=True):
            mixed += np.tile(features[:, ::step], (1, step)) * weight[:, None]
        return parts | {"feature": mixed}

    def geometry(
        self, eye: np.ndarray | None, unit: bool = True
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """means (N, 3) m, scales (N, 3) m, wxyz (N, 4) unit, opacity (N,), not above 0 = absent.

        unit False: quaternions of any length.  Absent splats may have any scale and rotation.
        """
        look, model = self.look(eye), self.model
        scales, wxyz = self._room()
        out = self._heads["covariance"].run(look.rows, look.parts)
        out = out.reshape(-1, model.splats_per_anchor, 7)
        scales[look.rows] = model.scales[look.rows, None] * sigmoid(out[..., :3])
        wxyz[look.rows] = out[..., 3:]
        wxyz = wxyz.reshape(-1, 4)
        wxyz = normalize(wxyz) if unit else wxyz
        return self._means, scales.reshape(-1, 3), wxyz, look.opacity.reshape(-1)

    def _room(self) -> tuple[np.ndarray, np.ndarray]:
        """scales (A, k, 3), wxyz (A, k, 4) to be filled; with `keep` the same again."""
        if self._kept is not None:
            return self._kept
        shape = self.model.offsets.shape[:2]
        scales, wxyz = np.zeros((*shape, 3), np.float32), np.zeros((*shape, 4), np.float32)
        wxyz[..., 0] = 1
        if self._keep:
            self._kept = scales, wxyz
        return scales, wxyz

    def color(self, eye: np.ndarray) -> np.ndarray:
        """(N, 3) display sRGB seen from an eye (3,); of splats that are absent, 0."""
        return self._color_of(self.look(eye))

    def _color_of(self, look: Look) -> np.ndarray:
        model = self.model
        color = np.zeros((len(model.anchors), 3 * model.splats_per_anchor), np.float32)
        color[look.rows] = self._heads["color"].run(look.rows, look.parts)
        return color.reshape(-1, 3)

    def color_along(self, eye: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """The same with each anchor looked at along its direction (A, 3), else as from the eye."""
        look = self.look(eye)
        turned = replace(look, parts=look.parts | {"direction": direction[look.rows]})
        return self._color_of(turned)


def sigmoid(z: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):
        return 1 / (1 + np.exp(-z))


def softmax(z: np.ndarray) -> np.ndarray:
    """Along the rows of (n, m)."""
    e = np.exp(z - z.max(axis=1, keepdims=True, initial=-np.inf))
    return e / e.sum(axis=1, keepdims=True)


class Network:
    """One network; the part of its first layer that meets what no eye changes is kept."""

    def __init__(
        self,
        name: str,
        mlp: Mlp,
        fixed: dict[str, np.ndarray],
        widths: dict[str, int],
        threads: int,
    ) -> None:
        part_of = np.repeat(mlp.inputs, [widths[part] for part in mlp.inputs])
        first = mlp.weights[0]
        self._inputs = [part for part in mlp.inputs if part not in fixed]
        self._width_out = mlp.width_out
        rest = replace(mlp, weights=(first[:, ~np.isin(part_of, list(fixed))], *mlp.weights[1:]))
        self._session = open_session(write_onnx(rest, name, "input and rows"), threads)
        self._bias = mlp.biases[0][None]  # (1, hidden)
        self._base = np.zeros((1, len(first)), np.float32)  # (A, hidden), (1, hidden) of none
        for part in set(mlp.inputs) & fixed.keys():
            # By a session as well: numpy's matrix product leaves threads spinning for milliseconds.
            layer = Mlp((first[:, part_of == part],), (np.zeros(len(first), np.float32),))
            session = open_session(write_onnx(layer, part), threads)
            self._base = self._base + session.run(["output"], {"input": fixed[part]})[0]

    def run(self, rows: Rows, parts: dict[str, np.ndarray]) -> np.ndarray:
        """(n, outputs) of some anchors (n,); parts: the inputs that depend on the eye, of these."""
        count = len(parts["direction"])
        out = np.empty((count, self._width_out), np.float32)
        fixed = self._base if len(self._base) == 1 else self._base[rows]
        for start in range(0, count, BATCH):
            now = slice(start, start + BATCH)
            columns = np.concatenate([parts[name][now] for name in self._inputs], axis=1)
            base = np.repeat(fixed, len(columns), axis=0) if len(fixed) == 1 else fixed[now]
            given = {"input": columns, "bias": self._bias, "rows": base}
            out[now] = self._session.run(["output"], given)[0]
        return out
