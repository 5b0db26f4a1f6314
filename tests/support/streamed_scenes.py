"""Small scenes in levels of detail on disk, read leaf by leaf."""

import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.part_cache import PartCache
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import LeafReading, PlainSplats, Reading
from shapeshift.runtime_models.splats.sog.write_streamed import write_streamed
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.splat_scenes import shell

MB = 1 << 20


def write_levels(layers: SplatLayers, folder: Path, leaf: int = 200) -> Path:
    """The splats as streamed SOG."""
    folder.mkdir(parents=True)
    arrays = (layers.means, layers.scales, layers.wxyz, layers.opacity, layers.sh)
    write_streamed(PlainSplats(*arrays), folder, leaf, "test", lambda part: None)
    return folder


def open_levels(folder: Path, budget: int, cache: int = 64 * MB, **reading) -> SplatLayers:
    """The scene, to be drawn by that budget."""
    return read_model(folder, Reading(leaves=LeafReading(budget, PartCache(cache)), **reading))


def walled() -> SplatLayers:
    """A wall of flat splats over x = -2..2 and y = -1..1 at z = 1, opaque; behind its left half,
    at z = -1, and beside it at the right, x = 2.5..6.5, the same bumpy shell.
    """
    wall = shell(2000, seed=1)
    rng = np.random.default_rng(2)
    means = rng.uniform((-2, -1.2, 0.99), (2, 1.2, 1.01), (2000, 3)).astype(np.float32)
    scales = np.tile(np.array([0.12, 0.12, 0.01], np.float32), (2000, 1))
    upright = np.tile(np.array([1, 0, 0, 0], np.float32), (2000, 1))
    opaque = np.full(2000, 0.99, np.float32)
    wall = replace(wall, means=means, scales=scales, wxyz=upright, opacity=opaque)
    one = shell(3000, seed=3)
    scale = np.float32(0.5)
    places = one.means * scale
    hidden = replace(
        one, means=places + np.array([-1, 0, -1], np.float32), scales=one.scales * scale
    )
    free = replace(
        one, means=places + np.array([3.5, 0, -1], np.float32), scales=one.scales * scale
    )
    parts = (wall, hidden, free)
    names = ("means", "scales", "wxyz", "opacity", "sh", "layer")
    return replace(wall, **{n: np.concatenate([getattr(p, n) for p in parts]) for n in names})


def scene_of(*models: SplatLayers) -> Scene:
    return Scene(tuple(SceneObject(f"object {i}", model) for i, model in enumerate(models)))


def view_at(eye=(0.0, 0.5, 6.0), target=(0.0, 0.0, 0.0), size=(160, 96), fov_y=0.8) -> View:
    return View(look_at(np.array(eye), np.array(target)), perspective(fov_y, size), 0.05, 100, size)


def rest(renderer, view) -> int:
    """Frames of one view until nothing is on its way."""
    for n in range(400):
        if not renderer.draw([view]).streaming.pending:
            return n
        time.sleep(0.002)  # for the thread that reads
    raise AssertionError("still on its way")


def changed_tree(folder: Path, change) -> None:
    """Rewrites lod-meta.json after change(tree: dict)."""
    file = folder / "lod-meta.json"
    tree = json.loads(file.read_text())
    change(tree)
    file.write_text(json.dumps(tree))


def first_leaf(node: dict) -> dict:
    """The first leaf of a tree's node."""
    while "lods" not in node or not node["lods"]:
        node = node["children"][0]
    return node
