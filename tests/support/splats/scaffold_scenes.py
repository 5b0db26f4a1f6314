"""Scaffold-GS folders made by our own code, and their decode by hand, anchor by anchor."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import AnchorModel, Mlp
from shapeshift.runtime_models.package.package_files import write_onnx
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.operations.rotate_splats import HALF_TURN, rotate_quaternions
from shapeshift.scene.pose import Pose, View, look_at, perspective
from tests.support.models import psi_of
from tests.support.splats.torch_files import write_tensors

Layers = list[tuple[np.ndarray, np.ndarray]]  # (weight (out, in), bias (out,)) of each


@dataclass(frozen=True)
class Raw:
    """What the files of a run hold, in their axes and their coding."""

    anchors: np.ndarray  # (A, 3)
    offsets: np.ndarray  # (A, k, 3), times exp(log_scales[:, :3])
    features: np.ndarray  # (A, F)
    log_scales: np.ndarray  # (A, 6)
    networks: dict[str, Layers]  # opacity_mlp, cov_mlp, color_mlp[, feature_bank_mlp]
    appearance: np.ndarray | None = None  # (images, E)
    levels: dict = field(default_factory=dict)  # level, extra_level (A,), voxel, standard, ...
    distance: bool = False  # the networks take it
    add_level: bool = False

    @property
    def k(self) -> int:
        return self.offsets.shape[1]


def random_raw(
    anchors: int = 40, k: int = 3, features: int = 8, seed: int = 0, appearance: int = 0,
    bank: bool = False, distance: bool = False, levels: int = 0, add_level: bool = False,
) -> Raw:  # fmt: skip
    """A scene of random networks about the file's zero."""
    rng = np.random.default_rng(seed)

    def layers(width: int, outputs: int) -> Layers:
        sizes = [(features, width), (outputs, features)]
        return [(rng.normal(0, 0.4, s), rng.normal(0, 0.2, s[0])) for s in sizes]

    view = features + 3 + distance + add_level
    networks = {
        "opacity_mlp": layers(view, k),
        "cov_mlp": layers(view, 7 * k),
        "color_mlp": layers(view + appearance, 3 * k),
    }
    if bank:
        networks["feature_bank_mlp"] = layers(3 + (add_level if levels else 1), 3)
    octree = {}
    if levels:
        octree = {
            "level": rng.integers(0, levels, anchors).astype(np.float64),
            "extra_level": rng.normal(0, 0.2, anchors),
            "voxel": 0.5,
            "standard": 6.0,
        }
    return Raw(
        rng.normal(0, 1, (anchors, 3)), rng.normal(0, 0.5, (anchors, k, 3)),
        rng.normal(0, 1, (anchors, features)), rng.normal(-2, 0.3, (anchors, 6)), networks,
        rng.normal(0, 1, (15, appearance)) if appearance else None, octree, distance, add_level,
    )  # fmt: skip


def write_run(raw: Raw, folder: Path, how: str = "unite", settings: str = "") -> Path:
    """point_cloud.ply and its networks into a folder; how: unite | split | onnx."""
    folder.mkdir(parents=True, exist_ok=True)
    write_cloud(raw, folder / "point_cloud.ply")
    tables = {
        stem: {f"{2 * i}.{part}": np.float32(a) for i, pair in enumerate(layers)
               for part, a in zip(("weight", "bias"), pair, strict=True)}
        for stem, layers in raw.networks.items()
    }  # fmt: skip
    if raw.appearance is not None:
        tables["embedding_appearance"] = {"embedding.weight": np.float32(raw.appearance)}
    if how == "unite":
        whole = {
            f"{'appearance' if stem == 'embedding_appearance' else stem}.{label}": array
            for stem, table in tables.items()
            for label, array in table.items()
        }
        write_tensors(folder / "checkpoints.pth", whole)
    for stem, table in tables.items() if how != "unite" else ():
        if how == "onnx" and stem in ONNX_HEADS:
            (folder / f"{stem}.onnx").write_bytes(write_onnx(as_mlp(raw, stem), stem))
        else:
            write_tensors(folder / f"{stem}.pt", table)
    if settings:
        (folder / "cfg_args").write_text(settings)
    return folder


ONNX_HEADS = {"opacity_mlp": "tanh", "cov_mlp": "none", "color_mlp": "sigmoid"}


def as_mlp(raw: Raw, stem: str) -> Mlp:
    weights, biases = zip(*raw.networks[stem], strict=True)
    return Mlp(tuple(map(np.float32, weights)), tuple(map(np.float32, biases)), ONNX_HEADS[stem])


