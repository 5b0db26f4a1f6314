"""Trains the hidden units and features that a new stop has alone, with the steps of every training.

At the new stop a network's outputs are those of the source stop and what the new units add
(runtime_models/stops/change_stops.py).  So only these are trained: heads of one hidden layer on old
and new features, whose outputs are added to the stored ones of the source stop before activation.
Whatever a package's networks are like, deep, fixed or of any width, this stays the same.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.evaluate import directions, looked_along
from shapeshift.runtime_models.model import HEADS, AnchorModel, BadFile
from shapeshift.runtime_models.session import BATCH, FoldedNetwork
from shapeshift.runtime_models.stops.change_stops import NewUnits, add_units
from shapeshift.training.export import ACTIVATION
from shapeshift.training.heads.gaussians import SCALE_CLIP, Gaussians
from shapeshift.training.heads.networks import HeadLayout, Layers, padded
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.settings import SHORT, check_numbers, parameter_rates
from shapeshift.training.step import TrainingStep
from shapeshift.training.train import FEATURE_SPREAD

KERNEL = Path(__file__).parents[1] / "kernels" / "new_stop.cl"
BIAS_SPREAD = 0.2  # of the new units' first biases, either way


@dataclass(frozen=True)
class StopSettings:
    """What a new stop may change, and with how much."""

    heads: tuple[str, ...] = ("color",)  # out of HEADS: what may be another than at the source
    units: int = 32  # hidden units of each of these networks
    features: int = 8  # numbers that each anchor stores for them
    seed: int = 0

    def __post_init__(self) -> None:
        check_numbers(self, {"units": 1, "features": 0, "seed": 0}, {})


class StopTrainer:
    """One stop while it learns what it has alone.  `finished` gives the scene with it."""

    def __init__(
        self,
        device,
        model: AnchorModel,
        stop: str,
        settings: StopSettings,
        inside: np.ndarray | None = None,
    ) -> None:
        """stop: one that `insert_stop` put in, still as its source, or with what it has learned
        before.  inside (A,) bool: the anchors that may change; None: all.  Raises BadFile.
        """
        refuse_unusual(model)
        self.device, self.source, self.settings = device, model, settings
        self.stop, self.inside = stop, inside
        attributes = () if model.frames is None else ("frame",)
        self.layout = HeadLayout(
            model.splats_per_anchor, model.features.shape[1] + settings.features, settings.units,
            1, HEADS, False, attributes,
        )  # fmt: skip
        self.adam = Adam(device, *self.begin())
        self.step = StopStep(device, model, stop, self.layout, self.adam, inside)

    def begin(self) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Values and rates of the optimiser: of what there was before, the rates are 0."""
        model, settings, layout = self.source, self.settings, self.layout
        rng = np.random.default_rng([settings.seed, 17])
        known, width = model.features.shape[1], padded(layout.features)
        features = np.zeros((len(model.anchors), width), np.float32)
        features[:, :known] = model.features
        fresh = rng.normal(size=(len(features), settings.features)) * FEATURE_SPREAD
        features[:, known : layout.features] = fresh
        networks: dict[str, Layers] = {}
        for head, out in zip(HEADS, layout.outs, strict=True):
            inputs = len(layout.first_rows(head))
            first = rng.uniform(-1, 1, (settings.units, inputs)) / np.sqrt(inputs)
            bias = rng.uniform(-1, 1, settings.units) * BIAS_SPREAD
            networks[head] = (first, bias, np.zeros((out, settings.units)), np.zeros(out))
        values = {"weights": layout.pack(networks), "anchors": model.anchors, "features": features}
        rates = parameter_rates(layout, SHORT, 1.0)
        trained: dict[str, Layers] = {
            head: tuple(
                np.full(array.shape, head in settings.heads and part != 3)
                for part, array in enumerate(arrays)
            )  # not the last bias: it would stay at the other stops
            for head, arrays in networks.items()
        }
        rates["weights"] = rates["weights"] * layout.pack(trained)
        rates["features"] = np.zeros_like(features)
        rates["features"][:, known : layout.features] = SHORT.feature
        rates["anchors"] = np.zeros(1, np.float32)
        if model.frames is not None:
            values["frames"] = np.hstack([np.log(model.frames.scales), model.frames.wxyz])
            rates["frames"] = np.zeros(1, np.float32)
        return values, rates

    def update(self, grads: dict[str, object], done: float) -> None:
        """One step of the optimiser; done: part of the run, 0..1."""
        self.step.update(grads, SHORT.decay**done)

    def units(self) -> dict[str, NewUnits]:
        """What each trained head has learned."""
        arrays = self.layout.unpack(self.device.download(self.adam["weights"]))
        found = {}
        for head in self.settings.heads:
            first, bias, out, _ = arrays[head]
            found[head] = NewUnits(first, bias, out)
        return found

    def finished(self) -> AnchorModel:
        """The scene whose stop shows what was learned.  Raises BadFile where that is no number."""
        features = self.device.download(self.adam["features"])
        features = features[:, self.source.features.shape[1] : self.layout.features]
        units = self.units()
        sound = all(
            np.isfinite(u.out).all() and np.isfinite(u.feature).all() for u in units.values()
        )
        if not (sound and np.isfinite(features).all()):
            raise BadFile(
                f"the stop '{self.stop}' was lost while it learned: its numbers are not finite; "
                "take fewer steps."
            )
        return add_units(self.source, self.stop, features, units, self.inside)


