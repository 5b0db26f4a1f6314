"""Models as a web page reads them: tables, networks cut for its shaders, stops and paces."""

import json
import struct
from collections.abc import Mapping
from typing import Any, Literal, NotRequired, TypedDict

import numpy as np

from shapeshift.runtime_models.blocks.block_model import one_network
from shapeshift.runtime_models.model import (
    AnchorModel,
    BadFile,
    Mlp,
    Model,
    ScaffoldModel,
    SplatLayers,
)
from shapeshift.runtime_models.stop_weights import Control, StopWeights

# The file that a web page reads: "SHIFTWEB", a table of contents in JSON, and arrays.
#
# Tables are stored as codes between the ends of each column, lowest bytes first: such bytes
# deflate better than floats do, and 16 bits of a position are finer than what a screen shows.
#
# Whatever stands in the table of contents has a TypedDict, here or in page_scene.py:
# `python3 tools/web/write_conventions.py` writes their fields down for the page's JavaScript.

MAGIC = b"SHIFTWEB"
FORMAT: Literal["shapeshift web 1"] = "shapeshift web 1"
SectionKind = Literal["f32", "f16", "u16", "u8", "p8", "p16", "p24"]  # p: planes of bytes of codes
TYPES: dict[str, SectionKind] = {
    "float32": "f32", "float16": "f16", "uint16": "u16", "uint8": "u8",
}  # fmt: skip
PLANES: tuple[SectionKind, ...] = ("p8", "p16", "p24")  # by how many bytes a code has
Section = tuple[SectionKind, int, int]  # type, byte offset, count of numbers


# What a page can hold and how finely its tables are stored, for web/conventions.js, too.
WIDTH = 2048  # texels a row of a list: the least that every WebGL2 driver allows
BATCH_ROWS = 64  # of anchors that are decoded at once: 131,072, 36 MB between two passes
BLOCK_VEC4S = 1024  # of a uniform block: 16 kB, the least that every WebGL2 driver allows
MOST_ANCHORS = 4_000_000  # of plain splats, too
MOST_SPLATS = 4_194_304  # WIDTH rows of a list
MOST_BYTES = 1 << 30  # of a scene, inflated
MOST_WEIGHTS = 8 * 4 * BLOCK_VEC4S  # of one network: 8 of the 12 blocks that a shader may have
LARGEST_FILE = 24_000_000  # bytes in one HTML file: above, browsers take long to open it
FEATURE_BITS = 9  # 10 make the page of the demo larger than its package
FRAME_BITS = 12  # of scales, by their logarithm, and quaternions
COLOR_BITS = 12  # of harmonics of degree 0, and opacities
HARMONIC_BITS = 8  # of degree 1 and above
POSITION_STEP = 1e-4  # of the scene's radius: where 16 bits are coarser, 24 are taken


class TableEntry(TypedDict):
    """(N, width) numbers as codes 0..most between the ends (2, width) of each column.

    Without `most` the codes are the numbers themselves.
    """

    codes: Section
    ends: Section
    width: int
    most: NotRequired[int]


