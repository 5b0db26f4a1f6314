"""decode_heads: anchors and five heads -> rows of the arena, at a control value and for an eye."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device

if TYPE_CHECKING:
    import pyopencl as cl
    from pyopencl.array import Array

KERNEL = Path(__file__).parent / "kernels" / "decode" / "decode_heads.cl"
WIDTH = {"cpu": 16, "gpu": 1}  # anchors at a time: a vector of AVX-512, a work-item of a GPU
GROUP = {"cpu": 1, "gpu": 64}
RUN = {"cpu": 16, "gpu": 1}  # blocks of WIDTH anchors a work-item
TILE = 5  # outputs side by side in memory; divides those of 5 and of 10 splats an anchor
ROWS = {"cpu": 8, "gpu": 5}  # hidden units that are summed at once
UNITS = 16  # hidden units that are looked at at once: a head has a multiple of it
MOST_HIDDEN = 128  # units of a head: they lie in private memory
MOST_SPLATS = 16  # an anchor, likewise
ACTIVATIONS = ("none", "tanh", "sigmoid", "softplus", "exp")  # their numbers in the kernel
DIRECTION = 3  # inputs
LIGHTS = 8  # coefficients of a channel of light by direction
NO_CLIP = (-float("inf"), float("inf"))
TABLE = np.dtype(
    [(name, np.int32) for name in ("hidden", "unit_at", "first_at", "last_at", "tiles", "act")]
    + [(name, np.float32) for name in ("low", "high", "gain")]
)  # Head of the kernel


@dataclass(frozen=True)
class HeadWeights:
    """One hidden layer with ReLU, then gain * activation(clip(z)); Psi(x) is none of its inputs."""

    feature: np.ndarray  # (hidden, F) columns of the first layer
    look: np.ndarray | None  # (hidden, 3) those that meet the direction from the eye, (hidden, 4
    #                          or 6) with the light along it, of one channel or three, behind it
    last: np.ndarray  # (out, hidden)
    last_bias: np.ndarray  # (out,)
    activation: str = "none"  # one of ACTIVATIONS
    clip: tuple[float, float] = NO_CLIP
    gain: float = 1.0
    brightest: np.ndarray | None = None  # (channels,) the most that any anchor's light is along
    #                                      any direction

    @property
    def units(self) -> int:
        return len(self.feature)


class AnchorHeads:
    """Anchors and the heads offset, scale, rotation, opacity, color on a device, made ready once.

    It takes as much memory as the anchors and their features, and 4 bytes a block and hidden unit:
    the largest that the features give the unit there, which tells where it sleeps.
    """

    def __init__(
        self, device: Device, anchors: np.ndarray, features: np.ndarray, heads: list[HeadWeights],
        splats: int, frames: np.ndarray | None = None, width: int | None = None,
        light: np.ndarray | None = None,
    ) -> None:  # fmt: skip
        """anchors (A, 3) metres, features (A, F); splats: k; frames (A, 7): of every anchor's own
        axes factors and unit wxyz.  width: anchors at a time, 16 or 1; by default the device's.
        light (A, 8 a channel): by direction, where the last head looks at it.
        """
        self._device, self._count, self._splats = device, len(anchors), splats
        self._width = width or WIDTH[device.kind]
        self._features = features.shape[1]
        starts = np.cumsum([0, *(padded(head.units) for head in heads)])
        self._units = int(starts[-1])
        # Where the units of all heads lie, one after the other, among those that are padded.
        self._at = np.concatenate(
            [start + np.arange(head.units) for start, head in zip(starts, heads, strict=False)]
        )
        self._reach = np.concatenate([_reach(head) for head in heads])
        self._looks = 0 if heads[-1].look is None else heads[-1].look.shape[1]
        channels = 0 if light is None else light.shape[1] // LIGHTS
        if max(self._looks - DIRECTION, 0) != channels:
            raise ValueError("light by direction and the colour head's columns for it go together.")
        self._kernels = device.program(
            KERNEL, WIDTH=self._width, TILE=TILE, ROWS=ROWS[device.kind], UNITS=UNITS,
            LIGHTS=LIGHTS,
            MAX_HIDDEN=MOST_HIDDEN, MAX_SPLATS=MOST_SPLATS,
        )  # fmt: skip
        table, weights = _flat(heads)
        self._heads, self._weights = device.constants(table), device.upload(weights)
        self._feature, self._places = self._blocks(features), self._blocks(anchors)
        self._frames = None if frames is None else self._blocks(frames)
        self._light = None if light is None else self._blocks(light)
        first = np.zeros((self._units, self._features), np.float32)
        first[self._at] = np.concatenate([head.feature for head in heads])
        self._bounds = device.empty((self._feature.shape[0], self._units))
        # Work-items, and how many of them a group has.
        self._items = (-(-self._feature.shape[0] // RUN[device.kind]), GROUP[device.kind])
        device.launch(
            self._kernels["bound_units"], *self._items,
            self._feature.shape[0], self._features, self._units,
            RUN[device.kind], device.constants(first), self._feature, self._bounds,
        )  # fmt: skip

    def decode_shapes(
        self, bias: np.ndarray, start: int, mean_opacity: "Array", covariance: "Array",
        shapes: bool = True,
    ) -> None:  # fmt: skip
        """Writes rows start... of mean_opacity (N, 4) and covariance (N, 8), object frame; where
        not `shapes`, of the opacities alone.

        bias: (units of all heads,) of the first layers, with what Psi(x) adds to them.
        """
        self._device.launch(
            self._kernels["decode_shapes"], *self._items,
            self._count, start, RUN[self._device.kind], self._splats,
            self._features, self._units, shapes, self._heads, self._weights,
            *self._biases(bias), self._bounds, self._feature, self._places, self._frames,
            mean_opacity, covariance,
        )  # fmt: skip

    def decode_colors(
        self, bias: np.ndarray, eye: np.ndarray, start: int, color: "Array",
        seen: np.ndarray | None = None,
    ) -> None:  # fmt: skip
        """Writes rows start... of color (N, 4), display sRGB towards an eye (3,), object frame.

        seen: (A,) bool: where False the colours may stay what they were.
        """
        wanted = None
        if seen is not None and self._count:
            whole = np.zeros(self._feature.shape[0] * self._width, bool)
            whole[: self._count] = seen
            blocks = whole.reshape(-1, self._width).any(axis=1)
            wanted = self._device.constants(np.asarray(blocks, np.uint8))
        x, y, z = (float(v) for v in eye)
        self._device.launch(
            self._kernels["decode_colors"], *self._items,
            self._count, start, RUN[self._device.kind], self._splats,
            self._features, self._units, self._looks, x, y, z, self._heads, self._weights,
            *self._biases(bias), self._bounds, self._feature, self._places, self._light,
            wanted, color,
        )  # fmt: skip

    def _biases(self, bias: np.ndarray) -> "tuple[cl.Buffer, cl.Buffer]":
        """The biases, and what the bound of each unit has to exceed for the unit to be awake."""
        rows = np.zeros((2, self._units), np.float32)
        rows[1] = np.inf  # nothing wakes what is there to fill up
        rows[0, self._at], rows[1, self._at] = bias, -(bias + self._reach)
        return self._device.constants(rows[0]), self._device.constants(rows[1])

    def _blocks(self, rows: np.ndarray) -> "Array":
        """(blocks, columns, WIDTH) of rows (A, columns); the last row fills the last block up."""
        if missing := -len(rows) % self._width:
            rows = np.concatenate([rows, np.repeat(rows[-1:], missing, axis=0)])
        blocks = rows.reshape(-1, self._width, rows.shape[1]).transpose(0, 2, 1)
        return self._device.upload(np.asarray(blocks, np.float32))


def padded(units: int) -> int:
    """The multiple of UNITS that a head's hidden units are filled up to."""
    return -(-units // UNITS) * UNITS


def _reach(head: HeadWeights) -> np.ndarray:
    """(units,) how much a direction of length 1, and light along it, can add to a head's units."""
    if head.look is None:
        return np.zeros(head.units, np.float32)
    length = np.linalg.norm(head.look[:, :DIRECTION], axis=1)
    if head.brightest is None:
        return length
    return length + np.abs(head.look[:, DIRECTION:]) @ head.brightest


def _flat(heads: list[HeadWeights]) -> tuple[np.ndarray, np.ndarray]:
    """The table of the heads, and the weights that it points into: first layers, then last ones."""
    table = np.zeros(len(heads), TABLE)
    parts: list[np.ndarray] = []
    at = unit = 0
    for row, head in zip(table, heads, strict=True):
        first = head.feature if head.look is None else np.hstack([head.feature, head.look])
        first = np.pad(first, ((0, padded(head.units) - head.units), (0, 0)))
        row["hidden"], row["unit_at"], row["first_at"] = len(first), unit, at
        parts.append(first.ravel())
        unit, at = unit + len(first), at + first.size
    for row, head in zip(table, heads, strict=True):
        hidden, out = int(row["hidden"]), len(head.last)
        tiles = -(-out // TILE)
        last = np.zeros((tiles * TILE, hidden), np.float32)
        last[:out, : head.units] = head.last
        bias = np.pad(head.last_bias, (0, tiles * TILE - out))
        # (tile, unit, output): the weights of a unit for a tile lie side by side
        tiled = last.reshape(tiles, TILE, hidden).transpose(0, 2, 1)
        row["last_at"], row["tiles"], row["gain"] = at, tiles, head.gain
        row["act"], (row["low"], row["high"]) = ACTIVATIONS.index(head.activation), head.clip
        parts += [bias, tiled.ravel()]
        at += bias.size + tiled.size
    return table, np.concatenate(parts).astype(np.float32)
