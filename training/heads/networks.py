"""The five heads on the device: packing of their weights, forward and backward (eq. 4, 5)."""

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import WIDTHS, channels_of
from shapeshift.runtime_models.model import HEADS, SIZE_PER_SPLAT

KERNELS = Path(__file__).parents[1] / "kernels"
DIRECTION = 3
CHUNKS = {"cpu": 16, "gpu": 64}  # shares of the anchors whose weight gradients are summed apart
SIDE = 16  # of a block of weights, as in heads_gpu.cl
RATED_HIDDEN = 32  # hidden units of the networks for which the learning rates were chosen
# What anchors may have besides their features, and what the kernels call it: a base colour may be
# one for all stops, or one for each of them; light of red, green and blue, or one for all three.
ANCHOR_ATTRIBUTES = {
    "frame": "frames", "color": "colors", "stop_color": "colors", "light": "light",
    "gray_light": "light",
}  # fmt: skip
# Numbers an anchor, see gaussians.cl; light is of red, green and blue, in older scenes one for all.
ATTRIBUTE_WIDTH = {"frames": 7, "colors": 3, "light": WIDTHS[3]}
# Stops that may have base colours of their own; of more, the colour network would get more hidden
# units than the kernels of decoding take (rasterizer/decode): 12 a stop beside 32, and 6 for light.
MOST_STOP_COLORS = 7
Layers = tuple[np.ndarray, ...]  # of each layer W (out, in) and b (out,), first to last


def padded(width: int) -> int:
    """Rounded up to whole vectors of the kernels."""
    return (width + 7) // 8 * 8


