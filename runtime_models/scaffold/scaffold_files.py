"""A Scaffold-GS or Octree-GS cloud, and the networks beside it, turned into our axes with it.

city-super/Scaffold-GS save_mlp_checkpoints: one TorchScript file a network ("split") or one
checkpoints.pth ("unite"); the same exported as ONNX is taken as well.  Their inputs are read off
the width of the first layer.
"""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from io import RawIOBase
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.checkpoint.read_torch import read_script
from shapeshift.runtime_models.files.blocks import BLOCK, each_block
from shapeshift.runtime_models.files.memory import Account, unlimited
from shapeshift.runtime_models.model import SCAFFOLD_HEADS, BadFile, Finding, Mlp
from shapeshift.runtime_models.package.package_files import LARGEST_NETWORK
from shapeshift.runtime_models.package.read_onnx import read_onnx
from shapeshift.runtime_models.shapes import column_names, column_offset
from shapeshift.runtime_models.splats.operations.rotate_splats import rotate_quaternions
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.ply_file import PlyHeader, read_header
from shapeshift.runtime_models.splats.ply.read_ply import read_fully

UNITED = "checkpoints.pth"
APPEARANCE = "embedding_appearance"
STEMS = {
    "opacity": "opacity_mlp", "covariance": "cov_mlp", "color": "color_mlp",
    "bank": "feature_bank_mlp",
}  # fmt: skip
ROLES = {stem: role for role, stem in STEMS.items()}
IN_UNITED = {**{stem: stem for stem in STEMS.values()}, APPEARANCE: "appearance"}
ACTIVATIONS = {"opacity": "tanh", "covariance": "none", "color": "sigmoid", "bank": "none"}
ENDS = {"tanh": "Tanh", "sigmoid": "Sigmoid", "none": "Linear"}  # TorchScript's module
LAYER = re.compile(r"(?:.*\.)?([0-9]{1,6})\.(weight|bias)", re.ASCII)
EVALUATED_ROW = 10  # the appearance that Octree-GS's own render.py takes for every view (--ape)


# The cloud, as their scene/gaussian_model.py writes it: x y z, f_offset_* (all x of an anchor's
# splats, then all y, then all z), f_anchor_feat_*, scale_0..5 (logarithms: 0..2 multiply the
# offsets, 3..5 bound the splats' scales); Octree-GS: level, extra_level and, in the first two rows
# of info, the coarsest cell's size and the standard distance.

PLACE = ("x", "y", "z")
SCALES = tuple(f"scale_{i}" for i in range(6))
PREFIXES = ("f_offset_", "f_anchor_feat_")


@dataclass(frozen=True)
class Cloud:
    """What a cloud says, in the file's axes; every row of it, judged by `good`."""

    header: PlyHeader
    anchors: np.ndarray  # (A, 3) float32 metres
    features: np.ndarray  # (A, F)
    offsets: np.ndarray  # (A, k, 3) metres
    scales: np.ndarray  # (A, 3) metres
    levels: np.ndarray  # (A, 3) level, extra_level, info; (0, 3) where there are none
    good: np.ndarray  # (A,) bool: all of it is finite

    def kept(self) -> tuple[np.ndarray, ...]:
        """anchors, features, offsets, scales, levels of the good rows; no copies where all are."""
        arrays = (self.anchors, self.features, self.offsets, self.scales, self.levels)
        if self.good.all():
            return arrays
        return tuple(array[self.good] if len(array) else array for array in arrays)


def read_cloud(path: Path, reading: Reading) -> Cloud:
    """All rows of a binary cloud, block by block: it is never in memory as a whole.

    Raises BadFile.
    """
    header = read_header(path)
    vertex, begins = header.find("vertex")
    if header.encoding == "ascii":
        raise BadFile(f"{path.name} is an ASCII PLY; export it as a binary one.")
    vertex.require((*PLACE, *SCALES), path.name)
    k, width = count_columns(column_names(vertex.layout), path.name)
    count, row = vertex.count, vertex.layout
    floats = 3 + width + 3 * k + 3 + 3  # of an anchor
    reading.within(path).account.charge(2 * 4 * count * floats, f"{count:,} anchors")
    cloud = Cloud(
        header,
        np.empty((count, 3), np.float32),
        np.empty((count, width), np.float32),
        np.empty((count, k, 3), np.float32),
        np.empty((count, 3), np.float32),
        np.zeros((count if "level" in column_names(row) else 0, 3), np.float32),
        np.empty(count, bool),
    )

    @contextmanager
    def opened() -> Iterator[tuple[RawIOBase, np.ndarray]]:
        with path.open("rb", buffering=0) as file:
            yield file, np.empty(BLOCK, row)

    def work(rows: slice, own: tuple[RawIOBase, np.ndarray]) -> None:
        file, table = own[0], own[1][: rows.stop - rows.start]
        file.seek(begins + rows.start * row.itemsize)
        if read_fully(file, table.view(np.uint8).data) < table.nbytes:
            raise BadFile(f"{path.name} became shorter while it was read; is it still written?")
        fill(cloud, rows, table)

    def progress(part: float) -> None:
        reading.report(f"reading {path.name}", part)

    each_block(count, work, progress, opened)
    return cloud


