"""Our OpenCL heads against float64 numpy and onnxruntime: block edges, shapes, bad numbers."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer import decode_heads
from shapeshift.rasterizer.decode_heads import ACTIVATIONS, MOST_HIDDEN, MOST_SPLATS, RUN, WIDTH
from shapeshift.rasterizer.pack import pack
from shapeshift.renderer.tiles.slot import ModelHeads, uncovered
from shapeshift.runtime_models.evaluate import Evaluator, directions
from shapeshift.runtime_models.model import HEADS, AnchorModel, Mlp
from shapeshift.runtime_models.rotation import covariance, normalize, product, rotation_matrices
from tests.support.models import (
    make_random_model,
    psi_of,
    run_in_numpy,
    with_frames,
    with_light,
    without_control,
    without_direction,
)
from tests.support.renderer.gl_models import f32, make_mlp, make_model
from tests.support.renderer.rasterizer_scenes import device

EYE = np.array([0.3, -0.2, 2.0])
BEFORE, AFTER = 3, 5  # rows of other objects
BLOCK, RUNS = WIDTH["cpu"], WIDTH["cpu"] * RUN["cpu"]  # anchors of a block, of a work-item
MOST = 1e-5  # of the largest of a column group: 80 times the rounding of a float


def geometry(heads: ModelHeads, x: float, start: int, arena: tuple, placed: bool) -> None:
    """As the drawing has it: what does not follow x may stay where it is."""
    shapes = heads.shapes_follow or not placed
    heads.anchors.decode_shapes(heads.folded(x), start, *arena, shapes)


def decoded(model: AnchorModel, x: float, eye=EYE, seen=None) -> tuple[np.ndarray, ...]:
    """mean_opacity, covariance, color of the model's rows; those before and after must stay."""
    d, n = device(), model.splat_count
    arrays = [d.upload(np.full((BEFORE + n + AFTER, k), -7, np.float32)) for k in (4, 8, 4)]
    heads = ModelHeads(d, model)
    geometry(heads, x, BEFORE, tuple(arrays[:2]), placed=False)
    heads.color_into(arrays[2], BEFORE, x, eye, seen)
    found = [d.download(array) for array in arrays]
    for rows in found:
        assert (rows[:BEFORE] == -7).all() and (rows[BEFORE + n :] == -7).all()
    return tuple(rows[BEFORE : BEFORE + n] for rows in found)


@pytest.mark.parametrize("anchors", [1, BLOCK, BLOCK + 1, RUNS + 1])
@pytest.mark.parametrize("size", [1.0, 20.0])  # 20: light alone wakes units, and closes them
@pytest.mark.parametrize("channels", [1, 3])
def test_anchors_with_light_by_direction(anchors, size, channels):
    """onnxruntime and numpy's harmonics; at an anchor there is no direction, so no light."""
    model = with_light(make_random_model(anchors, k=3), channels=channels)
    model = replace(model, light=np.float32(size) * model.light)
    for eye in (EYE, -EYE, model.anchors[0].astype(np.float64)):
        found, want = decoded(model, 0.4, eye)[2][:, :3], Evaluator(model).color(0.4, eye)
        np.testing.assert_allclose(found, want, rtol=0, atol=2e-5)
    dark = decoded(replace(model, light=-model.light), 0.4)[2]
    assert np.abs(dark - decoded(model, 0.4)[2]).max() > 0.1


