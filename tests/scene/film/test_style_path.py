"""Style paths: what a text means, beta_t between two keys, and one function for all who blend."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stop_weights import Pace, StopBlend, StopWeights
from shapeshift.scene.cameras.framing import default_view
from shapeshift.scene.control import Shift, Sweep, control_of
from shapeshift.scene.film.style_path import PERCENT, read_style_path, style_path_of
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.selectors.selector import Sphere
from shapeshift.scene.world.reactions import Motion, TwoAxes
from tests.support.three_stops import THREE, three_stop_model

ROOT = Path(__file__).resolve().parents[3]
BLEND = StopBlend(THREE)


def path_of(text: str, seconds: float = 10.0, blend: StopBlend = BLEND):
    written = read_style_path(text, seconds)
    place = {stop.name: stop.x for stop in blend.stops}
    return style_path_of(written, [place[key.word] for key in written.keys], blend)


@pytest.mark.parametrize(
    ("text", "words", "at"),
    [
        ("RGB@0", ["RGB"], [0]),
        ("RGB@0 Thermal@3s Opened@6s", ["RGB", "Thermal", "Opened"], [0, 3, 6]),
        ("  RGB@.5s\nOpened@10  ", ["RGB", "Opened"], [0.5, 10]),
        ("RGB@20% Opened@80%", ["RGB", "Opened"], [0.2, 0.8]),
        ("RGB@0 Opened@100%", ["RGB", "Opened"], [0, 1]),
        ("Warm walls@1s cold@night@2s", ["Warm walls", "cold@night"], [1, 2]),
        ("RGB:0.5,Opened:0.5@2s 0.25@3s", ["RGB:0.5,Opened:0.5", "0.25"], [2, 3]),
    ],
)
def test_a_text_says_what_is_shown_when(text, words, at):
    path = read_style_path(text, 10.0)
    assert [key.word for key in path.keys] == words
    assert [key.at for key in path.keys] == at
    assert read_style_path(path.text(), 10.0) == path


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "0 keys"),
        ("RGB", "no key of a style path"),
        ("RGB@", "no key"),
        ("RGB@-1", "no key"),
        ("RGB@nan", "no key"),
        ("RGB@1e9s", "no key"),
        ("@3s", "no key"),
        ("RGB@3s Opened@2s", "times must rise"),
        ("RGB@3s Opened@3s", "times must rise"),
        ("RGB@0 Opened@10.001s", "the film ends at 10 s"),
        ("RGB@0 Opened@101%", "100% is the end"),
        ("RGB@1s Opened@50%", "in seconds and in %"),
        ("RGB@0 Opened@3s more", "'more'"),
    ],
)
def test_a_wrong_text_is_one_sentence(text, said):
    with pytest.raises(ValueError, match=r"^[^\n]+\.$") as refused:
        read_style_path(text, 10.0)
    assert said in str(refused.value)


def test_between_two_keys_beta_is_a_smoothstep():
    """Equation 5 of 3SGS with beta_t = t^2 (3 - 2 t), by hand at a quarter of the way."""
    path = path_of("RGB@2s Opened@6s")
    quarter = BLEND.weights(path.control(3.0))
    np.testing.assert_allclose(quarter, [1 - 0.15625, 0, 0.15625], atol=1e-12)
    np.testing.assert_allclose(BLEND.weights(path.control(4.0)), [0.5, 0, 0.5], atol=1e-12)


@pytest.mark.parametrize("at", [0.0, 1.999, 2.0])
def test_before_its_first_key_a_path_holds(at):
    assert path_of("RGB@2s Opened@6s").control(at) == 0.0


@pytest.mark.parametrize("at", [6.0, 6.001, 1e9])
def test_after_its_last_key_too(at):
    assert path_of("RGB@2s Opened@6s").control(at) == 1.0


def test_equal_neighbours_hold():
    path = path_of("RGB@0 Thermal@2s Thermal@5s Opened@7s")
    assert {path.control(at) for at in (2.0, 3.1, 4.9, 5.0)} == {0.5}


def test_a_blend_that_holds_is_the_same_blend():
    half = StopWeights((("RGB", 0.5), ("Opened", 0.5)))
    path = style_path_of(read_style_path("a@0 b@3s", 4.0), [half, half], BLEND)
    assert path.control(1.5) == half


def test_places_of_the_way_are_no_seconds():
    written = read_style_path("RGB@0 Opened@50%", 10.0)
    assert written.unit == PERCENT
    assert written.stretched(2.0) == written
    assert [k.at for k in read_style_path("RGB@0 Opened@4s", 10).stretched(0.5).keys] == [0, 2]


def test_the_pace_of_a_pair_is_walked():
    curve = (0.0, 0.9, 1.0)  # half of the way mixes in nine tenths
    paced = StopBlend(THREE, (Pace("RGB", "Opened", curve),))
    path = path_of("RGB@0 Opened@4s", blend=paced)
    np.testing.assert_allclose(paced.weights(path.control(2.0)), [0.1, 0, 0.9], atol=1e-12)


def test_every_user_of_ways_goes_through_one_function(monkeypatch):
    """Slider, shifts, films, reactions, selectors: each asks StopBlend.between, and nobody else."""
    asked = []
    real = StopBlend.between

    def between(self, start, end, part):
        asked.append((start, end))
        return real(self, start, end, part)

    monkeypatch.setattr(StopBlend, "between", between)
    model = three_stop_model()
    sphere = Sphere(centre=(0.0, 0.0, 0.0), radius=0.5, x=1.0, border=0.2)
    users = {
        "slider at play": lambda: Sweep.over(model.blend).advance(1.0),
        "shift": lambda: Shift(0.0, 1.0, model.blend, 0.2).control,
        "film": lambda: path_of("RGB@0 Opened@4s", blend=model.blend).control(1.0),
        "reaction": lambda: Motion(0.0, 1.0, 0.0, 2.0, "smooth", blend=model.blend).x(1.0),
        "two dials": lambda: TwoAxes().x(0.5, 0.5, model.blend),
        "selector": lambda: control_of(SceneObject("a", model, selectors=(sphere,))),
    }
    for name, use in users.items():
        asked.clear()
        use()
        assert asked, name


def test_nobody_else_makes_blends():
    """StopWeights are made where ways are walked, where files are read, where the pace itself is
    measured, and where a blend is split into what is thermal and the rest; whoever else needs one
    asks `between`.
    """
    makers = set()
    for folder in ("app", "scene", "renderer", "vr", "shapeshift", "runtime_models"):
        for path in (ROOT / folder).rglob("*.py"):
            if "StopWeights(" not in (text := path.read_text()):
                continue
            calls = (n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Call))
            if any(ast.unparse(call.func) == "StopWeights" for call in calls):
                makers.add(path.relative_to(ROOT).as_posix())
    assert makers == {
        "runtime_models/stop_weights.py",
        "runtime_models/files/json_fields.py",
        "renderer/pace.py",
        "renderer/colors/false_colors.py",
    }


def test_from_rgb_to_opened_nothing_thermal_is_seen():
    """The pictures on the way are the same to the bit whatever palette the stop between them has;
    on the way to that stop they are not.
    """
    model = three_stop_model()
    gray = Stop("Thermal", 0.5, "thermal", "gray", (15.0, 95.0), "°C")
    other = replace(model, stops=(THREE[0], gray, THREE[2]))
    view = default_view(model, (48, 36))

    def frames(model, text):
        path = path_of(text, blend=model.blend)
        with Renderer(None) as renderer:
            for at in (1.0, 2.0, 3.0):
                renderer.update(Scene((SceneObject("scene", model, x=path.control(at)),)))
                renderer.draw([view])
                yield renderer.resolved().copy()

    way = "RGB@0 Opened@4s"
    for one, two in zip(frames(model, way), frames(other, way), strict=True):
        np.testing.assert_array_equal(one, two)
    heat = "RGB@0 Thermal@4s"
    changed = [
        np.abs(a - b).max() for a, b in zip(frames(model, heat), frames(other, heat), strict=True)
    ]
    assert min(changed) > 0.02, changed
