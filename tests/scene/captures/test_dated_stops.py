"""Captures of several days: dates of modalities, of photos, of folders, and through training."""

import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.stop_dates import x_of_date
from shapeshift.scene.captures.capture_rules import spread_stops
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.training.settings import TrainSettings
from shapeshift.training.train import Trainer
from tests.support.scene.captures import simple, write_transforms

DAYS = ("2026-03-01", "2026-03-11", "2026-06-09")  # 10 and 90 days apart


def of_days(folder, days=DAYS, **more) -> tuple[list[dict], dict]:
    frames, head = simple(folder, 3 * len(days))
    for i, frame in enumerate(frames):
        frame.pop("modality", None)
        frame |= {"split": "train"} | {k: v(days[i % len(days)]) for k, v in more.items()}
    return frames, {k: v for k, v in head.items() if k != "modalities"}


def stops_of(folder, frames, head) -> list[tuple]:
    write_transforms(folder, frames, **head)
    return [(s.name, round(s.x, 6), s.date, s.kind) for s in read_capture(folder).stops]


def test_photos_with_dates_are_stops_as_far_apart_as_their_days(tmp_path):
    frames, head = of_days(tmp_path, date=lambda day: f"{day}T09:30")
    found = stops_of(tmp_path, frames, head)
    assert found == [(day, x, day, "rgb") for day, x in zip(DAYS, (0, 0.1, 1), strict=True)]


def test_modalities_may_say_when_instead_of_where(tmp_path):
    frames, head = of_days(
        tmp_path, modality=lambda day: {DAYS[0]: "a", DAYS[1]: "b"}.get(day, "c")
    )
    listed = [{"name": n, "date": d} for n, d in zip("cab", (DAYS[2], *DAYS[:2]), strict=True)]
    found = stops_of(tmp_path, frames, head | {"modalities": listed})
    assert [row[:3] for row in found] == [("a", 0, DAYS[0]), ("b", 0.1, DAYS[1]), ("c", 1, DAYS[2])]
    both = [row | {"x": x} for row, x in zip(listed, (1, 0, 0.5), strict=True)]
    assert stops_of(tmp_path, frames, head | {"modalities": both})[1][1:3] == (0.5, DAYS[1])


def test_a_date_of_the_file_is_not_one_of_its_frames(tmp_path):
    frames, head = of_days(tmp_path)
    assert stops_of(tmp_path, frames, head | {"date": "Monday"})[0][0] == "RGB"


def test_names_that_are_dates_are_dated_and_others_are_not():
    assert [stop.x for stop in spread_stops(DAYS)] == [0, pytest.approx(0.1), 1]
    assert spread_stops(["2026-03-01", "RGB"])[0].date == ""
    assert spread_stops(["2026-03-01"])[0].date == ""  # one alone needs no calendar


@pytest.mark.parametrize(
    ("listed", "said"),
    [
        ([("a", None, DAYS[0]), ("b", 0.5, DAYS[1])], "has no 'x'"),
        ([("a", 0.0, ""), ("b", None, DAYS[1])], "has no 'x'"),
        ([("a", 0.0, DAYS[1]), ("b", 1.0, DAYS[0])], "dates must rise with x"),
        ([("a", None, DAYS[1]), ("b", None, DAYS[1] + "T00:00")], "of one date"),
        ([("a", None, "4 May"), ("b", None, DAYS[1])], "a date such as"),
        ([("a", None, ""), ("b", None, "")], "'x'"),
    ],
)
def test_what_cannot_be_a_calendar_is_refused(tmp_path, listed, said):
    frames, head = of_days(tmp_path, ("1", "2"), modality=lambda day: "ab"[int(day) - 1])
    rows = [{"name": n, "date": d} | ({} if x is None else {"x": x}) for n, x, d in listed]
    write_transforms(tmp_path, frames, **head, modalities=rows)
    with pytest.raises(BadFile, match=said):
        read_capture(tmp_path)


def test_dates_go_through_training_into_the_package_and_through_the_capture_form(device, tmp_path):
    frames, head = of_days(tmp_path, date=lambda day: day)
    write_transforms(tmp_path, frames, **head)
    capture = read_capture(tmp_path)
    write_capture(capture)
    assert read_capture(tmp_path).stops == capture.stops
    settings = TrainSettings(iterations=1, max_anchors=50, points="random")
    trainer = Trainer(device, capture, settings)
    write_package(trainer.model(), tmp_path / "a.shift")
    stops = read_model(tmp_path / "a.shift").stops
    assert [stop.date for stop in stops] == list(DAYS)
    assert x_of_date("2026-04-25", stops) == pytest.approx(0.55)
