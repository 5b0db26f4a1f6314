"""The page as a file: its modules, its policy, what it refuses."""

import re
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.app.page.page_file import (
    MODULES,
    START,
    digest,
    export_page,
    one_file,
    one_script,
    packed,
    page_text,
)
from shapeshift.app.page.page_scene import PageSettings, cut_to_ground, page_scene
from shapeshift.runtime_models.model import BadFile, ScaffoldModel
from shapeshift.scene.scene import Scene
from shapeshift.scene.selectors.selector import Lens
from tests.support.web.page_scenes import paced_model, plain_splats
from tools.web.conventions import conventions_text, entries_text

ROOT = Path(__file__).resolve().parents[2]
WEB = ROOT / "web"
MOST_CODE = 48_000  # bytes of script, as a page has it: deflated, as text
MOST_INFLATED = 105_000  # of that a fifth for headsets
PLAIN = PageSettings("a <scene> & more", pictures=False)


def nothing(*_):
    """No progress is shown."""


def test_constants_are_those_of_python():
    text = (WEB / "conventions.js").read_text()
    assert text == conventions_text(), "run python3 tools/web/write_conventions.py"


def test_types_are_those_of_python():
    text = (WEB / "entries.d.ts").read_text()
    assert text == entries_text(), "run python3 tools/web/write_conventions.py"


def test_each_module_comes_after_what_it_imports():
    assert {path.relative_to(WEB).as_posix()[:-3] for path in WEB.rglob("*.js")} == set(MODULES)
    for i, name in enumerate(MODULES):
        text = (WEB / f"{name}.js").read_text()
        for other in re.findall(r'^import .* from "(\.{1,2}/[\w/]+)\.js";$', text, re.M):
            path = ((WEB / name).parent / other).resolve().relative_to(WEB).as_posix()
            assert path in MODULES[:i], f"{name}.js imports {path}.js, which comes later"
        odd = r"^import (?!\{.*\} from \"\.{1,2}/[\w/]+\.js\";$).*"
        assert not re.findall(odd, text, re.M), name


def test_names_at_the_top_of_modules_are_unique():
    """They share one scope in the page of one file."""
    top = re.compile(
        r"^(?:export )?(?:async )?(?:const|let|class|function\*?) (?!vec2|int)(\w+)", re.M
    )
    names = [name for path in WEB.rglob("*.js") for name in top.findall(path.read_text())]
    assert len(names) == len(set(names)), sorted({n for n in names if names.count(n) > 1})


def test_the_code_is_small_and_asks_for_nothing_elsewhere():
    script, page = one_script(), (WEB / "index.html").read_text()
    assert len(START) + len(packed(script.encode())) <= MOST_CODE
    assert len(script.encode()) <= MOST_INFLATED
    assert not re.search(r"https?:|\beval\(|new Function|innerHTML|document\.write", script + page)
    assert not re.search(r"\son\w+=|\sstyle=", page)  # the policy would refuse them


def test_files_and_functions_stay_readable():
    for path in WEB.rglob("*.js"):
        text = path.read_text()
        assert len(text.splitlines()) <= 400 and text.startswith("// " + path.stem + ":"), path


def test_the_policy_allows_what_is_in_the_page_and_no_more():
    page = page_text("<title>", b"0" * 12)
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1]
    script = re.search(r'<script type="module">(.*?)</script>', page, re.S)[1]
    style = re.search(r"<style>(.*?)</style>", page, re.S)[1]
    assert (
        f"script-src {digest(script)} blob:;" in policy and f"style-src {digest(style)};" in policy
    )
    assert policy.startswith("default-src 'none'") and "connect-src" not in policy
    assert "<title>&lt;title&gt;</title>" in page
    assert "connect-src 'self'" in page_text("x", None)


def test_the_same_scene_gives_the_same_bytes(tmp_path):
    document = Document.of(paced_model(20))
    for name in ("page.html", "page.zip"):
        sizes = [export_page(document, tmp_path / name, PLAIN, nothing) for _ in range(2)]
        first = (tmp_path / name).read_bytes()
        export_page(document, tmp_path / f"again-{name}", PLAIN, nothing)
        assert (tmp_path / f"again-{name}").read_bytes() == first and sizes == [len(first)] * 2


