"""Colliders of known shapes made of splats: near, closed, few hulls; and of hardly anything."""

import subprocess
import sys
import time
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.ndimage import distance_transform_edt
from scipy.spatial import ConvexHull

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.scene.colliders import collider
from shapeshift.scene.colliders.collider import (
    Collider,
    Making,
    collider_of_model,
    collider_of_splats,
    mesh_of_splats,
    parts_volume,
)
from shapeshift.scene.colliders.collider_wrap import squared_distances
from shapeshift.scene.colliders.convex_parts import (
    MOST_VERTICES,
    SEARCH,
    cut_into_parts,
    cut_quickly,
)
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh
from tests.support.models import make_random_model
from tests.support.scene.collider_shapes import Cloud, distances, shapes, solid, splatted
from tests.support.splats.scaffold_scenes import random_raw, write_run

FRESH = Making(kept=False)
ROUGH = Making(kept=False, rough=True)


def check_hulls(collider: Collider, most: int = 16) -> None:
    """Each hull is convex (all of its vertices are corners), has a volume and few vertices."""
    assert 1 <= len(collider.parts) <= most
    for hull in collider.parts:
        assert hull.dtype == np.float32 and 4 <= len(hull) <= MOST_VERTICES
        found = ConvexHull(hull.astype(np.float64))
        assert found.volume > 0
        assert len(found.vertices) == len(hull)


def uncovered(collider: Collider, shape: trimesh.Trimesh) -> float:
    """Metres that nearly all of a shape's surface lies within the hulls or less far from them."""
    points, _ = trimesh.sample.sample_surface(shape, 4000, seed=5)
    out = np.full(len(points), np.inf)
    for hull in collider.parts:
        planes = ConvexHull(hull.astype(np.float64)).equations
        out = np.minimum(out, (points @ planes[:, :3].T + planes[:, 3]).max(1))
    return float(np.percentile(out, 99))


# shape: volume to at most (times its own), euler number, hulls at most, their volume at most
EXPECTED = {
    "sphere": (1.03, 2, 1, 1.05),
    "torus": (1.04, 0, 16, 1.15),
    "cube": (1.03, 2, 16, 1.5),
    "L-block": (1.04, 2, 16, 1.4),
    "plate": (1.3, 2, 16, 3.0),
    "two spheres": (1.04, 4, 2, 1.08),
}


