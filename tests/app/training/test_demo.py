"""The bundled demo: what lies in assets/ is what `launch.py demo` makes, and it can be made."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.errors import UsageError
from shapeshift.app.paths import TOUCH
from shapeshift.app.training import demo
from shapeshift.renderer.pace import EVEN_ENOUGH, largest_step
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.colliders.collider_files import colliders_of
from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.document.scene_file import read_models
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.world.settle import begin
from shapeshift.scene.world.world import World
from shapeshift.training.synthetic.workshop import STOPS, dome

BUNDLED = Path(__file__).resolve().parents[3] / "assets" / "workshop.shift"


def test_the_bundled_package_is_small_whole_and_of_these_stops():
    assert BUNDLED.stat().st_size <= demo.MOST_BYTES
    model = read_package(BUNDLED)
    assert model.stops == STOPS
    settings = model.provenance["settings"]
    assert settings["max_anchors"] == demo.MOST_ANCHORS
    assert settings["anchor_attributes"] == demo.ATTRIBUTES
    assert settings["blended_shapes"] == demo.BLENDED_SHAPES and model.encoding.d == len(STOPS)
    assert model.provenance["iterations"] == settings["iterations"] == demo.ITERATIONS
    alive = []
    for stop in STOPS:
        splats = evaluate(model, stop.x, np.array([0.0, 0.5, 2.0]))
        assert np.isfinite(splats.means).all()
        alive.append((splats.opacity > 0).sum())
    assert min(alive) > 5000
    low, high = splats.means.min(0), splats.means.max(0)
    assert (high - low > (1.0, 0.3, 0.6)).all()  # metres: a bench


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"size": "1x1"}, "--size is 1x1; each side must be 16 or more"),
        ({"size": "384x15"}, "each side must be 16"),
        ({"views": 0}, "--views is 0, expected 2"),
        ({"test_views": -1}, "--test-views is -1, expected 1"),
        ({"processes": -1}, "--processes is -1, expected 0"),
        ({"iterations": 0}, "iterations is 0"),
        ({"seconds": float("nan")}, "seconds is nan"),
    ],
)
def test_what_is_no_demo_is_refused_before_minutes_of_photos(tmp_path, monkeypatch, changes, said):
    monkeypatch.setattr(demo, "photograph", lambda *_: pytest.fail("photos were taken"))
    with pytest.raises(UsageError, match=said):
        demo.run(replace(demo.Options(out=tmp_path / "out"), **changes))
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_tiny_demo_from_start_to_end_and_again(tmp_path, capsys):
    options = demo.Options(
        out=tmp_path, size="48x36", views=4, test_views=1, processes=1, iterations=20
    )
    assert demo.run(options) == 0
    package = tmp_path / "workshop.shift"
    first = read_package(package)
    assert first.stops == STOPS
    assert "Using the photos" not in capsys.readouterr().err
    assert demo.run(options) == 0
    assert "Using the photos" in capsys.readouterr().err
    again = read_package(package)
    np.testing.assert_array_equal(first.anchors, again.anchors)
    np.testing.assert_array_equal(first.features, again.features)


def pictures(model, xs) -> list[np.ndarray]:
    """(V, H, W, 3) at each x, from three places around the bench."""
    views = [view for view in dome(48, 0.0, (192, 144))][::16]
    with Renderer(None) as renderer:
        renderer.settings = RenderSettings(background=(0.075, 0.078, 0.085))
        seen = []
        for x in xs:
            renderer.update(Scene((SceneObject("demo", model, x=x),)))
            rows = []
            for view in views:
                renderer.draw([view])
                rows.append(renderer.resolved().copy())
            seen.append(np.stack(rows))
    return seen


def test_the_slider_is_a_shift():
    """Nothing happened before x = 0.2 and everything at 0.24, 13 even steps at once, when its
    networks were trained with an encoding whose middle no photo taught.
    """
    model = read_model(BUNDLED)
    assert not model.findings and len(model.pace) == 3
    assert largest_step(model) < 1.5 < EVEN_ENOUGH
    assert largest_step(replace(model, pace=())) < EVEN_ENOUGH
    other = replace(model, between_stops="encoding")  # a program that knows of no blends
    assert largest_step(other) < EVEN_ENOUGH


@pytest.mark.parametrize(("low", "high"), [(0, 1), (1, 2)])
def test_between_two_stops_it_is_their_cross_fade(low, high):
    """32 dB at every x; the palette over the photo's brightness had 19.6 (white tools were hot)."""
    model = read_model(BUNDLED)
    a, b = model.stops[low], model.stops[high]
    xs = np.linspace(a.x, b.x, 11)
    first, *between, last = pictures(model, xs.tolist())
    for x, seen in zip(xs[1:-1], between, strict=True):
        weight = model.blend.weights(x)[high]
        fade = (1 - weight) * first + weight * last
        for one, wanted in zip(seen, fade, strict=True):
            assert -10 * np.log10(np.mean((one - wanted) ** 2)) > 32


# The scene that the program opens: the same bench, with things that were cut out of it.


@pytest.fixture(scope="module")
def things():
    """(scene file, models by name, its world as it begins), with nothing that has to be made."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("shapeshift.scene.colliders.convex_parts.run_coacd", None)
        patch.setattr("shapeshift.scene.colliders.collider.wrap", None)
        file, models = read_models(read_scene_file(TOUCH))
        world = World(file, models, colliders_of(file, models))
    begin(world)
    return file, models, world


def test_the_demo_has_a_mug_and_a_wrench_with_bodies(things):
    file, models, world = things
    assert [item.name for item in file.items] == ["mug", "wrench"]
    assert all(world.objects[item.name].moves and not item.floats for item in file.items)
    assert world.objects["background"].collider is not None and file.floor_y is not None
    assert world.findings == [], "nothing has to be pushed apart"
    for item in file.all_items:  # one slider moves all three
        assert item.x == 0.0 and models[item.name].stops == STOPS


def test_they_stay_where_they_are_until_somebody_takes_them(things):
    """Within 2 % of their size and 2 degrees in a second; the solver's own rest is far below."""
    *_, world = things
    names = ("mug", "wrench")
    before = {name: world.objects[name].pose for name in names}
    for _ in range(world.hz):
        world.step()
    for name in names:
        obj = world.objects[name]
        corners = np.concatenate(obj.collider.parts)
        moved = np.linalg.norm(obj.pose.position - before[name].position)
        assert moved <= 0.02 * np.ptp(corners, axis=0).min()
        turned = 2 * np.arccos(min(abs(float(obj.pose.wxyz @ before[name].wxyz)), 1.0))
        assert np.rad2deg(turned) <= 2


def test_the_mug_is_hot_at_thermal_and_the_wrench_is_as_cold_as_the_room(things):
    """The tracer's mug has 52 to 57 °C and 71 of coffee, its wrench 20, of 15 to 95."""
    _, models, _ = things
    assert STOPS[1].value_range is not None
    low, high = STOPS[1].value_range
    degrees = {}
    for name in ("mug", "wrench"):
        splats = evaluate(models[name], STOPS[1].x, np.array([0.0, 0.5, 2.0]))
        shown = splats.opacity > 0.5
        degrees[name] = low + (high - low) * np.median(splats.color[shown, 0])
    assert 45 < degrees["mug"] < 75 and degrees["wrench"] < 30
