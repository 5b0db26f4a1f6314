"""The moving picture in README.md: the demo's slider through its stops, then its mug is thrown.

python3 tools/pictures/moving_picture.py [docs/shapeshift.webp]
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

import shapeshift as ss  # noqa: E402
from shapeshift.scene.world.read_script import Act, HandPath, read_script  # noqa: E402

SIZE = (480, 238)  # of the scene; the band with the slider lies below
BAND = 32  # pixels: 480x270 in all
PER_SECOND = 12
# Stops of the demo with the frames of the way to each one and of the rest there.
WAY = (("RGB", 0, 6), ("Thermal", 10, 8), ("Opened", 10, 10), ("RGB", 10, 4))
SWAY_DEGREES, TURN_FRAMES = 14.0, 58  # of the camera about the scene, there and back once
TOUCH_FROM_S, TOUCH_FRAMES = 0.3, 38  # of the demo's script, in real time
HEATS_S = (0.6, 1.2)  # of the script: the slider goes from RGB to Thermal meanwhile
EYE, TARGET, FOV_Y = (0.03, 0.42, 0.98), (0.02, 0.08, 0.1), 0.75  # metres, radians
HAND = "right"
BACKGROUND = (0.075, 0.078, 0.085)  # that of the viewer
LIGHT, DIM, ACCENT = (235, 235, 235), (150, 150, 150), (255, 178, 64)
QUALITY = 78  # of WebP: below a megabyte


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, nargs="?", default=ROOT / "docs" / "shapeshift.webp")
    path = parser.parse_args().out
    with ss.Renderer() as renderer:
        renderer.settings = replace(renderer.settings, background=BACKGROUND)
        pictures = [*slider_frames(renderer)]
        pictures += touch_frames(renderer)
    first, *rest = pictures
    first.save(
        path, save_all=True, append_images=rest, duration=round(1000 / PER_SECOND), loop=0,
        quality=QUALITY, method=6,
    )  # fmt: skip
    sys.stdout.write(f"{path}: {len(pictures)} frames, {path.stat().st_size:,} bytes\n")


def slider_frames(renderer: ss.Renderer) -> Iterator[Image.Image]:
    """The demo while its slider goes the WAY, the camera swaying about it."""
    scene = ss.load(ss.DEMO)
    stops = {stop.name: stop.x for stop in scene.stops}
    xs = [stops[WAY[0][0]]] * WAY[0][2]
    for (before, *_), (after, frames, rest) in pairwise(WAY):
        part = np.arange(1, frames + 1) / frames
        eased = part**2 * (3 - 2 * part)
        xs += [*(stops[before] + (stops[after] - stops[before]) * eased), *[stops[after]] * rest]
    view, (centre, _) = scene.views("front", 1, SIZE)[0], scene.bounds
    for i, x in enumerate(xs):
        angle = np.radians(SWAY_DEGREES) * np.sin(2 * np.pi * i / TURN_FRAMES)
        picture = to_image(renderer.render(scene.at(float(x)), turned(view, centre, angle)))
        draw_slider(picture, stops, float(x))
        yield picture


def touch_frames(renderer: ss.Renderer) -> Iterator[Image.Image]:
    """The demo while its script's hand carries and throws; a ring marks the hand."""
    scene = ss.load(ss.TOUCH)
    script, items = ss.TOUCH.with_name("demo.jsonl"), scene.subject.file.all_items
    acts = read_script(script, items)
    view = replace(
        scene.views("front", 1, SIZE)[0],
        world_from_eye=ss.look_at(np.array(EYE), np.array(TARGET)),
        tangents=ss.perspective(FOV_Y, SIZE),
    )  # fmt: skip
    stops = {stop.name: stop.x for stop in ss.load(ss.DEMO).stops}
    times = [TOUCH_FROM_S + i / PER_SECOND for i in range(TOUCH_FRAMES)]
    for step in ss.simulate(scene, script, seconds=times[-1] + 0.1):
        if not times or step.seconds < times[0] - 1e-9:
            continue
        times.pop(0)
        part = float(np.clip((step.seconds - HEATS_S[0]) / (HEATS_S[1] - HEATS_S[0]), 0, 1))
        x = stops["Thermal"] * part**2 * (3 - 2 * part)
        picture = to_image(renderer.render(step.scene.at(x), view))
        draw_hand(picture, view, acts, step.seconds)
        draw_slider(picture, stops, x)
        yield picture


def turned(view: ss.View, centre: np.ndarray, angle: float) -> ss.View:
    """The view carried about +Y through `centre` (3,) by `angle` radians."""
    about_y = np.array([np.cos(angle / 2), 0, np.sin(angle / 2), 0])
    world_from_eye = ss.Pose(np.zeros(3), about_y).matrix()
    world_from_eye[:3, 3] = centre - world_from_eye[:3, :3] @ centre
    pose = ss.Pose.from_matrix(world_from_eye @ view.world_from_eye.matrix())
    return replace(view, world_from_eye=pose)


def to_image(picture: np.ndarray) -> Image.Image:
    """(H, W, 3) display sRGB as 8 bits, with room for the slider below."""
    whole = np.concatenate([picture, np.tile(np.array(BACKGROUND, np.float32), (BAND, SIZE[0], 1))])
    return Image.fromarray((np.clip(whole, 0, 1) * 255 + 0.5).astype(np.uint8))


def draw_slider(picture: Image.Image, stops: dict[str, Any], x: float) -> None:
    """The track with the names of the stops, the nearest one bright, and the knob at x."""
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(13)
    left, right, y = 70, SIZE[0] - 70, SIZE[1] + BAND - 11
    nearest = min(stops, key=lambda name: abs(stops[name] - x))
    draw.line([(left, y), (right, y)], fill=DIM, width=2)
    for name, at in stops.items():
        place = left + at * (right - left)
        draw.line([(place, y - 4), (place, y + 4)], fill=DIM, width=2)
        color = LIGHT if name == nearest else DIM
        draw.text((place, y - 8), name, fill=color, font=font, anchor="mb")
    knob = left + x * (right - left)
    draw.ellipse([knob - 6, y - 6, knob + 6, y + 6], fill=ACCENT)


def draw_hand(picture: Image.Image, view: ss.View, acts: tuple[Act, ...], seconds: float) -> None:
    """A ring where the hand is, filled as long as it holds something."""
    place = np.array([*HandPath(acts, HAND).at(seconds).position, 1.0])
    clip = view.clip_from_eye() @ np.linalg.inv(view.world_from_eye.matrix()) @ place
    x, y = (clip[:2] / clip[3] * (0.5, -0.5) + 0.5) * SIZE
    done = [act.do for act in acts if act.hand == HAND and act.t <= seconds and act.do != "hand"]
    holds = [each for each in done if each in ("grab", "release")][-1:] == ["grab"]
    ring = [x - 9, y - 9, x + 9, y + 9]
    ImageDraw.Draw(picture).ellipse(ring, outline=ACCENT, width=4 if holds else 2)


if __name__ == "__main__":
    main()
