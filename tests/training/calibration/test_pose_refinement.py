"""Poses learned with the scene: their gradient, their steps, and that a run keeps them."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.training.baselines.plain import one_modality
from shapeshift.training.calibration.extrinsics import (
    about_pivot,
    moved_by,
    offset_view,
    slope_about_pivot,
    small_move,
)
from shapeshift.training.calibration.pose_refinement import (
    DECAY,
    EVERY,
    FROM,
    KEPT,
    MOST,
    PACE,
    PoseGradient,
    PoseRefinement,
)
from shapeshift.training.drawing import camera_of
from shapeshift.training.first_anchors.views import pixel_of
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import SSIM_SHARE, ImageLoss
from shapeshift.training.photos import LoadedPhoto
from shapeshift.training.settings import TrainSettings
from shapeshift.training.step import TrainingStep
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer
from tests.support.renderer.rasterizer_reference import finite_differences
from tests.support.training.reference import decode_reference, step_loss_reference
from tests.support.training.situations import (
    BACKGROUND,
    LAYOUT,
    MIN_OPACITY_SHARE,
    OTHERS,
    SIZE,
    VOXEL,
    situation,
)
from tests.support.training.training_runs import bits, run, run_keeping

DISTANCE = 3.1  # metres


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("layout", [LAYOUT, OTHERS["colour alike from everywhere"]])
def test_each_of_the_six_numbers_by_differences_of_the_reference(device, layout, seed):
    """Of the whole loss: what colours see of the eye's place is in it."""
    parameters, control, stated, rgba = situation(seed, layout)
    view = offset_view(stated, moved_by(np.array([0.1, -0.05, 0.2, 0.1, 0.05, -0.2])))
    adam = Adam(device, parameters, {name: np.ones(1) for name in parameters})
    step = TrainingStep(device, layout, VOXEL, adam)
    step.pose_gradient = PoseGradient(device)
    loss = ImageLoss(device, SIZE)
    target = loss.target(device.upload(rgba), BACKGROUND)
    drawing = step.draw(view, control, BACKGROUND)
    step.gradients(drawing, loss, target, min_opacity_share=MIN_OPACITY_SHARE)
    found = slope_about_pivot(step.pose_gradient.by_eye, DISTANCE)

    def loss_at(six: np.ndarray) -> float:
        moved = offset_view(view, about_pivot(six, DISTANCE))
        eye = moved.world_from_eye.position
        splats = decode_reference(layout, parameters, control, eye, VOXEL)
        shares = SSIM_SHARE, MIN_OPACITY_SHARE
        return step_loss_reference(
            splats, camera_of(moved), rgba[..., :3] / 255, BACKGROUND, shares
        )

    wanted = finite_differences(loss_at, np.zeros(6)).ravel()
    # Sums of float32 of both signs: 1e-4 of the largest
    assert np.abs(found - wanted).max() < 1e-4 * np.abs(wanted).max(), (found, wanted)


def photo_of(name: str) -> LoadedPhoto:
    return LoadedPhoto(situation(0)[2], "RGB", np.zeros((18, 21, 4), np.uint8), None, name)


def probed(photos: list[LoadedPhoto], curvature: float) -> PoseRefinement:
    """One whose probes have all shown the same curvature."""
    poses = PoseRefinement({"RGB": photos})
    for _ in range(KEPT):
        aside = poses.probe(photos[0], FROM)
        poses.note_probe(photos[0], aside, about_eye(curvature * aside, poses.distance))
        poses.step(photos[0], np.zeros(6), FROM)
    return poses


def about_eye(slope: np.ndarray, distance: float) -> np.ndarray:
    """The gradient by the eye's own turn and shift that is `slope` about the pivot."""
    shift = slope[3:] / distance
    return np.concatenate([slope[:3] + np.cross((0, 0, -distance), shift), shift])


def test_a_step_is_that_of_newton_for_one_camera_and_no_other():
    photos = [photo_of("a"), photo_of("b")]
    poses = probed(photos, 40.0)
    np.testing.assert_array_equal(poses.moved, np.tile(np.eye(4), (2, 1, 1)))
    slope = 0.04 * np.array([0.3, -0.2, 0.1, 0.5, -1.0, 0.2])
    poses.step(photos[0], about_eye(slope, poses.distance), 0.5)
    found = small_move(poses.moved[0], poses.distance)
    np.testing.assert_allclose(found, -PACE * DECAY**0.5 * slope / 40, atol=1e-6)
    np.testing.assert_array_equal(poses.moved[1], np.eye(4))
    from_stated = np.linalg.inv(photos[0].view.world_from_eye.matrix())
    moved = from_stated @ poses.view(photos[0]).world_from_eye.matrix()
    np.testing.assert_allclose(moved, poses.moved[0], atol=1e-12)
    before = np.abs(found).max()
    for _ in range(400):  # a gradient of nothing: the spring brings the camera back
        poses.step(photos[0], np.zeros(6), 0.5)
    assert np.abs(small_move(poses.moved[0], poses.distance)).max() < 0.1 * before


