"""Clouds as several objects and as one: scenes for tests of the one sort and of turned objects."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.runtime_models.splats.operations.rotate_splats import rotate_splats
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.splat_scenes import only

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
CYCLE = np.array([0.5, 0.5, 0.5, 0.5])  # wxyz: x to y, y to z, z to x; its matrix is of 0 and 1
ODD = np.array([0.3, -0.5, 0.7, 0.41]) / np.linalg.norm([0.3, -0.5, 0.7, 0.41])


def joined(clouds: list[SplatLayers]) -> SplatLayers:
    """One cloud of all, one behind the other."""
    fields = ("means", "scales", "wxyz", "opacity", "sh", "layer")
    columns = {name: np.concatenate([getattr(c, name) for c in clouds]) for name in fields}
    return replace(clouds[0], **columns)


def dealt(cloud: SplatLayers, count: int) -> list[SplatLayers]:
    """The cloud's splats dealt to `count` objects in turns: wherever one has a splat, all have."""
    return [only(cloud, np.arange(first, len(cloud.means), count)) for first in range(count)]


def in_objects(clouds: list[SplatLayers], poses: list[Pose] | None = None) -> Scene:
    still = Pose(np.zeros(3), UPRIGHT)
    placed = zip(clouds, poses or [still] * len(clouds), strict=True)
    objects = [SceneObject(f"object {i}", c, p, label=i + 1) for i, (c, p) in enumerate(placed)]
    return Scene(tuple(objects))


def exact_cloud(count: int, seed: int = 0) -> SplatLayers:
    """Round splats on a grid of 1/64 m with sizes of powers of two: floats turn and move them
    without rounding by CYCLE and whole metres.
    """
    rng = np.random.default_rng(seed)
    means = rng.integers(-64, 64, size=(count, 3)) / 64
    scales = np.repeat(2.0 ** -rng.integers(3, 7, size=(count, 1)), 3, axis=1)
    arrays = (
        means,
        scales,
        np.tile([1.0, 0, 0, 0], (count, 1)),
        rng.integers(1, 65, count) / 64,
        rng.normal(size=(count, 1, 3)),
    )
    stops = (Stop("only", 0.0),)
    return SplatLayers(*(np.float32(a) for a in arrays), np.zeros(count, np.int32), stops)


def put(cloud: SplatLayers, pose: Pose) -> SplatLayers:
    """The cloud where the pose puts it, harmonics turned with it, as one that stands unposed."""
    arrays = (cloud.means, cloud.scales, cloud.wxyz, cloud.opacity, cloud.sh)
    turned = rotate_splats(PlainSplats(*arrays), pose.matrix()[:3, :3])
    means = (turned.means + pose.position).astype(np.float32)
    return replace(cloud, means=means, wxyz=turned.wxyz, sh=turned.sh)


def straight_view(size: tuple[int, int] = (96, 80), z: float = 5.0) -> View:
    """Along -Z from a place of whole metres: no product of the projection is rounded away."""
    pose = Pose(np.array([0.0, 0.0, z]), UPRIGHT)
    return View(pose, (-0.5, 0.5, -0.5, 0.5), 0.0625, 64.0, size)


def turned_view(view: View, pose: Pose) -> View:
    """The eye as something sees it that has this pose in the world."""
    seen = np.linalg.inv(pose.matrix()) @ view.world_from_eye.matrix()
    return replace(view, world_from_eye=Pose.from_matrix(seen))
