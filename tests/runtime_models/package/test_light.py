"""Anchors with light by direction: what it means, on disk and back, turned, and what is refused."""

import io
import json
from dataclasses import replace

import numpy as np
import onnxruntime
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import sph_harm_y

from shapeshift.runtime_models.bake import bake
from shapeshift.runtime_models.colors.color_bounds import color_slope
from shapeshift.runtime_models.colors.spherical_harmonics import (
    LIGHT_COEFFICIENTS,
    WIDTHS,
    harmonics,
    light_along,
    most_light,
    shade,
    turn_light,
)
from shapeshift.runtime_models.evaluate import Evaluator, evaluate
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.package.drop_unused import drop_unused
from shapeshift.runtime_models.package.feature_codes import (
    EXACT,
    FEATURES,
    decode_features,
    encode_light,
)
from shapeshift.runtime_models.package.package_files import ANCHORS, MANIFEST
from shapeshift.runtime_models.package.read_package import read_files, read_package
from shapeshift.runtime_models.package.write_package import package_files, write_package
from shapeshift.runtime_models.read_scene import describe
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.runtime_models.stops.change_stops import (
    NewUnits,
    add_units,
    insert_stop,
    remove_stop,
)
from shapeshift.training.export import with_light as carried
from tests.support.models import (
    make_random_model,
    psi_of,
    with_frames,
    with_light,
    without_control,
)

EYE = np.array([0.3, -0.2, 2.0])


def spread(count: int, seed: int = 0) -> np.ndarray:
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def by_scipy(direction: np.ndarray) -> np.ndarray:
    """(N, 8) real harmonics of degree 1 and 2 from scipy's complex ones, over that of z's size."""
    x, y, z = direction.T
    polar, around = np.arccos(np.clip(z, -1, 1)), np.arctan2(y, x)

    def real(degree: int, order: int) -> np.ndarray:
        value = sph_harm_y(degree, abs(order), polar, around) * (-1) ** order  # no phase
        if order == 0:
            return value.real
        return np.sqrt(2) * (value.real if order > 0 else value.imag)

    orders = [(1, 1), (1, -1), (1, 0), (2, -2), (2, -1), (2, 1), (2, 0), (2, 2)]
    return np.stack([real(*each) for each in orders], 1) / np.sqrt(3 / (4 * np.pi))


def test_the_functions_are_those_of_scipy():
    direction = np.concatenate([spread(200), np.eye(3), -np.eye(3)])
    np.testing.assert_allclose(harmonics(direction), by_scipy(direction), atol=1e-12)


def test_they_are_orthogonal_and_of_one_size_over_the_sphere():
    """By a product rule that is exact for polynomials of this degree: Gauss in z, even turns."""
    z, weight = np.polynomial.legendre.leggauss(8)
    turn = 2 * np.pi * np.arange(16) / 16
    ring = np.sqrt(1 - z**2)[:, None]
    places = [ring * np.cos(turn), ring * np.sin(turn), np.broadcast_to(z[:, None], (8, 16))]
    values = harmonics(np.stack([each.ravel() for each in places], 1))
    mean = np.einsum("n,na,nb->ab", np.repeat(weight, 16) / 32, values, values)
    np.testing.assert_allclose(mean, np.eye(LIGHT_COEFFICIENTS) / 3, atol=1e-12)


def test_no_direction_gives_no_light():
    assert not harmonics(np.zeros((2, 3), np.float32)).any()


CHANNELS = pytest.mark.parametrize("channels", list(WIDTHS))


@CHANNELS
def test_light_stays_below_its_bound_and_may_reach_it(channels):
    direction = spread(4000)
    light = np.random.default_rng(1).normal(size=(50, WIDTHS[channels]))
    each = light.reshape(50, channels, LIGHT_COEFFICIENTS)  # red, green, blue
    most = np.abs(each @ harmonics(direction).T).max(axis=2)
    assert most_light(light).shape == most.shape
    assert (most <= most_light(light)).all()
    ahead = np.array([[0.0, 0, 1]])
    same_way = np.tile(harmonics(ahead), channels)  # both degrees are largest there: 1 + 5/3
    assert most_light(same_way)[0] == pytest.approx(8 / 3)
    assert light_along(same_way, ahead)[0] == pytest.approx(8 / 3)


def test_channels_are_apart_and_one_after_the_other():
    light, direction = np.random.default_rng(2).normal(size=(40, 24)), spread(40)
    found = light_along(light, direction)
    for channel in range(3):
        own = light[:, 8 * channel : 8 * channel + 8]
        np.testing.assert_array_equal(found[:, [channel]], light_along(own, direction))
        np.testing.assert_allclose(
            found[:, channel], (own * by_scipy(direction)).sum(1), atol=1e-12
        )