def write_cloud(raw: Raw, path: Path, kind: str = "float") -> None:
    """The cloud as save_ply of Scaffold-GS or Octree-GS writes it; kind: of x, float or double."""
    count = len(raw.anchors)
    columns = {axis: raw.anchors[:, i] for i, axis in enumerate("xyz")}
    comments = []
    if raw.levels:
        columns |= {name: raw.levels[name] for name in ("level", "extra_level")}
        if "voxel" in raw.levels:
            columns["info"] = np.zeros(count)
            columns["info"][:2] = raw.levels["voxel"], raw.levels["standard"]
        else:
            comments = [f"obj_info standard_dist {raw.levels['standard']:.6f}"]
    else:
        columns |= {name: np.zeros(count) for name in ("nx", "ny", "nz")}
    by_channel = raw.offsets.transpose(0, 2, 1).reshape(count, -1)
    for prefix, table in (
        ("f_offset_", by_channel), ("f_anchor_feat_", raw.features), ("scale_", raw.log_scales),
    ):  # fmt: skip
        columns |= {f"{prefix}{i}": column for i, column in enumerate(table.T)}
    columns |= {"opacity": np.zeros(count), "rot_0": np.ones(count)}
    columns |= {f"rot_{i}": np.zeros(count) for i in (1, 2, 3)}
    header = ["ply", "format binary_little_endian 1.0", *comments, f"element vertex {count}"]
    kinds = {name: kind if name == "x" else "float" for name in columns}
    header += [f"property {kinds[name]} {name}" for name in columns] + ["end_header\n"]
    rows = np.empty(
        count, [(name, {"float": "<f4", "double": "<f8"}[kinds[name]]) for name in columns]
    )
    for name, column in columns.items():
        rows[name] = column
    path.write_bytes("\n".join(header).encode() + rows.tobytes())


def decode_by_hand(raw: Raw, eye: np.ndarray, rule: str = "round", row: int = 0) -> dict:
    """Every splat of the files seen from an eye in their axes, float64: the slow twin.

    means, scales, wxyz (unit), opacity (not above 0 = absent), color; anchor after anchor.
    """
    found = {name: [] for name in ("means", "scales", "wxyz", "opacity", "color")}
    for a in range(len(raw.anchors)):
        for name, part in decode_anchor(raw, a, eye, rule, row).items():
            found[name].append(part)
    return {name: np.concatenate(parts) for name, parts in found.items()}


