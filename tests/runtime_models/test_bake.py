"""Any model at one x as plain splats: what is there, where, and in which colours."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.commands.exported import ExportLook, Part, bake_part
from shapeshift.renderer.colors.palette import LUMINANCE, palette_values
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.bake import LEAST_ALPHA, bake
from shapeshift.runtime_models.colors.spherical_harmonics import COEFFICIENTS, basis, shade
from shapeshift.runtime_models.evaluate import directions, evaluate
from shapeshift.runtime_models.eyes import EYES, MOST_EYES, eyes_of, spread_eyes
from shapeshift.runtime_models.fit_harmonics import (
    BLOCK,
    ROUND,
    ROUND_SHARE,
    fit_rows,
    fit_seen_colors,
    recolored,
    spread_directions,
)
from shapeshift.runtime_models.model import BadFile, SplatLayers, Stop
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.write_plain import merged, placed
from shapeshift.scene.cameras.framing import default_view
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.selectors.selector import Painted, Sphere
from tests.support.models import make_random_model
from tests.support.splat_scenes import random_layers
from tests.support.splats.scaffold_scenes import random_raw, write_run

FAR = 1e7  # metres: seen from there all directions are the same


@pytest.fixture(scope="module")
def model():
    return make_random_model(60, k=4)


@pytest.mark.parametrize("x", [0.0, 0.5, 1.0])
def test_places_and_opacities_are_the_evaluators(model, x):
    """The slow twin, row by row."""
    whole = evaluate(model, x, np.zeros(3))
    plain = bake(model, x)
    row = 0
    for i in range(model.splat_count):
        if not whole.opacity[i] >= LEAST_ALPHA:
            continue
        for name in ("means", "scales", "wxyz", "opacity"):
            np.testing.assert_allclose(
                getattr(plain, name)[row], getattr(whole, name)[i], rtol=1e-5, atol=1e-6
            )
        row += 1
    assert row == len(plain.means)
    absent = model.splat_count - row
    assert (sum(f.count for f in plain.findings) == absent) and absent > 0


def test_colors_are_the_least_squares_fit_over_the_sphere(model):
    """Beside numpy's own solver on the same directions, and better with every degree."""
    spread = spread_directions(64)
    assert np.abs(spread.mean(0)).max() < 2e-3
    seen = [evaluate(model, 0.3, -FAR * d) for d in spread]  # the network's own answers
    there = seen[0].opacity >= LEAST_ALPHA
    colors = np.stack([s.color[there] for s in seen])  # (64, n, 3)
    worst = []
    for degree, count in enumerate(COEFFICIENTS):
        sh = bake(model, 0.3, sh_degree=degree).sh
        assert sh.shape == (there.sum(), count, 3)
        rows = basis(spread.astype(np.float64), count)
        flat = colors.reshape(64, -1) - 0.5
        wanted = np.linalg.lstsq(rows, flat, rcond=None)[0].reshape(count, -1, 3)
        np.testing.assert_allclose(sh, wanted.transpose(1, 0, 2), atol=2e-5)
        fitted = np.einsum("dm,nmc->dnc", rows, sh)
        worst.append(np.sqrt(np.mean((fitted + 0.5 - colors) ** 2)))
    assert worst[0] > worst[1] > worst[2] > worst[3]
    assert worst[3] < 0.2 * worst[0]


def test_directions_solve_every_degree():
    for count in COEFFICIENTS:
        spread, parts = fit_rows(count)
        np.testing.assert_allclose(parts.T @ basis(spread, count), np.eye(count), atol=1e-5)
        assert np.linalg.cond(basis(spread.astype(float), count)) < 1.1


# Where the model knows from where its photos were taken


