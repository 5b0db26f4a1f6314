"""A Scaffold-GS scene on its way to the picture: what is decoded when, and equal to the oracle."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.rasterizer.device import NoDevice, open_device
from shapeshift.renderer.colors.color_cache import reach_of_scaffold
from shapeshift.renderer.reference import reference_image
from shapeshift.runtime_models.evaluate import Evaluator, evaluate
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.cameras.framing import default_view, model_points
from shapeshift.scene.control import control_of
from shapeshift.scene.pick import Picker, anchor_places
from shapeshift.scene.pose import Pose, View, look_at, perspective, stereo_pair
from shapeshift.scene.scene import IDENTITY, Scene, SceneObject
from shapeshift.scene.selectors.selector import Painted
from shapeshift.training.evaluation.evaluate import ModelRenderer
from tests.support.renderer.frames import draw_counted
from tests.support.splat_scenes import psnr_db, random_layers
from tests.support.splats.scaffold_scenes import (
    CASES,
    SIZE,
    TURNED,
    from_anchors,
    made,
    seen_from,
    write_run,
)


def in_scene(model, pose: Pose = IDENTITY, **how) -> Scene:
    return Scene((SceneObject("scaffold", model, pose, **how),))


@pytest.mark.parametrize("case", CASES)
def test_tiles_are_the_oracle_from_every_eye(renderer, tmp_path, case):
    scene = in_scene(made(tmp_path, **CASES[case]), TURNED)
    pictures = []
    for eye in ((0, 0.3, 3), (2.5, 0, -1), (0.2, 0.1, 0.9)):
        (image,), stats = draw_counted(renderer, scene, [seen_from(*eye)])
        assert psnr_db(image, reference_image(scene, seen_from(*eye))) > 80
        assert stats.drawn > 20
        pictures.append(image)
    assert psnr_db(pictures[0], pictures[1]) < 40


def test_beside_other_objects_in_one_order(renderer, tmp_path):
    one = made(tmp_path / "a", anchors=40)
    both = Scene((
        SceneObject("scaffold", one, TURNED), SceneObject("layers", random_layers(200, seed=1)),
        SceneObject("again", one, Pose(np.array([-0.4, 0, 0]), np.array([1.0, 0, 0, 0]))),
    ))  # fmt: skip
    view = seen_from(0, 0.3, 3)
    (image,), stats = draw_counted(renderer, both, [view])
    assert psnr_db(image, reference_image(both, view)) > 80
    assert stats.geometry_runs == 3


@pytest.mark.parametrize("order", ["depth", "distance"])
def test_each_eye_sees_the_splats_that_it_sees_alone(renderer, tmp_path, order):
    """Opacities, scales and rotations follow it as well: eyes are drawn one after the other."""
    one = made(tmp_path, anchors=60)
    both = Scene((SceneObject("scaffold", one, TURNED), SceneObject("layers", random_layers(200))))
    pair = stereo_pair(seen_from(0.3, 0.3, 2), 0.064)
    images, stats = draw_counted(renderer, both, pair, order=order)
    assert (stats.geometry_runs, stats.color_runs) == (3, 4)  # layers stay where they are
    assert (stats.sorts, stats.color_sets) == (2, 2)
    again, stats = draw_counted(renderer, both, pair, order=order)
    assert stats.geometry_runs == 2
    for eye, image, same in zip(pair, images, again, strict=True):
        (by_itself,), _ = draw_counted(renderer, both, [eye], order=order)
        np.testing.assert_array_equal(image, by_itself)
        np.testing.assert_array_equal(same, by_itself)


def test_shared_both_eyes_are_decoded_once_for_their_middle(renderer, tmp_path):
    scene, view = in_scene(made(tmp_path, anchors=60)), seen_from(0.3, 0.3, 2)
    pair = stereo_pair(view, 0.064)
    images, stats = draw_counted(renderer, scene, pair, stereo_colors="shared")
    assert (stats.geometry_runs, stats.color_runs, stats.color_sets) == (1, 1, 1)
    for image, eye in zip(images, pair, strict=True):
        middle = reference_image(scene, eye, eye=view.world_from_eye.position)
        assert psnr_db(image, middle) > 80


def test_decoded_again_only_when_the_eye_moves_far_enough(renderer, tmp_path):
    scene = in_scene(made(tmp_path, anchors=60))
    far = [seen_from(3 * np.sin(a), 0.2, 3 * np.cos(a)) for a in np.radians([0, 1, 3.5, 3.5])]
    runs = [draw_counted(renderer, scene, [view])[1].geometry_runs for view in far]
    assert runs == [1, 1, 1, 0]
    runs, images = [], []
    draw_counted(renderer, Scene(()), [far[0]])
    for view in far:
        (image,), stats = draw_counted(renderer, scene, [view], recolor_degrees=2.0)
        runs.append((stats.geometry_runs, stats.color_runs))
        images.append(image)
    assert runs == [(1, 1), (0, 0), (1, 1), (0, 0)]
    # Kept: the splats are those of the first eye, not of its own.
    kept = reference_image(scene, far[1], eye=far[0].world_from_eye.position)
    assert psnr_db(images[1], kept) > 80 > psnr_db(images[1], reference_image(scene, far[1]))
    assert psnr_db(images[2], reference_image(scene, far[2])) > 80


@pytest.mark.parametrize("case", CASES)
def test_only_what_is_in_view_is_decoded_and_the_picture_is_the_same(renderer, tmp_path, case):
    """From inside, turning: bit for bit the same, and decoded again when something comes in."""
    how = CASES[case] | {"anchors": 600}
    model = made(tmp_path, **how)
    model = replace(model, scales=model.scales * 0.2, offsets=model.offsets * 0.2)
    scene, eye = in_scene(model, TURNED), np.array([0.1, 0.0, 0.2])
    turns = [0.0, 0.05, 1.5, 1.5, 0.0]
    views = [
        View(look_at(eye, eye + ahead), perspective(0.6, SIZE), 0.01, 50, SIZE)
        for ahead in np.stack([np.sin(turns), np.full(5, 0.1), np.cos(turns)], 1)
    ]
    draw_counted(renderer, Scene(()), views[:1])
    whole = [draw_counted(renderer, scene, [view])[0][0] for view in views]
    draw_counted(renderer, Scene(()), views[:1])
    runs = []
    for view, image in zip(views, whole, strict=True):
        (same,), stats = draw_counted(renderer, scene, [view], skip_unseen=True)
        assert np.array_equal(same, image)
        runs.append(stats.geometry_runs)
    assert runs[0] == runs[2] == runs[4] == 1
    assert runs[3] == 0
    # Which anchors were decoded; the picture is the same either way.
    seen = renderer._decoded[0].colored[0].anchors
    assert 0 < seen.sum() < len(seen) / 2
    _, stats = draw_counted(renderer, scene, [views[0]])
    assert stats.geometry_runs == 1  # all are wanted now
    assert draw_counted(renderer, scene, [views[2]])[1].geometry_runs == 0


def test_coming_nearer_counts_as_turning_does(renderer, tmp_path):
    """Levels and networks go by the distance, too: 2 degrees are 3.5 % of it."""
    scene = in_scene(made(tmp_path, anchors=120, levels=4))
    centre = scene.objects[0].model.anchors.mean(axis=0)
    draw_counted(renderer, Scene(()), [seen_from(0, 0, 3)])
    runs = []
    for away in (3.0, 2.95, 2.85, 2.85 * 1.03, 2.85 * 1.04):
        eye = centre + away * np.array([0, 0, 1])
        view = View(look_at(eye, centre), perspective(0.8, SIZE), 0.05, 50.0, SIZE)
        runs.append(draw_counted(renderer, scene, [view], recolor_degrees=2.0)[1].geometry_runs)
    assert runs == [1, 0, 1, 0, 1]


def test_no_splat_reaches_beyond_what_is_known_beforehand(tmp_path):
    model = made(tmp_path, anchors=300)
    reach = reach_of_scaffold(model, 1 / 255)
    for eye in np.random.default_rng(0).normal(size=(8, 3)) * 3:
        splats = evaluate(model, 0.0, eye)
        away = np.linalg.norm(splats.means - np.repeat(model.anchors, 3, axis=0), axis=1)
        sigma = splats.scales.max(axis=1)
        cut = np.sqrt(2 * np.log(np.maximum(splats.opacity * 255, 1)))
        there = splats.opacity > 0
        assert (away + cut * sigma <= np.repeat(reach, 3))[there].all()


def test_the_slider_decodes_nothing(renderer, tmp_path):
    model, view = made(tmp_path, anchors=60), seen_from(0, 0.2, 3)
    draw_counted(renderer, in_scene(model), [view])
    (image,), stats = draw_counted(renderer, in_scene(model, x=0.7), [view])
    assert stats.geometry_runs == 0
    part = Painted.of(range(10), 60, 1.0)
    assert control_of(SceneObject("s", model, selectors=(part,))).shape == (60,)
    selected = in_scene(model, selectors=(part,))
    (same,), stats = draw_counted(renderer, selected, [view], skip_unseen=True)
    assert stats.geometry_runs == 0
    assert np.array_equal(image, same)


def test_a_packages_scene_as_a_run_shows_the_same(renderer, tmp_path):
    """The bundled demo, converted to a Scaffold-GS run at x = 0: at least 60 dB.

    Without the anchors' own axes and sizes, and without the few anchors whose largest scale is held
    at a package's limit: a run has neither.
    """
    demo = read_model(Path(__file__).resolve().parents[2] / "assets" / "workshop.shift")
    demo, head = replace(demo, frames=None), demo.networks["scale"]
    scales = evaluate(demo, 0.0, np.ones(3)).scales.reshape(len(demo.anchors), -1)
    free = scales.max(axis=1) < 0.999 * head.gain * np.exp(head.clip[1])
    assert free.mean() > 0.99
    demo = demo.with_anchors(free)
    run = read_model(write_run(from_anchors(demo, 0.0), tmp_path / "run", "split"))
    view = default_view(demo, (320, 180))
    (image,), _ = draw_counted(renderer, in_scene(demo), [view])
    (same,), _ = draw_counted(renderer, in_scene(run), [view])
    assert psnr_db(same, image) > 60


def test_held_out_photos_are_compared_from_their_own_eyes(tmp_path):
    """launch.py eval draws with the rasterizer alone."""
    try:
        painter = ModelRenderer(open_device(), model := made(tmp_path, anchors=60))
    except NoDevice as reason:
        pytest.skip(str(reason))
    assert painter.set_control(0.0) == 180
    for eye in ((0, 0.3, 3), (2.5, 0, -1)):
        picture = painter.picture(seen_from(*eye), (0.0, 0.0, 0.0))
        wanted = reference_image(in_scene(model), seen_from(*eye))[..., :3]
        assert psnr_db(picture, wanted) > 60


def test_framing_and_picking(tmp_path, monkeypatch):
    model = made(tmp_path, anchors=60)
    assert np.array_equal(anchor_places(model), model.anchors)
    assert len(model_points(model)[0]) == 60
    scene, picker = in_scene(model, TURNED), Picker()
    decode, given = Evaluator.geometry, []
    monkeypatch.setattr(
        Evaluator,
        "geometry",
        lambda *a, **named: given.append(decode(*a, **named)) or given[-1],
    )
    eye = np.array([0.0, 0.2, 3.0])
    hit = picker.under(scene, eye, TURNED.position - eye)
    assert hit is not None
    assert 1 < hit.depth < 4
    object_from_world = np.linalg.inv(TURNED.matrix())
    there = object_from_world[:3, :3] @ eye + object_from_world[:3, 3]
    assert len(given) == 1
    picker.under(scene, eye, np.array([0.1, 0, -1.0]))
    assert len(given) == 1
    picker.under(scene, -eye, np.array([0.1, 0, 1.0]))
    assert len(given) == 2
    monkeypatch.undo()
    assert np.array_equal(given[0][3], evaluate(model, 0.0, there).opacity)
