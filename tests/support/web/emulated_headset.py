"""A page in an emulated headset (iwer), and hands that a test moves."""

import base64
import json
import os
from pathlib import Path

import numpy as np

from shapeshift.scene.pose import Pose, View

CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
SCRIPT = CACHE / "shapeshift" / "iwer" / "node_modules" / "iwer" / "build" / "iwer.min.js"
# Chromium has a navigator.xr of its own, which iwer replaces only when it is told to.
INSTALL = """
;globalThis.device = new IWER.XRDevice(IWER.metaQuest3);
device.installRuntime({ forceInstall: true }); device.stereoEnabled = true; device.fovy = 1.2;
"""
# The next picture that is drawn, before panel and rays lie over it, with its views.
WATCH = """(() => {
  const { renderer, gl, canvas } = shapeshift, draw = renderer.draw.bind(renderer);
  renderer.draw = (views, ...more) => {
    draw(views, ...more);
    if (!globalThis.wanted || !renderer.settled) return;
    const pixels = new Uint8Array(4 * canvas.width * canvas.height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    let text = '';
    for (let i = 0; i < pixels.length; i += 8192)
      text += String.fromCharCode(...pixels.subarray(i, i + 8192));
    globalThis.seen = [btoa(text), canvas.width, canvas.height, views];
    globalThis.wanted = false;
  };
})(), 1"""
STICK, TRIGGER, SQUEEZE = "thumbstick", "trigger", "squeeze"
HOMES = {"left": "y-button", "right": "b-button"}


def install(page) -> None:
    """Every page that is opened from now on finds the headset."""
    page.call("Page.addScriptToEvaluateOnNewDocument", source=SCRIPT.read_text() + INSTALL)


def enter(page, text: str = "Enter VR") -> None:
    """Presses the page's button and waits for the first frames."""
    buttons = "[...document.querySelectorAll('#headsets button')]"
    click = f"{buttons}.find((b) => b.textContent === '{text}').click(), 1"
    page.call("Runtime.evaluate", expression=click, userGesture=True)
    page.until("shapeshift.headset?.frames > 1")
    page.run(WATCH)


def eyes(page) -> tuple[list[np.ndarray], list[View]]:
    """Pictures (H, W, 3) 0..1 of both eyes, settled, and what each of them is a picture of."""
    page.run("globalThis.seen = null, globalThis.wanted = true, 1")
    page.until("globalThis.seen !== null")
    text, width, height, entries = page.run("globalThis.seen")
    pixels = np.frombuffer(base64.b64decode(text), np.uint8).reshape(height, width, 4)
    pictures, views = [], []
    for entry in entries:
        left, low, wide, high = entry["viewport"]
        pictures.append(pixels[low : low + high, left : left + wide][::-1, :, :3] / 255)
        pose = Pose(*(np.array(entry["worldFromEye"][name]) for name in ("position", "wxyz")))
        views.append(View(pose, tuple(entry["tangents"]), entry["near"], 1e3, (wide, high)))
    return pictures, views


def wait(page, frames: int = 3) -> None:
    """So many frames of the headset more."""
    before = page.run("shapeshift.headset.frames")
    page.until(f"shapeshift.headset.frames >= {before + frames}")


def push(page, hand: str, across: float, ahead: float = 0.0) -> None:
    """A stick; 0 lets it go."""
    page.run(f"device.controllers.{hand}.updateAxes('{STICK}', {across}, {-ahead}), 1")


def press(page, hand: str, button: str, value: float) -> None:
    page.run(f"device.controllers.{hand}.updateButtonValue('{button}', {value}), 1")
    wait(page)


def away(page) -> None:
    """Both hands behind the head, pointing away from everything."""
    for hand in ("left", "right"):
        page.run(
            f"device.controllers.{hand}.position.set(0, 2, 5),"
            f"device.controllers.{hand}.quaternion.set(0, 1, 0, 0), 1"
        )
    wait(page)


def aim(page, hand: str, at, back_m: float = 0.5, kind: str = "controllers") -> None:
    """Puts a hand `back_m` before a place of the world, level, pointing at it along the head's -z.

    The room is turned about +y alone.
    """
    x, y, z = page.run(f"""(() => {{
      const {{ position: [px, py, pz], wxyz: [w, , v] }} = shapeshift.headset.worldFromFloor;
      const [x, y, z] = {json.dumps(list(map(float, at)))}, c = w * w - v * v, s = 2 * w * v;
      return [c * (x - px) - s * (z - pz), y - py, s * (x - px) + c * (z - pz)];
    }})()""")
    page.run(
        f"device.{kind}.{hand}.position.set({x}, {y}, {z + back_m}),"
        f"device.{kind}.{hand}.quaternion.set(0, 0, 0, 1), 1"
    )
    wait(page)


def shift(page, hand: str, by, kind: str = "controllers") -> None:
    """Moves a hand by metres of the world; the room is turned about +y alone."""
    x, y, z = map(float, by)
    page.run(f"""(() => {{
      const {{ wxyz: [w, , v] }} = shapeshift.headset.worldFromFloor;
      const c = w * w - v * v, s = 2 * w * v, place = device.{kind}.{hand}.position;
      place.set(place.x + c * {x} - s * {z}, place.y + {y}, place.z + s * {x} + c * {z});
      return 1;
    }})()""")
    wait(page)


def lift(page, hand: str, by_m: float, kind: str = "controllers") -> None:
    shift(page, hand, (0, by_m, 0), kind)


def level(page, hand: str, before_m: float) -> None:
    """The hand a little before the head, pointing ahead."""
    page.run(
        f"device.controllers.{hand}.position.set(device.position.x, device.position.y - 0.2,"
        f" device.position.z - {before_m}), device.controllers.{hand}.quaternion.set(0, 0, 0, 1), 1"
    )
    wait(page)
