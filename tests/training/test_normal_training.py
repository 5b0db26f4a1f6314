"""Normal maps in training: the loss, the whole step's gradients, and what they are good for."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.raster import RasterFrame
from shapeshift.rasterizer.surface import DepthFrame
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.captures.depth_photo import load_depth
from shapeshift.scene.captures.normal_photo import load_normals
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.drawing import camera_of
from shapeshift.training.first_anchors import initial
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import ImageLoss
from shapeshift.training.losses.surface_losses import (
    DepthLoss,
    DepthTerm,
    NormalLoss,
    NormalTerm,
    pairs_of,
)
from shapeshift.training.photos import read
from shapeshift.training.settings import TrainSettings
from shapeshift.training.step import TrainingStep
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer
from tests.support.renderer.surface_reference import render_depth_reference
from tests.support.training.depth_photos import depth_error, depth_loss_reference, depth_photo
from tests.support.training.reference import decode_reference, differences, image_loss_reference
from tests.support.training.situations import BACKGROUND, LAYOUT, SIZE, VOXEL, situation

SHARE = 0.7
TURNED = 0.25  # how much of a normal is chance


def normal_map(seed: int, size: tuple[int, int] = SIZE) -> np.ndarray:
    """(H, W, 4) int8: towards the eye, with noise; some are not known."""
    rng = np.random.default_rng(seed)
    normals = rng.normal((0.2, 0.3, 1), TURNED, (*size[::-1], 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    known = rng.random(size[::-1]) < 0.9
    steps = np.rint(127 * normals) * known[..., None]
    return np.concatenate([steps, known[..., None]], axis=2).astype(np.int8)


def normal_loss_reference(metres, through, normals, view: View) -> float:
    """By the sentence in NormalLoss, over arrays of all pairs."""
    _, fx, fy, cx, cy = view.pinhole()
    height, width = metres.shape
    rays = np.stack(
        np.broadcast_arrays(
            (np.arange(width) + 0.5 - cx) / fx, -(np.arange(height)[:, None] + 0.5 - cy) / fy, -1
        ),
        axis=-1,
    )  # eye axes
    covered = 1 - through
    depth = np.where(covered >= 0.5, metres / np.maximum(covered, 0.5), 0)
    whole, total, count = normals.astype(np.float64), 0.0, 0
    for one, two, step in (
        (np.s_[:, :-1], np.s_[:, 1:], 1 / fx),
        (np.s_[:-1], np.s_[1:], 1 / fy),
    ):
        a, b = whole[one], whole[two]
        same = (a[..., 3] > 0) & (b[..., 3] > 0)
        same &= (a[..., :3] * b[..., :3]).sum(axis=2) >= 14516
        count += same.sum()
        same &= (depth[one] > 0) & (depth[two] > 0)
        way = depth[two][..., None] * rays[two] - depth[one][..., None] * rays[one]
        slope = ((a + b)[..., :3] / 254 * way).sum(axis=2)
        slope = np.abs(slope[same]) / (0.5 * step * (depth[one] + depth[two])[same])
        total += float((slope / (1 + slope)).sum())
    assert count == pairs_of(normals)
    return total / count


@pytest.mark.parametrize("with_depth", [False, True])
def test_every_gradient_of_a_step_with_normals(device, with_depth):
    parameters, control, view, rgba = situation(1)
    depth, normals = depth_photo(1), normal_map(1)
    camera, photo = camera_of(view), rgba[..., :3] / 255

    def decode(values):
        return decode_reference(LAYOUT, values, control, view.world_from_eye.position, VOXEL)

    def loss(splats):
        image, through, metres = render_depth_reference(splats, camera, BACKGROUND)
        shown = image_loss_reference(image.transpose(1, 2, 0), photo, 0.2)
        deep = depth_loss_reference(metres, through, depth) if with_depth else 0.0
        return shown + SHARE * (deep + normal_loss_reference(metres, through, normals, view))

    rates = {name: np.array([1.0], np.float32) for name in parameters}
    step = TrainingStep(device, LAYOUT, VOXEL, Adam(device, parameters, rates))
    image_loss, depth_loss = ImageLoss(device, SIZE), DepthLoss(device, SIZE)
    normal_loss = NormalLoss(device, SIZE)
    drawing = step.draw(view, control, BACKGROUND, with_depth=True)
    covered = device.download(drawing.frame.transmittance) <= 0.5
    assert 50 < covered.sum() < covered.size - 50  # what counts and what does not
    target = image_loss.target(device.upload(rgba), BACKGROUND)
    deep = DepthTerm(depth_loss, depth_loss.target(depth), SHARE) if with_depth else None
    term = NormalTerm(normal_loss, normal_loss.target(normals, view), SHARE, deep)
    grads = step.gradients(drawing, image_loss, target, depth=term, min_opacity_share=0.0)
    total = image_loss.value() + SHARE * normal_loss.value()
    total += SHARE * depth_loss.value() if with_depth else 0
    assert normal_loss.value() > 0.05
    assert total == pytest.approx(loss(decode(parameters)), rel=1e-4)
    wanted = differences(loss, decode, parameters, LAYOUT, 1e-7)
    for name, grad in grads.items():
        have = device.download(grad).astype(np.float64)
        error = np.abs(have - wanted[name]).max() / np.abs(wanted[name]).max()
        assert error < 1e-4, (name, error)


@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_a_plane_that_lies_as_its_normals_say_counts_nothing(device, tilt):
    """The depth of a plane by rays, whatever its distance; turned, it counts the slope."""
    size = (17, 9)
    view = View(look_at(np.array([0.0, 0, 2]), np.zeros(3)), perspective(0.7, size), 0.05, 9, size)
    _, fx, fy, cx, cy = view.pinhole()
    x = (np.arange(17) + 0.5 - cx) / fx
    y = -(np.arange(9)[:, None] + 0.5 - cy) / fy
    normal = np.array([0.3, 0.4, 0.866])
    away = -(normal[0] * x + normal[1] * y - normal[2])  # of a ray with z -1
    found = []
    for metres in (1.0, 40.0):
        depth = (metres / away).astype(np.float32)
        frame = RasterFrame(None, device.zeros((9, 17)), None)
        drawn = DepthFrame(frame, None, device.upload(depth))
        turned = normal - np.array([0, tilt, 0])
        steps = np.rint(127 * turned / np.linalg.norm(turned))
        normals = np.broadcast_to([*steps, 1], (9, 17, 4)).astype(np.int8)
        loss = NormalLoss(device, size)
        by_metres, _ = loss.compare(drawn, loss.target(normals, view), 1.0)
        found.append(loss.value())
        assert np.isfinite(device.download(by_metres)).all()
    assert found[0] == pytest.approx(found[1], rel=1e-3, abs=1e-4)  # no distance is known
    if tilt:
        assert found[0] > 0.1
    else:
        assert found[0] < 0.006  # normals are rounded to 1 / 127


def test_edges_creases_and_what_is_not_known_pull_nothing(device):
    """Pairs of other normals, of unknown ones, of uncovered pixels, and none at all; NaN, too."""
    size = (4, 1)
    view = View(look_at(np.array([0.0, 0, 2]), np.zeros(3)), perspective(0.7, size), 0.05, 9, size)
    front, aside, unknown = (0, 0, 127, 1), (90, 0, 90, 1), (0, 0, 0, 0)
    loss = NormalLoss(device, size)
    cases = (
        ([front, aside, front, aside], [0, 0, 0, 0], 0),
        ([front, unknown, front, unknown], [0, 0, 0, 0], 0),
        ([front] * 4, [0.51, 0, 0.51, 0], 3),
        ([front] * 4, [np.nan, 0.9, np.nan, 0.9], 3),
    )
    for normals, through, known in cases:
        frame = RasterFrame(None, device.upload(np.array([through], np.float32)), None)
        drawn = DepthFrame(frame, None, device.upload(np.array([[1, 2, 3, 4]], np.float32)))
        target = loss.target(np.array([normals], np.int8), view)
        assert target.known == known
        for grad in loss.compare(drawn, target, 1.0):
            assert not device.download(grad).any()
        assert loss.value() == 0
    half = RasterFrame(
        None, device.upload(np.array([[0.5] * 4], np.float32)), None
    )  # exactly half counts
    drawn = DepthFrame(half, None, device.upload(np.array([[1, 2, 3, 4]], np.float32)))
    target = loss.target(np.array([[front] * 4], np.int8), view)
    assert device.download(loss.compare(drawn, target, 1.0)[0]).all() and loss.value() > 0.1


def with_normals(capture: Capture, folder) -> Capture:
    """Photos with the normals of their exact depth: another formula, by differences."""
    photos = []
    for number, photo in enumerate(capture.photos):
        depth = load_depth(photo)
        _, fx, fy, cx, cy = photo.view.pinhole()
        height, width = depth.shape
        x = (np.arange(width) + 0.5 - cx) / fx * depth
        y = -(np.arange(height)[:, None] + 0.5 - cy) / fy * depth
        places = np.stack([x, y, -depth], axis=-1)
        across, up = np.gradient(places, axis=1), -np.gradient(places, axis=0)
        normals = np.cross(across, up)
        normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-12)
        normals[depth <= 0] = np.nan
        path = folder / f"{number}.npy"
        np.save(path, normals.astype(np.float32))
        photos.append(replace(photo, normals=path))
    return replace(capture, photos=tuple(photos))


def test_normal_maps_bring_the_shape_nearer_where_photos_are_few(device, tmp_path, monkeypatch):
    """From three depth photos a modality, at every pixel: measured once, 0.034 against 0.063 with
    this seed, 0.032 against 0.063 with another.  From points two pixels apart, as a run takes them,
    there is less to mend: 0.037 against 0.053.
    """
    monkeypatch.setattr(initial, "one_a_cell", lambda points, edge: points)
    balls = with_normals(make_balls(tmp_path / "balls", 64, 3, 3, depth=True), tmp_path)
    mapped = load_normals(balls.photos[0])
    assert mapped[..., 3].mean() > 0.3 and (mapped[..., 2][mapped[..., 3] > 0] > -30).mean() > 0.9
    bare = replace(balls, points=None, point_colors=None)
    errors = []
    for share in (0.3, 0.0):
        settings = TrainSettings(
            iterations=120, max_anchors=400, grow=False, depth_share=0.0, normal_share=share
        )
        trainer = Trainer(device, bare, settings)
        assert trainer.origin == "depth photos"
        for _ in trainer.steps():
            pass
        errors.append(depth_error(trainer))
    assert errors[0] < 0.7 * errors[1], errors


def test_a_normal_map_follows_its_photo_through_masks_and_sizes(tmp_path):
    photo = with_normals(make_balls(tmp_path / "balls", 64, 2, 1, depth=True), tmp_path).photos[0]
    loaded = read(photo, 2, "object")
    assert loaded.has_normals and loaded.normals.shape == (32, 32, 4)
    assert loaded.bytes == 32 * 32 * 12 and loaded.kind == ((32, 32), True, True)
    bare = replace(photo, normals=None)
    assert read(bare, 2, "object").kind == ((32, 32), True, False)
    np.testing.assert_array_equal(read(bare, 2, "object").depth, loaded.depth)
