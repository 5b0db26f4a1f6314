"""A Scaffold-GS, Octree-GS or Octree-AnyGS output: point_cloud.ply and the networks beside it."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.checkpoint.read_checkpoint import text_of
from shapeshift.runtime_models.files.blocks import BLOCK
from shapeshift.runtime_models.lint.lint_whole import (
    MIN_ALPHA,
    MOST_LAYERS,
    SAMPLE,
    layers,
    sample_of,
)
from shapeshift.runtime_models.model import (
    OCTREE_RULES,
    BadFile,
    Finding,
    Octree,
    ScaffoldModel,
    Stop,
)
from shapeshift.runtime_models.scaffold.evaluate_scaffold import ScaffoldEvaluator
from shapeshift.runtime_models.scaffold.scaffold_files import (
    Cloud,
    Networks,
    Shape,
    read_cloud,
    read_networks,
    rotate_networks,
)
from shapeshift.runtime_models.shapes import three
from shapeshift.runtime_models.splats.operations.activate import origin_of
from shapeshift.runtime_models.splats.operations.decimate import largest
from shapeshift.runtime_models.splats.operations.rotate_splats import ours_from_file
from shapeshift.runtime_models.splats.plain_splats import COLMAP_UP, Reading

CLOUD = "point_cloud.ply"
MARK = b"f_anchor_feat_0"
HEAD = 1 << 16  # bytes
SETTINGS = ("cfg_args", "config.yaml")  # of Scaffold-GS and Octree-GS, of Octree-AnyGS
SETTING = re.compile(r"(\w+)\s*[:=]\s*'?([\w.+-]+)")
NETWORK_ENDINGS = (".pt", ".pth", ".onnx")
FEW = 10  # rows that a finding names
MOST_LEVELS = 64
SHOWN = 60  # bytes of a splat that is decoded


def cloud_of(path: Path) -> Path:
    """Where the cloud should be, whatever of a model is named."""
    if path.is_dir():
        return path / CLOUD
    return path.with_name(CLOUD) if path.suffix in NETWORK_ENDINGS else path


def is_scaffold(path: Path) -> bool:
    """A cloud with anchors' features, the folder that holds one, or a network beside one."""
    cloud = cloud_of(path)
    if not cloud.is_file():
        return False
    with cloud.open("rb") as file:
        head = file.read(HEAD)
    return head[:3] == b"ply" and MARK in head.split(b"end_header")[0]


def read_scaffold(path: Path, reading: Reading) -> ScaffoldModel:
    """The model of a cloud, of its folder or of a network beside it, in our axes.

    Raises BadFile.
    """
    file = cloud_of(path)
    reading = reading.within(file.parent)
    memory = reading.account
    settings, unread = read_settings(file.parent)
    cloud = read_cloud(file, reading)
    findings = judge_rows(cloud.good, reading, file.name)
    octree = read_octree(cloud, settings) if len(cloud.levels) else None
    _, k, _ = cloud.offsets.shape
    features = cloud.features.shape[1]
    shape = Shape(features, k, octree is not None, boolean(settings.get("add_level")))
    networks = read_networks(file.parent, shape, memory)
    anchors, features_of, offsets, scales, _ = cloud.kept()
    sample = sample_of(anchors, scales, np.ones(len(anchors)))
    place, far = origin_of(sample, anchors.dtype, file.name)
    origin = np.array(place)
    anchors -= origin.astype(np.float32)
    if octree is not None:
        octree.places[:] -= origin.astype(np.float32)
    rotation = ours_from_file(reading.up or COLMAP_UP, reading.flip)
    for places in (anchors, offsets, *([] if octree is None else [octree.places])):
        rotate_places(places, rotation)
    model = ScaffoldModel(
        anchors,
        features_of,
        offsets,
        scales,
        rotate_networks(networks.mlps, rotation, features),
        (Stop("RGB", 0.0),),
        octree,
        provenance_of(file, networks, octree, settings),
        three(rotation @ origin),
        (*unread, *networks.findings, *findings, *far),
    )
    memory.charge(SHOWN * model.splat_count, f"{model.splat_count:,} splats")
    if not reading.allow_huge:
        refuse_filling(model, file.name)
    return within_budget(model, reading.most_splats)