def count_columns(names: tuple[str, ...], file: str) -> tuple[int, int]:
    """Splats an anchor and features of a cloud, by its columns.  Raises BadFile."""
    counts = []
    for prefix in PREFIXES:
        mine = {n for n in names if n.startswith(prefix)}
        if not mine or mine != {f"{prefix}{i}" for i in range(len(mine))}:
            raise BadFile(f"{file}: its {len(mine)} columns {prefix}* are not numbered from 0 on.")
        counts.append(len(mine))
    if counts[0] % 3:
        raise BadFile(f"{file} has {counts[0]} columns f_offset_*, expected three a splat.")
    return counts[0] // 3, counts[1]


def fill(cloud: Cloud, rows: slice, table: np.ndarray) -> None:
    """Puts records of the file into some rows, offsets and scales in metres."""
    k, width = cloud.offsets.shape[1], cloud.features.shape[1]
    names = column_names(table.dtype)
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is judged below
        cloud.anchors[rows] = columns_of(table, PLACE)
        cloud.features[rows] = columns_of(table, [f"f_anchor_feat_{i}" for i in range(width)])
        scales = np.exp(columns_of(table, SCALES))
        cloud.scales[rows] = scales[:, 3:]
        by_channel = columns_of(table, [f"f_offset_{i}" for i in range(3 * k)]).reshape(-1, 3, k)
        by_channel *= scales[:, :3, None]
        cloud.offsets[rows] = by_channel.transpose(0, 2, 1)
        for i, name in enumerate(("level", "extra_level", "info") if len(cloud.levels) else ()):
            if name in names:
                cloud.levels[rows, i] = table[name]
    finite = [np.isfinite(a[rows]).reshape(len(table), -1).all(axis=1) for a in (
        cloud.anchors, cloud.features, cloud.offsets, cloud.scales)]  # fmt: skip
    cloud.good[rows] = np.logical_and.reduce(finite)