@CHANNELS
@pytest.mark.parametrize("seed", range(3))
def test_turned_light_is_the_same_light_seen_from_a_turned_eye(seed, channels):
    turn = Rotation.random(random_state=seed).as_matrix()
    light = np.random.default_rng(seed).normal(size=(40, WIDTHS[channels]))
    direction = spread(40, seed + 9)
    found = light_along(turn_light(light, turn), direction @ turn.T)
    np.testing.assert_allclose(found, light_along(light, direction), atol=1e-12)
    back = turn_light(turn_light(light, turn), turn.T)
    np.testing.assert_allclose(back, light, atol=1e-12)


def logits(color: np.ndarray) -> np.ndarray:
    return np.log(color / (1 - color))


@pytest.mark.parametrize("fold", [True, False])
@pytest.mark.parametrize("hidden", [1, 32])
@CHANNELS
def test_an_exported_network_adds_the_light_to_every_logit(fold, hidden, channels):
    """Its oracle is scipy's harmonics and float64; the colours are far from 0 and 1."""
    bare = make_random_model(37, k=3, hidden=(hidden,))
    light = np.random.default_rng(3).normal(0, 0.3, (37, WIDTHS[channels])).astype(np.float32)
    color = carried(bare.networks["color"], 16, channels)
    model = replace(bare, networks=bare.networks | {"color": color}, light=light)
    delta = model.anchors - EYE
    delta /= np.linalg.norm(delta, axis=1, keepdims=True)
    added = np.stack(
        [(part * by_scipy(delta)).sum(axis=1) for part in np.split(light, channels, 1)]
    )
    added = np.broadcast_to(added, (3, 37)).T  # of red, green and blue
    for x in (0.0, 0.4, 1.0):
        shown = Evaluator(model, fold=fold).color(x, EYE).astype(np.float64)
        plain = Evaluator(bare, fold=fold).color(x, EYE).astype(np.float64)
        found = (logits(shown) - logits(plain)).reshape(37, -1)
        np.testing.assert_allclose(found, np.tile(added, 3), atol=2e-4)


@CHANNELS
def test_folded_whole_and_chosen_rows_agree(channels):
    model = with_light(make_random_model(50, k=2), channels=channels)
    want = Evaluator(model, fold=False).color(0.3, EYE)
    folded = Evaluator(model)
    np.testing.assert_allclose(folded.color(0.3, EYE), want, atol=1e-6)
    seen = np.random.default_rng(0).random(50) < 0.4
    out = np.full_like(want, 7)
    folded.color(0.3, EYE, seen, out)
    rows = np.repeat(seen, 2)
    np.testing.assert_allclose(out[rows], want[rows], atol=1e-6)
    assert (out[~rows] == 7).all()
    delta = model.anchors - EYE
    direction = (delta / np.linalg.norm(delta, axis=1, keepdims=True)).astype(np.float32)
    np.testing.assert_allclose(folded.color_along(0.3, direction), want, atol=1e-6)


@CHANNELS
@pytest.mark.parametrize("sides", [2, 50])
def test_a_control_an_anchor_has_its_own_light(sides, channels):
    """Two controls run in two folded networks, many in a whole one: each as one for all does."""
    model = with_light(make_random_model(50, k=2), channels=channels)
    xs = np.linspace(0, 1, sides)
    x = xs[np.arange(50) % sides].astype(np.float32)
    found = Evaluator(model).color(x, EYE).reshape(50, -1)
    for value in xs[:3].astype(np.float32):
        one = evaluate(model, float(value), EYE).color.reshape(50, -1)
        np.testing.assert_allclose(found[x == value], one[x == value], atol=1e-5)


@CHANNELS
def test_the_file_itself_run_by_onnxruntime_gives_the_same(tmp_path, channels):
    """As docs/package.md says it to a stranger; nothing of ours between the bytes and numbers."""
    lit = with_light(make_random_model(30, k=4), channels=channels)
    write_package(lit, tmp_path / "scene", "float32")
    manifest = json.loads((tmp_path / "scene" / MANIFEST).read_text())
    assert manifest["format"] == {1: "shapeshift 3", 3: "shapeshift 4"}[channels]
    with np.load(tmp_path / "scene" / ANCHORS) as arrays:
        positions, features, light = (arrays[n] for n in ("positions", "features", "light"))
    d = positions.astype(np.float64) - EYE
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    x, y, z = d.T
    terms = [
        x, y, z, np.sqrt(5) * x * y, np.sqrt(5) * y * z, np.sqrt(5) * z * x,
        np.sqrt(5 / 12) * (2 * z * z - x * x - y * y), np.sqrt(5 / 4) * (x * x - y * y),
    ]  # fmt: skip
    added = np.stack(
        [sum(light[:, 8 * c + i] * term for i, term in enumerate(terms)) for c in range(channels)],
        axis=1,
    )
    model = read_package(tmp_path / "scene")
    parts = {"feature": features, "direction": d, "light": added,
             "control": np.tile(psi_of(model, 0.6), (30, 1))}  # fmt: skip
    rows = np.concatenate([parts[p] for p in manifest["heads"]["color"]["inputs"]], axis=1)
    session = onnxruntime.InferenceSession(
        tmp_path / "scene" / "color.onnx", providers=["CPUExecutionProvider"]
    )
    found = session.run(["output"], {"input": rows.astype(np.float32)})[0].reshape(-1, 3)
    np.testing.assert_allclose(Evaluator(model).color(0.6, EYE), found, atol=1e-6)


