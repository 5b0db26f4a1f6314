"""A ground at once: what is solid carries at its height, fog does not, and exact bodies come
without a jump.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.scene.colliders.collider import Collider, box_around, one_hull
from shapeshift.scene.colliders.collider_wrap import is_watertight, volume
from shapeshift.scene.colliders.quick_ground import (
    REACH,
    ground_of_model,
    mended,
    rows_near,
    stood,
)
from shapeshift.scene.document.scene_file import BACKGROUND, HULLS, SceneFile, SceneItem
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import IDENTITY
from shapeshift.scene.world.follow import follow
from shapeshift.scene.world.settle import begin
from shapeshift.scene.world.world import World

SIDE, HIGH, STEP = 0.08, 0.1, 0.01  # metres: of a mug, and of its table's splats
SINKS = 0.006  # metres: the mug's splats reach into the table
FLAT = np.array([0.7071068, -0.7071068, 0.0, 0.0])  # the thin axis, Z, upwards


def splats(places: np.ndarray, scales, opacity: float = 0.9) -> list[np.ndarray]:
    count = len(places)
    return [places, np.tile(scales, (count, 1)), np.tile(FLAT, (count, 1)), np.full(count, opacity)]


def model_of(*parts: list[np.ndarray]) -> SplatLayers:
    means, scales, wxyz, opacity = (
        np.concatenate(each).astype(np.float32) for each in zip(*parts, strict=True)
    )
    count = len(means)
    return SplatLayers(
        means, scales, wxyz, opacity, np.zeros((count, 1, 3), np.float32),
        np.zeros(count, np.int32), (Stop("one", 0.0),),
    )  # fmt: skip


def table(tilt: float = 0.0, hole: float = 0.03) -> list[np.ndarray]:
    """A top of .6 by .6 m at y = 0 and up by `tilt` a metre along x, open under the mug."""
    x, z = np.meshgrid(np.arange(-0.3, 0.3, STEP), np.arange(-0.3, 0.3, STEP))
    places = np.stack([x.ravel(), tilt * x.ravel(), z.ravel()], 1)
    places = places[np.hypot(places[:, 0], places[:, 2]) > hole]
    return splats(places, (STEP, STEP, 1e-4))


def fog() -> list[np.ndarray]:
    """Half a metre of haze over one corner, and one opaque floater in it."""
    rng = np.random.default_rng(1)
    places = rng.uniform((0.1, 0.02, 0.1), (0.28, 0.3, 0.28), (60, 3))
    haze = splats(places, (0.02, 0.02, 0.02), 0.015)
    speck = splats(np.array([[0.2, 0.2, -0.2]]), (1e-3, 1e-3, 1e-3))
    return [np.concatenate(each) for each in zip(haze, speck, strict=True)]


def mug() -> np.ndarray:
    """(V, 3) its rough hull, metres about its middle."""
    angle = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    ring = np.stack([np.cos(angle), np.zeros(16), np.sin(angle)], 1) * SIDE / 2
    low, high = ring.copy(), ring.copy()
    low[:, 1], high[:, 1] = -HIGH / 2 - SINKS * np.linspace(0, 1, 16), HIGH / 2
    return np.concatenate([low, high]).astype(np.float32)


AT = np.array([0.0, HIGH / 2, 0.0])  # its middle: it stands on y = 0


def height_at(ground: Collider, x: float, z: float) -> float:
    """Metres: of the upper side over a place."""
    a, b, c = (ground.mesh.vertices.astype(np.float64)[ground.mesh.faces[:, k]] for k in range(3))
    one, two = b - a, c - a  # (F, 3)
    area = one[:, 0] * two[:, 2] - one[:, 2] * two[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        u = ((x - a[:, 0]) * two[:, 2] - (z - a[:, 2]) * two[:, 0]) / area
        v = ((z - a[:, 2]) * one[:, 0] - (x - a[:, 0]) * one[:, 2]) / area
        over = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
    heights = a[:, 1] + u * one[:, 1] + v * two[:, 1]
    return float(heights[over].max(initial=-np.inf))


@pytest.mark.parametrize("tilt", [0.0, 0.05])
@pytest.mark.parametrize("turned", [False, True])
def test_a_ground_lies_where_splats_stop_the_light(tilt, turned):
    """Nearer than 2 mm, closed under the thing, with no fog or floater in it; in any frame."""
    pose = Pose(np.array([0.4, -0.2, 0.1]), np.array([0.5, 0.5, 0.5, 0.5])) if turned else IDENTITY
    model = model_of(table(tilt), fog())
    if turned:
        own = np.linalg.inv(pose.matrix())
        means = (model.means @ own[:3, :3].T + own[:3, 3]).astype(np.float32)
        half = np.array([0.5, -0.5, -0.5, -0.5])
        model = replace(model, means=means, wxyz=np.tile(turn(half, FLAT), (len(means), 1)))
    ground, (plane,) = ground_of_model(model, 0.0, pose, [mug() + AT])
    assert ground is not None and ground.rough and plane is not None
    assert is_watertight(ground.mesh.faces)
    assert volume(ground.mesh.vertices, ground.mesh.faces) > 0, "faces look outward"
    world = ground.mesh.vertices @ pose.matrix()[:3, :3].T + pose.matrix()[:3, 3]
    ground = replace(ground, mesh=replace(ground.mesh, vertices=world.astype(np.float32)))
    for x, z in ((0, 0), (0.02, 0.01), (0.06, 0), (-0.15, 0.1), (0.2, 0.2), (0.2, -0.2)):
        assert height_at(ground, x, z) == pytest.approx(tilt * x, abs=2e-3), f"{x} {z}"
    assert height_at(ground, 0.5, 0.5) < -1, "beside the table things fall"
    np.testing.assert_allclose(plane.normal, np.array([-tilt, 1, 0]) / np.hypot(tilt, 1), atol=0.02)


def turn(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(4,) float32: the quaternion of b, then a."""
    w, x, y, z = a
    s, i, j, k = b
    return np.array(
        [w * s - x * i - y * j - z * k, w * i + x * s + y * k - z * j,
         w * j - x * k + y * s + z * i, w * k + x * j - y * i + z * s], np.float32
    )  # fmt: skip