def slow(model: AnchorModel, x: float, eye=EYE) -> tuple[np.ndarray, ...]:
    """The same by float64, network by network."""
    count, k = len(model.anchors), model.splats_per_anchor
    parts = {
        "feature": model.features,
        "control": np.tile(psi_of(model, x), (count, 1)),
        "direction": directions(model.anchors.astype(np.float64), eye),
    }
    out = {}
    for name, mlp in model.networks.items():
        rows = np.concatenate([parts[part] for part in mlp.inputs], axis=1)
        out[name] = run_in_numpy(mlp, rows)
    offset, scale = (out[name].reshape(-1, 3) for name in ("offset", "scale"))
    wxyz = normalize(out["rotation"].reshape(-1, 4))
    if model.frames is not None:
        own, sizes = (np.repeat(part, k, axis=0).astype(np.float64)
                      for part in (model.frames.wxyz, model.frames.scales))  # fmt: skip
        offset = np.einsum("nij,nj->ni", rotation_matrices(own), sizes * offset)
        scale, wxyz = sizes * scale, product(own, wxyz)
    means = np.repeat(model.anchors, k, axis=0) + offset
    sigma = covariance(scale, wxyz)
    return (
        np.column_stack([means, out["opacity"].reshape(-1)]), sigma, out["color"].reshape(-1, 3)
    )  # fmt: skip


def assert_equal(found: tuple[np.ndarray, ...], wanted: tuple[np.ndarray, ...]) -> None:
    """Means and opacities to 1e-5 of the larger of 1 and the largest, colours likewise; Sigma to
    1e-5 of each splat's largest variance.
    """
    for i in (0, 2):
        size = max(1.0, float(np.abs(wanted[i]).max(initial=0)))
        columns = wanted[i].shape[1]
        assert (np.abs(found[i][:, :columns] - wanted[i]) <= MOST * size).all()
    largest = np.abs(wanted[1]).max(axis=1, initial=0)[:, None]
    assert (np.abs(found[1][:, :6] - wanted[1]) <= MOST * largest + 1e-30).all()
    assert not found[1][:, 6:].any() and not found[2][:, 3:].any()


def by_onnxruntime(model: AnchorModel, x: float, eye=EYE) -> tuple[np.ndarray, ...]:
    d, n, evaluator = device(), model.splat_count, Evaluator(model)
    mean_opacity, sigma = d.zeros((n, 4)), d.zeros((n, 8))
    pack(d, evaluator.geometry(x, unit=False), 0, mean_opacity, sigma)
    colors = evaluator.color(x, eye)
    return d.download(mean_opacity), d.download(sigma)[:, :6], colors


@pytest.mark.parametrize("anchors", [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, RUNS - 1, RUNS, RUNS + 1])
@pytest.mark.parametrize("k", [1, 5, 10])
def test_sizes_around_blocks_and_work_items(anchors, k):
    model = make_model(anchors, k=k)
    found = decoded(model, 0.3)
    assert_equal(found, slow(model, 0.3))
    assert_equal(found, by_onnxruntime(model, 0.3))


@pytest.mark.parametrize("anchors", [1, BLOCK + 1])
@pytest.mark.parametrize("k", [1, 3])
def test_anchors_with_axes_and_sizes_of_their_own(anchors, k):
    model = with_frames(make_model(anchors, k=k))
    assert_equal(decoded(model, 0.7), slow(model, 0.7))


@pytest.mark.parametrize("anchors", [1, 64, 65])
def test_the_form_for_a_gpu_an_anchor_a_work_item(anchors, monkeypatch):
    monkeypatch.setitem(decode_heads.WIDTH, device().kind, 1)
    model = with_frames(make_random_model(anchors, k=3))
    assert_equal(decoded(model, 0.4), slow(model, 0.4))


@pytest.mark.parametrize(
    ("features", "k", "hidden", "d"),
    [(1, 1, 1, 2), (19, 8, 15, 3), (5, 3, 16, 9), (48, 2, 17, 16), (7, MOST_SPLATS, 128, 4)],
)
def test_any_width_and_number_of_splats(features, k, hidden, d):
    model = make_model(37, features, k, (hidden,), d)
    assert_equal(decoded(model, 0.6), slow(model, 0.6))


@pytest.mark.parametrize("head", ACTIVATIONS)
@pytest.mark.parametrize("clip", [None, (-0.5, 0.25)])
def test_every_activation_with_clip_and_gain(head, clip):
    model, rng = make_model(33, k=2), np.random.default_rng(1)
    heads = {
        "offset": make_mlp(rng, [32, 16, 6], head, clip=clip, gain=1.7),
        "opacity": make_mlp(rng, [32, 16, 2], head, clip=clip, gain=-0.3),
        "color": make_mlp(rng, [32, 16, 6], head, clip=clip),
    }
    model = replace(model, networks=model.networks | heads)
    assert_equal(decoded(model, 0.2), slow(model, 0.2))


