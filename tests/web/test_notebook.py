"""`scene.show()`: the page in a sandboxed frame, as notebooks have it."""

import base64
import io
import re

import numpy as np
import pytest
from PIL import Image

import shapeshift as ss
from shapeshift.api import views
from shapeshift.renderer.gl.context import NoContext
from tests.support.web.page_scenes import paced_model


@pytest.fixture(scope="module")
def shown():
    return ss.Scene.from_model(paced_model(60)).show(height=300)


def test_a_picture_stays_where_no_frame_is_shown(shown):
    picture = np.asarray(Image.open(io.BytesIO(shown.png)))
    assert picture.shape == (360, 640, 3) and picture.std() > 5
    assert shown.html.count("<iframe") == 1 and "height: 300px" in shown.html


def test_the_last_line_of_a_cell_is_a_picture_and_a_line(monkeypatch):
    """As large as the picture, whatever the scene; where nothing can be drawn the line alone."""
    scene = ss.Scene.from_model(paced_model(60))
    large = ss.Scene.from_model(paced_model(3000))
    for shown, splats in ((s._repr_html_(), s.splat_count) for s in (scene, large)):
        assert shown is not None
        found = re.search(r'^<img alt="The scene" src="data:image/png;base64,([^"]+)">', shown)
        assert found is not None
        picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(found[1]))))
        assert picture.shape == (360, 640, 3) and picture.std() > 5 and len(shown) < 1_000_000
        assert f"{splats:,} splats, stops" in shown and "<iframe" not in shown

    def refuse(*_args):
        raise NoContext("none here")

    monkeypatch.setattr(views, "picture_of", refuse)
    assert scene._repr_html_() is None


def test_a_height_that_is_none_is_refused():
    with pytest.raises(ss.UsageError, match=r"^height is 10, expected 100 to 4000 pixels\.$"):
        ss.Scene.from_model(paced_model(20)).show(height=10)


@pytest.mark.slow
def test_the_frame_draws_and_answers_the_notebook(browser, shown, tmp_path):
    """Sandboxed, so without an address; x and camera go both ways by postMessage."""
    page = tmp_path / "notebook.html"
    page.write_text(
        "<!doctype html><html><script>const told = [];"
        "addEventListener('message', (e) => told.push(e.data.shapeshift));</script>"
        f"<body>{shown.html}</body></html>"
    )
    browser.open(page, ready=False)
    browser.until("globalThis.told?.length > 0 || (typeof told !== 'undefined' && told.length > 0)")
    assert browser.run("told.at(-1)").startswith("#x=0&eye=")
    link = "#x=0.4&eye=1,2,3&turn=1,0,0,0&at=0,0,0"
    browser.run(f"frames[0].postMessage({{ shapeshift: '{link}' }}, '*'), 1")
    browser.until(f"told.at(-1) === '{link}'")
    browser.run("frames[0].postMessage({ shapeshift: '#x=7' }, '*'), 1")  # refused, as in a link
    browser.run("frames[0].postMessage({ shapeshift: '#x=0.6' }, '*'), 1")
    browser.until("told.at(-1).startsWith('#x=0.6&eye=1,2,3')")
    assert not any(said.startswith("#x=7") for said in browser.run("told"))
    assert not browser.complaints()
