"""A stop put into a finished model: whatever it has learned, every other stop stays."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import BadFile, ControlEncoding, Stop
from shapeshift.runtime_models.package.feature_codes import EXACT, decode_features, encode_features
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.runtime_models.stops.change_stops import MOST_STOPS, insert_stop, remove_stop
from tests.support.models import make_random_model, without_control
from tests.support.new_stops import THREE, framed_model, wild_stop

EYE = np.array([0.3, -0.2, 2.0])
FIELDS = ("means", "scales", "wxyz", "opacity", "color")
# Sums of a few dozen products of up to about 3 in float32, before and after: some 1e-6 of each.
ROUNDING = 2e-5


def filed(model, path):
    """The model after it was written and read."""
    write_package(model, path / "scene.shift", EXACT)
    return read_package(path / "scene.shift")


def assert_same(before, after, x, other_x, rows=slice(None), atol=ROUNDING):
    one, other = evaluate(before, x, EYE), evaluate(after, other_x, EYE)
    for field in FIELDS:
        a, b = getattr(one, field)[rows], getattr(other, field)[rows]
        np.testing.assert_allclose(b, a, atol=atol * max(1, np.abs(a).max()), err_msg=field)


def place(model, name):
    return next(stop.x for stop in model.stops if stop.name == name)


MODELS = {
    "as trained": lambda: framed_model(),
    "of the paper's encoding": lambda: framed_model(encoding=ControlEncoding()),
    "two hidden layers": lambda: framed_model(hidden=(7, 9)),
    "no hidden layer": lambda: framed_model(hidden=()),
    "shapes that see no x": lambda: without_control(framed_model(), "offset", "scale", "rotation"),
    "one stop": lambda: replace(framed_model(), stops=THREE[:1]),
    "without frames": lambda: replace(
        framed_model(), frames=None, labels=None, objects=(), stops=(THREE[0], THREE[2])
    ),
    "one anchor": lambda: framed_model(1),
}


@pytest.mark.parametrize("name", MODELS)
def test_whatever_all_heads_hold_old_stops_stay_after_write_and_read(name, tmp_path):
    """The exactness of the new stop, and of taking it out again with fewer bytes than before."""
    model = MODELS[name]()
    wild = filed(wild_stop(model), tmp_path)
    assert [stop.name for stop in wild.stops][1] == "Wild"
    for stop in model.stops:
        assert_same(model, wild, stop.x, place(wild, stop.name))
    shown = [evaluate(m, x, EYE).color for m, x in ((model, 0.0), (wild, place(wild, "Wild")))]
    assert np.abs(shown[0] - shown[1]).mean() > 0.1  # and it is wild indeed
    kept = {stop.name: stop for stop in wild.stops}
    for stop in model.stops:
        assert replace(kept[stop.name], x=stop.x) == stop
    assert (kept["Wild"].kind, kept["Wild"].palette, kept["Wild"].unit) == ("style", "", "")
    np.testing.assert_array_equal(wild.labels, model.labels)
    before = write_package(model, tmp_path / "before.shift", EXACT)
    back = remove_stop(wild, "Wild")
    if name != "no hidden layer":  # which has got one
        after = write_package(back, tmp_path / "back.shift", EXACT)
        assert after <= before + 16, "no number more; other numbers pack a few bytes differently"
    for stop in model.stops:
        assert_same(model, back, stop.x, place(back, stop.name))
    assert back.features.shape == model.features.shape


def test_blends_of_old_stops_stay_shut_too():
    """A gate is a weighted mean of gates: RGB to Opened shows nothing of the new one between."""
    model = framed_model()
    wild = wild_stop(model)
    for share in (0.1, 0.5, 0.9):
        way = StopWeights((("RGB", 1 - share), ("Opened", share)))
        assert_same(model, wild, way, way)


def test_the_way_to_the_new_stop_leads_past_no_other():
    """It shows what a scene shows that has none but these two."""
    wild = wild_stop(framed_model())
    two = remove_stop(remove_stop(wild, "Thermal"), "Opened")
    for share in (0.05, 0.3, 0.7, 0.95):
        way = StopWeights((("RGB", 1 - share), ("Wild", share)))
        assert_same(wild, two, way, way, atol=5e-5)  # gates of some 100, in float32


@pytest.mark.parametrize("inside", [1, 60, 119, 120])
def test_outside_a_region_the_new_stop_is_its_source(inside, tmp_path):
    model = framed_model()
    mask = np.arange(120) < inside
    wild = filed(wild_stop(model, mask), tmp_path)
    rows = np.repeat(~mask, model.splats_per_anchor)
    if rows.any():
        assert_same(model, wild, 0.0, place(wild, "Wild"), rows)
        blend = StopWeights((("RGB", 0.3), ("Wild", 0.7)))
        assert_same(model, wild, 0.0, blend, rows)  # and on the way there
    for stop in model.stops:
        assert_same(model, wild, stop.x, place(wild, stop.name))
    back = remove_stop(wild, "Wild")
    assert back.features.shape == model.features.shape


def test_two_styles_one_after_the_other_and_out_in_any_order(tmp_path):
    model = framed_model()
    first = wild_stop(model)
    named = replace(first, stops=tuple(
        replace(s, name="First") if s.name == "Wild" else s for s in first.stops
    ))  # fmt: skip
    both = filed(wild_stop(named, seed=9, after=None), tmp_path)
    assert [s.name for s in both.stops] == ["RGB", "First", "Thermal", "Opened", "Wild"]
    for stop in named.stops:
        assert_same(named, both, stop.x, place(both, stop.name))
    for order in (("First", "Wild"), ("Wild", "First")):
        back = both
        for name in order:
            back = remove_stop(back, name)
        for stop in model.stops:
            assert_same(model, back, stop.x, stop.x)
        assert back.features.shape == model.features.shape


@pytest.mark.parametrize("kind", ["float16", "uint8", "float32"])
def test_features_keep_their_storage_and_their_numbers(kind, tmp_path):
    """A package of bytes stays one of bytes: nothing else would be as small and as exact."""
    model = replace(make_random_model(200), stops=THREE)
    coded = encode_features(model.features, kind)
    stored = decode_features(coded["features"], coded.get("feature_range"), "test")
    model = replace(model, features=stored)
    wild = wild_stop(model)
    size = write_package(wild, tmp_path / "scene.shift", EXACT)
    again = read_package(tmp_path / "scene.shift")
    np.testing.assert_array_equal(again.features, wild.features)
    assert size < 1.02 * write_package(wild, tmp_path / "other.shift", kind) + 64


def test_frames_are_read_as_they_were_written(tmp_path):
    """Halves of quaternions are not of length 1, and are divided by it: they are found again."""
    model = filed(framed_model(500), tmp_path)
    write_package(model, tmp_path / "half.shift", "float16")
    half = read_package(tmp_path / "half.shift")
    size = write_package(half, tmp_path / "exact.shift", EXACT)
    again = read_package(tmp_path / "exact.shift")
    np.testing.assert_array_equal(again.frames.wxyz, half.frames.wxyz)
    np.testing.assert_array_equal(again.frames.scales, half.frames.scales)
    assert size == (tmp_path / "half.shift").stat().st_size


@pytest.mark.parametrize(("name", "source", "after", "wanted"), [
    ("", "RGB", None, "cannot be a stop's name"), (" a", "RGB", None, "cannot be a stop's name"),
    ("a" * 61, "RGB", None, "1 to 60 printable letters"), ("a\nb", "RGB", None, "printable"),
    ("rgb", "RGB", None, "a stop 'rgb' already"), ("New", "X", None, "no stop 'X'; it has RGB"),
    ("New", "RGB", "Y", "no stop 'Y'"),
])  # fmt: skip
def test_what_cannot_be_put_in_is_refused(name, source, after, wanted):
    with pytest.raises(BadFile, match=wanted):
        insert_stop(framed_model(2), name, source, after)


def test_as_many_stops_as_the_encoding_tells_apart():
    names = [Stop(str(i), i / (MOST_STOPS - 2)) for i in range(MOST_STOPS - 1)]
    model = framed_model(3, encoding=ControlEncoding(63, 1 / 62, 0.008))
    model = replace(model, stops=tuple(names))
    full = insert_stop(model, "Last", "0")
    assert len(full.stops) == MOST_STOPS == 64
    assert_same(model, full, names[7].x, place(full, "7"))
    with pytest.raises(BadFile, match="has 64 stops, and a scene has 64 at most"):
        insert_stop(full, "More", "0")


def test_networks_that_know_what_lies_between_are_left_alone():
    with pytest.raises(BadFile, match="know what lies between"):
        insert_stop(replace(framed_model(2), between_stops="encoding"), "New", "RGB")


def test_what_cannot_be_taken_out_is_refused():
    model = framed_model(2)
    with pytest.raises(BadFile, match="no stop 'X'; it has RGB, Thermal, Opened"):
        remove_stop(model, "X")
    with pytest.raises(BadFile, match="the only stop"):
        remove_stop(replace(model, stops=THREE[:1]), "RGB")
