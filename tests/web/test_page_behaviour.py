"""The page as a person meets it: slider, keys, touch, names, links, things to throw, a server."""

import functools
import http.server
import threading
import time
from pathlib import Path

import pytest

from shapeshift.app.document import Document, open_document
from shapeshift.app.opening import ReadingOptions
from shapeshift.app.page.page_file import export_page
from shapeshift.app.page.page_scene import PageSettings
from tests.support.web.page_pictures import write_page
from tests.support.web.page_scenes import paced_model, several_objects

TOUCH = Path(__file__).resolve().parents[2] / "examples" / "touch.scene.json"
X = "shapeshift.renderer.objects[0].x"
POSE = "JSON.stringify(shapeshift.camera.pose)"


@pytest.fixture
def page(browser, tmp_path):
    browser.resize((480, 400))  # room beside the panels
    browser.open(write_page(Document.of(paced_model(60)), tmp_path / "page.html"))
    browser.until("shapeshift.renderer.settled")
    return browser


def test_slider_stops_and_play(page):
    assert page.run(X) == 0
    page.key("2", "Digit2")
    page.until(f"{X} === 0.4")
    slider = "document.getElementById('x')"
    assert page.run(f"{slider}.getAttribute('aria-valuetext')") == "Thermal"
    assert page.run("document.querySelector('#stops [aria-pressed=true]').textContent") == "Thermal"
    legend = page.run("document.getElementById('legend').textContent")
    assert "15 °C" in legend and "95 °C" in legend
    page.key("1", "Digit1")  # back; a shift leads through numbers of these two stops
    page.until(f"{X} === 0")
    assert page.run("document.getElementById('legend').hidden")
    page.key("3", "Digit3")  # straight: no third stop is passed
    page.until(f"Array.isArray({X})")
    assert page.run(f"{X}[1]") == 0
    page.until(f"{X} === 1")
    set_slider = f"({slider}.value = 0.41, {slider}.dispatchEvent(new Event('input')))"
    page.run(set_slider)
    assert page.run(X) == 0.4  # a stop attracts the knob
    page.key(" ", "Space")
    assert page.run("document.getElementById('play').getAttribute('aria-pressed')") == "true"
    page.until(f"{X} !== 0.4 && {X} > 0.4")
    page.key(" ", "Space")
    assert page.run("shapeshift.panel.sweep") is None


