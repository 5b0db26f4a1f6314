"""Stops with dates and folders of frames: time as x."""

import json
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.runtime_models.stop_dates import (
    LEAST_GAP,
    calendar_ticks,
    check_dates,
    places_of,
    read_date,
    seconds_of,
    x_of_date,
)
from shapeshift.runtime_models.stop_weights import StopBlend, parse_control
from shapeshift.scene.control import Sweep
from tests.support.models import make_random_model
from tests.support.splat_scenes import random_layers

DATES = ("2026-01-01", "2026-01-11", "2026-03-02", "2026-12-27T12:00")
DAYS = np.array([0, 10, 60, 360.5])


def dated(dates=DATES) -> tuple[Stop, ...]:
    xs = places_of(dates)
    return tuple(Stop(f"visit {i}", x, date=d) for i, (x, d) in enumerate(zip(xs, dates)))  # noqa: B905


def folder_of(folder, names, count=20) -> None:
    for i, name in enumerate(names):
        c = random_layers(count + i, seed=i, coefficients=1)
        write_ply(PlainSplats(c.means, c.scales, c.wxyz, c.opacity, c.sh), folder / name)


def test_places_follow_the_dates_and_keep_the_least_gap():
    """Two of four gaps of a year in days are below 1/63 of it or near it."""
    xs = np.array(places_of(DATES))
    np.testing.assert_allclose(xs, DAYS / 360.5, atol=1e-12)
    close = ["2026-01-01", "2026-01-01T00:01", "2026-06-01", "2026-12-31"]
    xs = np.array(places_of(close))
    assert xs[0] == 0 and xs[-1] == 1 and np.diff(xs).min() >= LEAST_GAP - 1e-12
    assert np.diff(xs)[1] / np.diff(xs)[2] == pytest.approx(
        (seconds_of(close[2]) - seconds_of(close[1]))
        / (seconds_of(close[3]) - seconds_of(close[2]))
    )
    even = [f"2026-{1 + i // 28:02}-{1 + i % 28:02}" for i in range(64)]
    assert np.diff(places_of(even)).min() >= LEAST_GAP - 1e-12
    assert places_of(["2026-01-01"]) == [0.0]


def test_x_of_a_date_is_even_in_time_and_a_day_means_its_stop():
    stops = dated()
    assert x_of_date("2026-01-11", stops) == stops[1].x
    assert x_of_date("2026-12-27", stops) == 1.0  # of the stop at noon of that day
    assert x_of_date("2026-01-06", stops) == pytest.approx(5 / 360.5, abs=1e-12)
    assert x_of_date("2026-01-06T12:00+02:00", stops) == pytest.approx(5.41666667 / 360.5)
    assert parse_control("2026-01-06", stops) == pytest.approx(5 / 360.5)
    for text in ("2025-12-31", "2027-01-01"):
        with pytest.raises(ValueError, match="is outside of 2026-01-01 to 2026-12-27T12:00"):
            parse_control(text, stops)
    with pytest.raises(ValueError, match="is no date"):
        parse_control("2026-13-01", stops)
    undated = tuple(replace(stop, date="") for stop in stops)
    with pytest.raises(ValueError, match="is no x"):
        parse_control("2026-01-06", undated)


def test_dates_that_are_none_do_not_rise_or_are_too_many():
    for dates, words in (
        (("yesterday", "2026-01-01"), "stop 'visit 0': 'yesterday' is no date"),
        (("2026-02-30", "2026-03-01"), "is no date"),
        (("2026-02-02", "2026-02-01"), "dates must rise with x"),
        (("2026-02-02", "2026-02-02"), "dates must rise with x"),
    ):
        stops = tuple(Stop(f"visit {i}", float(i), date=d) for i, d in enumerate(dates))
        with pytest.raises(ValueError, match=words):
            check_dates(stops)
    many = [Stop(str(i), i / 64, date=f"{1900 + i}-01-01") for i in range(65)]
    check_dates(many[:64])
    with pytest.raises(ValueError, match="65 stops have dates; at most 64"):
        check_dates(many)
    assert read_date("2026-05-04T12:00Z") == read_date("2026-05-04T12:00")


def test_a_package_keeps_dates_and_refuses_bad_ones(tmp_path):
    model = make_random_model(20)
    stops = (replace(model.stops[0], date="2026-05-04"), replace(model.stops[1], date="2026-06-01"))
    write_package(replace(model, stops=stops), tmp_path / "a")
    assert read_package(tmp_path / "a").stops == stops
    manifest = tmp_path / "a" / "scene.json"
    for date, words in (("May 4", "is no date"), (5, "'date'"), ("2026-07-01", "must rise")):
        rows = json.loads(manifest.read_text())
        rows["stops"][0]["date"] = date
        changed = tmp_path / "b"
        changed.mkdir(exist_ok=True)
        for file in (tmp_path / "a").iterdir():
            (changed / file.name).write_bytes(file.read_bytes())
        (changed / "scene.json").write_text(json.dumps(rows))
        with pytest.raises(BadFile, match=words):
            read_package(changed)


