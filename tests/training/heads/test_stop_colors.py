"""A base colour for each stop: gradients, what rests, first colours, and packages that hold it."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.tiles.slot import uncovered
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import ControlEncoding, Stop
from shapeshift.runtime_models.package.feature_codes import EXACT
from shapeshift.runtime_models.package.read_package import read_files
from shapeshift.runtime_models.package.refit_encoding import encoding_for
from shapeshift.runtime_models.package.write_package import package_files
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.scene.pose import View
from shapeshift.training.drawing import camera_of
from shapeshift.training.export import model_of
from shapeshift.training.heads.networks import MOST_STOP_COLORS, HeadLayout, initial_weights
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import SSIM_SHARE, ImageLoss
from shapeshift.training.step import TrainingStep
from tests.support.renderer.rasterizer_reference import finite_differences
from tests.support.training.reference import decode_reference, step_loss_reference
from tests.support.training.situations import (
    BACKGROUND,
    LAYOUT,
    MIN_OPACITY_SHARE,
    SIZE,
    VOXEL,
    situation,
)

RNG = np.random.default_rng
PLACES = {"two": (0.0, 1.0), "three": (0.0, 0.5, 1.0), "uneven": (0.0, 0.2, 0.45, 0.9)}
EYE = np.array([0.5, 0.7, 3.0])


def layout_of(xs: tuple[float, ...], **more) -> HeadLayout:
    attributes = ("frame", "stop_color", "light")
    units = encoding_for(list(xs)).d
    return replace(LAYOUT, control=units, attributes=attributes, stops=len(xs), **more)


def controls_of(xs: tuple[float, ...]) -> np.ndarray:
    return encoding_for(list(xs)).encode(np.array(xs)[:, None])


def parameters_of(layout: HeadLayout, seed: int = 1) -> tuple[dict, View, np.ndarray]:
    """As `situation`, with logits of every size up to 8, and 0."""
    one = replace(layout, attributes=("frame", "light"), stops=1)
    parameters, _, view, rgba = situation(seed, one)
    for number, group in enumerate(layout.color_groups):
        colors = RNG([seed, number]).uniform(-4, 4, (5, 3))
        colors[number % 5] = (0, 8, -8)
        parameters[group] = colors.astype(np.float32)
    return parameters, view, rgba


def step_of(device, layout: HeadLayout, parameters: dict, xs: tuple[float, ...]) -> TrainingStep:
    adam = Adam(device, parameters, {name: np.ones(1) for name in parameters})
    return TrainingStep(device, layout, VOXEL, adam, controls_of(xs))


@pytest.mark.parametrize("stop", range(3))
def test_a_step_learns_the_base_colours_of_its_stop_alone(device, stop):
    """Its gradients against finite differences of the float64 reference; the others rest."""
    xs = PLACES["three"]
    layout, control = layout_of(xs), controls_of(xs)[stop]
    parameters, view, rgba = parameters_of(layout)
    for group in layout.color_groups:  # where a sigmoid is flat, nothing could be told apart
        parameters[group] *= np.float32(0.3)
    step, loss = step_of(device, layout, parameters, xs), ImageLoss(device, SIZE)
    target = loss.target(device.upload(rgba), BACKGROUND)
    drawing = step.draw(view, control, BACKGROUND)
    grads = step.gradients(drawing, loss, target, min_opacity_share=MIN_OPACITY_SHARE)
    own = f"colors_{stop}"
    assert [name for name in grads if name.startswith("colors")] == [own]
    photo, camera = rgba[..., :3] / 255, camera_of(view)

    def loss_with(values: np.ndarray) -> float:
        changed = {**parameters, own: values}
        eye = view.world_from_eye.position
        splats = decode_reference(layout, changed, control, eye, VOXEL, stop)
        shares = SSIM_SHARE, MIN_OPACITY_SHARE
        return step_loss_reference(splats, camera, photo, BACKGROUND, shares)

    wanted = finite_differences(loss_with, parameters[own].astype(np.float64))
    # float32 all the way, sums of some hundred terms, as compare_gradients
    assert np.abs(device.download(grads[own]) - wanted).max() < 1e-5 * np.abs(wanted).max()
    step.update(grads, 0.01)
    for group in layout.color_groups:
        moved = device.download(step.adam[group]) != parameters[group]
        assert moved.any() == (group == own), group


def test_colours_between_two_stops_are_refused(device):
    """What Psi means there, no step has learned; a blend that is a stop's own is that stop."""
    xs = PLACES["two"]
    layout, controls = layout_of(xs), controls_of(xs)
    parameters, view, _ = parameters_of(layout)
    step = step_of(device, layout, parameters, xs)
    shapes = np.tile(controls.mean(0), (5, 1))
    shapes[-1] = controls[1]  # shapes between two stops, colours of one
    assert step.groups_at(shapes)["colors"] == "colors_1"
    for wrong in (controls.mean(0), np.full_like(controls[0], np.nan)):
        with pytest.raises(ValueError, match="between two"):
            step.draw(view, wrong, BACKGROUND)