@pytest.mark.parametrize("name", ["sphere", "torus", "plate", "two spheres"])
def test_a_known_shape_is_found(name):
    check_shape(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cube", "L-block"])
def test_a_known_shape_with_edges_is_found(name):
    check_shape(name)


def newly_made(name: str) -> Collider:
    return collider_of_splats(*splatted(shapes()[name], floaters=0.01).columns, FRESH)


made_once = cache(newly_made)


def check_shape(name: str) -> None:
    shape = shapes()[name]
    larger, euler, most, hull_volume = EXPECTED[name]
    made = made_once(name)
    mesh = solid(made)
    assert mesh.is_volume and mesh.euler_number == euler
    assert 2000 <= len(mesh.faces) <= 2800
    assert shape.volume * 0.97 <= mesh.volume <= shape.volume * larger
    chamfer, hausdorff = distances(shape, mesh)
    noise, _ = distances(shape, shape)
    assert chamfer - noise < 0.0005  # metres, of 0.2: the samples' own distance taken off
    assert hausdorff < 0.012
    check_hulls(made, most)
    assert shape.volume * 0.95 <= parts_volume(made) <= shape.volume * hull_volume
    assert uncovered(made, shape) < 0.004


def test_the_same_splats_give_the_same_collider():
    one, two = made_once("torus"), newly_made("torus")
    assert one.mesh.vertices.tobytes() == two.mesh.vertices.tobytes()
    assert one.mesh.faces.tobytes() == two.mesh.faces.tobytes()
    assert [h.tobytes() for h in one.parts] == [h.tobytes() for h in two.parts]


def test_a_shell_open_below_is_filled():
    """What stood on a table was never seen from below; it is solid all the same."""
    ball = shapes()["sphere"]
    cloud = splatted(ball)
    seen = cloud.means[:, 1] > -0.075
    made = collider_of_splats(*(column[seen] for column in cloud.columns), FRESH)
    assert solid(made).is_volume
    assert 0.85 * ball.volume < solid(made).volume < 1.05 * ball.volume


def test_far_floaters_haze_and_damage_change_little():
    shape = shapes()["sphere"]
    cloud = splatted(shape)
    rng = np.random.default_rng(1)
    n = 60
    odd = Cloud(
        np.vstack([rng.normal(0, 50, (n, 3)), np.zeros((3, 3))]).astype(np.float32),
        np.vstack([np.full((n, 3), 0.01), np.full((3, 3), 5)]).astype(np.float32),
        np.tile(np.array([1, 0, 0, 0], np.float32), (n + 3, 1)),
        np.full(n + 3, 0.9, np.float32),
    )
    odd.means[0] = np.nan
    odd.opacity[1:3] = np.nan, -1
    both = [np.concatenate(pair) for pair in zip(cloud.columns, odd.columns, strict=True)]
    made = collider_of_splats(*both, FRESH)
    assert solid(made).volume == pytest.approx(shape.volume, rel=0.03)
    assert np.ptp(made.mesh.vertices, axis=0).max() < 0.21


def test_long_splats_that_stand_out_alone_leave_no_spikes():
    """Captures have them below, where nothing was seen; a thing would stand on them."""
    cloud = splatted(shapes()["sphere"])
    needles = Cloud(
        np.array([[0, -0.1, 0], [0.07, -0.07, 0], [0, 0, 0.1]], np.float32),
        np.tile(np.array([0.002, 0.06, 0.002], np.float32), (3, 1)),
        np.array([[1, 0, 0, 0], [0.924, 0, 0, 0.383], [0.707, 0.707, 0, 0]], np.float32),
        np.full(3, 0.9, np.float32),
    )
    both = [np.concatenate(pair) for pair in zip(cloud.columns, needles.columns, strict=True)]
    mesh = mesh_of_splats(*both, FRESH)
    assert np.linalg.norm(mesh.vertices, axis=1).max() < 0.115  # not 0.16


def test_faint_splats_count_where_they_add_up():
    shape = shapes()["sphere"]
    cloud = splatted(shape, 2000)
    opaque = splatted(shapes()["two spheres"], 1500, seed=3)
    faint = np.full(2000, 0.05, np.float32)
    thick = [np.tile(c, (8, *[1] * (c.ndim - 1))) for c in (*cloud.columns[:3], faint)]
    one = collider_of_splats(
        *(np.concatenate(p) for p in zip(opaque.columns, thick, strict=True)), FRESH
    )
    assert np.ptp(one.mesh.vertices, axis=0)[1] == pytest.approx(0.2, abs=0.01)
    thin = [*cloud.columns[:3], np.full(2000, 0.02, np.float32)]
    two = collider_of_splats(
        *(np.concatenate(p) for p in zip(opaque.columns, thin, strict=True)), FRESH
    )
    assert np.ptp(two.mesh.vertices, axis=0)[1] == pytest.approx(0.08, abs=0.01)


@pytest.mark.parametrize("shape", [(1, 1, 1), (5, 1, 9), (20, 33, 17)])
@pytest.mark.parametrize("share", [0.0, 0.002, 0.05, 1.0])
def test_distances_within_reach_are_those_of_scipy(shape, share):
    """Exactly, as they are whole numbers; 15 is the most whose square has a byte."""
    taken = np.random.default_rng(0).random(shape) < share
    taken.flat[-1] = True
    whole = np.rint(distance_transform_edt(~taken) ** 2)
    for reach in (1, 2, 4, 6, 15):
        want = np.where(whole <= reach**2, whole, 255)
        np.testing.assert_array_equal(squared_distances(taken, reach), want)
    assert (squared_distances(np.zeros(shape, bool), 15) == 255).all()


@pytest.fixture
def soon(monkeypatch):
    """CoACD has a second; on clouds of nothing in particular it takes all the time there is."""
    monkeypatch.setattr(collider, "cut_into_parts", partial(cut_into_parts, limit_s=1.0))


@pytest.mark.parametrize("count", [1, 2, 3, 4, 29, 30, 31, 257])
@pytest.mark.parametrize("kind", ["point", "line", "plane", "cloud"])
def test_few_and_flat_splats_have_a_collider(soon, count, kind):
    rng = np.random.default_rng(count)
    means = rng.random((count, 3)).astype(np.float32) * 0.1
    means[:, {"point": [0, 1, 2], "line": [1, 2], "plane": [1], "cloud": []}[kind]] = 0.5
    wxyz = np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1))
    scales = np.full((count, 3), (0.0, 1e-30, 0.003)[count % 3], np.float32)
    for making in (FRESH, ROUGH):
        made = collider_of_splats(means, scales, wxyz, np.ones(count, np.float32), making)
        check_hulls(made)
        assert solid(made).is_volume and made.rough == making.rough
        assert making is FRESH or len(made.parts) == 1


