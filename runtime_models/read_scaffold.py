"""A Scaffold-GS, Octree-GS or Octree-AnyGS output: point_cloud.ply and the networks beside it.

Columns as save_ply of their scene/gaussian_model.py writes them: x y z, f_offset_* (all x, then all
y, then all z), f_anchor_feat_*, scale_0..5 (logarithms: 0..2 multiply the offsets, 3..5 bound the
splats' scales); Octree-GS adds level and extra_level.
"""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from runtime_models.model import (
    OCTREE_RULES,
    BadFile,
    Finding,
    Octree,
    ScaffoldModel,
    Stop,
)
from runtime_models.plain_splats import COLMAP_UP, Reading
from runtime_models.ply_file import columns, read_header, read_table
from runtime_models.scaffold_budget import within_budget
from runtime_models.scaffold_networks import Shape, read_networks, turn_networks
from runtime_models.turn import ours_from_file

CLOUD = "point_cloud.ply"
MARK = b"f_anchor_feat_0"
HEAD = 1 << 16  # bytes
SETTINGS = ("cfg_args", "config.yaml")  # of Scaffold-GS and Octree-GS, of Octree-AnyGS
SETTING = re.compile(r"(\w+)\s*[:=]\s*'?([\w.+-]+)")
FEW = 10  # rows that a finding names


def is_scaffold(path: Path) -> bool:
    """A cloud with anchors' features, or a folder that holds one as point_cloud.ply."""
    cloud = path / CLOUD if path.is_dir() else path
    if not cloud.is_file():
        return False
    with cloud.open("rb") as file:
        head = file.read(HEAD)
    return head[:3] == b"ply" and MARK in head.split(b"end_header")[0]


def read_scaffold(path: Path, reading: Reading) -> ScaffoldModel:
    """The model of a cloud or of the folder that holds it, in our axes.  Raises BadFile."""
    cloud = path / CLOUD if path.is_dir() else path
    folder = cloud.parent
    settings = read_settings(folder)
    reading.tell(f"reading {cloud.name}", 0.1)
    table = read_table(cloud, ("x", "y", "z", *(f"scale_{i}" for i in range(6))))
    k, width = count_columns(table, cloud.name)
    octree = read_octree(cloud, table, settings) if "level" in table.dtype.names else None
    shape = Shape(width, k, octree is not None, boolean(settings.get("add_level")))
    networks = read_networks(folder, shape)
    reading.tell(f"reading {cloud.name}", 0.3)
    arrays = read_anchors(table, k, width)
    good = np.logical_and.reduce([np.isfinite(a).reshape(len(table), -1).all(1) for a in arrays])
    findings = (*networks.findings, *judge_rows(good, reading, cloud.name))
    if not good.all():
        arrays = [a[good] for a in arrays]
        if octree is not None:
            octree = replace(
                octree, level=octree.level[good], extra=octree.extra[good],
                places=octree.places[good],
            )  # fmt: skip
    rotation = ours_from_file(reading.up or COLMAP_UP, reading.flip)
    anchors, features, offsets, scales = arrays
    provenance = {
        "format": "Scaffold-GS" if octree is None else "Octree-GS",
        "files": [cloud.name, *networks.files],
    }
    if networks.appearance:
        provenance["appearance"] = networks.appearance
    if boolean(settings.get("white_background")):
        provenance["background"] = (1.0, 1.0, 1.0)
    if octree is not None:
        octree = replace(octree, places=turned(octree.places, rotation))
    model = ScaffoldModel(
        turned(anchors, rotation),
        features,
        turned(offsets, rotation),
        scales,
        turn_networks(networks.mlps, rotation, width),
        (Stop(folder.resolve().name, 0.0),),
        octree,
        provenance,
        findings=findings,
    )
    reading.tell(f"reading {cloud.name}", 0.9)
    return within_budget(model, reading.most_splats)