def provenance_of(
    file: Path, networks: Networks, octree: Octree | None, settings: dict[str, str]
) -> dict:
    """Where it comes from, and what else the run says that a viewer can use."""
    found: dict[str, object] = {
        "format": "Scaffold-GS" if octree is None else "Octree-GS",
        "files": [file.name, *networks.files],
    }
    if networks.appearance:
        found["appearance"] = networks.appearance
    if boolean(settings.get("white_background")):
        found["background"] = (1.0, 1.0, 1.0)
    return found


def rotate_places(places: np.ndarray, rotation: np.ndarray) -> None:
    """(n, ..., 3) turned by a rotation (3, 3), in place and block by block."""
    for start in range(0, len(places), BLOCK):
        block = places[start : start + BLOCK]
        block[:] = block @ rotation.T


def judge_rows(good: np.ndarray, reading: Reading, name: str) -> tuple[Finding, ...]:
    """What is said about the anchors that are not finite.  Raises BadFile."""
    bad = np.flatnonzero(~good)
    if not len(bad):
        return ()
    if len(bad) == len(good):
        raise BadFile(f"{name}: not one of {len(good):,} anchors is finite; export it again.")
    what = f"{len(bad):,} anchors have NaN or Inf"
    if reading.strict:
        raise BadFile(f"{name}: {what}; --strict repairs nothing, export it again.")
    return (Finding(what, len(bad), "dropped", tuple(map(int, bad[:FEW])), name),)


def read_octree(cloud: Cloud, settings: dict[str, str]) -> Octree:
    """The levels of the good rows, in the file's axes.

    Octree-GS keeps the coarsest cell's size and the standard distance in the first two rows of the
    column info, and measures to a cell's middle; Octree-AnyGS names the distance in its header and
    measures to the anchor.  fork and dist2level are in the run's settings, else as by default.
    """
    name, info = cloud.header.file, cloud.levels[:2, 2]
    named = dict(c.split(" ", 1) for c in cloud.header.comments if " " in c)
    fork, rule = number(settings.get("fork", "2")), settings.get("dist2level", "round")
    voxel, standard = 0.0, number(named.get("standard_dist", ""))
    if "standard_dist" not in named and len(info) == 2:
        voxel, standard = map(float, info)
    if not (0 < standard < math.inf and 1 < fork < math.inf and 0 <= voxel < math.inf):
        raise BadFile(
            f"{name} has levels, but its standard distance is {standard:g}, its fork {fork:g} and "
            f"its cells are {voxel:g} m; without them no one knows which level to draw."
        )
    if rule not in OCTREE_RULES:
        raise BadFile(f"dist2level is {rule[:40]!r}; {', '.join(OCTREE_RULES)} are known.")
    level, extra, _ = (column.copy() for column in cloud.kept()[4].T)
    finite = np.isfinite(level).all() and np.isfinite(extra).all()
    if not (finite and np.float64(level.max()) - level.min() < MOST_LEVELS):
        raise BadFile(f"{name}: its column level holds no levels; export it again.")
    with np.errstate(over="ignore"):
        middle = voxel / 2 / np.float64(fork) ** level
        places = cloud.kept()[0] + middle[:, None].astype(np.float32)
    if not np.isfinite(places).all():
        raise BadFile(f"{name}: the middles of its cells are not finite; export it again.")
    return Octree(level, extra, places, standard, fork, rule)


def number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def boolean(text: str | None) -> bool | None:
    return None if text is None else text.lower() == "true"


def read_settings(folder: Path) -> tuple[dict[str, str], tuple[Finding, ...]]:
    """The run's settings by name, as text, where cfg_args or config.yaml lies in its folder; a
    finding where they cannot be read."""
    here = folder.absolute()
    places = [here, here.parents[1]] if len(here.parents) > 1 else [here]
    for file in (place / name for place in places for name in SETTINGS):
        if file.exists():
            text, why = text_of(file)
            done = "not looked at; its background, fork and rule of levels are taken as usual"
            found = (Finding(f"its run's {file.name} {why}", 0, done, file=CLOUD, repaired=False),)
            # of a name given twice the first counts
            return dict(reversed(SETTING.findall(text))), found if why else ()
    return {}, ()