@pytest.mark.parametrize("frames", [True, False])
@pytest.mark.parametrize("kind", [*FEATURES, EXACT])
@CHANNELS
def test_a_package_gives_back_the_light(tmp_path, kind, frames, channels):
    model = with_light(make_random_model(300), channels=channels)
    model = with_frames(model) if frames else model
    write_package(model, tmp_path / "a.shift", kind)
    back = read_package(tmp_path / "a.shift")
    assert (back.frames is not None) == frames
    # A byte: half of the least power of two of which 127 reach the column's largest number.
    step = 2.0 ** np.ceil(np.log2(np.abs(model.light).max(axis=0) / 127))
    exact = kind in ("float32", EXACT)
    assert (np.abs(back.light - model.light) <= (0 if exact else step / 2)).all()
    facts = describe(back, tmp_path / "a.shift")
    size, ends = (4, 0) if exact else (1, 64)
    assert facts["format"] == {1: "shapeshift 3", 3: "shapeshift 4"}[channels]
    assert facts["light_by_direction_bytes"] == channels * (300 * 8 * size + ends)
    write_package(back, tmp_path / "b.shift", EXACT)
    np.testing.assert_array_equal(read_package(tmp_path / "b.shift").light, back.light)
    fewer = back.with_anchors(np.arange(0, 300, 7))
    write_package(fewer, tmp_path / "c.shift", EXACT)
    again = read_package(tmp_path / "c.shift")
    np.testing.assert_array_equal(again.light, fewer.light)
    assert written_kind(again) == (np.float32 if exact else np.uint8)


def written_kind(model) -> np.dtype:
    with np.load(io.BytesIO(package_files(model, EXACT)[ANCHORS])) as arrays:
        return arrays["light"].dtype


@pytest.mark.parametrize(
    "largest, step",
    [
        (0, 1), (1e-45, 2.0**-140), (127, 1), (np.nextafter(np.float32(127), np.float32(200)), 2),
        (np.nextafter(np.float32(127), np.float32(0)), 1), (128, 2), (63.5, 0.5), (10_000, 128),
    ],
)  # fmt: skip
def test_steps_of_light_are_the_least_powers_of_two(largest, step):
    """Where 127 steps reach the largest number exactly, no more are taken."""
    light = np.zeros((3, 8), np.float32)
    light[1, 2] = -largest
    found = encode_light(light, "float16")
    assert found["light_range"][:, 2].tolist() == [-128 * step, 127 * step]
    back = decode_features(found["light"], found["light_range"], "here", "light")
    assert abs(back[1, 2] + largest) <= step / 2
    assert not np.delete(back.ravel(), 10).any()  # 0 stays 0
    again = encode_light(back, EXACT)
    np.testing.assert_array_equal(
        decode_features(again["light"], again["light_range"], "here", "light"), back
    )


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("kind", [*FEATURES, EXACT])
def test_light_that_is_no_number_is_not_written_as_one(tmp_path, value, kind):
    model = with_light(make_random_model(10))
    model.light[3, 4] = value
    with pytest.raises(BadFile, match="light"):
        write_package(model, tmp_path / "a.shift", kind)
    assert not (tmp_path / "a.shift").exists()


def test_a_package_without_light_is_as_it_was(tmp_path):
    model = with_frames(make_random_model(10))
    files = package_files(model, "float16")
    assert json.loads(files[MANIFEST])["format"] == "shapeshift 2"
    with np.load(io.BytesIO(files[ANCHORS])) as arrays:
        assert set(arrays) == {"positions", "features", "frame_log_scales", "frame_rotations"}
    back = read_files(files.__getitem__, "here")
    assert back.light is None
    write_package(back, tmp_path / "a.shift")
    assert "light_by_direction_bytes" not in describe(back, tmp_path / "a.shift")


def test_what_nothing_shows_goes_with_its_light():
    model = with_light(make_random_model(40, k=2))
    alive = np.random.default_rng(2).random((40, 2)) < 0.4
    smaller, removed = drop_unused(model, alive)
    kept = alive.any(axis=1)
    assert removed.anchors == (~kept).sum() > 0
    np.testing.assert_array_equal(smaller.light, model.light[kept])


