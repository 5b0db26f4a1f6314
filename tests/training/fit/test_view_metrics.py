"""What photos say of a model, beside plain numpy: view_psnr, the pixels of an anchor, outlines."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import Mlp
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.drawing import camera_of
from shapeshift.training.evaluation.metrics import psnr
from shapeshift.training.fit.fit import largest_contribution, outline_ious, view_psnr
from shapeshift.training.photos import LoadedPhoto
from tests.support.models import make_random_model, without_control
from tests.support.renderer.rasterizer_reference import render_reference

SIZE = (40, 30)
SHAPE_HEADS = ("offset", "scale", "rotation", "opacity")


def photo_of(modality: str, azimuth: float, seed: int) -> LoadedPhoto:
    eye = look_at(np.array([3 * np.cos(azimuth), 0.8, 3 * np.sin(azimuth)]), np.zeros(3))
    view = View(eye, perspective(np.deg2rad(50), SIZE), 0.05, 100.0, SIZE)
    rgba = np.random.default_rng(seed).integers(0, 256, (SIZE[1], SIZE[0], 4)).astype(np.uint8)
    rgba[..., 3] = 255
    return LoadedPhoto(view, modality, rgba, None, str(Path(f"{seed}.png")))


PHOTOS = [photo_of("RGB", 0.1, 0), photo_of("Thermal", 1.0, 1), photo_of("RGB", 2.0, 2)]


def drawn(model, stop, photo, background, color=None):
    """(H, W, 3) float64 by the slow reference."""
    splats = evaluate(model, stop.x, photo.view.world_from_eye.position)
    color = splats.color if color is None else color
    fields = (splats.means, splats.scales, splats.wxyz, splats.opacity, color)
    image, _ = render_reference(fields, camera_of(photo.view), background)
    return image.transpose(1, 2, 0)


def test_likeness_is_that_of_every_photo(device):
    model, background = make_random_model(30, k=2), (0.3, 0.2, 0.9)
    found = view_psnr(device, model, PHOTOS, model.stops, background)
    for stop in model.stops:
        mine = [p for p in PHOTOS if p.modality == stop.name]
        wanted = [psnr(drawn(model, stop, p, background), p.over(background)) for p in mine]
        np.testing.assert_allclose(found[stop.name], wanted, atol=1e-3)


def test_the_pixels_of_an_anchor_are_what_its_colour_adds(device):
    model = make_random_model(12, k=2)
    found = largest_contribution(device, model, PHOTOS, model.stops)
    wanted = np.zeros(12)
    for stop in model.stops:
        for photo in PHOTOS:
            if photo.modality != stop.name:
                continue
            for anchor in range(12):
                color = np.zeros((24, 3))
                color[2 * anchor : 2 * anchor + 2] = 1
                image = drawn(model, stop, photo, (0, 0, 0), color)
                wanted[anchor] = max(wanted[anchor], image[..., 0].sum())
    np.testing.assert_allclose(found, wanted, rtol=2e-4, atol=1e-3)
    assert wanted.max() > 1 and (wanted > 0).sum() > 5


def test_outlines_of_a_shape_that_does_not_follow_x_are_one(device):
    model = without_control(make_random_model(60, k=3), *SHAPE_HEADS)
    assert outline_ious(device, model, PHOTOS, model.stops) == {("RGB", "Thermal"): 1.0}
    other = outline_ious(device, make_random_model(60, k=3), PHOTOS, model.stops)
    assert 0 < other["RGB", "Thermal"] < 1


def test_outlines_of_two_places_have_nothing_in_common(device):
    """The left half is there at the first stop alone, the right half at the last."""
    model = make_random_model(40, k=1, features=2)
    left = np.arange(40) % 2 == 0
    anchors = (0.2 * model.anchors).astype(np.float32)
    anchors[:, 1] += np.where(left, 0.7, -0.7)  # metres; seen from everywhere
    features = np.stack([np.where(left, 1, -1), np.zeros(40)], axis=1).astype(np.float32)
    first = np.zeros((2, 2 + model.encoding.d), np.float32)
    first[:, 0] = 1, -1
    first[0, 2], first[1, -1] = 1, 1  # Psi at x = 0 and at x = 1
    opacity = Mlp(
        (first, np.full((1, 2), 5, np.float32)),
        (np.full(2, -1, np.float32), np.full(1, -1, np.float32)),
        "tanh",
    )
    big = replace(model.networks["scale"], gain=0.1)
    networks = model.networks | {"opacity": opacity, "scale": big}
    model = replace(model, anchors=anchors, features=features, networks=networks)
    assert outline_ious(device, model, PHOTOS, model.stops) == {("RGB", "Thermal"): 0.0}
    hidden = replace(opacity, biases=(opacity.biases[0] - 9, opacity.biases[1]))
    empty = replace(model, networks=networks | {"opacity": hidden})
    assert outline_ious(device, empty, PHOTOS, model.stops) == {("RGB", "Thermal"): 1.0}