def decode_anchor(raw: Raw, a: int, eye: np.ndarray, rule: str, row: int) -> dict:
    away = np.float32(raw.anchors[a]).astype(float) - eye
    distance = np.linalg.norm(away)
    direction = away / distance
    extra = [distance] if raw.distance else []
    extra += [raw.levels["level"][a]] if raw.add_level else []
    feature = np.float32(raw.features[a]).astype(float)
    if "feature_bank_mlp" in raw.networks:
        fourth = ([raw.levels["level"][a]] if raw.add_level else []) if raw.levels else [distance]
        z = forward(raw.networks["feature_bank_mlp"], [*direction, *fourth])
        w = np.exp(z) / np.exp(z).sum()
        n = len(feature)
        feature = np.array(
            [w[0] * feature[4 * (i % (n // 4))] + w[1] * feature[2 * (i % (n // 2))]
             + w[2] * feature[i] for i in range(n)]
        )  # fmt: skip
    seen = [*feature, *direction, *extra]
    look = [] if raw.appearance is None else list(raw.appearance[row])
    opacity = np.tanh(forward(raw.networks["opacity_mlp"], seen))
    cov = forward(raw.networks["cov_mlp"], seen).reshape(raw.k, 7)
    color = 1 / (1 + np.exp(-forward(raw.networks["color_mlp"], [*seen, *look])))
    size = np.exp(np.float32(raw.log_scales[a]).astype(float))
    return {
        "means": np.float32(raw.anchors[a]) + np.float32(raw.offsets[a]) * size[:3],
        "scales": size[3:] / (1 + np.exp(-cov[:, :3])),
        "wxyz": cov[:, 3:] / np.linalg.norm(cov[:, 3:], axis=1)[:, None],
        "opacity": opacity * shown_part(raw, a, eye, rule),
        "color": color.reshape(raw.k, 3),
    }


def shown_part(raw: Raw, a: int, eye: np.ndarray, rule: str) -> float:
    """1, or what an octree's rule leaves of an anchor's opacity; -inf never draws it."""
    if not raw.levels:
        return 1.0
    levels = raw.levels["level"]
    level, last = levels[a], levels.max() - levels.min()
    place = raw.anchors[a] + raw.levels.get("voxel", 0.0) / 2 / 2.0**level
    asked = np.log2(raw.levels["standard"] / np.linalg.norm(place - eye))
    asked += raw.levels["extra_level"][a]
    if rule == "progressive":
        asked = min(max(asked + 1, 0.9999), last + 0.9999)
        whole = np.floor(asked)
        return 0.0 if level > whole else asked - whole if level == whole else 1.0
    whole = min(max({"round": round, "floor": np.floor, "ceil": np.ceil}[rule](asked), 0), last)
    return float(level <= whole)


def forward(layers: Layers, row: list) -> np.ndarray:
    value = np.asarray(row, float)
    for i, (weight, bias) in enumerate(layers):
        value = np.float32(weight).astype(float) @ value + np.float32(bias)
        value = np.maximum(value, 0) if i < len(layers) - 1 else value
    return value


def from_anchors(model: AnchorModel, x: float) -> Raw:
    """A package's scene at one x as a Scaffold-GS run that shows the same but for 1 % of a scale.

    Psi(x) goes into the biases; the scale network's exp becomes a sigmoid far below its middle,
    where both are the same.  Its axes are COLMAP's, as a run's are.
    """
    heads, k = model.networks, model.splats_per_anchor
    psi = psi_of(model, x)
    opacity, color, scale, rotation = (
        folded(heads[name], psi) for name in ("opacity", "color", "scale", "rotation")
    )
    (w0, b0), (w1, b1) = scale
    largest = heads["scale"].gain * np.exp(heads["scale"].clip[1])
    limit = 100 * largest  # metres
    b1 = b1 + np.log(heads["scale"].gain / limit)
    (v0, c0), (v1, c1) = rotation
    v1, c1 = (rotate_quaternions(a.reshape(k, 4, -1).transpose(0, 2, 1).reshape(-1, 4), HALF_TURN)
              .reshape(k, -1, 4).transpose(0, 2, 1) for a in (v1, c1))  # fmt: skip
    hidden = np.concatenate([w0, v0]), np.concatenate([b0, c0])
    last = np.zeros((k, 7, len(b0) + len(c0)))
    last[:, :3, : len(b0)] = w1.reshape(k, 3, -1)
    last[:, 3:, len(b0) :] = v1
    bias = np.concatenate([b1.reshape(k, 3), c1[..., 0]], axis=1)
    means = evaluate(model, x, np.zeros(3)).means.reshape(len(model.anchors), k, 3)
    features = model.features.shape[1]
    color[0][0][:, features : features + 3] @= HALF_TURN
    for one in (opacity, [hidden]):  # they do not look at the direction
        one[0] = (np.pad(one[0][0], ((0, 0), (0, 3))), one[0][1])
        hidden = one[0]
    sizes = np.zeros((len(means), 6))
    sizes[:, 3:] = np.log(limit)
    offsets = (means - model.anchors[:, None]) @ HALF_TURN
    networks = {"opacity_mlp": opacity, "color_mlp": color}
    networks["cov_mlp"] = [hidden, (last.reshape(7 * k, -1), bias.reshape(-1))]
    return Raw(model.anchors @ HALF_TURN, offsets, model.features, sizes, networks)


def folded(mlp: Mlp, psi: np.ndarray) -> Layers:
    """The layers of a network for one control value: its columns come last."""
    first = mlp.weights[0].astype(np.float64)
    bias = mlp.biases[0] + first[:, -len(psi) :] @ psi
    rest = [(w.astype(np.float64), b.astype(np.float64))
            for w, b in zip(mlp.weights[1:], mlp.biases[1:], strict=True)]  # fmt: skip
    return [(first[:, : -len(psi)].copy(), bias), *rest]


SIZE = (160, 100)
TURNED = Pose(np.array([0.3, -0.2, 0.4]), np.array([0.8, 0.0, 0.6, 0.0]))
CASES = {
    "plain": {"anchors": 60},
    "all inputs": {"anchors": 60, "bank": True, "distance": True, "appearance": 4},
    "octree": {"anchors": 120, "levels": 4},
}


def made(folder: Path, **how):
    """A scene a metre across."""
    raw = random_raw(**how)
    raw = replace(raw, anchors=raw.anchors / 3, log_scales=raw.log_scales - 0.7)
    return read_model(write_run(raw, folder))


def seen_from(*eye: float) -> View:
    return View(look_at(eye, (0, 0, 0)), perspective(0.8, SIZE), 0.05, 50.0, SIZE)