@pytest.mark.parametrize("anchors", [1, 255, 256, 257])
@pytest.mark.parametrize("count", COEFFICIENTS)
def test_seen_colors_are_the_weighted_fit_of_each_anchor(anchors, count, monkeypatch):
    """Beside numpy's own solver, an anchor at a time, on rows times the roots of their weights."""
    monkeypatch.setattr("shapeshift.runtime_models.fit_harmonics.BLOCK", 256)
    rng = np.random.default_rng(anchors)
    places = rng.uniform(-1, 1, (anchors, 3)).astype(np.float32)
    rows = np.flatnonzero(rng.uniform(size=2 * anchors) < 0.8) // 2  # of some one, of some none
    eyes = rng.normal(size=(5, 3)) + np.array([0, 3, 0])  # all above
    own = rng.normal(size=(len(rows), 3, 3)).astype(np.float32)

    def color_along(toward: np.ndarray) -> np.ndarray:
        bent = np.einsum("nij,nj->ni", own, toward[rows])
        return np.abs(bent).astype(np.float32)

    found = fit_seen_colors(color_along, places, rows, eyes, count)
    spread = [np.tile(d, (anchors, 1)) for d in spread_directions(ROUND)]
    looks = spread + [directions(places, eye) for eye in eyes]
    root = np.sqrt([ROUND_SHARE / ROUND] * ROUND + [(1 - ROUND_SHARE) / 5] * 5)[:, None]
    colors = np.stack([color_along(look) for look in looks])  # (D, n, 3)
    assert found.shape == (len(rows), count, 3) and found.dtype == np.float32
    for i in {0, len(rows) // 2, len(rows) - 1} if len(rows) else ():
        toward = np.stack([look[rows[i]] for look in looks]).astype(np.float64)
        matrix, wanted = root * basis(toward, count), root * (colors[:, i] - 0.5)
        np.testing.assert_allclose(
            found[i], np.linalg.lstsq(matrix, wanted, rcond=None)[0], rtol=2e-3, atol=2e-3
        )  # float32 sums, of equations whose condition is 1 / ROUND_SHARE and more
        fitted = root * basis(toward, count) @ found[i]
        least = root * basis(toward, count) @ np.linalg.lstsq(matrix, wanted, rcond=None)[0]
        assert np.sum((fitted - wanted) ** 2) <= np.sum((least - wanted) ** 2) * 1.0001 + 1e-9


def test_an_export_is_better_where_the_photos_were(model):
    """From between the eyes; from below, where there was none, it is worse than without them."""
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    eyes = np.stack([0.8 * np.cos(turn), np.full(12, 3.0), 0.8 * np.sin(turn)], axis=1)
    knowing = replace(model, provenance=spread_eyes(eyes))
    assert {tuple(eye) for eye in eyes_of(knowing)} == {tuple(eye) for eye in eyes.round(3)}

    def error(of: np.ndarray, eye: np.ndarray) -> float:
        whole = evaluate(model, 0.3, eye)
        there = whole.opacity >= LEAST_ALPHA
        toward = np.repeat(directions(model.anchors, eye), 4, axis=0)[there]
        return float(np.sqrt(np.mean((shade(of, toward) - whole.color[there]) ** 2)))

    half = np.pi / 12  # between two of them
    between, below = np.array([0.8 * np.cos(half), 3, 0.8 * np.sin(half)]), np.array([0.0, -4, 0])
    for degree in (0, 1, 2, 3):
        with_eyes, without = (bake(m, 0.3, sh_degree=degree).sh for m in (knowing, model))
        assert error(with_eyes, between) < 0.6 * error(without, between)
        assert error(with_eyes, below) > error(without, below)


def test_an_eye_at_an_anchor_and_a_single_eye_are_sound(model):
    for eyes in ([model.anchors[0].tolist()], [[0.0, 1e30, 0.0]], [[0, 2, 0]]):
        assert np.isfinite(bake(replace(model, provenance={EYES: eyes}), 0.3).sh).all()


@pytest.mark.parametrize("count", [0, 1, 2, MOST_EYES - 1, MOST_EYES, MOST_EYES + 1, 500])
def test_eyes_are_far_from_one_another(count):
    """Some of the places, each once; no place is farther from them than they from each other."""
    places = np.random.default_rng(count).normal(size=(count, 3)) * 7
    found = np.array(spread_eyes(places)[EYES]).reshape(-1, 3)
    assert len(found) == min(count, MOST_EYES)
    if not count:
        return
    off = np.linalg.norm(places[:, None] - found, axis=2)  # (N, E)
    assert off.min(axis=0).max() < 0.01  # rounded to four digits of about 40 m
    assert len(set(off.argmin(axis=0))) == len(found)
    if len(found) > 1:
        apart = np.linalg.norm(found[:, None] - found, axis=2)[~np.eye(len(found), dtype=bool)]
        assert off.min(axis=1).max() <= apart.min() + 0.01


def test_eyes_at_one_place_are_one():
    assert spread_eyes(np.tile([1.23456, -7, 0], (9, 1)))[EYES] == [[1.2346, -7.0, 0.0]]


def test_a_control_value_an_anchor(model):
    x = np.where(model.anchors[:, 0] > 0, 1.0, 0.0).astype(np.float32)
    plain, ends = bake(model, x), [bake(model, value) for value in (0.0, 1.0)]
    known = {row.tobytes() for end in ends for row in end.means.round(4)}
    assert {row.tobytes() for row in plain.means.round(4)} <= known
    assert len(plain.means) not in (len(ends[0].means), 0)


def test_layers_keep_what_they_were_trained_with():
    layers = random_layers(300, coefficients=16, layers=3)
    labels = np.arange(300, dtype=np.int32) % 3
    layers = replace(
        layers, labels=labels, extra={"error": labels * 2}, origin=(1e6, 2.0, 3.0), antialiased=True
    )
    plain = bake(layers, 0.25)
    there = layers.opacity * layers.weights(0.25)[layers.layer] >= LEAST_ALPHA
    for name in ("means", "scales", "wxyz", "sh", "labels"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(layers, name)[there])
    np.testing.assert_array_equal(plain.extra["error"], layers.extra["error"][there])
    assert plain.origin == layers.origin and plain.antialiased
    half = layers.layer[there] == 1  # the second layer is half there
    np.testing.assert_allclose(plain.opacity[half], layers.opacity[there][half] / 2)
    low = bake(layers, 0.25, sh_degree=1)
    np.testing.assert_array_equal(low.sh, layers.sh[there, :4])
    some = bake(layers, 0.25, keep=labels == 2)
    np.testing.assert_array_equal(some.means, layers.means[there & (labels == 2)])


def test_broken_and_faint_splats_are_left_out():
    layers = random_layers(6)
    layers.opacity[:4] = (0.0, 1 / 256, LEAST_ALPHA, 1.0)
    plain = bake(layers, 0.0)
    kept = layers.opacity >= LEAST_ALPHA
    assert len(plain.means) == kept.sum() == 4
    layers.means[5] = np.nan  # written after the check at the door
    assert len(bake(layers, 0.0).means) == 3
    layers.opacity[:] = 0
    with pytest.raises(BadFile, match="none of 6 splats is there at this x"):
        bake(layers, 0.0)
    with pytest.raises(BadFile, match="degree 4"):
        bake(layers, 0.0, sh_degree=4)


def test_scaffold_models_are_baked_from_one_eye(tmp_path):
    """What is there and its shape as from the eye, colours along every direction."""
    folder = write_run(random_raw(60, k=3, distance=True), tmp_path / "run")
    model, eye = read_model(folder), np.array([0.3, 0.8, 2.5])
    with pytest.raises(BadFile, match="say from where it is seen"):
        bake(model, 0.0)
    plain, whole = bake(model, 0.0, eye), evaluate(model, 0.0, eye)
    there = whole.opacity >= LEAST_ALPHA
    assert 0 < there.sum() < len(there)
    for name in ("means", "scales", "wxyz", "opacity"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(whole, name)[there])
    # Degree 3 has what the network gives along each anchor's own direction, nearly.
    toward = np.repeat(directions(model.anchors, eye), model.splats_per_anchor, axis=0)[there]
    error = np.abs(shade(plain.sh, toward) - whole.color[there])
    assert error.mean() < 0.02
    flat = bake(model, 0.0, eye, sh_degree=0)
    assert np.abs(shade(flat.sh, toward) - whole.color[there]).mean() > 3 * error.mean()
    splats = bake_part(Part(SceneObject("run", model)), ExportLook())
    assert any("--eye" in finding.done for finding in splats.findings)
    other = bake_part(Part(SceneObject("run", model)), ExportLook(eye=tuple(eye)))
    np.testing.assert_array_equal(other.opacity, plain.opacity)


# As the program shows it: false colours, regions, poses


def drawn(*objects, view) -> np.ndarray:
    with Renderer(None) as renderer:
        renderer.update(Scene(objects))
        renderer.draw([view])
        return renderer.resolved(0).copy()


def as_layers(plain) -> SplatLayers:
    arrays = (plain.means, plain.scales, plain.wxyz, plain.opacity, plain.sh)
    return SplatLayers(*arrays, np.zeros(len(plain.means), np.int32), (Stop("only", 0.0),))


def test_a_region_looks_as_it_is_shown(model):
    inside = Sphere(centre=(0.3, 0, 0), radius=0.5, x=1.0, border=0.2)
    obj = SceneObject("random", model, selectors=(inside,))
    plain = bake_part(Part(obj), ExportLook())
    view = default_view(model, (90, 60))
    wanted = drawn(obj, view=view)
    found = drawn(SceneObject("baked", as_layers(plain)), view=view)
    # The palette is laid over each splat here, and over the blended heat on screen.
    assert psnr(found, wanted) > 35
    plainly = bake_part(Part(obj), ExportLook(palette=False))
    assert psnr(drawn(SceneObject("b", as_layers(plainly)), view=view), wanted) < 35


def test_palette_of_layers_is_laid_over_each_color():
    layers = random_layers(200, coefficients=1, layers=1)
    stops = (Stop("heat", 0.0, "thermal", "ironbow"),)
    plain = bake_part(Part(SceneObject("hot", replace(layers, stops=stops))), ExportLook())
    there = layers.opacity >= LEAST_ALPHA
    up = np.tile(np.array([0, 1, 0], np.float32), (there.sum(), 1))
    false = palette_values(shade(layers.sh[there], up) @ LUMINANCE, "ironbow")
    np.testing.assert_allclose(shade(plain.sh, up), false, atol=1e-5)
    as_filed = bake_part(
        Part(SceneObject("hot", replace(layers, stops=stops))), ExportLook(palette=False)
    )
    np.testing.assert_array_equal(as_filed.sh, layers.sh[there])


@pytest.mark.parametrize("count", [1, BLOCK - 1, BLOCK, BLOCK + 1])
@pytest.mark.parametrize("coefficients", COEFFICIENTS)
def test_coloring_anew_is_the_fit_of_the_new_colors(count, coefficients):
    """Beside one splat at a time; and nothing changes where the colours do not."""
    rng = np.random.default_rng(count)
    sh = (rng.normal(size=(count, coefficients, 3)) * 0.05).astype(np.float32)
    np.testing.assert_allclose(recolored(sh, lambda at, rows: at(0.0)), sh, atol=2e-6)
    gain = rng.uniform(0.5, 2, count).astype(np.float32)
    found = recolored(sh, lambda at, rows: gain[rows, None] * at(0.0) ** 2)
    spread, _ = fit_rows(coefficients, 4 * coefficients)
    for i in {0, count // 2, count - 1}:
        seen = shade(np.repeat(sh[i : i + 1], len(spread), 0), spread)
        wanted = np.linalg.lstsq(basis(spread, coefficients), gain[i] * seen**2 - 0.5, rcond=None)[
            0
        ]
        np.testing.assert_allclose(found[i], wanted, atol=1e-5)


def test_inside_is_by_anchor_and_by_paint(model):
    obj = SceneObject("random", model)
    ball = Sphere(centre=(0.0, 0, 0), radius=0.6, x=0.0)
    near = np.linalg.norm(model.anchors, axis=1) <= 0.6
    whole, part = (bake_part(Part(obj, i), ExportLook(0)) for i in (None, (ball,)))
    rows = np.repeat(near, 4)[evaluate(model, 0.0, np.zeros(3)).opacity >= LEAST_ALPHA]
    np.testing.assert_array_equal(part.means, whole.means[rows])
    painted = bake_part(Part(obj, (Painted(near, 0.5),)), ExportLook(0))
    np.testing.assert_array_equal(painted.means, part.means)
    both = bake_part(Part(obj, (ball, Painted(~near, 0.5))), ExportLook(0))
    np.testing.assert_array_equal(both.means, whole.means)


def test_objects_are_merged_where_they_stand():
    one, two = random_layers(70, seed=1), random_layers(50, seed=2, coefficients=16)
    pose = Pose(np.array([0.5, -0.2, 0.1]), np.array([0.5, 0.5, -0.5, 0.5]))
    objects = (SceneObject("one", one), SceneObject("two", two, pose))
    whole = merged([bake_part(Part(obj), ExportLook()) for obj in objects])
    assert whole.sh.shape == (len(whole.means), 16, 3)
    whole = replace(whole, means=whole.means + np.array(whole.origin, np.float32))
    view = default_view(one, (90, 60))
    wanted = drawn(*objects, view=view)
    assert psnr(drawn(SceneObject("merged", as_layers(whole)), view=view), wanted) > 60


def test_a_far_place_keeps_its_millimetres():
    near = bake(random_layers(40), 0.0)
    far = placed(near, np.eye(3), (4e6, -2e6, 5e5))
    assert far.origin == (4e6, -2e6, 5e5)
    np.testing.assert_array_equal(far.means, near.means)
    both = merged([far, placed(near, np.eye(3), (4e6 + 1, -2e6, 5e5))])
    np.testing.assert_allclose(
        both.means[len(near.means) :] - near.means, [[1, 0, 0]] * len(near.means), atol=1e-6
    )