@pytest.mark.parametrize("head", ACTIVATIONS)
@pytest.mark.parametrize("z", [-200.0, -87.5, -20.0, -1e-8, 0.0, 1e-4, 20.0, 80.0])
def test_activations_at_the_ends_of_their_range(head, z):
    model = make_model(3, k=1)
    flat = Mlp((np.zeros((4, 32), np.float32), np.zeros((1, 4), np.float32)),
               (f32(np.zeros(4)), f32([z])), head)  # fmt: skip
    model = replace(model, networks=model.networks | {"opacity": flat})
    wanted = run_in_numpy(flat, np.zeros((3, 32)))
    # tanh is 1 less something: two roundings of a number near 1
    np.testing.assert_allclose(decoded(model, 0.0)[0][:, 3:], wanted, rtol=MOST, atol=2.4e-7)


@pytest.mark.parametrize("x", [0.0, 1e-7, 0.25, 0.5, 0.5 + 1e-6, 1 - 1e-7, 1.0])
def test_stops_ends_and_what_is_between(x):
    model = make_random_model(50, k=2)
    assert_equal(decoded(model, x), slow(model, x))


def test_networks_that_lack_an_input():
    model = without_control(make_random_model(20, k=2), "rotation", "opacity")
    model = without_direction(model)
    assert_equal(decoded(model, 0.4), slow(model, 0.4))
    lone = make_mlp(np.random.default_rng(0), [model.encoding.d, 8, 6], "tanh", inputs=("control",))
    model = replace(model, networks=model.networks | {"offset": lone})
    assert_equal(decoded(model, 0.4), slow(model, 0.4))


def test_an_eye_in_an_anchor_and_one_far_away():
    model = make_random_model(20, k=2)
    for eye in (model.anchors[7], np.array([1e15, -3e15, 2e15])):
        eye = eye.astype(np.float32).astype(np.float64)
        assert_equal(decoded(model, 0.4, eye), slow(model, 0.4, eye))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e30])
def test_a_bad_feature_is_that_of_its_anchor_alone(bad):
    """Its neighbours in the block keep every bit; NaN stays NaN, which no pass draws."""
    model, row = make_random_model(40, k=2), 21
    clean = decoded(model, 0.3)
    model.features[row, 3] = bad  # past the check at the door
    poisoned = decoded(model, 0.3)
    mine = np.repeat(np.arange(40), 2) == row
    for before, after in zip(clean, poisoned, strict=True):
        np.testing.assert_array_equal(after[~mine], before[~mine])
    if np.isnan(bad):
        assert np.isnan(poisoned[0][mine]).all() and np.isnan(poisoned[2][mine, :3]).all()


@pytest.mark.parametrize("name", ["opacity", "scale", "color"])
@pytest.mark.parametrize("head", ACTIVATIONS)
def test_a_nan_in_one_output_is_that_of_its_splats_alone(name, head):
    """Two outputs share a division, whose rounding alone the others may notice."""
    model, k = make_random_model(33, k=5), 5
    network = replace(model.networks[name], head=head)
    model = replace(model, networks=model.networks | {name: network})
    clean = decoded(model, 0.3)
    outputs = len(network.biases[1])
    for output in {0, 1, 2, 4, outputs - 1}:
        last = network.biases[1].copy()
        last[output] = np.nan
        broken = replace(network, biases=(network.biases[0], last))
        found = decoded(replace(model, networks=model.networks | {name: broken}), 0.3)
        mine = np.arange(33 * k) % k == output // (outputs // k)
        for before, after in zip(clean, found, strict=True):
            assert (np.abs(after - before)[~mine] <= MOST * np.abs(before).max()).all()
        column = {"opacity": found[0][mine, 3], "color": found[2][mine, output % 3]}
        if name in column:
            assert np.isnan(column[name]).all()


