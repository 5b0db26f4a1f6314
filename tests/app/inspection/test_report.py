"""Reports: one file that loads nothing, PDF pages, names that want to be markup, the way back."""

import base64
import io
import json
import re

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.app.inspection.inspect_view import InspectedView, with_readings
from shapeshift.app.inspection.outputs import three_pictures
from shapeshift.app.inspection.pictures import ColorScale
from shapeshift.app.inspection.report import (
    ReportHead,
    report_of,
    runs_of,
    with_gaps,
)
from shapeshift.app.inspection.report_pdf import write_report
from shapeshift.scene.cameras.read_cameras import read_camera_list
from shapeshift.scene.inspection.marks import Isotherm, Mark, box_at, line_at
from shapeshift.scene.inspection.marks_file import HeldOutError, MarksFile
from tests.support.scene.warm_wall import STOPS, celsius_at, traced, write_wall
from tests.support.web.page_texts import Page

EVIL = '<script>alert("$x$")</script>'
HEAD = ReportHead("Hall \udcff", "2026-11-23", EVIL, "温度 Müller", "Look at $\\frac{1}{0$ again.")
SCALE = ColorScale(0.0, 100.0, "ironbow")


def inspected(marks: int = 0) -> tuple[MarksFile, list[InspectedView]]:
    """Two traced views of the wall with marks, differences, isotherms."""
    picture = traced()
    laid = [
        Mark("Sp1", "spot", np.array([(0.2, 0.1, 0.0)]), note=EVIL),
        Mark("gone", "spot", np.array([(0.2, 0.1, -1.0)])),
        box_at("Ar1", picture, (30, 20), (60, 50)),
        line_at("Li1", picture, np.array([(20.0, 36.0), (76.0, 36.0)])),
    ]
    laid += [Mark(f"more {i}", "spot", np.array([(0.0, 0.0, 0.0)])) for i in range(marks)]
    file = MarksFile(
        tuple(laid), (("Sp1", "Ar1"),), (Isotherm("above", low=60.0),),
        held_out=HeldOutError(0.53, 2.1, 8),
    )  # fmt: skip
    photo = np.full((72, 96, 3), 0.4, np.float32)
    views = [picture, traced((0.5, 0.2, 1.4))]
    return file, [with_readings(InspectedView(v, photo, "RGB", (), (), ()), file) for v in views]


def written(path, marks: int = 0, scene=None, views: int = 2):
    file, shown = inspected(marks)
    scene = scene or path.parent / "hall.shift"
    report = report_of(HEAD, scene, STOPS[1], shown[:views], file, SCALE, np.array([10.0, 0, 0]))
    return shown, write_report(report, path)


def test_html_is_one_file_that_loads_nothing(tmp_path):
    cameras = written(tmp_path / "report.html")[1]
    text = (tmp_path / "report.html").read_text()
    page = Page(text)
    assert not {"script", "link", "iframe", "object"} & {tag for tag, _ in page.tags}
    assert not any(name.startswith("on") for _, attrs in page.tags for name in attrs)
    links = [attrs[key] for _, attrs in page.tags for key in ("src", "href") if key in attrs]
    assert len(links) == 7 and all(link.startswith("data:") for link in links)
    assert "default-src 'none'" in text
    assert any(EVIL in part for part in page.texts)  # as a text
    for link in links[:6]:
        picture = Image.open(io.BytesIO(base64.b64decode(link.split(",")[1])))
        assert picture.height == 72 and picture.width >= 96
    inline = json.loads(base64.b64decode(links[6].split(",")[1]))
    assert inline == json.loads(cameras.read_text())


def test_html_says_what_was_read(tmp_path):
    shown, cameras = written(tmp_path / "report.html")
    texts = Page((tmp_path / "report.html").read_text()).texts
    cells = " | ".join(texts)
    spot = shown[0].readings[0]
    assert spot.mean == pytest.approx(celsius_at(0.2), abs=0.1)
    assert f"Sp1 | spot | {spot.mean:.1f} °C" in re.sub(r"[\s|]+\|\s*", " | ", cells)
    assert "--" in texts  # the mark behind the wall
    assert "10.200,0.100,0.000" in texts  # in the world of the scene's file
    for words in ("0.53 °C in the mean", "Sp1 less Ar1", "above 60 °C", "0 to 100 °C"):
        assert words in cells
    assert f"launch.py view hall.shift --x Thermal --camera {cameras.name}" in cells
    assert str(tmp_path) not in cells  # a client learns no folder of whoever wrote it