def test_which_base_colours_there_are():
    many = HeadLayout(attributes=("stop_color",), stops=3)
    assert many.per_anchor == ("anchors", "features", "colors_0", "colors_1", "colors_2")
    assert many.own == ("colors",) and sum(many.own_widths.values()) == 9
    both = replace(many, attributes=("color", "stop_color"))
    assert both.color_groups == many.color_groups and both.own == many.own
    assert len(replace(many, stops=MOST_STOP_COLORS).color_groups) == MOST_STOP_COLORS
    more = replace(many, stops=MOST_STOP_COLORS + 1)
    for one in (replace(many, stops=1), replace(many, fixed=("color",)), more):
        assert one.color_groups == ("colors",)
    assert replace(many, attributes=("frame",)).color_groups == ()


def test_the_most_stops_leave_the_networks_to_the_kernels_of_decoding():
    xs = tuple(np.linspace(0, 1, MOST_STOP_COLORS).tolist())
    layout = replace(HeadLayout(attributes=("stop_color", "light")), stops=len(xs))
    layout = replace(layout, control=encoding_for(list(xs)).d)
    widths = {"anchors": 3, "features": 16} | layout.own_widths
    rows = {name: np.ones((5, width), np.float32) for name, width in widths.items()}
    weights = initial_weights(layout, RNG(0)).astype(np.float32)
    assert uncovered(model_with(layout, xs, rows | {"weights": weights})) == ""


def model_with(layout: HeadLayout, xs: tuple[float, ...], parameters: dict, encoding=None):
    state = {f"{name}.value": value for name, value in parameters.items()}
    stops = tuple(Stop(f"stop {x:g}", x) for x in xs)
    encoding = encoding or encoding_for(list(xs))
    return model_of(state, layout, VOXEL, encoding, stops, {})


@pytest.mark.parametrize("view_dependent", [True, False])
@pytest.mark.parametrize("places", PLACES)
def test_a_package_shows_every_stop_as_it_was_trained(device, places, view_dependent):
    """Through onnxruntime, which runs what is exported and knows nothing of base colours."""
    xs = PLACES[places]
    layout = layout_of(xs, view_dependent=view_dependent)
    parameters, _, _ = parameters_of(layout)
    parameters = {n: v for n, v in parameters.items() if n in (*layout.per_anchor, "weights")}
    step = step_of(device, layout, parameters, xs)
    model = model_with(layout, xs, parameters)
    read = read_files(package_files(model, EXACT).__getitem__, "test")
    for x, control in zip(xs, controls_of(xs), strict=True):
        trained, shown = step.decode(control, EYE), evaluate(read, x, EYE)
        # A logit is what is left of sums of up to 25 in size: float32 keeps 2e-6 of them, and a
        # colour a quarter of it.
        np.testing.assert_allclose(shown.color, device.download(trained.color), atol=2e-6)
        np.testing.assert_allclose(shown.means, device.download(trained.means), atol=1e-6)


@pytest.mark.parametrize("places", PLACES)
def test_between_two_stops_base_colours_cross_over(places):
    """Halfway is the mean of both logits; a colour goes from one to the other and not beyond."""
    xs = PLACES[places]
    layout = layout_of(xs, view_dependent=False)
    layout = replace(layout, attributes=("stop_color",))
    parameters, _, _ = parameters_of(layout)
    weights = {name: parameters[name] for name in ("anchors", "features", *layout.color_groups)}
    silent = np.zeros_like(parameters["weights"])
    model = model_with(layout, xs, weights | {"weights": silent})

    def logits(weight: float) -> np.ndarray:
        names = [stop.name for stop in model.stops[:2]]
        blend = StopWeights(tuple(zip(names, (1 - weight, weight), strict=True)))
        color = evaluate(model, blend, EYE).color.astype(np.float64)
        return np.log(color / (1 - color)).reshape(5, -1, 3)[:, 0]

    first, second = (parameters[group] for group in layout.color_groups[:2])
    found = np.stack([logits(weight) for weight in (0, 0.25, 0.5, 0.75, 1)])
    # The sigmoid of 8 leaves 3e-4 to 1: float32 knows its logit to 2e-4.
    for weight, wanted in ((0, first), (2, (first + second) / 2), (4, second)):
        np.testing.assert_allclose(found[weight], wanted, atol=5e-4)
    # c w is c / 2 or less from either; between them what both add lies within their sizes.
    assert (np.abs(found) <= np.abs(first) + np.abs(second) + 1e-3).all()


def test_a_wide_encoding_holds_them_too(device):
    """Packages of other programs have the paper's 16 units: weights of stops follow from them."""
    xs, paper = PLACES["three"], ControlEncoding(16, 1 / 15, 0.04)
    layout = replace(layout_of(xs), control=16)
    parameters, _, _ = parameters_of(layout)
    model = model_with(layout, xs, parameters, paper)
    adam = Adam(device, parameters, {name: np.ones(1) for name in parameters})
    controls = np.stack([paper.encode(x) for x in xs])
    step = TrainingStep(device, layout, VOXEL, adam, controls)
    for x, control in zip(xs, controls, strict=True):
        wanted = device.download(step.decode(control, EYE).color)
        np.testing.assert_allclose(evaluate(model, x, EYE).color, wanted, atol=2e-6)
