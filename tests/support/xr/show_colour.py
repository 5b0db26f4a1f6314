"""Shows known colours through `Session` in one of the runtime's formats; tells what lies there.

show_colour.py FORMAT FRAMES       one line of JSON: its format, and each eye's patches
"""

import json
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
PATCHES = ((0, 0, 0), (10, 20, 30), (128, 128, 128), (255, 128, 0), (255, 255, 255))


def main(pixels: str, frames: int) -> None:
    sys.path.insert(0, str(ROOT))
    from shapeshift.renderer.gl.context import open_context
    from shapeshift.vr.openxr.instance import Instance
    from shapeshift.vr.openxr.session import Session

    with (
        open_context("egl") as ctx,
        Instance() as instance,
        Session(instance, ctx, pixels=pixels) as session,
    ):
        textures = []
        for i, (width, height) in enumerate(session.sizes):
            stripe = np.repeat(np.array(PATCHES, np.uint8), width // len(PATCHES), axis=0)
            row = np.zeros((width, 4), np.uint8)
            row[: len(stripe), :3] = stripe
            picture = np.repeat(row[None] if i == 0 else row[None, ::-1], height, axis=0)
            textures.append(ctx.texture((width, height), 4, picture.tobytes()))
        session.layers.keep = True
        seen = []
        for frame in session.frames():
            if frame.drawn:
                session.submit(textures)
                seen.append([patches_of(eye) for eye in session.layers.kept])
            if len(seen) == frames:
                session.leave()
    told = {"format": session.pixels.name, "linear": session.pixels.linear, "eyes": seen[-1]}
    print(json.dumps(told | {"states": session.life.states, "shown": len(seen)}))


def patches_of(picture: np.ndarray) -> list[list[float]]:
    """The colour in the middle of every patch, left to right."""
    height, width, _ = picture.shape
    size = width // len(PATCHES)
    middles = [picture[height // 2, size * i + size // 2] for i in range(len(PATCHES))]
    return [[float(value) for value in each[:3]] for each in middles]


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