def test_frames_are_stops_each_shown_alone_and_exactly(tmp_path):
    folder_of(tmp_path, [f"frame_{n:04}.ply" for n in (2, 10, 1)])
    model = read_model(tmp_path)
    assert model.mode == "exclusive" and model.provenance["files"] == [
        "frame_0001.ply", "frame_0002.ply", "frame_0010.ply",
    ]  # fmt: skip
    assert [stop.x for stop in model.stops] == [0, 0.5, 1]
    for number, stop in enumerate(model.stops):
        weights = model.weights(stop.x)
        np.testing.assert_array_equal(weights, np.eye(3, dtype=np.float32)[number])
        alone = read_model(tmp_path / model.provenance["files"][number])
        mine = model.layer == number
        np.testing.assert_array_equal(model.means[mine], alone.means)
        np.testing.assert_array_equal(model.opacity[mine], alone.opacity)
    np.testing.assert_allclose(model.weights(0.25), [0.5, 0.5, 0])  # a cross-fade between
    # A way from the first to the last leads through the one between, as time does.
    assert [model.blend.between(0.0, 1.0, part) for part in (0.0, 0.25, 0.5, 1.0)] == [
        0.0, 0.25, 0.5, 1.0,
    ]  # fmt: skip
    assert StopBlend(dated()).between(0.0, 1.0, 0.4) == 0.4


def test_dated_frames_stand_as_far_apart_as_their_dates(tmp_path):
    folder_of(tmp_path, [f"site_{d}.ply" for d in ("2026-03-02", "2026-01-01", "2026-01-11")])
    model = read_model(tmp_path)
    assert [stop.date for stop in model.stops] == ["2026-01-01", "2026-01-11", "2026-03-02"]
    np.testing.assert_allclose([stop.x for stop in model.stops], [0, 1 / 6, 1])
    assert parse_control("2026-01-06", model.stops) == pytest.approx(1 / 12)


def test_what_are_no_frames_are_layers_as_before_and_bad_frames_one_sentence(tmp_path):
    plain = tmp_path / "plain"
    plain.mkdir()
    folder_of(plain, ["skin.ply", "bone.ply"])
    assert read_model(plain).mode == "cumulative"
    many = tmp_path / "many"
    many.mkdir()
    folder_of(many, [f"frame_{n}.ply" for n in range(65)], count=1)
    with pytest.raises(BadFile, match="65 frames; at most 64"):
        read_model(many)
    (many / "frame_64.ply").unlink()
    assert len(read_model(many).stops) == 64
    (many / "frame_7.splat").write_bytes(bytes(32))
    with pytest.raises(BadFile, match="frames of two kinds"):
        read_model(many)
    bad = tmp_path / "bad"
    bad.mkdir()
    folder_of(bad, ["2026-02-30.ply", "2026-03-01.ply"])
    with pytest.raises(BadFile, match=r"2026-02-30.ply: '2026-02-30' is no date"):
        read_model(bad)
    twice = tmp_path / "twice"
    twice.mkdir()
    folder_of(twice, ["a_2026-03-01.ply", "b_2026-03-01.ply"])
    with pytest.raises(BadFile, match="are of one date"):
        read_model(twice)


def test_playing_is_even_in_time():
    sweep = Sweep.over(StopBlend(dated()))
    assert sweep.by_date and sweep.rest_s == 0 and sweep.ease == "even"
    sweep.playing, round_s = True, sweep.period
    assert round_s == pytest.approx(6 * 2.5)  # there and back, 2.5 s a leg in the mean
    for day in (0, 5, 10, 35, 60, 200):
        sweep.seconds = round_s / 2 * day / 360.5
        assert sweep.x == pytest.approx(day / 360.5, abs=1e-9)
        sweep.resume_at(sweep.x)
        assert sweep.x == pytest.approx(day / 360.5, abs=1e-9)
    sweep.by_date = False
    sweep.seconds = round_s / 6
    assert sweep.x == pytest.approx(10 / 360.5)
    assert not Sweep.over(StopBlend((Stop("a", 0), Stop("b", 0.5), Stop("c", 1)))).by_date


def test_the_calendar_has_whole_months_years_days_and_hours():
    ticks = calendar_ticks(dated(), 12)
    assert [words for _, words in ticks] == [f"2026-{m:02}" for m in range(1, 13)]
    for x, words in ticks:
        assert x == pytest.approx(x_of_date(f"{words}-01", dated()), abs=1e-12)
    assert [w for _, w in calendar_ticks(dated(), 4)] == [
        "2026-01",
        "2026-04",
        "2026-07",
        "2026-10",
    ]
    day = dated(("2026-05-04T08:30", "2026-05-04T10:10"))
    assert [words for _, words in calendar_ticks(day, 3)] == ["09:00", "10:00"]
    years = dated(("1999-06-01", "2026-05-04"))
    assert calendar_ticks(years, 6)[0][1] == "2000"
    assert calendar_ticks(dated()[:1], 5) == [] == calendar_ticks(dated(), 0)