def of_cloud(cloud: Cloud, making: Making | None = None) -> Collider:
    means, scales, wxyz, opacity = cloud.columns
    return collider_of_splats(means, scales, wxyz, opacity, making)


def test_nothing_to_touch_is_one_sentence():
    cloud = splatted(shapes()["sphere"], 100)
    for count, opacity in ((0, 1), (100, 0), (100, -1), (100, np.nan)):
        means, scales, wxyz = [column[:count] for column in cloud.columns[:3]]
        light = np.full(count, opacity, np.float32)
        for making in (FRESH, ROUGH):
            with pytest.raises(BadFile, match="opaque enough to be touched"):
                collider_of_splats(means, scales, wxyz, light, making)


@pytest.mark.parametrize("name", ["sphere", "torus", "cube", "two spheres"])
def test_a_rough_collider_is_the_hull_of_all(name):
    """With floaters and damage; a splat reaches 3 % of its size over the surface, 64 corners of a
    ball lose 6 % of it and are blown up to the same volume.  Nothing is cut, nothing kept.
    """
    shape = shapes()[name]
    cloud = splatted(shape, 5000, floaters=0.01)
    made = of_cloud(cloud, Making(rough=True))
    check_hulls(made, 1)
    want = shape.convex_hull.volume
    assert made.rough and 0.97 * want < parts_volume(made) < 1.2 * want
    assert uncovered(made, shape) < 0.03 * shape.extents.max()
    again = of_cloud(cloud, Making(rough=True))
    assert again.rough


def test_in_place_of_a_rough_collider_what_was_made_before_is_taken():
    cloud = splatted(shapes()["sphere"], 500)
    exact = of_cloud(cloud)
    again = of_cloud(cloud, Making(rough=True))
    assert not again.rough and np.array_equal(again.parts[0], exact.parts[0])


def test_a_rough_place_is_made_as_it_is():
    """One hull of a room would fill it."""
    cloud = splatted(shapes()["sphere"], 500)
    made = of_cloud(cloud, Making(kept=False, rough=True, hollow=True))
    assert not made.rough and len(made.mesh.faces) > 100


def test_told_ends_it_and_leaves_no_process():
    def told(what: str, part: float) -> None:
        heard.append((what, part))
        if "convex" in what and part > 0.001:
            raise KeyboardInterrupt

    heard = []
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        cloud = splatted(shapes()["torus"], 4000)
        collider_of_splats(*cloud.columns, Making(kept=False, progress=told))
    assert time.monotonic() - begun < 20
    assert all(0 <= part <= 1 for _, part in heard)
    assert {what for what, _ in heard} >= {"wrapping the splats", "cutting it into convex pieces"}


