"""What a page draws, as numbers: views set from outside, pixels read back."""

import base64
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.app.document import Document
from shapeshift.app.page.page_file import page_text
from shapeshift.app.page.page_scene import PageSettings, page_scene
from shapeshift.renderer.colors.false_colors import PICTURE, false_colors
from shapeshift.renderer.colors.palette import apply_palette, over_background
from shapeshift.renderer.reference import reference_image
from shapeshift.runtime_models.web.web_model import control_entry
from shapeshift.scene.control import control_of
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene

DRAW = """(async (views, controls, target) => {
  const { renderer, camera, gl, canvas } = shapeshift;
  renderer.arena.blendInto(target, renderer.scene.brightest ?? Infinity);
  renderer.resortDegrees = 0.001; renderer.sortedFor = null;
  controls.forEach((x, i) => renderer.setX(x, renderer.objects[i]));
  renderer.draw(views);
  for (let i = 0; i < 6000 && !renderer.settled; i++) {
    if (renderer.takeMeans()) renderer.draw(views);
    await new Promise((r) => setTimeout(r, 5));
  }
  renderer.draw(views);
  const pixels = new Uint8Array(4 * canvas.width * canvas.height);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  let text = '';
  for (let i = 0; i < pixels.length; i += 8192)
    text += String.fromCharCode(...pixels.subarray(i, i + 8192));
  return [btoa(text), canvas.width, canvas.height, renderer.settled];
})"""


def write_page(document: Document, path: Path, **settings) -> Path:
    """A page of one file, without pictures of the stops."""
    scene = page_scene(document, PageSettings("test", pictures=False, **settings), lambda *_: None)
    path.write_text(page_text("test", scene))
    return path


def still(page) -> None:
    """From now on the page draws only what a test asks for."""
    page.run("""(page => { page.headset = { session: true };  // it may not have drawn at all yet
      const { canvas } = page;
      [canvas.width, canvas.height] = [canvas.clientWidth, canvas.clientHeight];
    })(shapeshift)""")


def view_entry(view: View, left: int = 0) -> dict:
    """A view as the page's renderer takes it, `left` pixels from the canvas' left side."""
    return {
        "worldFromEye": {"position": view.world_from_eye.position.tolist(),
                         "wxyz": view.world_from_eye.wxyz.tolist()},
        "tangents": list(view.tangents), "near": view.near, "viewport": [left, 0, *view.size],
    }  # fmt: skip


def drawn(page, scene: Scene, views: Sequence[View], target: str = "rgba16") -> np.ndarray:
    """(H, W, 3) 0..1 of the canvas: the views side by side, each object at its x."""
    lefts = np.cumsum([0, *(view.size[0] for view in views)]).tolist()
    entries = [view_entry(view, left) for view, left in zip(views, lefts, strict=False)]
    controls = [control_entry(obj.model, obj.x) for obj in scene.objects]
    call = f"{DRAW}({json.dumps(entries)}, {json.dumps(controls)}, '{target}')"
    text, width, height, settled = page.run(call)
    assert settled, "no order has come"
    pixels = np.frombuffer(base64.b64decode(text), np.uint8).reshape(height, width, 4)
    return pixels[::-1, :, :3] / 255


def expected(document: Document, scene: Scene, view: View, eye=None) -> np.ndarray:
    """(H, W, 3) of the float64 reference, with palettes and background, held to 0..1."""
    rgba = reference_image(scene, view, eye=eye)
    colors = false_colors(scene, [control_of(obj) for obj in scene.objects])
    if colors.way == PICTURE:
        rgba = apply_palette(rgba, colors.palette)
    return np.clip(over_background(rgba, document.background), 0, 1)


def at(document: Document, *xs) -> Scene:
    """The objects at these controls; one for all."""
    objects = document.scene.objects
    xs = xs * len(objects) if len(xs) == 1 else xs
    return Scene(tuple(replace(obj, x=x) for obj, x in zip(objects, xs, strict=True)))


def decibels(page, document: Document, scene: Scene, view: View, target: str = "rgba16") -> float:
    """PSNR of the page against the reference."""
    return psnr(drawn(page, scene, [view], target), expected(document, scene, view))