def columns_of(table: np.ndarray, names: list[str] | tuple[str, ...]) -> np.ndarray:
    """(n, len(names)) float32 of some columns."""
    kinds = table.dtype
    if all(kinds[name] == np.dtype("<f4") for name in column_names(kinds)):
        places = [column_offset(kinds, name) // 4 for name in names]
        return np.take(table.view("<f4").reshape(len(table), -1), places, axis=1)
    out = np.empty((len(table), len(names)), np.float32)
    for i, name in enumerate(names):
        out[:, i] = table[name]
    return out


@dataclass(frozen=True)
class Shape:
    """What the cloud says about its networks."""

    features: int
    splats_per_anchor: int
    octree: bool
    level_is_input: bool | None  # add_level of the run's settings; None: they are not there


@dataclass(frozen=True)
class Networks:
    mlps: dict[str, Mlp]  # keys SCAFFOLD_HEADS, "bank" where there is one
    files: tuple[str, ...]
    appearance: str  # which row of the embedding the colours are for; "" = there is none
    findings: tuple[Finding, ...]


def read_networks(folder: Path, shape: Shape, memory: Account) -> Networks:
    """All networks of a folder, in the file's axes.  Raises BadFile, naming what is missing."""
    found, files = gather(folder, memory)
    missing = [STEMS[role] for role in SCAFFOLD_HEADS if STEMS[role] not in found]
    if missing:
        raise BadFile(
            f"{folder} lacks {', '.join(f'{stem}.pt' for stem in missing)}: a Scaffold-GS model is "
            "point_cloud.ply with opacity_mlp, cov_mlp and color_mlp (.pt or .onnx) or "
            f"{UNITED} beside it; copy the whole iteration folder."
        )
    mlps = {role: found[stem](ACTIVATIONS[role]) for role, stem in STEMS.items() if stem in found}
    table = found[APPEARANCE]("") if APPEARANCE in found else None
    row = 0 if table is None or not shape.octree else min(EVALUATED_ROW, len(table) - 1)
    mlps, findings = with_inputs(mlps, 0 if table is None else table.shape[1], shape, folder)
    if table is not None:
        mlps["color"] = fold_inputs(mlps["color"], table[row])
    appearance_row = "" if table is None else f"row {row} of {len(table)}"
    return Networks(mlps, files, appearance_row, findings)


def gather(folder: Path, memory: Account) -> tuple[dict[str, Callable], tuple[str, ...]]:
    """stem -> a function that reads it (networks: given the activation); and the files' names."""
    found, files = {}, []
    for stem in (*STEMS.values(), APPEARANCE):
        script, graph = folder / f"{stem}.pt", folder / f"{stem}.onnx"
        if script.is_file():
            found[stem] = from_tensors(*read_torch_file(script, memory), script.name, stem, memory)
            files.append(script.name)
        elif graph.is_file() and stem != APPEARANCE:
            found[stem] = from_graph(graph, memory)
            files.append(graph.name)
    united = folder / UNITED
    if any(STEMS[role] not in found for role in SCAFFOLD_HEADS) and united.is_file():
        tensors, _ = read_torch_file(united, memory)
        files.append(UNITED)
        for stem, key in IN_UNITED.items():
            mine = {name: t for name, t in tensors.items() if name.startswith(f"{key}.")}
            if mine and stem not in found:
                found[stem] = from_tensors(mine, {}, f"{UNITED} ({key})", stem, memory)
    return found, tuple(files)


def read_torch_file(path: Path, memory: Account) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    if path.stat().st_size > LARGEST_NETWORK:
        raise BadFile(
            f"{path.name} has {path.stat().st_size:,} bytes; a network of at most "
            f"{LARGEST_NETWORK:,} is read."
        )
    return read_script(path, memory)


def from_tensors(
    tensors: dict[str, np.ndarray], modules: dict[str, str], name: str, stem: str, memory: Account
) -> Callable:
    if stem == APPEARANCE:
        return lambda _: embedding_of(tensors, name)
    around = {label.rpartition(".")[0] for label in modules if label}  # hold the others
    names = sorted(modules.keys() - around, key=lambda label: (len(label), label))  # 2 before 10
    kinds = [modules[label] for label in names]
    wanted = "Softmax" if stem == STEMS["bank"] else ENDS[ACTIVATIONS[ROLES[stem]]]
    if kinds and (kinds[-1] != wanted or not set(kinds[:-1]) <= {"Linear", "ReLU"}):
        raise BadFile(
            f"{name} is {', '.join(kinds[:9])}; a network of Scaffold-GS is Linear, ReLU, Linear"
            f"{'' if wanted == 'Linear' else ', ' + wanted}."
        )
    return lambda activation: mlp_of(tensors, name, activation, memory)


def from_graph(path: Path, memory: Account) -> Callable:
    """An ONNX graph says itself how it ends."""
    if path.stat().st_size > LARGEST_NETWORK:
        raise BadFile(f"{path.name} has {path.stat().st_size:,} bytes, no network of this kind.")
    memory.charge(path.stat().st_size, path.name)
    return lambda _: read_onnx(path.read_bytes(), path.name, (), memory)


def embedding_of(tensors: dict[str, np.ndarray], name: str) -> np.ndarray:
    """(images, width) float32 appearances."""
    tables = [t for t in tensors.values() if t.ndim == 2 and t.dtype.kind == "f" and t.size]
    if len(tensors) != 1 or len(tables) != 1 or not np.isfinite(tables[0]).all():
        raise BadFile(f"{name} is no table of appearances (images, width); save it again.")
    return tables[0].astype(np.float32)


def mlp_of(
    tensors: dict[str, np.ndarray], name: str, activation: str, memory: Account | None = None
) -> Mlp:
    """A torch.nn.Sequential of Linear and ReLU by its parameters "0.weight", "0.bias", ..."""
    memory = memory or unlimited()
    layers: dict[int, dict[str, np.ndarray]] = {}
    for label, tensor in tensors.items():
        if not (match := LAYER.fullmatch(label)):
            raise BadFile(f"{name} holds {label[:60]!r}, which no plain network has.")
        layers.setdefault(int(match[1]), {})[match[2]] = tensor
    weights: list[np.ndarray] = []
    biases: list[np.ndarray] = []
    for number, layer in sorted(layers.items()):
        weight, bias = layer.get("weight"), layer.get("bias")
        refusal = f"{name}: layer {number} does not fit the one before; save it again."
        if weight is None or bias is None or weight.ndim != 2 or not weight.size:
            raise BadFile(refusal)
        if bias.shape != weight.shape[:1] or (weights and weight.shape[1] != len(weights[-1])):
            raise BadFile(refusal)
        memory.charge(3 * 4 * weight.size, f"layer {number} of {name}")
        with np.errstate(over="ignore"):
            weights.append(weight.astype(np.float32))
            biases.append(bias.astype(np.float32))
        if not (np.isfinite(weights[-1]).all() and np.isfinite(biases[-1]).all()):
            raise BadFile(f"{name}: layer {number} has weights that are NaN or Inf.")
    return Mlp(tuple(weights), tuple(biases), activation, ())


def with_inputs(
    mlps: dict[str, Mlp], appearance: int, shape: Shape, folder: Path
) -> tuple[dict[str, Mlp], tuple[Finding, ...]]:
    """The networks with their inputs named, an appearance of the colours left out."""
    extra = {}  # inputs other than features, direction and appearance
    for role, size in SCAFFOLD_HEADS.items():
        mlp, own = mlps[role], appearance if role == "color" else 0
        extra[role] = mlp.width_in - shape.features - 3 - own
        if not 0 <= extra[role] <= 1 + shape.octree:
            lost = role == "color" and not own and extra[role] > 0
            raise BadFile(
                f"{folder / STEMS[role]}: takes {mlp.width_in} numbers, but {shape.features} "
                f"features and a direction are {shape.features + 3 + own}"
                + (f"; {APPEARANCE}.pt is missing, copy it, too." if lost else "; wrong cloud.")
            )
        wanted = size * shape.splats_per_anchor
        if mlp.width_out != wanted:
            raise BadFile(
                f"{folder / STEMS[role]}: gives {mlp.width_out} numbers an anchor, "
                f"{shape.splats_per_anchor} splats take {wanted}; it belongs to another cloud."
            )
    by_level, findings = takes_level(mlps.get("bank"), extra, shape)
    parts = {0: (), 1: ("level",) if by_level else ("distance",), 2: ("distance", "level")}
    named = {
        role: replace(mlps[role], inputs=("feature", "direction", *parts[extra[role]]))
        for role in SCAFFOLD_HEADS
    }
    if "bank" in mlps:
        named["bank"] = bank_with_inputs(mlps["bank"], shape, folder)
    return named, findings


def takes_level(
    bank: Mlp | None, extra: dict[str, int], shape: Shape
) -> tuple[bool, tuple[Finding, ...]]:
    """Whether one input more than usual is the octree level; else it is the distance.

    All networks take the level or none does (add_level), so most widths tell; where all have one
    input more and the run's settings are not there, it is read as the distance, and that is said.
    """
    if not shape.octree:
        return False, ()
    if shape.level_is_input is not None:
        return shape.level_is_input, ()
    if bank is not None:
        return bank.width_in == 4, ()
    if set(extra.values()) != {1}:
        return 2 in extra.values(), ()
    what = "every network takes one number after features and direction, and no cfg_args says what"
    return False, (Finding(what, 0, "read as the distance", (), "opacity_mlp.pt", repaired=False),)


def bank_with_inputs(bank: Mlp, shape: Shape, folder: Path) -> Mlp:
    name = folder / STEMS["bank"]
    if bank.width_out != 3 or bank.width_in not in (3, 4) or shape.features % 4:
        raise BadFile(
            f"{name}: mixes {shape.features} features by {bank.width_out} of "
            f"{bank.width_in} numbers; expected a multiple of 4, 3 and 3 or 4."
        )
    fourth = ("level",) if shape.octree else ("distance",)
    return replace(bank, inputs=("direction", *(fourth if bank.width_in == 4 else ())))


def fold_inputs(mlp: Mlp, last: np.ndarray) -> Mlp:
    """The network with its last inputs (n,) fixed: their product goes into the first bias."""
    first = mlp.weights[0].astype(np.float64)
    bias = mlp.biases[0] + first[:, -len(last) :] @ last.astype(np.float64)
    weight = np.ascontiguousarray(mlp.weights[0][:, : -len(last)])
    return replace(
        mlp,
        weights=(weight, *mlp.weights[1:]),
        biases=(bias.astype(np.float32), *mlp.biases[1:]),
    )


def rotate_networks(mlps: dict[str, Mlp], rotation: np.ndarray, features: int) -> dict[str, Mlp]:
    """The networks for directions and rotations of a world that was turned by (3, 3).

    Both are linear there: W d_file = (W R^T) d_turned, and q * (W h + b) = (q * W) h + q * b.
    """
    turned = {}
    for role, mlp in mlps.items():
        start = features if "feature" in mlp.inputs else 0
        weights, biases = [w.copy() for w in mlp.weights], list(mlp.biases)
        weights[0][:, start : start + 3] = weights[0][:, start : start + 3] @ rotation.T
        if role == "covariance":
            for arrays in (weights, biases):
                rows = arrays[-1].reshape(-1, 7, arrays[-1].size // len(arrays[-1])).copy()
                columns = np.moveaxis(rows[:, 3:], 1, 2)  # (k, hidden or 1, wxyz)
                columns = rotate_quaternions(columns.reshape(-1, 4), rotation).reshape(
                    columns.shape
                )
                rows[:, 3:] = np.moveaxis(columns, 2, 1)
                arrays[-1] = rows.reshape(arrays[-1].shape)
        turned[role] = replace(mlp, weights=tuple(weights), biases=tuple(biases))
    return turned