def refuse_unusual(model: AnchorModel) -> None:
    """BadFile for networks that end otherwise than the kernels of training take it."""
    for head in HEADS:
        mlp = model.networks[head]
        clip = SCALE_CLIP if head == "scale" else None
        gain = mlp.gain > 0 if head in ("offset", "scale") else mlp.gain == 1
        if not (gain and mlp.head == ACTIVATION[head] and mlp.clip == clip):
            raise BadFile(
                f"the {head} network of this scene ends in {mlp.head}, times {mlp.gain:g}, clipped "
                f"to {mlp.clip}; new stops can be trained for scenes of `train`, where it ends in "
                f"{ACTIVATION[head]}."
            )


class StopStep(TrainingStep):
    """The training step whose heads add to the source stop's outputs."""

    def __init__(
        self, device, model: AnchorModel, source: str, layout: HeadLayout, adam: Adam,
        inside: np.ndarray | None,
    ) -> None:  # fmt: skip
        super().__init__(device, layout, 1.0, adam)
        self.activation.reach = np.float32(model.networks["offset"].gain)
        self.activation.unit = np.float32(model.networks["scale"].gain)
        self.outputs = SourceOutputs(model, source, layout)
        self.base = device.upload(self.outputs.rows)
        count = len(model.anchors)
        self.may_change = device.upload(
            np.ones(count, np.float32) if inside is None else inside.astype(np.float32)
        )
        self.kernels = device.program(KERNEL, RAW=layout.raw_at[-1])

    def decode(self, control: np.ndarray, eye: np.ndarray, rows=None) -> Gaussians:
        """All splats of the new stop; `control` and `rows` have no meaning here."""
        adam = self.adam
        with self.timed("heads"):
            self.groups = self.groups_at(control)
            self.gathered = {n: adam.gather(g, None) for n, g in self.groups.items()}
            raw = self.heads.forward(
                adam["weights"], adam["anchors"], adam["features"], np.zeros(1), eye
            )
        with self.timed("source outputs"):
            if self.outputs.look_from(eye):
                self.base.set(self.outputs.rows)
            self.device.launch(
                self.kernels["add_source"], raw.size, 64, raw.size, self.may_change, self.base, raw
            )
        with self.timed("activate"):
            return self.activation.forward(raw, self.gathered, eye)

    def backward(self, grad: Gaussians) -> dict[str, object]:
        """The gradients by what the optimiser holds of those by the last splats decoded."""
        there = self.gathered
        grad_raw, found = self.activation.backward(self.heads.raw, there, grad)
        self.device.launch(
            self.kernels["may_change_alone"], grad_raw.size, 64, grad_raw.size, self.may_change,
            grad_raw,
        )  # fmt: skip
        weights, features = self.heads.backward(
            self.adam["weights"], there["anchors"], there["features"], grad_raw, found["anchors"]
        )
        return {"weights": weights, "features": features} | found


# What the networks of a model give at one stop before their activation.


class SourceOutputs:
    """Their outputs in rows (A, RAW), laid out as the heads' on the device; colours of one eye."""

    def __init__(self, model: AnchorModel, stop: str, layout: HeadLayout) -> None:
        place = next(each.x for each in model.stops if each.name == stop)
        self.model, self.psi = model, model.psi(place)
        self.rows = np.zeros((len(model.anchors), layout.raw_at[-1]), np.float32)
        columns = zip(layout.raw_at, layout.outs, strict=False)
        self.at: dict[str, tuple] = dict(zip(HEADS, columns, strict=True))
        self.networks = {
            head: FoldedNetwork(
                head, replace(mlp, head="none", clip=None, gain=1.0), model, threads=1
            )
            for head, mlp in model.networks.items()
        }
        self.eye: tuple | None = None
        self.follows_eye = "direction" in model.networks["color"].inputs
        for head in HEADS:
            if head != "color" or not self.follows_eye:
                self.fill(head, {})

    def look_from(self, eye: np.ndarray) -> bool:
        """Colours as seen from `eye` (3,) metres; whether the rows have changed."""
        seen_from = tuple(np.asarray(eye, np.float32).tolist())
        if not self.follows_eye or seen_from == self.eye:
            return False
        self.eye = seen_from
        direction = directions(self.model.anchors, np.array(seen_from))
        self.fill("color", looked_along(self.model, direction))
        return True

    def fill(self, head: str, parts: dict[str, np.ndarray]) -> None:
        """The columns of one head."""
        start, width = self.at[head]
        network, features = self.networks[head], self.model.features
        base = network.feature_part(features)
        for at in range(0, len(features), BATCH):
            rows = slice(at, at + BATCH)
            mine = {"feature": features[rows], "control": self.psi}
            mine |= {part: values[rows] for part, values in parts.items()}
            self.rows[rows, start : start + width] = network.run(
                mine, None if base is None else base[rows]
            )