@pytest.mark.parametrize("size", [1e3, 1e30, 1e200])
def test_no_step_is_larger_than_the_largest(size):
    poses = probed([photo := photo_of("a")], 1.0)
    poses.step(photo, size * np.ones(6), FROM)
    assert np.abs(small_move(poses.moved[0], poses.distance)).max() <= 1.01 * MOST


@pytest.mark.parametrize("curvature", [0.0, -3.0, np.nan])
def test_a_curvature_that_is_none_moves_nothing(curvature):
    poses = probed([photo := photo_of("a")], curvature)
    poses.step(photo, np.ones(6), 0.5)
    np.testing.assert_array_equal(poses.moved[0], np.eye(4))


def test_what_is_not_finite_too_early_or_unknown_moves_nothing():
    poses = probed([photo := photo_of("a")], 1.0)
    other = photo_of("b")
    poses.step(photo, np.array([1.0, np.nan, 0, 0, 0, 0]), 0.5)
    poses.step(photo, np.ones(6), np.nextafter(FROM, 0))
    poses.step(other, np.ones(6), 0.5)
    assert poses.view(other) is other.view and poses.probe(other, 0.5) is None
    np.testing.assert_array_equal(poses.moved[0], np.eye(4))
    poses.step(photo, np.ones(6), FROM)
    assert not np.array_equal(poses.moved[0], np.eye(4))


def test_probes_lie_half_a_pixel_aside_and_come_more_rarely():
    poses = PoseRefinement({"RGB": [photo := photo_of("a")]})
    assert poses.probe(photo, np.nextafter(FROM, 0)) is None
    asked = []
    for visit in range(2 * EVERY):
        if (aside := poses.probe(photo, 0.5)) is not None:
            asked.append(visit)
            camera, fx, fy, *_ = poses.view(photo, aside).pinhole()
            ahead = photo.view.world_from_eye.matrix() @ [0, 0, -poses.distance, 1]
            x, y, z, _ = camera @ ahead
            assert np.hypot(fx * x / z, fy * y / z) == pytest.approx(0.5, rel=1e-6)
            poses.note_probe(photo, aside, np.ones(6))
        poses.step(photo, np.zeros(6), 0.5)
    assert asked == [*range(KEPT), EVERY]


def test_of_another_run_nothing_is_loaded():
    poses, other = probed([photo_of("a")], 2.0), PoseRefinement({"RGB": [photo_of("a")] * 2})
    other.load(poses.state())
    assert np.isnan(other.curvature).all()
    again = PoseRefinement({"RGB": [photo_of("a")]})
    again.load(poses.state())
    assert all(np.array_equal(again.state()[n], a) for n, a in poses.state().items())
    assert PoseRefinement({}).state() == {}


SETTINGS = TrainSettings(iterations=260, max_anchors=1500, grow_every=40, poses="refine")


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    """RGB alone, every camera turned by a degree: 1.4 pixels."""
    capture = make_balls(tmp_path_factory.mktemp("balls"), size=64, views=16, test_views=4)
    rng, photos = np.random.default_rng(3), []
    for photo in one_modality(capture, "RGB").photos:
        turn = rng.normal(size=3)
        six = np.concatenate([np.deg2rad(1.0) * turn / np.linalg.norm(turn), np.zeros(3)])
        wrong = offset_view(photo.view, moved_by(six))
        photos.append(replace(photo, view=wrong) if photo.split == "train" else photo)
    return replace(one_modality(capture, "RGB"), photos=tuple(photos)), capture


def pixels_off(trainer: Trainer, true) -> float:
    """Mean pixels between where true and refined cameras see the middle of the scene."""
    views = {str(photo.path): photo.view for photo in true.photos}
    middle, off = np.zeros((1, 3)), []
    for photo in trainer.schedule.photos["RGB"]:
        right = views[photo.name].divided(trainer.factor)
        here, there = (pixel_of(v, middle)[0] for v in (right, trainer.poses.view(photo)))
        off.append(np.linalg.norm(here - there))
    return float(np.mean(off))


def test_refined_poses_go_on_with_the_same_bits(device, balls, tmp_path):
    settings = replace(SETTINGS, iterations=40)
    refined, kept = run_keeping(Trainer(device, balls[0], settings), tmp_path, 21)
    assert pixels_off(refined, balls[1]) != pixels_off(
        Trainer(device, *balls[:1], settings), balls[1]
    )
    assert bits(run(Trainer(device, balls[0], settings, *kept))) == bits(refined)


@pytest.mark.slow
def test_wrong_poses_come_nearer_and_pictures_are_better(device, balls, tmp_path):
    wrong, true = balls
    plain = run(Trainer(device, wrong, replace(SETTINGS, poses="stated")))
    refined, kept = run_keeping(Trainer(device, wrong, SETTINGS), tmp_path, 131)
    before, after = (pixels_off(trainer, true) for trainer in (plain, refined))
    gain = refined.held_out_psnr(9)["RGB"] - plain.held_out_psnr(9)["RGB"]
    assert after < before / 3, (before, after)  # 1.10 and 0.24 pixels
    assert gain > 2.5, gain  # 5.1 dB
    # Interrupted and resumed: the same bits.
    resumed = run(Trainer(device, wrong, SETTINGS, *kept))
    assert bits(resumed) == bits(refined)
