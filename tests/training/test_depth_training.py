"""Depth photos in training: the loss, the whole step's gradients, and what they are good for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.training.evaluate import print_table
from shapeshift.rasterizer.device import open_device
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.captures.depth_photo import load_depth
from shapeshift.training.baselines.plain_step import GROUPS, PlainStep
from shapeshift.training.drawing import camera_of
from shapeshift.training.evaluation.evaluate import evaluate_model, report
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import ImageLoss
from shapeshift.training.losses.surface_losses import DepthLoss, DepthTerm
from shapeshift.training.photos import read
from shapeshift.training.settings import TrainSettings
from shapeshift.training.step import TrainingStep
from shapeshift.training.supervision.targets import Targets
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer
from tests.support.renderer.surface_reference import render_depth_reference
from tests.support.training.depth_photos import depth_error, depth_loss_reference, depth_photo
from tests.support.training.plain_situations import situation as plain_situation
from tests.support.training.reference import (
    decode_plain_reference,
    decode_reference,
    differences,
    image_loss_reference,
)
from tests.support.training.situations import BACKGROUND, LAYOUT, SIZE, VOXEL, situation

SHARE = 0.7


@pytest.mark.parametrize("seed", [1])
def test_every_gradient_of_a_step_with_depth(device, seed):
    parameters, control, view, rgba = situation(seed)
    depth, size = depth_photo(seed), SIZE
    camera, photo = camera_of(view), rgba[..., :3] / 255

    def decode(values):
        return decode_reference(LAYOUT, values, control, view.world_from_eye.position, VOXEL)

    def loss(splats):
        image, through, metres = render_depth_reference(splats, camera, BACKGROUND)
        shown = image_loss_reference(image.transpose(1, 2, 0), photo, 0.2)
        return shown + SHARE * depth_loss_reference(metres, through, depth)

    rates = {name: np.array([1.0], np.float32) for name in parameters}
    step = TrainingStep(device, LAYOUT, VOXEL, Adam(device, parameters, rates))
    image_loss, depth_loss = ImageLoss(device, size), DepthLoss(device, size)
    drawing = step.draw(view, control, BACKGROUND, with_depth=True)
    target = image_loss.target(device.upload(rgba), BACKGROUND)
    term = DepthTerm(depth_loss, depth_loss.target(depth), SHARE)
    grads = step.gradients(drawing, image_loss, target, depth=term, min_opacity_share=0.0)
    total = image_loss.value() + SHARE * depth_loss.value()
    assert total == pytest.approx(loss(decode(parameters)), rel=1e-4)
    wanted = differences(loss, decode, parameters, LAYOUT, 1e-7)
    for name, grad in grads.items():
        have = device.download(grad).astype(np.float64)
        error = np.abs(have - wanted[name]).max() / np.abs(wanted[name]).max()
        assert error < 2e-5, (name, error)


def test_every_gradient_of_plain_splats_with_depth(device):
    parameters, view, rgba = plain_situation(1, 0)
    depth, camera, photo = depth_photo(3), camera_of(view), rgba[..., :3] / 255

    def decode(values):
        return decode_plain_reference(values, view.world_from_eye.position, 0)

    def loss(splats):
        image, through, metres = render_depth_reference(splats, camera, BACKGROUND)
        shown = image_loss_reference(image.transpose(1, 2, 0), photo, 0.2)
        return shown + SHARE * depth_loss_reference(metres, through, depth)

    adam = Adam(device, parameters, dict.fromkeys(GROUPS, np.ones(1)))
    step, image_loss, depth_loss = (
        PlainStep(device, adam, 0), ImageLoss(device, SIZE), DepthLoss(device, SIZE)
    )  # fmt: skip
    target = image_loss.target(device.upload(rgba), BACKGROUND)
    term = DepthTerm(depth_loss, depth_loss.target(depth), SHARE)
    drawing = step.draw(view, BACKGROUND, with_depth=True)
    grads = step.gradients(drawing, image_loss, target, None, term)
    wanted = differences(loss, decode, parameters, step=1e-7)
    for name in ("means", "scales", "wxyz", "opacity", "base"):
        have = device.download(grads[name]).astype(np.float64)
        error = np.abs(have - wanted[name]).max() / np.abs(wanted[name]).max()
        assert error < 2e-5, (name, error)


@pytest.fixture(scope="module")
def balls(tmp_path_factory) -> Capture:
    return make_balls(tmp_path_factory.mktemp("balls"), 64, 12, 3, depth=True)


def test_the_depth_photos_of_the_balls_are_exact(balls):
    photo = balls.photos[0]
    depth = load_depth(photo)
    _, fx, fy, cx, cy = photo.view.pinhole()
    y, x = np.nonzero(depth)
    rays = np.stack([(x + 0.5 - cx) / fx, -(y + 0.5 - cy) / fy, -np.ones(len(x))], axis=1)
    to_world = photo.view.world_from_eye.matrix()
    points = (rays * depth[y, x][:, None]) @ to_world[:3, :3].T + to_world[:3, 3]
    on_floor = points[:, 1] < 0.002  # the disc lies at 0
    assert on_floor.mean() > 0.2 and points[:, 1].min() > -0.002
    assert np.abs(points).max() < 1.2
    nearest = np.linalg.norm(points - [-0.45, 0.35, 0.25], axis=1).min()
    assert abs(nearest - 0.35) < 0.002  # the red ball


def test_depth_follows_its_photo_through_masks_and_sizes(balls):
    photo = balls.photos[0]
    loaded = read(photo, 2, "object")
    assert loaded.depth.shape == (32, 32) and loaded.depth.any()
    targets = Targets(open_device("cpu"))
    assert targets.depth_term(loaded, 0.0) is None
    assert targets.depth_term(replace(loaded, depth=None), 0.1) is None
    first = targets.depth_term(loaded, 0.1)
    assert targets.depth_term(loaded, 0.1).target is first.target
    assert first.target.known == (loaded.depth > 0).sum()
    nothing = replace(loaded, name="other", depth=loaded.depth * 0)
    assert targets.depth_term(nothing, 0.1) is None
    covered = read(replace(photo, mask=black_half(photo.path)), 1, "object").depth
    assert covered[:, 32:].any() and not covered[:, :32].any()


def black_half(photo: Path) -> Path:
    """A mask without the left half."""
    mask = np.zeros((64, 64), np.uint8)
    mask[:, 32:] = 255
    path = photo.with_name("mask.png")
    Image.fromarray(mask).save(path)
    return path


def trained(device, capture, **changes) -> Trainer:
    settings = TrainSettings(iterations=60, max_anchors=400, grow=False, **changes)
    trainer = Trainer(device, capture, settings)
    for _ in trainer.steps():
        pass
    return trainer


def test_depth_photos_bring_the_depth_nearer(device, balls):
    """Where the first points are a visual hull; measured once: 0.084 against 0.233."""
    hull = replace(balls, points=None, point_colors=None)
    with_depth, without = (trained(device, hull, depth_share=share) for share in (0.3, 0.0))
    one, other = depth_error(with_depth), depth_error(without)
    assert one < 0.8 * other, (one, other)


def test_without_depth_photos_or_a_share_the_bits_are_the_same(device, balls):
    bare = replace(balls, photos=tuple(replace(p, depth=None) for p in balls.photos))
    runs = [
        trained(device, capture, depth_share=share).adam.state()["weights.value"]
        for capture, share in ((bare, 0.1), (balls, 0.0))
    ]
    np.testing.assert_array_equal(*runs)


def test_photos_with_and_without_depth_train_together(device, balls):
    """What has no depth learns from its colours alone."""
    photos = tuple(replace(p, depth=None) if i % 3 else p for i, p in enumerate(balls.photos))
    trainer = trained(device, replace(balls, photos=photos), depth_share=0.1)
    assert min(trainer.held_out_psnr(9).values()) > 15
    assert all(np.isfinite(values).all() for values in trainer.adam.state().values())


def test_eval_tells_how_far_off_depth_is(device, balls, tmp_path, capsys):
    """By hand: splats on the true surface; and nothing at all, which is wrong by all of it."""
    scores = evaluate_model(device, wall_of(balls), balls)
    assert scores["RGB"].depth_error < 0.03 and scores["RGB"].depth_error > 1e-4
    nothing = replace(wall_of(balls), opacity=np.zeros(len(balls.points), np.float32))
    assert evaluate_model(device, nothing, balls)["RGB"].depth_error == 1.0
    bare = replace(balls, photos=tuple(replace(p, depth=None) for p in balls.photos))
    assert evaluate_model(device, nothing, bare)["RGB"].depth_error is None
    told = report(tmp_path, scores, 0.0)["modalities"]["RGB"]["depth_error"]
    assert told == pytest.approx(scores["RGB"].depth_error, abs=1e-5)
    print_table(report(tmp_path, scores, 0.0))
    assert f"{100 * told:.2f}" in capsys.readouterr().err


@pytest.mark.parametrize("zero", [(0.0, 0.0, 0.0), (500_000.0, 0.0, -5_600_000.0)])
def test_eval_knows_where_the_zeros_of_scene_and_capture_lie(device, balls, zero):
    """A scene that was re-centred elsewhere than its capture has the same figures: places are
    float32 all the same, so pictures differ by rounding alone."""
    capture = replace(balls, notes=balls.notes | {"origin": zero})
    wall = wall_of(balls)
    want = evaluate_model(device, wall, balls)["RGB"]
    for away in ((0, 0, 0), (1.0, -0.5, 2.0), (-1000.0, 0.0, 1000.0)):
        moved = replace(
            wall,
            means=(wall.means - np.array(away, np.float32)).astype(np.float32),
            origin=tuple(np.add(zero, away).tolist()),
        )
        found = evaluate_model(device, moved, capture)["RGB"]
        # A kilometre off, float32 places to 0.03 mm: a hundredth of a pixel of these photos.
        assert found.psnr_db == pytest.approx(want.psnr_db, abs=0.02 if max(away) > 9 else 1e-3)
        assert found.depth_error == pytest.approx(want.depth_error, rel=0.02)


def wall_of(capture: Capture) -> SplatLayers:
    """A round, opaque splat of 1 cm at each of the surface's points, in all stops."""
    count = len(capture.points)
    ones = np.ones(count, np.float32)
    return SplatLayers(
        capture.points,
        np.full((count, 3), 0.01, np.float32),
        np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)),
        ones * np.float32(0.99),
        np.zeros((count, 1, 3), np.float32),
        np.arange(count, dtype=np.int32) % 2,
        capture.stops,
    )
