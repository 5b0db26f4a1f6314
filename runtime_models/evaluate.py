"""Splats of a model at one x and one eye, by onnxruntime: the check of every faster path."""

import numpy as np

from shapeshift.runtime_models.blocks.block_model import BlockModel
from shapeshift.runtime_models.blocks.evaluate_blocks import BlockEvaluator
from shapeshift.runtime_models.colors.spherical_harmonics import light_along, shade
from shapeshift.runtime_models.model import (
    HEADS,
    SIZE_PER_SPLAT,
    AnchorFrames,
    AnchorModel,
    Model,
    ScaffoldModel,
    SplatLayers,
    Splats,
)
from shapeshift.runtime_models.rotation import normalize, product, rotation_matrices
from shapeshift.runtime_models.scaffold.evaluate_scaffold import ScaffoldEvaluator
from shapeshift.runtime_models.session import BATCH, FoldedNetwork, WholeNetwork
from shapeshift.runtime_models.stop_weights import Controls, is_each

MOST_CHANGED = 0.5  # of the anchors: from there on all of them are run


def follows_eye(model: Model) -> bool:
    """Whether more than a model's colours depends on the eye: opacity, scales and rotations."""
    return isinstance(model, ScaffoldModel)


def shape_follows_control(model: Model) -> bool:
    """Whether more than a model's colours depends on x: where its splats are, and which."""
    if isinstance(model, AnchorModel):
        return any("control" in model.networks[n].inputs for n in HEADS if n != "color")
    return isinstance(model, SplatLayers)


def only_fades(model: Model) -> bool:
    """Whether x changes nothing of its splats but their opacity: layers that do not move."""
    return isinstance(model, SplatLayers) and model.motion is None


def colors_follow_control(model: Model) -> bool:
    """Whether the colour of a splat depends on x."""
    return isinstance(model, AnchorModel) and "control" in model.networks["color"].inputs


def evaluate(model: Model, x: Controls, eye: np.ndarray) -> Splats:
    """The splats at control x seen from `eye` (3,), metres in the object's frame.

    Runs the networks as a package holds them, on every input, Psi(x) too: the plain twin of
    Evaluator, which is for one set of splats after the other.
    """
    evaluator = Evaluator(model, fold=False)
    return Splats(*evaluator.geometry(x, eye=eye), evaluator.color(x, eye))