def test_nothing_solid_is_no_ground_and_what_hangs_has_no_plane():
    assert ground_of_model(model_of(fog()), 0.0, IDENTITY, [mug() + AT])[1] == (None,)
    assert ground_of_model(model_of(table()), 0.0, IDENTITY, [])[0] is None
    ground, (plane,) = ground_of_model(model_of(table()), 0.0, IDENTITY, [mug() + AT + [0, 0.2, 0]])
    assert ground is not None and plane is None
    far = mug() + AT + [0, 0, 2 * REACH * HIGH]
    assert ground_of_model(model_of(table()), 0.0, IDENTITY, [far])[0] is None
    places = np.full((3, 3), np.nan)
    assert not len(rows_near(places, [mug()], 1)[0])


def test_a_shelf_above_a_thing_is_left_out():
    """It stands on the lower board, and is in no block under the upper one."""
    shelf = table(hole=0.0)
    shelf[0] = shelf[0] + [0, 0.25, 0]
    ground, (plane,) = ground_of_model(model_of(table(), shelf), 0.0, IDENTITY, [mug() + AT])
    assert ground is not None and plane is not None
    assert abs(height_at(ground, 0, 0)) < 2e-3 and abs(height_at(ground, 0.08, 0)) < 2e-3


def test_a_plane_goes_on_under_a_thing_without_ghosts():
    rng = np.random.default_rng(2)
    ghosts = splats(rng.uniform((-0.02, 0.01, -0.02), (0.02, 0.08, 0.02), (50, 3)), (5e-3,) * 3)
    model = model_of(table(), ghosts)
    thing = mug() + AT
    plane = ground_of_model(model, 0.0, IDENTITY, [thing])[1][0]
    columns = (model.means, model.scales, model.wxyz, model.opacity)
    means = mended(columns, IDENTITY, [(thing, plane)])[0]
    inside = np.hypot(means[:, 0], means[:, 2]) < 0.03
    assert inside.sum() > 20 and np.abs(means[inside, 1]).max() < 2e-3


def scene() -> tuple[SceneFile, dict]:
    table_model = model_of(table())
    items = (SceneItem(name="mug", model="mug", collider=HULLS, position=tuple(AT)),)
    under = SceneItem(name=BACKGROUND, model="table", collider=HULLS, static=True)
    file = SceneFile(folder=Path(), items=items, background=under, floor_y=-1.0)
    return file, {"mug": table_model, BACKGROUND: table_model}


def rough_bodies() -> dict[str, Collider]:
    ground, (plane,) = ground_of_model(model_of(table()), 0.0, IDENTITY, [mug() + AT])
    assert ground is not None and plane is not None
    parts, mesh = one_hull(mug())
    pose = Pose(AT, np.array([1.0, 0, 0, 0]))
    return {"mug": stood(Collider(parts, mesh, True), pose.matrix(), plane), BACKGROUND: ground}


@pytest.mark.parametrize("off_mm", [-4.0, -1.0, 0.0, 1.0, 4.0])
def test_a_thing_at_rest_stays_when_exact_bodies_come(off_mm):
    """The exact ground lies off the quick one, and the exact mug reaches into it."""
    file, models = scene()
    rough = rough_bodies()
    world = World(file, models, rough)
    start = world.objects["mug"].pose.position
    begin(world)
    assert not world.findings, "it stands on its table at once"
    for _ in range(60):
        world.step()
    rest = world.objects["mug"].pose.position
    np.testing.assert_allclose(rest, start, atol=1e-3)
    exact = dict(rough)
    for name in ("mug", BACKGROUND):
        if name == "mug":
            exact[name] = Collider((mug(),), rough[name].mesh)
        else:
            low, high = np.array([-0.3, -0.05, -0.3]), np.array([0.3, 1e-3 * off_mm, 0.3])
            box = box_around(np.stack([low, high]))
            exact[name] = Collider((box.vertices,), box)
        follow(world, file, models, exact)
        for _ in range(90):
            world.step()
            moved = world.objects["mug"].pose.position - rest
            assert np.linalg.norm(moved) < 1e-3, f"{name}: {1e3 * moved} mm"


def test_what_is_in_the_air_falls_on_when_exact_bodies_come():
    file, models = scene()
    rough = rough_bodies()
    world = World(file, models, rough)
    world.move_object("mug", Pose(AT + np.array([0, 0.5, 0]), np.array([1.0, 0, 0, 0])))
    for _ in range(9):
        world.step()
    before = world.physics.velocity(world.objects["mug"].body_id)[0]
    follow(world, file, models, rough | {"mug": replace(rough["mug"], rough=False)})
    after = world.physics.velocity(world.objects["mug"].body_id)[0]
    np.testing.assert_allclose(after, before, atol=1e-6)
    assert after[1] < -0.5
