"""A control value for each anchor: GL and onnxruntime against float64, one anchor at a time."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer import layout
from shapeshift.renderer.gl.buffers import Arena
from shapeshift.renderer.gl.decode import Decoder
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.evaluate import directions
from shapeshift.runtime_models.model import AnchorModel, ControlEncoding, Stop
from shapeshift.runtime_models.rotation import covariance, normalize
from shapeshift.scene.scene import Scene
from tests.support.models import psi_of, run_in_numpy
from tests.support.renderer.gl_models import make_layers, make_mlp, make_model, read
from tests.support.renderer.selected_scenes import VIEW, selected_scene
from tests.support.splat_scenes import psnr_db

EYE = np.array([0.3, -0.2, 2.0])
BLOCK = layout.DECODE_WORKGROUP


def controls(count: int) -> np.ndarray:
    """Both ends, the middle and anything between; half of them the same."""
    x = np.random.default_rng(0).uniform(0, 1, count).astype(np.float32)
    x[::2] = 0.25
    x[: min(3, count)] = [0, 1, 0.5][: min(3, count)]
    return x


def slow(model: AnchorModel, x: np.ndarray) -> tuple:
    """means, opacity, covariance (N, 6), colour by float64, with Psi in words of the paper."""
    if x.ndim == 2:  # weights over the stops
        psi = x.astype(np.float64) @ [psi_of(model, stop.x) for stop in model.stops]
    else:
        psi = np.array([psi_of(model, float(value)) for value in x])
    parts = {
        "feature": model.features, "control": psi,
        "direction": directions(model.anchors.astype(np.float64), EYE),
    }  # fmt: skip
    out = {}
    for name, mlp in model.networks.items():
        rows = np.concatenate([parts[part] for part in mlp.inputs], axis=1)
        out[name] = run_in_numpy(mlp, rows)
    k = model.splats_per_anchor
    means = np.repeat(model.anchors, k, axis=0) + out["offset"].reshape(-1, 3)
    sigma = covariance(out["scale"].reshape(-1, 3), normalize(out["rotation"].reshape(-1, 4)))
    return means, out["opacity"].reshape(-1), sigma, out["color"].reshape(-1, 3)


def decoded(gpu: Gpu, model, x, mlps: str = "gl") -> tuple:
    """means, opacity, covariance, colour of the arena, between neighbours that stay as they are."""
    others = make_layers(2), make_layers(1)
    models = [others[0], model, others[1]]
    with Arena(gpu, [m.splat_count for m in models]) as arena:
        with Decoder(gpu, arena, models, mlps) as decoder:
            for value in (0.7, x, 0.2, x):  # one value and many in turns
                decoder.geometry(1, value)
                decoder.color(1, value, EYE)
            mean_opacity, color = (
                read(arena.mean_opacity, np.float32, 4),
                read(arena.color, np.float32, 4),
            )
            sigma = read(arena.covariance, np.float32, 8)
    np.testing.assert_array_equal(mean_opacity[:2, :3], others[0].means)
    np.testing.assert_array_equal(mean_opacity[-1:, :3], others[1].means)
    rows = slice(2, 2 + model.splat_count)
    return mean_opacity[rows, :3], mean_opacity[rows, 3], sigma[rows, :6], color[rows, :3]


def assert_as_slow(gpu, model, mlps="gl", blends=False):
    x = controls(len(model.anchors))
    if blends:
        rows = np.random.default_rng(1).uniform(size=(len(x), len(model.stops)))
        x = (rows / rows.sum(axis=1, keepdims=True)).astype(np.float32)
    for a, b in zip(decoded(gpu, model, x, mlps), slow(model, x), strict=True):
        np.testing.assert_allclose(a, b, atol=3e-5 * max(1.0, np.abs(b).max(initial=0)))


@pytest.mark.parametrize("mlps", ["gl", "onnxruntime"])
@pytest.mark.parametrize("anchors", [1, 2, BLOCK - 1, BLOCK, BLOCK + 1, 1000])
def test_each_anchor_at_its_own_value(gpu, mlps, anchors):
    assert_as_slow(gpu, make_model(anchors), mlps)


@pytest.mark.parametrize("mlps", ["gl", "onnxruntime"])
def test_each_anchor_at_a_blend_of_its_own(gpu, mlps):
    stops = tuple(Stop(name, x) for name, x in (("a", 0.1), ("b", 0.3), ("c", 1.0)))
    assert_as_slow(gpu, replace(make_model(70), stops=stops), mlps, blends=True)


@pytest.mark.parametrize("mlps", ["gl", "onnxruntime"])
def test_each_anchor_at_its_own_value_encoded_as_it_is(gpu, mlps):
    assert_as_slow(gpu, replace(make_model(70), between_stops="encoding"), mlps)


@pytest.mark.parametrize("mlps", ["gl", "onnxruntime"])
@pytest.mark.parametrize(
    ("features", "k", "hidden", "encoding"),
    [
        (16, 10, (), ControlEncoding()),
        (5, 3, (7,), ControlEncoding(3, 0.5, 0.2)),
        (1, 1, (1,), ControlEncoding(1, 1.0, 0.3)),
        (48, 2, (33, 65), ControlEncoding(9, 0.125, 0.06)),
    ],
)
def test_any_width_and_encoding(gpu, mlps, features, k, hidden, encoding):
    model = make_model(130, features, k, hidden, encoding.d)
    assert_as_slow(gpu, replace(model, encoding=encoding), mlps)


def test_models_with_other_encodings_share_programs_and_nothing_else(gpu):
    models = [make_model(40), replace(make_model(30), encoding=ControlEncoding(16, 0.05, 0.1))]
    xs = [controls(40), controls(30)]
    with Arena(gpu, [m.splat_count for m in models]) as arena:
        with Decoder(gpu, arena, models) as decoder:
            for i in (0, 1, 0, 1):
                decoder.geometry(i, xs[i])
            opacity = read(arena.mean_opacity, np.float32, 4)[:, 3]
    wanted = np.concatenate([slow(m, x)[1] for m, x in zip(models, xs, strict=True)])
    np.testing.assert_allclose(opacity, wanted, atol=3e-5)


@pytest.mark.parametrize("mode", ["cumulative", "exclusive"])
def test_each_plain_splat_at_its_own_value(gpu, mode):
    model = replace(make_layers(300), mode=mode)
    x = controls(300)
    wanted = [model.opacity[i] * model.weights(float(x[i]))[model.layer[i]] for i in range(300)]
    np.testing.assert_allclose(decoded(gpu, model, x)[1], wanted, atol=1e-6)


@pytest.mark.parametrize("name", ["offset", "scale", "rotation", "opacity", "color"])
@pytest.mark.parametrize("mlps", ["gl", "onnxruntime"])
@pytest.mark.parametrize("own", [False, True])
def test_weights_that_are_not_a_number_stay_so(gpu, name, mlps, own):
    """Nothing makes an innocent number of them: project sees them and culls."""
    model = make_model(20, k=2)
    head = model.networks[name]
    broken = replace(head, weights=(*head.weights[:-1], np.full_like(head.weights[-1], np.nan)))
    model = replace(model, networks=model.networks | {name: broken})
    part = {"offset": 0, "scale": 2, "rotation": 2, "opacity": 1, "color": 3}[name]
    out = decoded(gpu, model, controls(20) if own else 0.4, mlps)
    assert np.isnan(out[part]).all()
    for i in set(range(4)) - {part}:
        assert np.isfinite(out[i]).all()


def test_one_head_of_many_outputs_broken_in_one_place(gpu):
    model = make_model(20, k=2)
    mlp = make_mlp(np.random.default_rng(0), [32, 16, 2], "tanh")
    mlp.biases[-1][1] = np.nan
    model = replace(model, networks=model.networks | {"opacity": mlp})
    opacity = decoded(gpu, model, 0.3)[1]
    assert np.isnan(opacity[1::2]).all() and np.isfinite(opacity[::2]).all()


@pytest.mark.parametrize("mlps", ["gl", "onnxruntime"])
def test_quads_draw_the_oracles_picture(ctx, mlps):
    scene = selected_scene()
    with Renderer(ctx, "quads", mlps, target="rgba32f") as renderer:
        renderer.update(scene)
        renderer.draw([VIEW])
        assert psnr_db(renderer.image(), reference_image(scene, VIEW)) > 60
        made = renderer.drawing.allocations
        for step in range(1, 4):
            ball = replace(scene.objects[0].selectors[0], radius=0.5 + 0.05 * step)
            objects = (replace(scene.objects[0], selectors=(ball,)), *scene.objects[1:])
            renderer.update(Scene(objects))
            renderer.draw([VIEW])
        assert renderer.drawing.allocations == made, "a selector that moves allocates nothing"