@pytest.mark.slow
def test_a_palette_can_be_chosen_and_a_value_is_read(page):
    page.run("shapeshift.panel.setX(0.4), 1")
    page.run("""(choice => { choice.value = 'gray'; choice.dispatchEvent(new Event('change')); })(
      document.getElementById('palette'))""")
    page.until("shapeshift.renderer.colors.palette === 'gray' && shapeshift.renderer.settled")
    page.until("!shapeshift.wanted")
    value = page.run("shapeshift.renderer.valueAt(0.5, 0.5)")
    assert 0 <= value <= 1
    page.mouse("mouseMoved", (240, 200))
    page.until("document.getElementById('reading').textContent.endsWith('°C')")
    box = "(({left, top, right, bottom}) => [left, top, right, bottom])"
    plate = f"{box}(document.getElementById('reading').getBoundingClientRect())"
    left, _, _, bottom = page.run(plate)
    assert 0 < left - 240 <= 20 and 0 < 200 - bottom <= 20  # beside the pointer, not at the legend
    before = page.run("document.getElementById('reading').textContent")
    page.run("shapeshift.panel.setX(0.6), 1")  # the picture changes, the pointer rests
    page.until(f"document.getElementById('reading').textContent !== '{before}'")
    page.run("shapeshift.panel.setX(0.4), 1")
    wide, high = page.run("[innerWidth, innerHeight]")
    page.mouse("mouseMoved", (wide - 2, high // 3))
    page.until(f"{plate}[2] > {wide - 2}")  # at an edge it stays within
    assert page.run(plate)[2] <= wide and page.run(plate)[3] < high // 3


@pytest.mark.slow
def test_mouse_keys_and_fingers_move_the_camera(page):
    def changes(*acts):
        before = page.run(POSE)
        for act in acts:
            act()
        return page.run(POSE) != before

    page.run("document.getElementById('picture').focus()")
    assert changes(lambda: page.key("ArrowRight", "ArrowRight"))
    assert changes(lambda: page.key("+", "Equal"))
    page.key("f", "KeyF")
    home = page.run(POSE)
    assert changes(
        lambda: page.mouse("mousePressed", (100, 150), 1),
        lambda: page.mouse("mouseMoved", (130, 160), 1),
        lambda: page.mouse("mouseReleased", (130, 160)),
    )
    assert changes(lambda: page.mouse("mouseWheel", (100, 150), deltaX=0, deltaY=120))
    page.key("Home", "Home")
    assert page.run(POSE) == home
    page.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)
    far = page.run("shapeshift.camera.distance")
    page.touch("touchStart", (140, 150), (180, 150))
    for step in range(5, 30, 5):
        page.touch("touchMove", (140 - step, 150), (180 + step, 150))
    page.touch("touchEnd")
    assert page.run("shapeshift.camera.distance") < 0.8 * far
    page.call("Emulation.setTouchEmulationEnabled", enabled=False)


def test_a_link_shows_what_its_sender_saw(page):
    page.run("shapeshift.panel.setX(0.25), shapeshift.camera.orbit(0.5, 0.1), 1")
    pose = page.run("shapeshift.camera.pose")
    page.run("document.getElementById('share').click()")
    address = page.run("location.href")
    assert "#x=0.25&eye=" in address
    page.open(address)
    page.until("shapeshift.renderer.settled")
    found = page.run("shapeshift.camera.pose")
    assert page.run(X) == 0.25
    numbers = [*pose["position"], *pose["wxyz"]], [*found["position"], *found["wxyz"]]
    assert all(abs(a - b) < 1e-4 for a, b in zip(*numbers, strict=True))
    page.open(address.split("#")[0] + "#x=7&eye=NaN,1&turn=<b>&at=1e999,0,0")
    assert page.run(X) == 0 and page.message() == ""


@pytest.mark.slow
def test_everything_has_a_name(page):
    page.run("shapeshift.panel.setX(0.4), 1")
    nodes = page.call("Accessibility.getFullAXTree")["nodes"]
    kinds = {"slider", "button", "combobox", "image", "group", "img"}
    named = [n for n in nodes if n.get("role", {}).get("value") in kinds and not n.get("ignored")]
    assert len(named) >= 8
    assert all(n.get("name", {}).get("value") for n in named), named


@pytest.mark.slow
def test_who_wants_no_motion_gets_none(page):
    feature = [{"name": "prefers-reduced-motion", "value": "reduce"}]
    page.call("Emulation.setEmulatedMedia", features=feature)
    page.run("shapeshift.panel.goTo(0.4), 1")
    assert page.run(X) == 0.4 and page.run("shapeshift.panel.shift") is None
    page.call("Emulation.setEmulatedMedia", features=[])


def test_a_thing_is_carried_and_thrown(browser, tmp_path):
    document = open_document(TOUCH, ReadingOptions())
    browser.resize((320, 400))
    browser.open(write_page(document, tmp_path / "page.html"))
    browser.until("shapeshift.renderer.settled")
    assert not browser.run("document.getElementById('touch').hidden")
    browser.run("document.getElementById('touch').click()")
    place = browser.run("""(() => { const { camera, canvas, grab, renderer } = shapeshift;
      for (let y = 0.1; y < 0.6; y += 0.01) for (let x = 0; x < 1; x += 0.01) {
        const found = grab.pick(camera.rayThrough([x, y]));
        if (found?.object.name === 'cube')
          return [x * canvas.clientWidth + 3, y * canvas.clientHeight + 3]; } })()""")
    cube = "shapeshift.renderer.objects.find(o => o.name === 'cube')"
    before = browser.run(f"{cube}.pose.position")
    browser.mouse("mousePressed", place, 1)
    assert browser.run("shapeshift.grab.held.size") == 1
    for step in range(1, 6):
        browser.mouse("mouseMoved", (place[0] + 6 * step, place[1] - 12 * step), 1)
        time.sleep(0.02)
    assert browser.run(f"{cube}.pose.position[1]") > before[1] + 0.05
    browser.mouse("mouseReleased", (place[0] + 30, place[1] - 60))
    assert browser.run("shapeshift.grab.moving.size") == 1
    steps = """(() => { for (let i = 0; i < 300; i++) shapeshift.grab.step(0.02);
      return shapeshift.grab.moving.size; })()"""
    assert browser.run(steps) == 0  # it has come to rest,
    rest = browser.run(f"{cube}.pose.position")
    table = open_document(TOUCH, ReadingOptions()).floor_y
    assert rest[1] >= table - 0.01 and rest != before  # on the table or on the floor
    assert browser.run("document.getElementById('object').selectedOptions[0].textContent") == "cube"
    browser.run("shapeshift.panel.setX(0.5), 1")
    xs = browser.run("shapeshift.renderer.objects.map(o => o.x)")
    assert browser.run(f"{cube}.x") == 0.5 and xs.count(0.5) == 2  # its own alone; the ring has 0.5


def test_a_folder_is_shown_by_a_server_coarse_first(browser, tmp_path):
    document = several_objects()
    export_page(document, tmp_path / "site", PageSettings("site", pictures=False), lambda *_: None)
    handler = functools.partial(QuietHandler, directory=str(tmp_path / "site"))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser.open(f"http://127.0.0.1:{server.server_address[1]}/")
        assert browser.message() == ""
        names = [a.rsplit("/", 1)[1] for a in browser.requests() if a.startswith("http")]
        assert names.index("coarse.bin") < names.index("scene.bin")
        assert browser.run("shapeshift.renderer.objects[0].count") == 600
        names = browser.run("[...document.querySelectorAll('#object option')].map(o => o.text)")
        assert names == ["all", *(obj.name for obj in document.scene.objects)]  # and not twice
        server.shutdown()
    browser.open(tmp_path / "site" / "index.html")
    assert "a folder needs a server" in browser.message()


class QuietHandler(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_) -> None:
        """Nothing is printed."""


@pytest.mark.slow
def test_a_frame_without_an_origin_of_its_own_draws_it(browser, tmp_path):
    """As notebooks show their outputs: sandboxed, the worker included."""
    import html

    path = write_page(Document.of(paced_model(30)), tmp_path / "page.html")
    page = html.escape(path.read_text(), quote=True)
    host = tmp_path / "host.html"
    host.write_text(f'<!doctype html><iframe sandbox="allow-scripts" srcdoc="{page}"></iframe>'
                    "<script>document.documentElement.dataset.ready = 'yes'</script>")  # fmt: skip
    browser.events.clear()
    browser.open(host)
    time.sleep(2)
    assert not browser.complaints()


@pytest.mark.slow
def test_a_lost_context_says_a_sentence(page):
    page.run("shapeshift.gl.getExtension('WEBGL_lose_context').loseContext()")
    page.until("document.getElementById('message').textContent.includes('reload')")