@dataclass(frozen=True)
class HeadLayout:
    """Sizes and inputs of the five networks, and where each lies in the flat weights.

    Raises ValueError where the kernels cannot be built so.
    """

    splats: int = 10  # k, Gaussians an anchor
    features: int = 16  # F
    hidden: int = 32
    control: int = 16  # d of Psi
    fixed: tuple[str, ...] = ()  # heads that do not see Psi: what they give is shared by all stops
    view_dependent: bool = True  # whether colour sees the direction from the eye
    attributes: tuple[str, ...] = ("frame", "stop_color")  # of anchors, besides their features
    stops: int = 1  # how many a run has: base colours an anchor, with "stop_color"
    light_channels: int = 3  # with "light": 1 where red, green and blue have the same

    def __post_init__(self) -> None:
        for name in self.fixed:
            if name not in HEADS:
                known = ", ".join(HEADS)
                raise ValueError(f"fixed: there is no head '{name}' to fix; they are {known}.")
        for name in self.attributes:
            if name not in ANCHOR_ATTRIBUTES:
                known = ", ".join(ANCHOR_ATTRIBUTES)
                raise ValueError(
                    f"anchor_attributes: anchors have no attribute '{name}'; use {known}."
                )

    @property
    def own(self) -> tuple[str, ...]:
        """What anchors have besides places and features, as the kernels call it."""
        names = dict.fromkeys(ANCHOR_ATTRIBUTES[name] for name in self.attributes)
        return tuple(name for name in names if name != "light" or self.view_dependent)

    @property
    def color_groups(self) -> tuple[str, ...]:
        """The optimiser's groups of base colours: one, one a stop, or none.

        Where the colour network sees no stop, its anchors show the same colour at all of them.
        """
        if "colors" not in self.own:
            return ()
        each = "stop_color" in self.attributes and "color" not in self.fixed
        each = each and 1 < self.stops <= MOST_STOP_COLORS
        return tuple(f"colors_{stop}" for stop in range(self.stops)) if each else ("colors",)

    @property
    def widths(self) -> dict[str, int]:
        """How many numbers an anchor has of each attribute, as the kernels call it."""
        return ATTRIBUTE_WIDTH | {"light": WIDTHS[self.light_channels]}

    def as_in(self, state: dict[str, np.ndarray]) -> "HeadLayout":
        """With light of as many channels as an optimiser's state has: older runs had one."""
        if "light" not in self.own:
            return self
        return replace(self, light_channels=channels_of(state["light.value"]))

    @property
    def own_widths(self) -> dict[str, int]:
        """How many numbers an anchor has in each of the optimiser's groups of what is its own."""
        groups = ((n, self.color_groups if n == "colors" else (n,)) for n in self.own)
        return {group: self.widths[name] for name, found in groups for group in found}

    @property
    def per_anchor(self) -> tuple[str, ...]:
        """The optimiser's groups that have a row for each anchor."""
        return ("anchors", "features", *self.own_widths)

    def parts_of(self, name: str) -> tuple[str, ...]:
        """What a head's network takes, in the order of the exported one (eq. 5)."""
        seen = ("direction",) if name == "color" and self.view_dependent else ()
        return ("feature", *seen, *(() if name in self.fixed else ("control",)))

    @property
    def outs(self) -> list[int]:
        """Real output widths in the order of HEADS."""
        return [self.splats * SIZE_PER_SPLAT[name] for name in HEADS]

    @property
    def raw_at(self) -> list[int]:
        """Where each head's outputs begin in an anchor's row of raw outputs; last, its length."""
        return np.cumsum([0] + [padded(n) for n in self.outs]).tolist()

    @property
    def inputs(self) -> int:
        """Rows of every first layer on the device: features, control, direction."""
        return padded(self.features) + self.control + DIRECTION

    @property
    def weights_at(self) -> list[int]:
        """Where each head begins in the flat weights; last, their number."""
        hidden = padded(self.hidden)
        first = (self.inputs + 1) * hidden
        sizes = [first + (hidden + 1) * padded(n) for n in self.outs]
        return np.cumsum([0, *sizes]).tolist()

    def defines(self) -> dict[str, int]:
        """What heads.cl and gaussians.cl are compiled with."""
        numbers = {
            "FEATURES": padded(self.features), "HIDDEN": padded(self.hidden),
            "CONTROL": self.control, "SPLATS": self.splats, "RAW": self.raw_at[-1],
            "WEIGHTS": self.weights_at[-1], "MAX_OUT": max(padded(n) for n in self.outs),
            "VIEW_COLOR": self.view_dependent,
            "CONDITIONED": sum(1 << m for m, name in enumerate(HEADS) if name not in self.fixed),
            "FRAMES": "frames" in self.own,
            "BASE_COLORS": "colors" in self.own,
            "LIGHT": self.light_channels if "light" in self.own else 0,
        }  # fmt: skip
        for m, out in enumerate(self.outs):
            numbers |= {
                f"OUT{m}": padded(out),
                f"OUT_AT{m}": self.raw_at[m],
                f"WEIGHTS_AT{m}": self.weights_at[m],
            }
        return numbers

    def parts(self, flat: np.ndarray, head: int) -> Layers:
        """Views into the flat weights: of each layer W (in, out) and b (out,), padded."""
        hidden = padded(self.hidden)
        widths = [self.inputs, hidden, padded(self.outs[head])]
        at, views = self.weights_at[head], []
        for takes, gives in pairwise(widths):
            views.append(flat[at : at + takes * gives].reshape(takes, gives))
            views.append(flat[at + takes * gives : at + (takes + 1) * gives])
            at += (takes + 1) * gives
        return tuple(views)

    def rate_shares(self) -> np.ndarray:
        """(weights,) float32: what part of a head's learning rate each of its weights takes.

        Rates are chosen for RATED_HIDDEN units.  Steps of Adam do not shrink where more inputs add
        up, so weights behind wider layers take smaller ones.
        """
        shares = np.ones(self.weights_at[-1], np.float32)
        for head in range(len(HEADS)):
            views = self.parts(shares, head)
            views[2][:] *= min(1.0, RATED_HIDDEN / self.hidden)
        return shares

    def first_rows(self, name: str) -> list[int]:
        """Rows of the device's first layer in the order of the exported network's inputs."""
        width = padded(self.features)
        rows = {
            "feature": range(self.features),
            "control": range(width, width + self.control),
            "direction": range(width + self.control, self.inputs),
        }
        return [row for part in self.parts_of(name) for row in rows[part]]

    def real(self, head: int) -> list[tuple]:
        """Of each view in `parts`, the index of what is no padding."""
        rows, hidden, out = self.first_rows(HEADS[head]), slice(self.hidden), slice(self.outs[head])
        return [(rows, hidden), (hidden,), (hidden, out), (out,)]

    def pack(self, networks: dict[str, Layers]) -> np.ndarray:
        """Flat float32 weights out of each head's layers, W (out, in) and b (out,) of each."""
        flat = np.zeros(self.weights_at[-1], np.float32)
        for head, name in enumerate(HEADS):
            triples = zip(self.parts(flat, head), self.real(head), networks[name], strict=True)
            for view, real, array in triples:
                view[real] = array.T
        return flat

    def unpack(self, flat: np.ndarray) -> dict[str, Layers]:
        """The inverse of `pack`."""
        networks = {}
        for head, name in enumerate(HEADS):
            pairs = zip(self.parts(flat, head), self.real(head), strict=True)
            networks[name] = tuple(view[real].T.copy() for view, real in pairs)
        return networks