def test_the_cameras_beside_it_are_the_views(tmp_path):
    shown, cameras = written(tmp_path / "report.html")
    views = read_camera_list(cameras).views
    for each, view in zip(shown, views, strict=True):
        own = each.values.view
        np.testing.assert_allclose(
            view.world_from_eye.position,
            own.world_from_eye.position + np.array([10, 0, 0]),
            atol=1e-9,
        )
        assert (view.size, view.tangents) == (own.size, pytest.approx(own.tangents))


@pytest.mark.slow
def test_pdf_has_pages_and_the_same_bytes(tmp_path):
    """A view is a page and a half with its profile; 60 rows more, of 1.55 % of a page, are one."""
    written(tmp_path / "a.pdf", views=1)
    data = (tmp_path / "a.pdf").read_bytes()
    assert data.startswith(b"%PDF-1.") and data.rstrip().endswith(b"%%EOF")
    assert pages_of(data) == 2
    again = tmp_path / "again"
    again.mkdir()
    written(again / "a.pdf", scene=tmp_path / "hall.shift", views=1)
    assert (again / "a.pdf").read_bytes() == data
    written(tmp_path / "b.pdf", marks=60, views=1)
    assert pages_of((tmp_path / "b.pdf").read_bytes()) == 3


def pages_of(data: bytes) -> int:
    return len(re.findall(rb"/Type /Page\b(?!s)", data))


def test_profiles_break_where_nothing_is_seen_or_the_surface_ends():
    known = np.array([True, True, False, True, False])
    assert [(run.start, run.stop) for run in runs_of(known)] == [(0, 2), (3, 4)]
    assert runs_of(np.zeros(3, bool)) == []
    rows = np.array([(0.0, 1), (0.1, 2), (0.2, 3), (1.5, 9), (1.6, 9)])
    held = with_gaps(rows)
    assert len(held) == 6 and np.isnan(held[3, 1]) and held[3, 0] == pytest.approx(0.85)
    np.testing.assert_array_equal(with_gaps(rows[:3]), rows[:3])


def test_the_command_writes_both(tmp_path, capsys):
    wall = write_wall(tmp_path / "wall")
    words = ["thermal", wall, "--size", "96x72", "--spot", "48,36", "--line", "30,36,60,36",
             "--between", "40", "60", "--client", EVIL, "--context", "none",
             "--report", tmp_path / "r.html", tmp_path / "r.pdf"]  # fmt: skip
    assert cli.main([*map(str, words)]) == 0
    assert any(EVIL in part for part in Page((tmp_path / "r.html").read_text()).texts)
    assert (tmp_path / "r.camera.json").is_file()
    data = (tmp_path / "r.pdf").read_bytes()
    assert data.startswith(b"%PDF-1.") and data.rstrip().endswith(b"%%EOF")
    assert pages_of(data) == 2  # the view and its table; the profile and the settings
    capsys.readouterr()
    assert cli.main([*map(str, words)]) == 2  # both are there
    assert "exists" in capsys.readouterr().err
    assert cli.main(["thermal", str(wall), "--report", "r.docx"]) == 2
    assert ".html or .pdf" in capsys.readouterr().err


def test_pdf_says_the_same_in_the_same_order_as_html(tmp_path, monkeypatch):
    """Marks have their heading and come before what is said of them; it stood after, without."""
    from matplotlib.figure import Figure

    found: list[str] = []
    text = Figure.text
    monkeypatch.setattr(
        Figure, "text", lambda self, x, y, s, **how: (found.append(s), text(self, x, y, s, **how))
    )
    written(tmp_path / "a.pdf", views=1)
    written(tmp_path / "a.html", views=1)
    inside = Page((tmp_path / "a.html").read_text()).texts
    order = ("Marks", "mark", "Sp1", "Profile of Li1", "How right it is", "Settings")
    for texts in (found, inside):
        places = [texts.index(words) for words in order if words in texts]
        assert len(places) >= 5 and places == sorted(places)
        (difference,) = (i for i, words in enumerate(texts) if words.startswith("Sp1 less Ar1"))
        assert texts.index("Sp1") < difference < texts.index("How right it is")


def test_a_scale_has_no_more_digits_than_anybody_reads():
    picture = inspected()[1][0]
    (title, _), *_ = (
        each for each in three_pictures(picture, ColorScale(14.42735, 101.3641, "ironbow"))
        if each[0].startswith("Thermal")
    )  # fmt: skip
    assert title == "Thermal, level 57.9, span 86.94 \u00b0C"