def test_the_cutting_ends_with_the_program_that_asked_for_it(tmp_path):
    if find_spec("coacd") is None:
        pytest.skip("coacd is not installed")
    torus = shapes()["torus"]
    np.savez(
        tmp_path / "mesh.npz", vertices=torus.vertices, faces=torus.faces, **SEARCH,
        threshold=0.01, max_convex_hull=64, max_ch_vertex=64,
    )  # fmt: skip
    script = Path(collider.__file__).with_name("coacd_run.py")
    command = [sys.executable, "-P", str(script), str(tmp_path / "mesh.npz"), str(tmp_path / "out")]
    child = subprocess.Popen(command, stdin=subprocess.PIPE)
    time.sleep(1.5)
    assert child.poll() is None
    child.stdin.close()  # as the system does for a program that is killed
    assert child.wait(10) == 1
    assert not (tmp_path / "out").exists()


def test_out_of_time_each_part_is_one_hull():
    torus = shapes()["torus"]
    other = torus.copy()
    other.apply_translation((0.3, 0, 0))
    both = trimesh.util.concatenate([torus, other])
    mesh = TriangleMesh(both.vertices.astype(np.float32), both.faces.astype(np.int32))
    hulls, finished = cut_into_parts(mesh, 16, lambda what, part: None, limit_s=0.0)
    assert not finished and len(hulls) == 2
    assert {round(float(h[:, 0].mean()), 1) for h in hulls} == {0.0, 0.3}


def test_quick_cuts_cover_a_thing_and_no_more():
    """An L of two bars, a box, two boxes apart; the volumes are those of their formulas."""
    bars = [trimesh.creation.box((0.4, 0.1, 0.1)), trimesh.creation.box((0.1, 0.3, 0.1))]
    bars[1].apply_translation((0.15, 0.2, 0))
    box, far = trimesh.creation.box((0.2, 0.1, 0.1)), trimesh.creation.box((0.2, 0.1, 0.1))
    far.apply_translation((0.5, 0, 0))
    for meshes, volume, fewest in ((bars, 0.007, 2), ([box], 0.002, 1), ([box, far], 0.004, 2)):
        both = trimesh.util.concatenate(meshes)
        assert isinstance(both, trimesh.Trimesh)
        mesh = TriangleMesh(both.vertices.astype(np.float32), both.faces.astype(np.int32))
        parts = cut_quickly(mesh, 16)
        made = Collider(parts, mesh)
        check_hulls(made)
        assert fewest <= len(parts) <= 4 and uncovered(made, both) < 1e-3  # metres
        # What hulls reach over cuts is counted twice: half the way between samples, 4 mm here.
        assert volume * 0.98 < parts_volume(made) < volume * 1.15
        assert len(cut_quickly(mesh, 1)) == 1


def test_models_have_colliders_at_their_x(soon, tmp_path):
    scaffold = read_model(write_run(random_raw(), tmp_path / "run"), Reading())
    for model in (make_random_model(), scaffold):
        made = collider_of_model(model, 0.5, FRESH)
        check_hulls(made)
        assert solid(made).is_volume


def test_mass_is_that_of_the_solid():
    made = collider_of_splats(*splatted(shapes()["sphere"]).columns, FRESH)
    found = solid(made)
    assert found.volume == pytest.approx(4 / 3 * np.pi * 0.1**3, rel=0.02)
    assert np.abs(found.center_mass).max() < 0.0005
    inertia = np.diag(found.moment_inertia) / found.mass  # square metres
    assert inertia == pytest.approx(0.4 * 0.1**2, rel=0.02)


@pytest.mark.parametrize(("faces", "hulls"), [(3, 16), (2500, 0), (2500, 65)])
def test_wrong_wishes_are_refused(faces, hulls):
    with pytest.raises(ValueError, match="is asked for"):
        collider_of_splats(*splatted(shapes()["sphere"], 50).columns, Making(faces, hulls))
