"""Scenes as far from zero as survey coordinates are: shown as at zero, written where they were."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.lint.lint_whole import Sample
from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.layers.read_layers import read_layers
from shapeshift.runtime_models.splats.operations.activate import COARSE, FINE, origin_of
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.runtime_models.splats.write_plain import describe_losses, writer_of
from tests.support.splats.ply_files import names_of, random_rows, write_rows

FAR = (5e6 + 0.25, -3_141_592.5, 4e5)  # metres, in the file's axes
DOUBLES = {"x": "double", "y": "double", "z": "double"}
SIGMA = 0.05  # metres


def scene_file(path, place, kinds, count=600, seed=0):
    """A ball of splats about a place."""
    rows = random_rows(count, names_of(4), seed)
    rng = np.random.default_rng(seed)
    for row in rows:
        for axis, number in zip("xyz", place, strict=True):
            row[axis] = float(np.round(row[axis] * 64) / 64) + number  # exact in a double
        for i in range(3):
            row[f"scale_{i}"] = float(np.float32(np.log(SIGMA) + rng.normal(0, 0.3)))
        row["opacity"] = float(np.float32(rng.normal(1, 2)))
    return write_rows(path, rows, kinds)


@pytest.fixture
def near_and_far(tmp_path):
    near = scene_file(tmp_path / "near.ply", (0, 0, 0), DOUBLES)
    return near, scene_file(tmp_path / "far.ply", FAR, DOUBLES)


@pytest.mark.parametrize("up, flip", [("", False), ("+Z", False), ("-X", True)])
def test_a_far_scene_is_the_near_one_about_another_zero(near_and_far, up, flip):
    from shapeshift.runtime_models.splats.operations.rotate_splats import ours_from_file

    near, far = (read_plain(path, Reading(up=up, flip=flip, strict=True)) for path in near_and_far)
    assert near.origin == (0, 0, 0) and near.findings == ()
    assert far.means.dtype == np.float32 and np.abs(far.means).max() < 8
    place = far.means + np.array(far.origin)  # float64, our axes
    want = near.means + ours_from_file(up or "-Y", flip) @ np.array(FAR)
    np.testing.assert_allclose(place, want, atol=1e-6, rtol=0)
    for name in ("scales", "wxyz", "opacity", "sh"):
        np.testing.assert_array_equal(getattr(far, name), getattr(near, name))
    (found,) = far.findings
    assert "far from zero" in found.what and not found.repaired


def test_written_and_read_again_it_is_where_it_was(near_and_far, tmp_path):
    far = read_plain(near_and_far[1])
    write_ply(far, tmp_path / "again.ply")
    again = read_plain(tmp_path / "again.ply")
    assert again.origin == far.origin
    np.testing.assert_array_equal(again.means, far.means)


def test_float32_says_what_it_has_lost(tmp_path):
    far = read_plain(scene_file(tmp_path / "far.ply", FAR, {}))
    assert len(far.findings) == 2 and not any(f.repaired for f in far.findings)
    lost = far.findings[1].what
    assert "steps of 0.5 m" in lost and "its splats are 0.0" in lost
    steps = far.means[:, 0] / 0.5
    np.testing.assert_array_equal(steps, np.round(steps))  # nothing more than that was lost
    assert np.abs(far.means).max() < 8


def test_float32_that_is_fine_enough_says_nothing_of_loss(tmp_path):
    far = read_plain(scene_file(tmp_path / "a.ply", (60_000.0, 0, 0), {}))
    (found,) = far.findings
    assert "far from zero" in found.what and far.origin[0] == pytest.approx(60_000, abs=2)


@pytest.mark.parametrize("ending", [".ply", ".glb", ".splat", ".compressed.ply"])
@pytest.mark.parametrize("place", [FAR, (0.5, 0, -3.0)])
def test_what_rounds_far_places_says_so(near_and_far, ending, place):
    splats = replace(read_plain(near_and_far[0]), origin=place)
    lost = describe_losses(splats, writer_of(Path("a" + ending)))
    if place is FAR and ending in (".splat", ".compressed.ply"):
        assert "steps of 0.5 m" in lost[0].what and ".ply and .glb keep them" in lost[0].done
    else:
        assert lost == ()


def sample(far, half, size) -> Sample:
    low, high = np.full(3, -half), np.full(3, half)
    low[0], high[0] = far - half, far + half
    return Sample(np.full((9, 3), size), np.ones(9, bool), low, high, 1.0)


def test_the_threshold_is_where_steps_are_a_hundredth_of_a_splat():
    far = 1024.0
    step = float(np.spacing(np.float32(far)))
    fine = step / FINE
    while step > FINE * fine:
        fine = np.nextafter(fine, np.inf)
    kind = np.dtype(np.float64)
    assert origin_of(sample(far, 2, fine), kind, "a") == ((0, 0, 0), [])
    origin, found = origin_of(sample(far, 2, fine * (1 - 1e-9)), kind, "a")
    assert origin == (far, 0, 0) and len(found) == 1
    # a scene that reaches from zero to there stays
    assert origin_of(sample(far, far, fine / 2), kind, "a")[0] == (0, 0, 0)
    assert origin_of(sample(far, far - 1e-6, fine / 2), kind, "a")[0] == (far, 0, 0)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_what_is_lost_is_told_of_float32_alone(kind):
    step = float(np.spacing(np.float32(5e6)))
    size = step / COARSE
    assert len(origin_of(sample(5e6, 2, size), np.dtype(kind), "a")[1]) == 1
    smaller = origin_of(sample(5e6, 2, size * 0.999), np.dtype(kind), "a")[1]
    assert len(smaller) == (2 if kind is np.float32 else 1)


def test_far_layers_share_one_zero(tmp_path):
    second = tuple(np.add(FAR, (3, 0, 0)))
    paths = [
        scene_file(tmp_path / "layer0.ply", FAR, DOUBLES),
        scene_file(tmp_path / "layer1.ply", second, DOUBLES, seed=1),
        scene_file(tmp_path / "layer2.ply", FAR, DOUBLES, seed=2),
    ]
    model = read_layers(paths, Reading())
    for i, path in enumerate(paths):
        part = read_plain(path)
        got = model.means[model.layer == i] + np.array(model.origin)
        np.testing.assert_allclose(got, part.means + np.array(part.origin), atol=2e-6, rtol=0)


def layers_of(plain) -> SplatLayers:
    none = np.zeros(len(plain.means), np.int32)
    arrays = (plain.means, plain.scales, plain.wxyz, plain.opacity, plain.sh)
    return SplatLayers(*arrays, none, (Stop("a", 0.0),), origin=plain.origin)


def test_outliers_do_not_frame_the_scene():
    """As MCMC leaves them: 20,000 km away, while the scene is 3 m wide."""
    from shapeshift.scene.cameras.framing import default_view
    from tests.support.splats.lint_scenes import cloud, ours

    raw = cloud(5000, 0.02)
    core = default_view(layers_of(ours(raw)), (640, 360)).world_from_eye.position
    raw.means[::250] *= 2e7 / 1.5
    model = layers_of(ours(raw))
    assert model.origin == (0, 0, 0)
    eye = default_view(model, (640, 360)).world_from_eye.position
    assert np.linalg.norm(eye - core) < 0.2 * np.linalg.norm(core)


def camera_file(path, place):
    """INRIA's cameras.json: one camera 6 m before the scene, in the file's axes."""
    camera = {"id": 0, "img_name": "a", "width": 96, "height": 64, "fx": 80.0, "fy": 80.0}
    camera["position"] = np.add(place, (0.3, -0.2, -6)).tolist()
    camera["rotation"] = np.eye(3).tolist()
    path.write_text(json.dumps([camera]))
    return path


def test_cameras_of_the_file_see_the_same_picture_there(near_and_far, tmp_path):
    from tests.support.program import launch

    pictures = []
    for scene, place in zip(near_and_far, ((0, 0, 0), FAR), strict=True):
        out = tmp_path / scene.stem
        cameras = camera_file(tmp_path / f"{scene.stem}.json", place)
        done = launch(
            "render", scene, "--camera", cameras, "--out", out, "--drawing", "tiles",
            "--context", "none",
        )  # fmt: skip
        if "OpenCL" in done.stderr and done.returncode == 2:
            pytest.skip(done.stderr.strip())
        assert done.returncode == 0, done.stderr
        (picture,) = out.glob("*.png")
        pictures.append(np.asarray(Image.open(picture), np.int32))
    assert pictures[0].max() > 100  # something is seen
    assert np.abs(pictures[0] - pictures[1]).max() <= 1


def test_the_oracle_draws_both_alike(near_and_far):
    from shapeshift.renderer.reference import reference_image
    from shapeshift.renderer.settings import RenderSettings
    from shapeshift.scene.cameras.framing import default_view
    from shapeshift.scene.scene import Scene, SceneObject

    near, far = (layers_of(read_plain(path)) for path in near_and_far)
    shift = np.array(far.origin) - np.array(FAR) * (1, -1, -1)  # the part of a metre
    view = default_view(near, (48, 32))
    pose = replace(view.world_from_eye, position=view.world_from_eye.position - shift)
    views = view, replace(view, world_from_eye=pose)
    pictures = [
        reference_image(Scene((SceneObject("a", model),)), v, RenderSettings())
        for model, v in zip((near, far), views, strict=True)
    ]
    np.testing.assert_allclose(pictures[0], pictures[1], atol=2e-4)