@CHANNELS
@pytest.mark.parametrize("size", [0.0, 1.0])
def test_units_that_carry_light_go_only_where_there_is_none(size, channels):
    bare = make_random_model(30)
    color = carried(bare.networks["color"], 16, channels)
    light = np.random.default_rng(0).normal(0, size, (30, WIDTHS[channels])).astype(np.float32)
    model = replace(bare, networks=bare.networks | {"color": color}, light=light)
    # In reach of the bound alone: units that light opens, and nothing else does.
    biases = (color.biases[0].copy(), color.biases[1])
    each = light.reshape(30, channels, LIGHT_COEFFICIENTS) @ harmonics(spread(5000)).T
    # Units carry the channels, then the channels below 0.
    biases[0][-2 * channels :] = -0.9 * np.tile(np.abs(each).max(axis=(0, 2)), 2)
    gated = replace(model, networks=model.networks | {"color": replace(color, biases=biases)})
    for each in (model, gated):
        smaller, _ = drop_unused(each, np.ones((30, 5), bool))
        assert (smaller.light is None) == (size == 0)
        assert ("light" in smaller.networks["color"].inputs) == (size > 0)
        assert len(smaller.networks["color"].biases[0]) == 32 + (2 * channels if size else 0)
        for eye in (EYE, -EYE, np.array([0.1, 3.0, 0])):
            np.testing.assert_allclose(
                evaluate(smaller, 0.4, eye).color, evaluate(each, 0.4, eye).color, atol=1e-6
            )


@CHANNELS
def test_a_new_stop_leaves_light_as_it_was_and_may_go_again(channels):
    model = with_light(make_random_model(25, k=2), channels=channels)
    names, rng = [stop.name for stop in model.stops], np.random.default_rng(4)
    wide = insert_stop(model, "Styled", names[0])
    units = {"color": NewUnits(rng.normal(size=(3, 17)), rng.normal(size=3),
                               rng.normal(size=(6, 3)))}  # fmt: skip
    wide = add_units(wide, "Styled", rng.normal(size=(25, 1)), units)
    np.testing.assert_array_equal(wide.light, model.light)

    def shown(of, stop):
        return evaluate(of, StopWeights(((stop, 1.0),)), EYE).color

    for name in names:
        np.testing.assert_allclose(shown(wide, name), shown(model, name), atol=2e-5)
    assert np.abs(shown(wide, "Styled") - shown(model, names[0])).max() > 0.01
    again = remove_stop(wide, "Styled")
    color, was = again.networks["color"], model.networks["color"]
    assert color.inputs == was.inputs
    assert len(color.biases[0]) == len(was.biases[0])  # the units of the stop have gone with it
    for name in names:
        np.testing.assert_allclose(shown(again, name), shown(model, name), atol=2e-5)


@CHANNELS
def test_baked_harmonics_follow_light(channels):
    """A network blind but for light: degree 2 of what a small light adds, to its rounding."""
    bare = make_random_model(20, k=1)
    color = carried(bare.networks["color"], 16, channels)
    first = color.weights[0].copy()
    first[:, 16:19] = 0
    color = replace(color, weights=(first, color.weights[1]))
    light = np.random.default_rng(1).normal(0, 0.02, (20, WIDTHS[channels])).astype(np.float32)
    model = replace(bare, networks=bare.networks | {"color": color}, light=light)
    plain = bake(model, 0.0, sh_degree=2)
    there = Evaluator(model).geometry(0.0)[3] >= 1 / 255
    for direction in np.concatenate([spread(20, 5), np.eye(3)]).astype(np.float32):
        every = np.tile(direction, (20, 1))
        want = Evaluator(model).color_along(0.0, every)[there]
        # What is not linear in light of 0.1: a tenth of its square.
        assert np.abs(shade(plain.sh, every[there]) - want).max() < 1e-3


def test_the_slope_of_colours_counts_light():
    """Light of degree 1 alone, all else blind: |dl / dangle| has the mean square |c|^2 / 3."""
    bare = without_control(make_random_model(4000, k=1), "color")
    color = carried(bare.networks["color"], 16, 1)
    first = color.weights[0].copy()
    first[:32] = 0
    last = color.weights[1].copy()
    last[:, :32] = 0
    flat = (np.zeros_like(color.biases[0]), np.zeros_like(color.biases[1]))
    color = replace(color, weights=(first, last), biases=flat)
    light = np.zeros((4000, 8), np.float32)
    light[:, 2] = 0.2
    model = replace(bare, networks=bare.networks | {"color": color}, light=light)
    # A quarter: the sigmoid's slope at 0.  4,000 random directions: to 2 %.
    assert color_slope(model) == pytest.approx(0.25 * 0.2 / np.sqrt(3), rel=0.03)