# How much a Scaffold-GS or Octree-GS model draws: --max-splats, and the gate before any drawing.
#
# What a splat shows depends on the eye; eyes outside the scene stand for all.

EYES = np.concatenate([np.eye(3), -np.eye(3)])  # directions from the middle
AWAY = 2.0  # times the radius


def within_budget(model: ScaffoldModel, most_splats: int) -> ScaffoldModel:
    """The model with no more splats than that; 0 = all.

    Octree: whole levels go, the finest first.  Then anchors, by what their splats show on average
    to six eyes around the middle: opacity times the product of the two larger scales.
    """
    if not most_splats or model.splat_count <= most_splats:
        return model
    keep, rows = max(most_splats // model.splats_per_anchor, 1), np.arange(len(model.anchors))
    if model.octree is not None:
        levels, counts = np.unique(model.octree.level, return_counts=True)
        whole = int(np.count_nonzero(np.cumsum(counts) <= keep))
        rows = np.flatnonzero(model.octree.level <= levels[max(whole - 1, 0)])
    if len(rows) > keep:
        rows = rows[largest(shown_of(pick(model, rows)), keep)]
    kept = pick(model, rows)
    found = Finding(
        f"{model.splat_count:,} splats, --max-splats asks for {most_splats:,}",
        0,
        f"{kept.splat_count:,} that show most are kept",
        file=", ".join(model.provenance.get("files", ())[:1]),
        repaired=False,
    )
    return replace(kept, findings=(*model.findings, found))


def pick(model: ScaffoldModel, rows: np.ndarray) -> ScaffoldModel:
    """The model of some anchors alone."""
    octree = model.octree
    if octree is not None:
        octree = replace(
            octree, level=octree.level[rows], extra=octree.extra[rows], places=octree.places[rows]
        )
    return replace(
        model, anchors=model.anchors[rows], features=model.features[rows],
        offsets=model.offsets[rows], scales=model.scales[rows], octree=octree,
    )  # fmt: skip


def shown_of(model: ScaffoldModel) -> np.ndarray:
    """(A,) m^2: what the splats of each anchor show on average."""
    evaluator = ScaffoldEvaluator(with_every_level(model))
    shown = np.zeros(model.offsets.shape[:2])
    for eye in eyes_around(model):
        _, scales, _, opacity = evaluator.geometry(eye)
        area = np.sort(scales, axis=1)[:, 1:].prod(axis=1)
        shown += (np.maximum(opacity, 0) * area).reshape(shown.shape)
    return shown.sum(axis=1)


def refuse_filling(model: ScaffoldModel, file: str) -> None:
    """BadFile where so many splats would lie over every pixel that drawing could halt a machine."""
    step = max(model.splat_count // SAMPLE, 1)
    few = pick(model, np.arange(0, len(model.anchors), step))
    evaluator = ScaffoldEvaluator(with_every_level(few))
    means, scales, _, opacity = evaluator.geometry(eyes_around(few)[0])
    ratio = layers(means, scales, opacity >= MIN_ALPHA) * len(model.anchors) / len(few.anchors)
    if not ratio <= MOST_LAYERS:
        raise BadFile(
            f"{file}: {ratio:,.0f} splats would lie over every pixel, at most {MOST_LAYERS:,.0f} "
            "are drawn: its scales are no logarithms of metres, or its networks are another "
            "cloud's; export it again, or add --allow-huge if this is meant."
        )


def eyes_around(model: ScaffoldModel) -> np.ndarray:
    """(6, 3) metres: outside the scene, one on each side."""
    low, high = np.percentile(model.anchors, (2, 98), axis=0)
    return (low + high) / 2 + AWAY * np.linalg.norm(high - low) / 2 * EYES


def with_every_level(model: ScaffoldModel) -> ScaffoldModel:
    """The model as seen from very near: no level of an octree is too fine."""
    if model.octree is None:
        return model
    return replace(model, octree=replace(model.octree, standard_m=np.inf))