class Container:
    """Arrays one after the other, each named by its type, byte offset and count."""

    def __init__(self, exact: bool = False) -> None:
        self.exact = exact  # tables as float32 instead of codes
        self._parts: list[bytes] = []
        self._length = 0

    def add(self, array: np.ndarray, kind: Literal["float32", "uint8"] = "float32") -> Section:
        """An array as it is."""
        data = np.ascontiguousarray(array, np.dtype(kind).newbyteorder("<"))
        return self._append(TYPES[kind], data.tobytes(), data.size)

    def add_table(self, what: str, table: np.ndarray, bits: int = 16) -> TableEntry:
        """(N, C) numbers as codes of so many bits, at most 24.  BadFile where one is not finite."""
        table = np.asarray(table, np.float64)
        if not np.isfinite(table).all():
            raise BadFile(f"{what} of the scene are not all finite; `info` and `lint` say which.")
        low, high = table.min(axis=0, initial=np.inf), table.max(axis=0, initial=-np.inf)
        ends = np.stack([low, high]).astype(np.float32)  # (2, C)
        width = table.shape[1]
        if self.exact:
            return {"codes": self.add(table), "ends": self.add(ends), "width": width}
        most = 2**bits - 1
        low, high = ends.astype(np.float64)
        scale = np.divide(most, high - low, out=np.zeros(width), where=high > low)
        codes = np.clip(np.rint((table - low) * scale), 0, most).astype(np.uint32)
        planes = -(-bits // 8)
        data = b"".join(((codes >> 8 * p) & 255).astype(np.uint8).tobytes() for p in range(planes))
        section = self._append(PLANES[planes - 1], data, codes.size)
        return {"codes": section, "ends": self.add(ends), "width": width, "most": most}

    def pack(self, scene: Mapping[str, Any]) -> bytes:
        """The whole file, with what the scene says of the arrays; its first word is FORMAT."""
        text = json.dumps(scene, separators=(",", ":"), allow_nan=False)
        head = MAGIC + struct.pack("<I", len(text.encode())) + text.encode()
        return head + bytes(-len(head) % 4) + b"".join(self._parts)

    def _append(self, kind: SectionKind, data: bytes, count: int) -> Section:
        section = (kind, self._length, count)
        self._parts.append(data + bytes(-len(data) % 4))
        self._length += len(self._parts[-1])
        return section


LARGEST = float(np.finfo(np.float32).max)
SMALLEST_SCALE = 1e-12  # metres: scales of plain splats are stored by their logarithm
ControlEntry = float | list[float]  # x on the slider, 0 to 1, or the weights of all stops


class StopEntry(TypedDict):
    """A stop of the slider; without a palette it shows colours, not values."""

    name: str
    x: float
    kind: str
    palette: str
    valueRange: tuple[float, float] | None
    unit: str
    digits: int


class PaceEntry(TypedDict):
    """Weight of stop `end` at even steps of the way from stop `start`, both by their numbers."""

    start: int
    end: int
    blend: list[float]


class EncodingEntry(TypedDict):
    """Psi of a control (paper eq. 6 and 7): d Gaussians."""

    d: int
    spacing: float
    sigma: float


class LayerEntry(TypedDict):
    """A layer of a network: weights (outs, 4 ins, 4), bias (4 outs); counts of vectors of four."""

    ins: int
    outs: int
    weights: Section
    bias: Section


class NetworkEntry(TypedDict):
    """A head: gain * head(clip(last layer)); control: what Psi enters the first layer with."""

    layers: list[LayerEntry]
    control: Section | None
    looks: bool
    head: str
    clip: tuple[float, float]
    gain: float


class StopsEntry(TypedDict):
    """What all models have; swell: how much larger the splats of a coarse sample are drawn."""

    swell: float
    stops: list[StopEntry]
    pace: list[PaceEntry]
    direct: bool


class FramesEntry(TypedDict):
    """Scales (N, 3) by their logarithm, metres, and quaternions (N, 4)."""

    scales: TableEntry
    wxyz: TableEntry


class AnchorsEntry(StopsEntry):
    """A model of anchors; metres.  light: harmonics of degree 1 and 2, 8 numbers a channel."""

    kind: Literal["anchors"]
    anchors: int
    perAnchor: int
    featureVecs: int
    encoding: EncodingEntry
    positions: TableEntry
    features: TableEntry
    networks: dict[str, NetworkEntry]
    scales: NotRequired[TableEntry]
    wxyz: NotRequired[TableEntry]
    light: NotRequired[TableEntry]


class LayersEntry(StopsEntry, FramesEntry):
    """Plain splats, each of the stop whose number is its layer; sh, shRest: harmonics."""

    kind: Literal["layers"]
    anchors: int
    perAnchor: int
    mode: str
    antialiased: bool
    coefficients: int
    positions: TableEntry
    opacity: TableEntry
    layer: Section
    sh: TableEntry
    shRest: NotRequired[TableEntry]


ModelEntry = AnchorsEntry | LayersEntry


def describe_model(out: Container, model: Model, swell: float = 1.0) -> ModelEntry:
    """The entry of a model in the table of contents; its arrays go into `out`.

    swell: how much larger its splats are drawn, where it is a coarse sample.  Raises BadFile for
    what a page cannot show.
    """
    if isinstance(model, ScaffoldModel):
        raise BadFile(
            "the splats of this model follow the eye (Scaffold-GS, Octree-GS), which a page cannot "
            "do; export it as plain splats first (--out scene.ply), then those as a page."
        )
    check_counts(model)
    shared = describe_stops(model, swell)
    if isinstance(model, AnchorModel):
        return describe_anchors(out, one_network(model), shared)
    return describe_layers(out, model, shared)


def check_counts(model: AnchorModel | SplatLayers) -> None:
    """BadFile, one sentence, for more than a page can hold, or nothing."""
    anchors = len(model.anchors) if isinstance(model, AnchorModel) else model.splat_count
    if not 0 < model.splat_count <= MOST_SPLATS or anchors > MOST_ANCHORS:
        raise BadFile(
            f"the scene has {model.splat_count:,} splats; a page shows 1 to {MOST_SPLATS:,}: "
            "--max-splats merges neighbours of plain splats."
        )


def describe_stops(model: AnchorModel | SplatLayers, swell: float) -> StopsEntry:
    """Stops, and the paces between them by their numbers."""
    names = model.blend.names
    stops: list[StopEntry] = [
        {"name": stop.name, "x": stop.x, "kind": stop.kind, "palette": stop.palette,
         "valueRange": stop.value_range, "unit": stop.unit, "digits": stop.digits}
        for stop in model.stops
    ]  # fmt: skip
    pace: list[PaceEntry] = [
        {"start": names.index(p.start), "end": names.index(p.end), "blend": list(p.blend)}
        for p in model.blend.pace
        if p.start in names and p.end in names
    ]
    return {
        "swell": float(swell), "stops": stops, "pace": pace, "direct": model.blend.direct,
    }  # fmt: skip


def control_entry(model: Model, x: Control) -> ControlEntry:
    """A control: x, or the weights of all stops in their order."""
    if isinstance(x, StopWeights):
        return [float(weight) for weight in model.blend.weights(x)]
    return float(x)


def describe_anchors(out: Container, model: AnchorModel, shared: StopsEntry) -> AnchorsEntry:
    features = padded(model.features)  # (A, 4 n)
    entry: AnchorsEntry = {
        **shared, "kind": "anchors", "anchors": len(model.anchors),
        "perAnchor": model.splats_per_anchor, "featureVecs": features.shape[1] // 4,
        "encoding": {"d": model.encoding.d, "spacing": float(model.encoding.spacing),
                     "sigma": float(model.encoding.sigma)},
        "positions": add_positions(out, model.anchors),
        "features": out.add_table("features", features, FEATURE_BITS),
        "networks": {name: network(out, mlp, name, model) for name, mlp in model.networks.items()},
    }  # fmt: skip
    if model.frames is not None:
        frames = add_frames(out, model.frames.scales, model.frames.wxyz)
        entry["scales"], entry["wxyz"] = frames["scales"], frames["wxyz"]
    if model.light is not None:
        entry["light"] = out.add_table("light", model.light, FEATURE_BITS)
    return entry


def describe_layers(out: Container, model: SplatLayers, shared: StopsEntry) -> LayersEntry:
    """Plain splats: one set a stop, weighed by x."""
    if model.motion is not None:
        raise BadFile(
            "the splats of this scene move in time, and a page holds splats that stand; export one "
            "moment with --x, as .ply or .glb."
        )
    count, coefficients, _ = model.sh.shape
    flat = model.sh.reshape(count, -1)
    entry: LayersEntry = {
        **shared, "kind": "layers", "anchors": count, "perAnchor": 1, "mode": model.mode,
        "antialiased": model.antialiased, "coefficients": coefficients,
        "positions": add_positions(out, model.means),
        **add_frames(out, model.scales, model.wxyz),
        "opacity": out.add_table("opacities", model.opacity[:, None], COLOR_BITS),
        "layer": out.add(model.layer, "uint8"),
        "sh": out.add_table("colours", flat[:, :3], COLOR_BITS),
    }  # fmt: skip
    if coefficients > 1:
        entry["shRest"] = out.add_table("harmonics", flat[:, 3:], HARMONIC_BITS)
    return entry


def add_frames(out: Container, scales: np.ndarray, wxyz: np.ndarray) -> FramesEntry:
    """Scales (N, 3) by their logarithm and quaternions (N, 4)."""
    logs = np.log(np.maximum(scales.astype(np.float64), SMALLEST_SCALE))
    return {
        "scales": out.add_table("scales", logs, FRAME_BITS),
        "wxyz": out.add_table("quaternions", wxyz, FRAME_BITS),
    }


def add_positions(out: Container, positions: np.ndarray) -> TableEntry:
    """Places (N, 3) in 16 bits, or in 24 where a few far ones would make those coarse."""
    places = positions.astype(np.float64)
    low, high = np.nanpercentile(places, (2, 98), axis=0)
    radius = max(float(np.linalg.norm(high - low)) / 2, float(np.finfo(np.float32).tiny))
    step = float((places.max(axis=0) - places.min(axis=0)).max()) / 65535
    return out.add_table("positions", positions, 16 if step <= POSITION_STEP * radius else 24)


def padded(table: np.ndarray) -> np.ndarray:
    """(N, C) -> (N, next multiple of 4), zeros beyond C."""
    width = 4 * max(1, -(-table.shape[1] // 4))
    whole = np.zeros((len(table), width), np.float32)
    whole[:, : table.shape[1]] = table
    return whole


def network(out: Container, mlp: Mlp, name: str, model: AnchorModel) -> NetworkEntry:
    """One network: layers in vectors of four, what Psi enters with apart, as the page adds it to
    the first bias.
    """
    widths = model.input_widths
    part_of = np.repeat(mlp.inputs, [widths[part] for part in mlp.inputs])
    weights, biases = list(mlp.weights), list(mlp.biases)
    first = weights[0]  # (outputs, inputs)
    looks, control = "direction" in mlp.inputs, None
    columns = [padded(as_features(first, part_of, widths["feature"]))]
    if looks:
        seen = [first[:, part_of == part] for part in ("direction", "light")]  # 3, and 0, 1 or 3
        columns.append(padded(np.concatenate(seen, axis=1)))
    if "control" in mlp.inputs:
        control = out.add(padded(first[:, part_of == "control"].T).T)
    weights[0] = np.concatenate(columns, axis=1)
    layers: list[LayerEntry] = []
    count = 0
    for weight, bias in zip(weights, biases, strict=True):
        table = vector_weights(weight)  # (outputs / 4, inputs, 4)
        count += table.size
        layers.append({"ins": table.shape[1] // 4, "outs": len(table), "weights": out.add(table),
                       "bias": out.add(padded(bias[None]))})  # fmt: skip
    if not (count <= MOST_WEIGHTS and len(layers) <= 4 and all(la["outs"] <= 64 for la in layers)):
        raise BadFile(
            f"the {name} network has {len(layers)} layers and {count:,} weights; a page runs at "
            f"most 4 layers of 256 units and {MOST_WEIGHTS:,} weights: train with smaller ones."
        )
    low, high = mlp.clip or (-LARGEST, LARGEST)
    return {"layers": layers, "control": control, "looks": looks, "head": mlp.head,
            "clip": (float(low), float(high)), "gain": float(mlp.gain)}  # fmt: skip


def as_features(first: np.ndarray, part_of: np.ndarray, width: int) -> np.ndarray:
    """(outputs, F) what features enter the first layer with; zeros where they do not."""
    if "feature" in part_of:
        return first[:, part_of == "feature"]
    return np.zeros((len(first), width), np.float32)


def vector_weights(weight: np.ndarray) -> np.ndarray:
    """(out, in) -> (out / 4, in, 4), zeros beyond both: what a shader adds up vector by vector."""
    whole = padded(padded(weight).T).T  # both multiples of 4
    return whole.reshape(-1, 4, whole.shape[1]).transpose(0, 2, 1)