def test_units_that_sleep_and_units_that_a_direction_wakes():
    """Every unit of the shape sleeps; those of the colour wake on one side of the anchors alone."""
    model = make_random_model(64, k=2, hidden=(16,))
    networks = dict(model.networks)
    for name in HEADS:
        first = np.zeros_like(model.networks[name].weights[0])
        if name == "color":
            first[:, model.features.shape[1] : model.features.shape[1] + 3] = 1.0
        networks[name] = replace(
            model.networks[name],
            weights=(first, model.networks[name].weights[1]),
            biases=(f32(np.full(16, -1.7)), model.networks[name].biases[1]),
        )
    model = replace(model, networks=networks)
    assert_equal(decoded(model, 0.3), slow(model, 0.3))
    towards = np.array([-9.0, -9.0, -9.0])  # sqrt 3 along the diagonal is more than 1.7
    colors = decoded(model, 0.3, towards)[2]
    assert_equal(decoded(model, 0.3, towards), slow(model, 0.3, towards))
    assert np.abs(colors[:, :3] - decoded(model, 0.3)[2][:, :3]).max() > 1e-3


def test_a_quaternion_of_any_length_turns_alike():
    model = make_random_model(17, k=1)
    turns = []
    for gain in (1e-30, 1e-10, 1.0, 1e10, 1e30):
        mlp = replace(model.networks["rotation"], gain=gain)
        turns.append(decoded(replace(model, networks=model.networks | {"rotation": mlp}), 0.3)[1])
    for turn in turns:
        assert (np.abs(turn - turns[2]) <= MOST * np.abs(turns[2]).max(axis=1)[:, None]).all()


def test_blocks_that_nobody_sees_stay_as_they_are():
    if device().kind == "gpu":
        pytest.skip("an anchor is a block there")
    model = make_random_model(3 * BLOCK + 2, k=2)
    seen = np.zeros(len(model.anchors), bool)
    seen[[BLOCK + 3, 3 * BLOCK + 1]] = True
    colors, every = decoded(model, 0.4, seen=seen)[2], decoded(model, 0.4)[2]
    wanted = np.repeat(np.isin(np.arange(len(seen)) // BLOCK, [1, 3]), 2)
    np.testing.assert_array_equal(colors[wanted], every[wanted])
    assert (colors[~wanted] == -7).all()


def test_what_does_not_follow_x_is_decoded_once():
    model = without_control(make_random_model(20, k=2), "offset", "scale", "rotation")
    d, heads = device(), ModelHeads(device(), model)
    mean_opacity, sigma = d.zeros((40, 4)), d.zeros((40, 8))
    geometry(heads, 0.0, 0, (mean_opacity, sigma), placed=False)
    sigma.fill(5)
    geometry(heads, 0.8, 0, (mean_opacity, sigma), placed=True)
    assert (d.download(sigma) == 5).all()
    wanted = slow(model, 0.8)[0]
    np.testing.assert_allclose(d.download(mean_opacity), wanted, atol=MOST)


@pytest.mark.parametrize(
    ("model", "reason"),
    [
        (make_model(3), ""),
        (make_model(3, k=MOST_SPLATS + 1), "17 splats an anchor, more than 16"),
        (make_model(3, hidden=(8, 8)), "its offset network has 3 layers instead of 2"),
        (make_model(3, hidden=()), "its offset network has 1 layers instead of 2"),
        (
            make_model(3, hidden=(MOST_HIDDEN + 1,)),
            "its offset network has 129 hidden units, more than 128",
        ),
    ],
)
def test_which_models_the_kernel_knows(model, reason):
    assert uncovered(model) == reason


def test_a_shape_that_looks_at_the_direction_is_not_known():
    model = make_model(3)
    looks = make_mlp(np.random.default_rng(0), [19, 8, 10], "tanh", inputs=("feature", "direction"))
    model = replace(model, networks=model.networks | {"opacity": looks})
    assert uncovered(model) == "its opacity network looks at the direction"
