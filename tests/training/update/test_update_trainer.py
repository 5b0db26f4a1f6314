"""Updating a part of a scene: what is outside stays to the bit, what is inside learns."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.colors.spherical_harmonics import WIDTHS
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import HEADS, BadFile
from shapeshift.runtime_models.package.write_package import package_files, write_package
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.sections.section import BoxShape
from shapeshift.training.export import with_light
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic import balls
from shapeshift.training.train import Trainer
from shapeshift.training.update.regions import UpdateRegion
from shapeshift.training.update.trainable import layout_of
from shapeshift.training.update.update_trainer import UpdateBase, begin_update
from tests.support.training.training_runs import bits, run, run_keeping

BALL = (0.15, 0.18, 0.55)  # metres: the yellow one, which is gone at the second visit
REGION = UpdateRegion((BoxShape(BALL, (0.32, 0.3, 0.32)),))
# Tiles stop early where less light than that is left in all of eight pixels, and look so often as
# the tile has splats: what is fainter may be drawn or not.
STOPPED = RenderSettings().min_transmittance
SETTINGS = TrainSettings(iterations=150, max_anchors=1500, grow_every=50)


@pytest.fixture(scope="module")
def visits(tmp_path_factory):
    """(earlier, later) captures."""
    there = balls.place()
    first = balls.make_balls(tmp_path_factory.mktemp("first"), size=64, views=14, test_views=3)
    with pytest.MonkeyPatch.context() as patch:
        fewer = [s for s in there.solids if s.world_from_local[2, 3] != BALL[2]]
        assert len(fewer) == len(there.solids) - 1
        patch.setattr(balls, "place", lambda: type(there).of(fewer))
        second = balls.make_balls(
            tmp_path_factory.mktemp("second"), size=64, views=14, test_views=3
        )
    return first, second


@pytest.fixture(scope="module")
def base(device, visits, tmp_path_factory) -> UpdateBase:
    """As a file has it: features of 16 bits."""
    settings = replace(SETTINGS, iterations=250, max_anchors=900)
    path = tmp_path_factory.mktemp("scene") / "first.shift"
    write_package(run(Trainer(device, visits[0], settings)).model(), path)
    model = read_model(path)
    return UpdateBase(model, REGION, "digest")


@pytest.fixture(scope="module")
def updated(device, visits, base):
    trainer = begin_update(device, base, visits[1], SETTINGS)
    before = trainer.psnr_before()
    return run(trainer), before


def rows(model) -> list[bytes]:
    parts = (model.anchors, model.features, model.frames.scales, model.frames.wxyz)
    return [b"".join(part.tobytes() for part in row) for row in zip(*parts, strict=True)]


def test_the_region_learns_what_is_there_now(updated):
    """The ball's place, by photos of the visit without it that were held out.

    Measured: RGB 17.3 to 20.1 dB, Thermal 11.1 to 24.6; half of what was gained is asked for.
    """
    trainer, before = updated
    after = trainer.held_out_psnr(most=99)
    assert trainer.guard.rollbacks == 0
    assert after["RGB"] > before["RGB"] + 1.3 and after["Thermal"] > before["Thermal"] + 6.5


def test_networks_and_all_that_stands_outside_stay_to_the_bit(updated, base, tmp_path):
    trainer, _ = updated
    write_package(trainer.model(), tmp_path / "new.shift", trainer.storage)
    model = read_model(tmp_path / "new.shift")
    inside = REGION.holds(base.model.anchors)
    assert inside.any() and not inside.all()
    assert rows(model)[: trainer.fixed] == rows(base.model.with_anchors(~inside))
    assert REGION.holds(model.anchors[trainer.fixed :]).all()
    was, now = (package_files(m, "float16") for m in (base.model, model))
    assert all(was[f"{name}.onnx"] == now[f"{name}.onnx"] for name in HEADS)
    assert (model.stops, model.pace) == (base.model.stops, base.model.pace)


def test_no_pixel_changes_that_no_splat_touches_which_left_or_came(renderer, updated, visits, base):
    """The oracle: who left, and who came, drawn alone cover nothing there."""
    from shapeshift.app.document import Document

    trainer, _ = updated
    model, inside = trainer.model(), REGION.holds(base.model.anchors)
    left = base.model.with_anchors(inside)
    came = model.with_anchors(slice(trainer.fixed, None))
    touched = free = 0
    for photo in [p for p in visits[1].photos if p.split == "test"]:
        pictures = []
        for each in (base.model, model, left, came):
            renderer.update(Document.of(each).placed(photo.modality).scene)
            renderer.draw([photo.view])
            pictures.append(np.array(renderer.image(0)))
        was, now = pictures[:2]
        clear = (pictures[2][..., 3] == 0) & (pictures[3][..., 3] == 0)
        seen = clear & (1 - was[..., 3] >= STOPPED) & (1 - now[..., 3] >= STOPPED)
        assert np.array_equal(was[seen], now[seen])
        np.testing.assert_allclose(was[clear], now[clear], rtol=0, atol=STOPPED)
        touched, free = touched + int((~clear).sum()), free + int(seen.sum())
    assert touched > 1000 and free > 5000  # both kinds of pixels are many


def test_what_it_decodes_is_what_the_package_shows(device, visits, base):
    """The optimiser's form against the runtime's networks, before any step."""
    trainer = begin_update(device, base, visits[1], SETTINGS)
    model, eye = trainer.model(), np.array([0.3, 1.0, 2.5])
    for stop in model.stops:
        splats = trainer.step.decode(trainer.control(stop.name), eye)
        means, opacity, color = map(device.download, (splats.means, splats.opacity, splats.color))
        shown, old = evaluate(model, stop.x, eye), trainer.fixed * model.splats_per_anchor
        np.testing.assert_allclose(means[:old], shown.means[:old], rtol=0, atol=2e-6)
        np.testing.assert_allclose(means, shown.means, rtol=0, atol=2e-4)  # sizes in 16 bits
        np.testing.assert_allclose(opacity[:old], shown.opacity[:old], rtol=0, atol=2e-5)
        np.testing.assert_allclose(color[:old], shown.color[:old], rtol=0, atol=2e-5)


@pytest.fixture(scope="module", params=[1, 3])
def lit(base, request) -> UpdateBase:
    """The scene with random light by direction, as training exports it, today and before."""
    model, size = base.model, (len(base.model.anchors), WIDTHS[request.param])
    light = np.random.default_rng(0).normal(0, 0.5, size).astype(np.float16)
    color = with_light(model.networks["color"], model.features.shape[1], request.param)
    networks = model.networks | {"color": color}
    return replace(base, model=replace(model, networks=networks, light=light.astype(np.float32)))


def test_light_outside_stays_to_the_bit_and_inside_learns(device, visits, lit):
    trainer = begin_update(device, lit, visits[1], replace(SETTINGS, iterations=40))
    eye, stop = np.array([0.3, 1.0, 2.5]), lit.model.stops[0]
    first, old = trainer.step.decode(trainer.control(stop.name), eye), trainer.fixed
    shown = evaluate(trainer.model(), stop.x, eye).color
    np.testing.assert_allclose(device.download(first.color), shown, rtol=0, atol=2e-5)
    began = trainer.model()
    model, outside = run(trainer).model(), ~REGION.holds(lit.model.anchors)
    np.testing.assert_array_equal(model.light[:old], lit.model.light[outside])
    kept = min(len(began.light), len(model.light))
    assert np.abs(model.light[old:kept] - began.light[old:kept]).max() > 0.01
    assert (
        package_files(model, "float16")["color.onnx"]
        == (package_files(lit.model, "float16")["color.onnx"])
    )


@pytest.mark.parametrize("where", ["first", "bias", "last", "channels"])
def test_light_that_a_network_mixes_with_others_is_refused(lit, where):
    color = lit.model.networks["color"]
    first, last = (weight.copy() for weight in color.weights)
    bias = color.biases[0].copy()
    if where == "first":
        first[-1, 0] = 0.1
    if where == "bias":
        bias[-1] = 0.1
    if where == "last":
        last[:, -1] *= 2
    if where == "channels":  # of one there is none to take for another
        at = color.inputs.index("direction")
        width = lit.model.features.shape[1] + 3
        assert color.inputs[at + 1] == "light"
        if lit.model.light.shape[1] == 8:
            pytest.skip("one channel")
        first[-1, width : width + 2] = -1
    color = replace(color, weights=(first, last), biases=(bias, color.biases[1]))
    mixed = replace(lit.model, networks=lit.model.networks | {"color": color})
    with pytest.raises(BadFile, match="mixes light by direction with its other inputs; scenes"):
        layout_of(mixed)
    layout_of(lit.model)


def test_an_update_resumes_to_the_same_bits_and_with_its_own_scene_only(
    device, visits, base, tmp_path
):
    settings = replace(SETTINGS, iterations=60, grow_every=25)
    begun = begin_update(device, base, visits[1], settings)
    whole, ((state, notes),) = run_keeping(begun, tmp_path, 30)
    again = run(begin_update(device, base, visits[1], settings, (state, notes)))
    assert bits(again) == bits(whole)
    with pytest.raises(BadFile, match="another scene, capture or region"):
        begin_update(device, replace(base, digest="other"), visits[1], settings, (state, notes))


def test_what_cannot_be_updated_is_refused(device, visits, base):
    _, later = visits
    rgb = tuple(p for p in later.photos if p.modality == "RGB")
    with pytest.raises(BadFile, match="no photos of the stop 'Thermal'"):
        begin_update(device, base, replace(later, photos=rgb), SETTINGS)
    far = replace(base, region=UpdateRegion((BoxShape((0.0, 900.0, 0.0), (0.1, 0.1, 0.1)),)))
    with pytest.raises(BadFile, match="no training photo of 'RGB'"):
        begin_update(device, far, later, SETTINGS)
    deep = base.model.networks["color"]
    deep = replace(
        deep,
        weights=(deep.weights[0], np.eye(len(deep.biases[0]), dtype=np.float32), deep.weights[1]),
        biases=(deep.biases[0], deep.biases[0] * 0, deep.biases[1]),
    )
    with pytest.raises(BadFile, match="2 hidden layers"):
        layout_of(replace(base.model, networks=base.model.networks | {"color": deep}))