def test_a_folder_and_a_zip_hold_the_page_and_a_coarse_scene(tmp_path):
    document = Document.of(plain_splats(800))
    export_page(document, tmp_path / "site", PLAIN, nothing)
    export_page(document, tmp_path / "site.zip", PLAIN, nothing)
    names = {"index.html", "coarse.bin", "scene.bin"}
    assert {path.name for path in (tmp_path / "site").iterdir()} == names
    with zipfile.ZipFile(tmp_path / "site.zip") as archive:
        assert set(archive.namelist()) == names
        assert archive.read("scene.bin") == (tmp_path / "site" / "scene.bin").read_bytes()
    coarse = zlib.decompress((tmp_path / "site" / "coarse.bin").read_bytes())
    whole = zlib.decompress((tmp_path / "site" / "scene.bin").read_bytes())
    assert whole[:8] == coarse[:8] == b"SHIFTWEB" and len(coarse) < 0.25 * len(whole)


def test_what_a_page_cannot_show_is_refused_in_a_sentence(tmp_path):
    def said(document, error=BadFile, name="page.html"):
        with pytest.raises(error) as refusal:
            export_page(document, tmp_path / name, PLAIN, nothing)
        assert str(refusal.value).endswith(".") and "\n" not in str(refusal.value)
        assert not list(tmp_path.iterdir())
        return str(refusal.value)

    model = paced_model(20)
    offsets = np.zeros((20, 5, 3), np.float32)
    follows = ScaffoldModel(model.anchors, model.features, offsets, model.anchors, model.networks)
    assert "follow the eye" in said(Document.of(follows))
    whole = Document.of(model)
    region = Lens(position=(0, 0, 0), wxyz=(1, 0, 0, 0), half_angle=0.5, x=1.0)
    (obj,) = whole.scene.objects
    assert "a lens" in said(Document(Scene((replace(obj, selectors=(region,)),))))
    wide = paced_model(10, hidden=(400,))
    assert "256 units" in said(Document.of(wide))
    assert "folder or a .zip" in said(whole, UsageError, "page.ply")


def test_a_page_too_large_for_one_file_is_refused(monkeypatch):
    monkeypatch.setattr("shapeshift.app.page.page_file.LARGEST_FILE", 90_000)
    scene = page_scene(Document.of(plain_splats(800)), PLAIN, nothing)
    with pytest.raises(BadFile, match=r"big\.html would have .* folder or a \.zip"):
        one_file("title", scene, "big.html")


@pytest.mark.slow
def test_the_page_of_the_demo_is_no_larger_than_its_package(tmp_path):
    from shapeshift.runtime_models.read_scene import read_model

    package = ROOT / "assets" / "workshop.shift"
    document = Document.of(read_model(package))
    size = export_page(document, tmp_path / "page.html", PageSettings("workshop"), nothing)
    assert size <= package.stat().st_size


def test_pictures_of_the_stops_have_false_colours():
    """The picture of the thermal stop is the one of the palette, not of values."""
    import base64
    import io

    from PIL import Image

    from shapeshift.app.page.page_scene import stop_pictures

    pictures = stop_pictures(Document.of(paced_model(60)), nothing)
    assert list(pictures) == [0.0, 0.4, 1.0] and sum(map(len, pictures.values())) < 15_000
    bytes_ = base64.b64decode(pictures[0.4].split(",")[1])
    shown = np.asarray(Image.open(io.BytesIO(bytes_)).convert("RGB"), int)
    assert np.abs(np.diff(shown, axis=2)).max() > 100  # ironbow is no grey


@pytest.mark.parametrize(("wxyz", "height", "top"), [
    ((1.0, 0.0, 0.0, 0.0), 0.1, 0.05), ((0.0, 1.0, 0.0, 0.0), 0.1, 0.5),
    ((1.0, 0.0, 0.0, 0.0), 0.6, 0.5),
])  # fmt: skip
def test_things_that_begin_in_a_bench_stand_on_what_lies_under_them(wxyz, height, top):
    """Not on the top of its box, which is that of the machine on it; it is upright, and they in
    it, or nothing is cut.
    """
    place: Any = {"wxyz": list(wxyz), "position": [0.0, 0.5, 0.0], "centre": [0.0] * 3,
                  "half": [1.0, 0.5, 1.0], "radius": 1.5}  # fmt: skip
    thing: Any = {"wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0.3, 0.5 + height, 0.0],
                  "centre": [0.0] * 3, "half": [0.05] * 3}  # fmt: skip
    cut_to_ground(place, [thing])
    assert place["centre"][1] + place["half"][1] == pytest.approx(top)
    assert place["centre"][1] - place["half"][1] == pytest.approx(-0.5)
    assert place["radius"] >= 1.5