def initial_weights(layout: HeadLayout, rng: np.random.Generator) -> np.ndarray:
    """Flat weights to start from: splats of opacity 0.3, unturned, spread about their anchor."""
    k = layout.splats
    last_bias = {
        "offset": rng.uniform(-0.25, 0.25, 3 * k),  # of 2 voxels: half a voxel each way
        "scale": np.zeros(3 * k),
        "rotation": np.tile([1.0, 0, 0, 0], k),
        "opacity": np.full(k, np.arctanh(0.3)),
        "color": rng.uniform(-1, 1, 3 * k) / np.sqrt(layout.hidden),
    }
    gain = {"offset": 1.0, "scale": 0.5, "rotation": 0.5, "opacity": 0.5, "color": 1.0}
    if "colors" in layout.own:  # the base colours are known; the network adds to them
        last_bias["color"], gain["color"] = np.zeros(3 * k), 0.3
    everything = replace(layout, fixed=(), view_dependent=True)
    networks = {}
    for name in HEADS:
        # Drawn for every input there could be: what a head does not see changes no other weight.
        rows = everything.first_rows(name)
        seen = np.isin(rows, layout.first_rows(name))
        inputs, out = len(rows), k * SIZE_PER_SPLAT[name]
        arrays = [
            (rng.uniform(-1, 1, (layout.hidden, inputs)) / np.sqrt(inputs))[:, seen],
            rng.uniform(-1, 1, layout.hidden) / np.sqrt(inputs),
        ]
        last = rng.uniform(-1, 1, (out, layout.hidden)) / np.sqrt(layout.hidden) * gain[name]
        networks[name] = (*arrays, last, last_bias[name])
    return layout.pack(networks)


def blocks_of_weights(layout: HeadLayout) -> np.ndarray:
    """(jobs, 4) int32 head, layer, first input, first output: what a work-group sums up at once.

    A layer's bias counts as one more input.
    """
    rows = []
    for head, out in enumerate(layout.outs):
        hidden = padded(layout.hidden)
        widths = [layout.inputs, hidden, padded(out)]
        for layer, (takes, gives) in enumerate(pairwise(widths)):
            rows += [
                (head, layer, i, j)
                for i in range(0, takes + 1, SIDE)
                for j in range(0, gives, SIDE)
            ]
    return np.array(rows, np.int32)