def directions(anchors: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """(A, 3) from the eye to each anchor, unit length (paper eq. 4); zero at the anchor itself."""
    delta = anchors - np.asarray(eye, np.float32)
    length = np.sqrt(np.einsum("ac,ac->a", delta, delta))
    known = (length > 0) & np.isfinite(length)
    if known.all():
        delta *= np.repeat(1 / length, 3).reshape(-1, 3)  # 3 times faster than to broadcast
        return delta
    return np.divide(delta, length[:, None], out=np.zeros_like(delta), where=known[:, None])


def looked_along(
    model: AnchorModel, direction: np.ndarray, rows: np.ndarray | slice = slice(None)
) -> dict[str, np.ndarray]:
    """What a colour network takes of directions (n, 3): themselves, and where anchors have light,
    what that of these rows of anchors gives along them (n, 1 or 3).
    """
    if model.light is None:
        return {"direction": direction}
    return {"direction": direction, "light": light_along(model.light[rows], direction)}


class Evaluator:
    """The networks of one model, made ready once.

    Psi(x) is the same for every anchor, so with `fold` its product with the first layer goes into
    that layer's bias: exact, and 1.6 times faster than to hand it to every anchor.  Of a network
    that looks at the eye, what the features give the first layer is kept: a colour run is a seventh
    faster, for one float an anchor and hidden unit (128 bytes an anchor of the demo).
    keep: geometry() writes into the same arrays again: no fresh memory, a quarter faster, but what
    it gave before is gone.  A network that does not see x then runs once, and where each anchor has
    a control of its own, it runs for those alone whose control has changed; its caller must not
    write into what it is given.
    """

    def __init__(
        self,
        model: Model,
        threads: int = 1,
        fold: bool = True,
        keep: bool = False,
    ) -> None:
        self.model = model
        self._networks: dict[str, FoldedNetwork | WholeNetwork] = {}
        self._kept: dict[str, np.ndarray] | None = {} if keep else None  # outputs of networks
        self._lasting: set[str] = set()  # of these, which hold for every x
        # Of a control value an anchor: what it was last, and what a network of the shape gave.
        self._mixed: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._whole: dict[str, WholeNetwork] = {}  # for a control value an anchor
        self._threads = threads
        self._own: tuple[np.ndarray, np.ndarray] | None = None  # x of anchors, Psi (A, d)
        self._centres: np.ndarray | None = None  # (A, k * 3) the anchor of every splat
        self._frames: FrameColumns | None = None
        self._scaffold: ScaffoldEvaluator | None = None
        self._blocks: BlockEvaluator | None = None
        if isinstance(model, ScaffoldModel):
            self._scaffold = ScaffoldEvaluator(model, keep)
        elif isinstance(model, BlockModel):
            self._blocks = BlockEvaluator(
                model, lambda part: Evaluator(part, threads, fold, keep), keep
            )
        elif isinstance(model, AnchorModel):
            if model.frames is not None:
                self._frames = FrameColumns(model.frames, model.splats_per_anchor)
            kind = FoldedNetwork if fold else WholeNetwork
            for name, mlp in model.networks.items():
                self._networks[name] = kind(name, mlp, model, threads)

    def geometry(
        self,
        x: Controls,
        unit: bool = True,
        eye: np.ndarray | None = None,
        seen: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """means (N, 3) m, scales (N, 3) m, wxyz (N, 4) unit, opacity (N,) negative = absent.

        unit False: quaternions of any length, for one who divides by it anyway.
        eye: (3,) metres in the object's frame; a model that follows_eye needs it (ValueError).
        seen: (A,) bool; of such a model, the splats of other anchors are absent.
        """
        model = self.model
        if self._scaffold is not None:
            return self._scaffold.geometry(eye, unit, seen)
        if self._blocks is not None:
            return self._blocks.geometry(x, unit)
        if isinstance(model, SplatLayers):
            weights = model.weights(x)  # (stops,) or (stops, N)
            there = weights[model.layer] if weights.ndim == 1 else _own(weights, model.layer)
            opacity = model.opacity * there
            if model.motion is None:
                return model.means, model.scales, model.wxyz, opacity
            means, wxyz, opacity = model.motion.at(model.means, model.wxyz, opacity, model.time(x))
            return means, model.scales, normalize(wxyz) if unit else wxyz, opacity
        if self._centres is None:
            self._centres = np.tile(model.anchors, model.splats_per_anchor)
        means = self._shape("offset", x)  # (A, k * 3)
        scales, wxyz = self._shape("scale", x), self._shape("rotation", x).reshape(-1, 4)
        opacity = self._shape("opacity", x).reshape(-1)
        wxyz = normalize(wxyz) if unit else wxyz
        return means.reshape(-1, 3), scales.reshape(-1, 3), wxyz, opacity

    def color(
        self,
        x: Controls,
        eye: np.ndarray,
        seen: np.ndarray | None = None,
        out: np.ndarray | None = None,
    ) -> np.ndarray:
        """(N, 3) display sRGB seen from `eye` (3,), metres in the object's frame.

        seen: (A,) bool; only these are computed, the rest of `out` (N, 3) stays what it was.
        out: written to and given back, where there is one.
        """
        model = self.model
        if self._scaffold is not None:
            return self._scaffold.color(eye)
        if self._blocks is not None:
            return self._blocks.color(x, eye, seen, out)
        places = model.means if isinstance(model, SplatLayers) else model.anchors
        if seen is None or seen.all():
            return self._color(x, slice(None), directions(places, eye), out)
        rows = np.flatnonzero(seen)
        out = np.zeros((model.splat_count, 3), np.float32) if out is None else out
        if rows.size:
            mine = x[rows] if is_each(x) else x
            per_row = out.reshape(len(places), -1)  # a view: the splats of a row side by side
            colors = self._color(mine, rows, directions(places[rows], eye))
            per_row[rows] = colors.reshape(rows.size, -1)
        return out

    def color_along(
        self, x: Controls, direction: np.ndarray, eye: np.ndarray | None = None
    ) -> np.ndarray:
        """(N, 3) display sRGB where each anchor is looked at along its direction (A, 3), unit.

        eye: as of geometry.
        """
        if self._scaffold is not None:
            assert eye is not None, "a model that follows the eye is asked for one eye"
            return self._scaffold.color_along(eye, direction)
        if self._blocks is not None:
            return self._blocks.color_along(x, direction)
        return self._color(x, slice(None), direction)

    def _color(
        self,
        x: Controls,
        rows: np.ndarray | slice,
        direction: np.ndarray,
        out: np.ndarray | None = None,
    ) -> np.ndarray:
        """(n, 3) colours of the splats of some rows, towards which `direction` (rows, 3) points."""
        if isinstance(self.model, SplatLayers):
            return shade(self.model.sh[rows], direction)
        shape = (len(direction), 3 * self.model.splats_per_anchor)
        out = np.empty(shape, np.float32) if out is None else out.reshape(shape)
        return self._run("color", x, direction, rows, out).reshape(-1, 3)

    def _shape(self, name: str, x: Controls) -> np.ndarray:
        """(A, k * size) of a network of the geometry, of offset from the world's origin.

        With `keep`, one that does not see x is what it was.
        """
        if self._kept is not None and name in self._lasting:
            return self._kept[name]
        changed = self._changed(name, x)
        if changed is not None and is_each(
            x
        ):  # a border that moves: anchors that it has not met stay
            before = self._mixed[name][1]
            if changed.size:
                room = np.empty((changed.size, before.shape[1]), np.float32)
                before[changed] = self._placed(
                    name, self._run(name, x[changed], rows=changed, out=room), changed
                )
            self._mixed[name] = np.array(x), before
            return before
        values = self._placed(name, self._run(name, x), slice(None))
        if self._kept is not None and "control" not in self._anchored.networks[name].inputs:
            self._lasting.add(name)
            self._kept[name] = values
        self._mixed.pop(name, None)  # its array may have been written over
        if self._kept is not None and is_each(x):
            self._mixed[name] = np.array(x), values
        return values

    def _placed(self, name: str, values: np.ndarray, rows: np.ndarray | slice) -> np.ndarray:
        """Outputs of a network of the shape, of some rows of anchors, in the object's frame."""
        if self._frames is not None:
            values = self._frames.apply(name, values, rows)
        if name == "offset":
            values += self._centres[rows]  # type: ignore[index]  # geometry has made them
        return values

    def _changed(self, name: str, x: Controls) -> np.ndarray | None:
        """With `keep`, the rows of anchors whose control is another than the last time; None: all
        of them are to be run.
        """
        if self._kept is None or name not in self._mixed or not is_each(x):
            return None
        before = self._mixed[name][0]
        if before.shape != x.shape:
            return None
        rows = np.flatnonzero(~alike(x, before))
        return rows if rows.size <= MOST_CHANGED * len(x) else None

    def _run(
        self,
        name: str,
        x: Controls,
        direction: np.ndarray | None = None,
        rows: np.ndarray | slice = slice(None),
        out: np.ndarray | None = None,
    ) -> np.ndarray:
        """(A, k * size) output of one network, the splats of one anchor side by side.

        rows: of the anchors; x and direction are already of these rows alone.
        """
        every = self._anchored.features
        if is_each(x) and isinstance(self._networks[name], FoldedNetwork):
            first = alike(x, x[0])
            if len(x) and alike(x[~first], x[~first][:1]).all():  # two sides of a sharp border
                return self._run_sides(name, x, first, direction, rows, out)
        network, features = self._network(name, not is_each(x)), every[rows]
        looks = {} if direction is None else looked_along(self._anchored, direction, rows)
        out = self._room(name) if out is None else out
        psi = self._encoded(x)
        base = network.feature_part(every)
        base = None if base is None else base[rows]
        for start in range(0, len(features), BATCH):
            part = slice(start, start + BATCH)
            parts = {"feature": features[part], "control": psi if len(psi) == 1 else psi[part]}
            parts |= {name: values[part] for name, values in looks.items()}
            out[part] = network.run(parts, None if base is None else base[part])
        return out

    def _run_sides(
        self,
        name: str,
        x: np.ndarray,
        first: np.ndarray,
        direction: np.ndarray | None,
        rows: np.ndarray | slice,
        out: np.ndarray | None,
    ) -> np.ndarray:
        """The same where anchors have one of two controls: each folded for its own; first (n,) bool
        says which.
        """
        out = self._room(name) if out is None else out
        network, every = self._networks[name], self._anchored.features
        base, numbers = network.feature_part(every), np.arange(len(every))[rows]
        looks = {} if direction is None else looked_along(self._anchored, direction, rows)
        for side in (np.flatnonzero(first), np.flatnonzero(~first)):
            for start in range(0, len(side), BATCH):
                part = side[start : start + BATCH]
                psi = self._anchored.psi(x[part[:1]])
                parts = {"feature": every[numbers[part]], "control": psi}
                parts |= {name: values[part] for name, values in looks.items()}
                out[part] = network.run(parts, None if base is None else base[numbers[part]])
        return out

    def _network(self, name: str, one_control: bool) -> FoldedNetwork | WholeNetwork:
        """The network for one control value, or for one an anchor, which is made at first use."""
        if one_control or isinstance(self._networks[name], WholeNetwork):
            return self._networks[name]
        if name not in self._whole:
            mlp = self._anchored.networks[name]
            self._whole[name] = WholeNetwork(name, mlp, self._anchored, self._threads)
        return self._whole[name]

    def _room(self, name: str) -> np.ndarray:
        """(A, k * size) for what a network gives; the same again with `keep`."""
        model = self._anchored
        shape = (len(model.features), model.splats_per_anchor * SIZE_PER_SPLAT[name])
        if self._kept is None:
            return np.empty(shape, np.float32)
        if name not in self._kept:
            self._kept[name] = np.empty(shape, np.float32)
        return self._kept[name]

    @property
    def _anchored(self) -> AnchorModel:
        """The model, where it is one of anchors and five networks."""
        assert isinstance(self.model, AnchorModel)
        return self.model

    def _encoded(self, x: Controls) -> np.ndarray:
        """Psi(x): (1, d) of one value, (A, d) of one an anchor."""
        if not is_each(x):
            return self._anchored.psi(x)
        if self._own is None or not np.array_equal(self._own[0], x):  # five networks ask for it
            self._own = np.array(x), self._anchored.psi(x)
        return self._own[1]


class FrameColumns:
    """What anchors' frames make of the outputs of the networks of the shape."""

    def __init__(self, frames: AnchorFrames, k: int) -> None:
        self._axes = rotation_matrices(frames.wxyz) * frames.scales[:, None]  # (A, 3, 3)
        self._scales = np.tile(frames.scales, k)  # (A, k * 3)
        self._wxyz = np.repeat(frames.wxyz, k, axis=0)  # (A * k, 4)

    def apply(self, name: str, values: np.ndarray, rows: np.ndarray | slice) -> np.ndarray:
        """(n, k * size) in the object's frame of such in each anchor's own; may be `values`.  rows:
        of the anchors.
        """
        count, width = values.shape  # of no anchors, too
        if name == "offset":
            own = values.reshape(count, width // 3, 3)  # (n, k, 3)
            return np.matmul(own, self._axes[rows].transpose(0, 2, 1)).reshape(count, width)
        if name == "scale":
            values *= self._scales[rows]
        elif name == "rotation":
            turns = self._wxyz.reshape(len(self._axes), width // 4, 4)[rows].reshape(-1, 4)
            values = product(turns, values.reshape(-1, 4)).reshape(count, width)
        return values


def alike(x: np.ndarray, one: np.ndarray) -> np.ndarray:
    """(n,) bool: which controls (n,) or (n, S) are this one."""
    same = x == one
    return same if same.ndim < 2 else same.all(axis=1)


def _own(weights: np.ndarray, layer: np.ndarray) -> np.ndarray:
    """(N,) of weights (stops, N): each splat's weight of its own layer."""
    return weights[layer, np.arange(len(layer))]
