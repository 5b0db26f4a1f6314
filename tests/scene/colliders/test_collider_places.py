"""Colliders of places: a room that one is in stays open, what stands on a floor is filled."""

import sys
import tracemalloc

import numpy as np
import pytest
import trimesh
from trimesh import creation

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.colliders.collider import (
    Making,
    collider_of_mesh,
    collider_of_splats,
    mesh_of_splats,
)
from shapeshift.scene.colliders.collider_wrap import is_watertight, volume
from shapeshift.scene.colliders.convex_parts import run_coacd, thick
from shapeshift.scene.world.physics import Physics
from shapeshift.scene.world.physics_shapes import engine
from tests.support.scene.collider_shapes import Cloud, refined, splatted
from tests.support.scene.physics_things import at, box, run

FRESH = Making(kept=False)
ROOM = Making(kept=False, hollow=True, faces=10_000)


def room(count: int = 60_000) -> Cloud:
    """Walls, floor and ceiling of 4 by 2.4 by 3 m from within, and a table of 0.7 m in it."""
    walls = creation.box((4, 2.4, 3))
    table = creation.box((1, 0.04, 0.8))
    table.apply_translation((0.5, -0.5, 0))
    parts = splatted(refined(walls), count), splatted(refined(table), count // 10)
    columns = zip(*(part.columns for part in parts), strict=True)
    return Cloud(*(np.concatenate(pair) for pair in columns))


def test_a_room_is_hollow_and_its_floor_walls_and_table_carry():
    pytest.importorskip("rapier3d", reason="the physics engine is not installed")
    made = collider_of_splats(*room().columns, ROOM)
    assert is_watertight(made.mesh.faces) and 5000 < len(made.mesh.faces) <= 11_000
    assert 0 < volume(made.mesh.vertices, made.mesh.faces) < 0.15 * 4 * 2.4 * 3  # walls alone
    assert len(made.parts) == 1
    physics = Physics()
    physics.add_static(made.mesh, at(0, 0, 0))
    on_floor = physics.add_body([box(0.05, 0.05, 0.05)], at(-1, 0, 0.4), 0.3)
    on_table = physics.add_body([box(0.05, 0.05, 0.05)], at(0.5, 0, 0.1), 0.3)
    thrown = physics.add_body([box(0.05, 0.05, 0.05)], at(-1, 0.5, -0.4), 0.3)
    physics.set_velocity(thrown, (-12, 2, -3))
    run(physics, 4)
    assert physics.pose(on_floor).position[1] == pytest.approx(-1.15, abs=0.03)
    assert physics.pose(on_table).position[1] == pytest.approx(-0.43, abs=0.03)
    assert (np.abs(physics.pose(thrown).position) < (2, 1.2, 1.5)).all()


def test_the_same_room_as_an_object_is_solid():
    mesh = mesh_of_splats(*room(20_000).columns, FRESH)
    assert volume(mesh.vertices, mesh.faces) == pytest.approx(4 * 2.4 * 3, rel=0.1)


def test_a_small_piece_beside_a_large_one_is_kept_and_floaters_are_not():
    ground = splatted(refined(creation.box((2, 0.1, 2))), 40_000)
    ball = creation.icosphere(3, 0.12)
    ball.apply_translation((0.4, 0.5, 0))
    columns = zip(ground.columns, splatted(ball, 3000, floaters=0.02).columns, strict=True)
    mesh = mesh_of_splats(*(np.concatenate(pair) for pair in columns), FRESH)
    assert mesh.vertices[:, 1].max() == pytest.approx(0.62, abs=0.03)
    assert trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).body_count == 2


def test_a_mesh_file_of_a_place_stays_as_it_is(tmp_path):
    mesh = creation.box((4, 2.4, 3))
    mesh.invert()  # seen from within
    mesh.update_faces(mesh.face_normals[:, 1] > -0.5)  # no ceiling
    mesh.export(tmp_path / "room.obj")
    made = collider_of_mesh(tmp_path / "room.obj", ROOM)
    assert len(made.mesh.faces) == 10
    assert np.ptp(made.mesh.vertices, axis=0) == pytest.approx((4, 2.4, 3))
    assert len(made.parts) == 1


@pytest.mark.parametrize("count", [1, 2, 3, 4, 27_000])
def test_points_are_thickened_in_memory_that_grows_as_they_do(count):
    """A background has so many corners: a (V, V) matrix of them would be 5.8 GB."""
    points = np.random.default_rng(0).normal(size=(count, 3)) * (1, 1, 1e-4)
    tracemalloc.start()
    made = thick(points, 1e-3)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 20 * points.nbytes + 20_000
    ways = {1: 3, 2: 2, 3: 1}.get(count, 1)  # a point is thickened every way, a plane across
    assert len(made) == count * 2**ways
    axes = np.linalg.eigh(np.cov(made.T))[1].T
    assert min(np.ptp(made @ axis) for axis in axes) >= 1e-3 * (1 - 1e-6)


def test_without_the_packages_there_is_one_sentence(monkeypatch, tmp_path):
    (tmp_path / "coacd.py").write_text("raise ImportError('no such library')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    torus = creation.torus(0.07, 0.03)
    mesh = mesh_of_splats(*splatted(torus, 2000).columns, FRESH)
    with pytest.raises(
        BadFile,
        match=r"coacd does not load \(no such library\); `.* install coacd`",
    ):
        run_coacd(mesh, 16, lambda what, part: None, 20.0)
    monkeypatch.setitem(sys.modules, "rapier3d", None)
    with pytest.raises(BadFile, match="rapier3d does not load"):
        engine()
    with pytest.raises(BadFile, match="-m pip install rapier3d`"):
        Physics()
