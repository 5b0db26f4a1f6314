"""A page treats its scene as a stranger's: what is wrong ends in one sentence, and soon."""

import base64
import json
import re
import subprocess
import zlib
from pathlib import Path

import pytest

from shapeshift.app.document import Document
from shapeshift.app.page.page_file import page_text
from shapeshift.app.page.page_scene import PageSettings, page_scene
from tests.support.models import with_light
from tests.support.web.page_scenes import paced_model, plain_splats

SCRIPT = Path(__file__).resolve().parents[1] / "support" / "web" / "broken_scene.mjs"
PLAIN = PageSettings("t", pictures=False)


def scene_of(model) -> bytes:
    return page_scene(Document.of(model), PLAIN, lambda *_: None)


def broken(node: str, scene: bytes, folder: Path, count: int, seed: int) -> dict:
    """What the page's reader made of mutations of a scene."""
    path = folder / "scene.bin"
    path.write_bytes(scene)
    command = [node, "--max-old-space-size=300", str(SCRIPT), str(path), str(count), str(seed)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    "model",
    [paced_model(60), with_light(paced_model(60)), plain_splats(90, 2)],
    ids=["package", "light", "plain"],
)
@pytest.mark.parametrize("count", [600, pytest.param(20_000, marks=pytest.mark.slow)])
def test_mutated_scenes_end_in_a_sentence(node, tmp_path, model, count):
    found = broken(node, scene_of(model), tmp_path, count, seed=count)
    assert not found["odd"], found["odd"][:5]
    assert found["refused"] + found["opened"] == count and found["refused"] > count / 3
    assert found["slowest"] < 1000  # ms; a cut scene of 100 splats takes less than one
    assert "larger than 1 MB" in found["bomb"] and found["bombMs"] < 2000


def page_with(scene: bytes, length: int | None = None) -> str:
    """A page whose scene is other bytes than what was exported."""
    page = page_text("t", scene)
    return page if length is None else re.sub(r'data-bytes="\d+"', f'data-bytes="{length}"', page)


def test_a_broken_page_says_one_sentence_and_draws_nothing(browser, tmp_path):
    whole = scene_of(paced_model(30))
    head = 12 + int.from_bytes(whole[8:12], "little")
    table = json.loads(whole[12:head])
    table["models"][0]["anchors"] = 10**5
    unlit = json.loads(whole[12:head])
    unlit["models"][0]["light"] = unlit["models"][0]["features"]  # four numbers a vector, not eight

    def of_table(table: dict) -> bytes:
        text = json.dumps(table).encode()
        begin = whole[:8] + len(text).to_bytes(4, "little") + text
        return begin + bytes(-len(begin) % 4) + whole[head + (-head % 4) :]

    cases = {
        "cut off": page_with(whole[: head + 8]),
        "no scene for a web page": page_with(b"X" + whole[1:]),
        "table of contents is damaged": page_with(whole[:20] + b"\0" * 40 + whole[60:]),
        "do not fit": page_with(of_table(table)),
        "tables do not fit its counts": page_with(of_table(unlit)),
        "larger than": page_with(whole, len(whole) - 1),
        "the size of the scene": page_with(whole, 10**12),
        "is damaged": page_with(whole).replace(
            base64.b64encode(zlib.compress(whole, 9)).decode(), "!!!! no base64"
        ),
    }
    for words, page in cases.items():
        path = tmp_path / "page.html"
        path.write_text(page)
        browser.open(path)
        said = browser.message()
        assert words in said and said.startswith("This scene cannot be shown: "), (words, said)
        assert said.count(".") >= 1 and "\n" not in said and len(said) < 500
        assert browser.run("document.documentElement.dataset.ready") == "no"


def test_names_are_text_and_the_policy_holds(browser, tmp_path):
    whole = scene_of(paced_model(30))
    evil = whole.replace(b'"name":"Opened"', b'"name":"<b>y<b"')  # as long as before
    assert evil != whole
    path = tmp_path / "page.html"
    path.write_text(page_with(evil))
    browser.open(path)
    assert browser.run("document.querySelectorAll('#stops b').length") == 0
    assert "<b>y<b" in browser.run("document.getElementById('stops').textContent")
    ran = browser.run("""(() => { const s = document.createElement('script');
      s.textContent = 'window.ran = 1'; document.body.append(s); return typeof window.ran; })()""")
    assert ran == "undefined"
    assert browser.run("fetch('data:,x').then(() => 'went', () => 'refused')") == "refused"
    addresses = browser.requests()
    assert all(a.startswith(("file:", "blob:", "about:", "data:")) for a in addresses), addresses
