"""What the modes without a window share: option checks, a renderer, pictures on disk."""

import math
import os
import re
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from app.errors import UsageError
from renderer.renderer import Renderer

LARGEST_SIDE = 16384  # pixels: the texture limit of common drivers


def parse_size(text: str) -> tuple[int, int]:
    """(width, height) of a text like 640x360."""
    found = re.fullmatch(r"(\d+)x(\d+)", text.strip().lower())
    if not found:
        raise UsageError(f"--size is '{text}', expected WIDTHxHEIGHT such as 640x360.")
    width, height = int(found[1]), int(found[2])
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        raise UsageError(f"--size is {width}x{height}; each side must be 1 to {LARGEST_SIDE}.")
    return width, height


def parse_controls(words: tuple[str, ...]) -> list[float]:
    """Control values of words that are numbers in [0, 1] or sweep:N."""
    values: list[float] = []
    for word in words:
        if found := re.fullmatch(r"sweep:(\d+)", word):
            if not 2 <= int(found[1]) <= 100_000:
                raise UsageError(f"--x is '{word}'; a sweep has 2 to 100000 values.")
            values += np.linspace(0, 1, int(found[1])).tolist()
            continue
        try:
            x = float(word)
        except ValueError:
            raise UsageError(f"--x is '{word}', expected a number in 0..1 or sweep:N.") from None
        if not 0 <= x <= 1:
            raise UsageError(f"--x is {word}, expected 0 to 1.")
        values.append(x)
    if not values:
        raise UsageError("--x has no value, expected numbers in 0..1 or sweep:N.")
    return values


def check_positive(name: str, value: float) -> None:
    if not (value > 0 and math.isfinite(value)):
        raise UsageError(f"{name} is {value}, expected a number above 0.")


@contextmanager
def open_renderer(context: str, drawing: str):
    """(Renderer, context or None) without a window; `none` draws with OpenCL tiles and no GL.

    auto goes on without GL where none is to be had, unless quads were asked for.
    """
    from renderer.context import NoContext, open_context

    if context == "none" and drawing == "quads":
        raise UsageError("--drawing quads needs GL; leave --context at auto.")
    ctx = None
    if context != "none":
        try:
            ctx = open_context(context)
        except NoContext:
            if context != "auto" or drawing == "quads":
                raise
    try:
        with Renderer(ctx, drawing if ctx is not None else "tiles") as renderer:
            yield renderer, ctx
    finally:
        if ctx is not None:
            ctx.release()


def save_png(image: np.ndarray, path: Path) -> None:
    """(H, W, 3) display sRGB 0..1 to a PNG, all or nothing."""
    from PIL import Image

    pixels = (np.clip(np.nan_to_num(image), 0, 1) * 255 + 0.5).astype(np.uint8)
    temporary = path.with_name(path.name + ".part")
    Image.fromarray(pixels).save(temporary, format="PNG")
    os.replace(temporary, path)


def make_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cannot make the folder {path}: {error.strerror}.") from None
    if not os.access(path, os.W_OK):
        raise UsageError(f"cannot write into {path}; choose another --out.")