class Heads:
    """Runs the heads; device buffers are kept from call to call and grow with the anchors.

    form: "cpu" or "gpu", by default the device's kind.  Sums are made in another order: their
    results agree to about 1e-6 of the largest.  lanes: 16 or 8 floats of a vector in heads.cl, by
    default as the device has them; the same bits.
    """

    def __init__(
        self, device, layout: HeadLayout, form: str | None = None, lanes: int | None = None
    ) -> None:
        self.device, self.layout = device, layout
        self.form = form or device.kind
        file = {"cpu": "heads.cl", "gpu": "heads_gpu.cl"}[self.form]
        self.lanes = lanes or (16 if device.lanes >= 16 else 8)
        self.kernels = device.program(KERNELS / file, LANES=self.lanes, **layout.defines())
        hidden, features = padded(layout.hidden), padded(layout.features)
        # Each chunk sums its own weight gradients.  The number is fixed a form, never taken from
        # the cores: the order of additions, so every bit, would depend on it.
        self.chunks = CHUNKS[self.form]
        if self.form == "gpu":
            blocks = blocks_of_weights(layout)
            self.groups, self.blocks = len(blocks) * self.chunks, device.upload(blocks)
        self.control = device.zeros((len(HEADS), layout.control))
        self.bias = device.empty(5 * hidden)
        self.first_t = device.empty(5 * hidden * features)
        self.second_t = device.empty(layout.raw_at[-1] * hidden)
        self.grad_chunks = device.empty((self.chunks, layout.weights_at[-1]))
        self.grad_weights = device.empty(layout.weights_at[-1])
        self.count = -1

    def resize(self, count: int) -> None:
        if count == self.count:
            return
        device, layout, self.count = self.device, self.layout, count
        self.hidden = device.empty((count, 5, padded(layout.hidden)))
        self.grad_units = device.empty(self.hidden.shape) if self.form == "gpu" else None
        self.raw = device.empty((count, layout.raw_at[-1]))
        self.grad_features = device.empty((count, padded(layout.features)))

    def forward(self, weights, anchors, features, control: np.ndarray, eye: np.ndarray):
        """Raw outputs (A, RAW) on the device for Psi `control` and an eye (3,) in metres.

        control: (d,) of all heads, or (5, d) one a head.
        """
        self.resize(len(anchors))
        rows = np.broadcast_to(np.asarray(control, np.float32), self.control.shape)
        self.control.set(np.ascontiguousarray(rows))
        self.eye = [np.float32(v) for v in eye]
        layout = self.layout
        self.device.launch(
            self.kernels["prepare_weights"], 5 * padded(layout.hidden), 8,
            weights, self.control, self.bias, self.first_t, self.second_t,
        )  # fmt: skip
        each = self.lanes // 2  # anchors of a work-item of heads.cl
        items, group = (-(-self.count // each), 1) if self.form == "cpu" else (5 * self.count, 64)
        self.device.launch(
            self.kernels["heads_forward"], items, group,
            self.count, *self.eye, weights, self.bias, anchors, features, self.hidden, self.raw,
        )  # fmt: skip
        return self.raw

    def backward(self, weights, anchors, features, grad_raw, grad_anchors):
        """(grad_weights, grad_features) of the last `forward`; adds to grad_anchors in place."""
        flow = {"cpu": self._chunks_backward, "gpu": self._blocks_backward}[self.form]
        flow(weights, anchors, features, grad_raw, grad_anchors)
        self.device.launch(
            self.kernels["sum_chunks"], self.layout.weights_at[-1], 64, self.chunks,
            self.grad_chunks, self.grad_weights,
        )  # fmt: skip
        self.device.launch(
            self.kernels["control_gradient"], 5 * padded(self.layout.hidden), 8,
            self.control, self.grad_weights,
        )  # fmt: skip
        return self.grad_weights, self.grad_features

    def _chunks_backward(self, weights, anchors, features, grad_raw, grad_anchors) -> None:
        """A work-item takes a chunk of anchors through everything."""
        self.device.launch(
            self.kernels["heads_backward"], self.chunks, 1,
            self.count, self.chunks, *self.eye, weights, self.first_t, self.second_t, anchors,
            features, self.hidden, grad_raw, self.grad_chunks,
            self.grad_features, grad_anchors,
        )  # fmt: skip

    def _blocks_backward(self, weights, anchors, features, grad_raw, grad_anchors) -> None:
        """Units first, an item an anchor and head; then a group a block of weights and a chunk."""
        kernels, launch = self.kernels, self.device.launch
        launch(
            kernels["units_gradient"], 5 * self.count, 64,
            self.count, *self.eye, weights, self.second_t, anchors, self.hidden,
            grad_raw, self.grad_units, grad_anchors,
        )  # fmt: skip
        launch(
            kernels["features_gradient"], self.grad_features.size, 64,
            self.count, self.first_t, self.grad_units, self.grad_features,
        )  # fmt: skip
        launch(
            kernels["weights_gradient"], self.groups * SIDE * SIDE, SIDE * SIDE,
            self.count, self.chunks, *self.eye, self.blocks, anchors, features, self.hidden,
            self.grad_units, grad_raw, self.grad_chunks,
        )  # fmt: skip