def turned(places: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """(..., 3) float32 after a rotation (3, 3)."""
    return (places @ rotation.T).astype(np.float32)


def count_columns(table: np.ndarray, name: str) -> tuple[int, int]:
    """Splats an anchor and features of a cloud, by its columns.  Raises BadFile."""
    names = table.dtype.names
    counts = []
    for prefix in ("f_offset_", "f_anchor_feat_"):
        mine = {n for n in names if n.startswith(prefix)}
        if not mine or mine != {f"{prefix}{i}" for i in range(len(mine))}:
            raise BadFile(f"{name} has {len(mine)} columns {prefix}*, numbered from 0 on; not so.")
        counts.append(len(mine))
    if counts[0] % 3:
        raise BadFile(f"{name} has {counts[0]} columns f_offset_*, expected three a splat.")
    return counts[0] // 3, counts[1]


def read_anchors(table: np.ndarray, k: int, width: int) -> list[np.ndarray]:
    """anchors (A, 3), features (A, F), offsets (A, k, 3), scales (A, 3), metres, file's axes.

    Offsets are kept by channel: all x of an anchor's splats first.
    """
    anchors = np.stack([table[axis] for axis in "xyz"], 1).astype(np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        scales = np.exp(columns(table, "scale_", 6))  # (A, 6) metres
        offsets = columns(table, "f_offset_", 3 * k).reshape(-1, 3, k)
        offsets *= scales[:, :3, None]
    features = columns(table, "f_anchor_feat_", width)
    return [anchors, features, np.ascontiguousarray(offsets.transpose(0, 2, 1)), scales[:, 3:]]


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


def read_octree(cloud: Path, table: np.ndarray, settings: dict[str, str]) -> Octree:
    """The levels of all rows, in the file's axes.

    Octree-GS keeps the finest cell's size and the standard distance in the first two rows of the
    column info, and measures to the cell's middle; Octree-AnyGS names the distance in its header
    and measures to the anchor.  fork and dist2level are in the run's settings, else as by default.
    """
    level, extra = (
        np.asarray(table[name], np.float32) if name in table.dtype.names else np.zeros(len(table))
        for name in ("level", "extra_level")
    )
    anchors = np.stack([table[axis] for axis in "xyz"], 1).astype(np.float32)
    fork, rule = number(settings.get("fork", "2")), settings.get("dist2level", "round")
    named = dict(c.split(" ", 1) for c in read_header(cloud).comments if " " in c)
    if "info" in table.dtype.names and len(table) > 1:
        voxel, standard = map(float, table["info"][:2])
    else:
        voxel, standard = 0.0, number(named.get("standard_dist", ""))
    if not (0 < standard < math.inf and fork > 1 and 0 <= voxel < math.inf):
        raise BadFile(
            f"{cloud.name} has levels, but its standard distance is {standard}, its fork {fork} "
            f"and its cells are {voxel} m; without them no one knows which level to draw."
        )
    if rule not in OCTREE_RULES:
        raise BadFile(f"dist2level is {rule[:40]!r}; {', '.join(OCTREE_RULES)} are known.")
    if not (np.isfinite(level).all() and np.isfinite(extra).all() and np.ptp(level) < 64):
        raise BadFile(f"{cloud.name}: its column level holds no levels; export it again.")
    with np.errstate(over="ignore"):
        places = anchors + (voxel / 2 / np.float64(fork) ** level)[:, None].astype(np.float32)
    places = np.nan_to_num(places)  # rows that are not finite are dropped with their anchors
    return Octree(level, extra.astype(np.float32), places, standard, fork, rule)


def number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def boolean(text: str | None) -> bool | None:
    return None if text is None else text.lower() == "true"


def read_settings(folder: Path) -> dict[str, str]:
    """The run's settings by name, as text, where cfg_args or config.yaml lies in its folder."""
    here = folder.absolute()
    places = [here, here.parents[1]] if len(here.parents) > 1 else [here]
    for file in (place / name for place in places for name in SETTINGS):
        if file.is_file():
            with file.open("rb") as opened:
                text = opened.read(HEAD).decode("utf-8", "replace")
            return dict(reversed(SETTING.findall(text)))  # of a name given twice the first counts
    return {}
