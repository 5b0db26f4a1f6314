"""What the modes that draw share: option checks, looks, a renderer, pictures on disk."""

import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import moderngl
import numpy as np

from shapeshift.app.errors import UsageError, as_typed
from shapeshift.app.terminal import say
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.files.whole_file import whole_file
from shapeshift.runtime_models.model import Model
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.appearance import NEUTRAL, Appearance, Background, Color, Sky, check_color
from shapeshift.scene.scene import Scene
from shapeshift.scene.sections.section import SceneSection
from shapeshift.scene.sections.section_texts import read_section

LARGEST_SIDE = 16384  # pixels: the texture limit of common drivers
MOST_PIXELS = LARGEST_SIDE * 8192  # float images of more do not fit one OpenCL buffer
MOST_VALUES = 100_000  # of x, and of views on an orbit
Texts = tuple[str, str, str]
SOFTWARE = "Shapeshift"  # the Software entry of our PNG files


def parse_size(text: str, option: str = "--size") -> tuple[int, int]:
    """(width, height) of a text like 640x360."""
    found = re.fullmatch(r"([0-9]{1,20})x([0-9]{1,20})", text.strip().lower())
    if not found:
        raise UsageError(f"{option} is '{text}', expected WIDTHxHEIGHT such as 640x360.")
    width, height = int(found[1]), int(found[2])
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        raise UsageError(f"{option} is {width}x{height}; each side must be 1 to {LARGEST_SIDE}.")
    if width * height > MOST_PIXELS:
        raise UsageError(f"{option} is {width}x{height}; at most {MOST_PIXELS:,} pixels are drawn.")
    return width, height


def split_controls(words: tuple[str, ...]) -> list[float | str]:
    """What --x lists: sweep:N as its numbers from 0 to 1, every other word as it is."""
    values: list[float | str] = []
    for word in words:
        kind, _, count = word.strip().partition(":")
        if kind != "sweep":
            values.append(word)
            continue
        if not (re.fullmatch("[0-9]{1,20}", count) and 2 <= int(count) <= MOST_VALUES):
            raise UsageError(f"--x is '{word}'; sweep:N has 2 to {MOST_VALUES} values.")
        values += np.linspace(0, 1, int(count)).tolist()
    return values


@contextmanager
def open_renderer(
    context: str, drawing: str, report: Callable[[str], None] = say
) -> Iterator[tuple[Renderer, moderngl.Context | None]]:
    """(Renderer, context or None) without a window; `none` draws with OpenCL tiles and no GL.

    auto goes on without GL where none is to be had, and tells so, unless quads were asked for.
    """
    from shapeshift.renderer.gl.context import NoContext, open_context

    if context == "none" and drawing == "quads":
        raise UsageError("--drawing quads needs GL; leave --context at auto.")
    ctx = None
    if context != "none":
        try:
            ctx = open_context(context)
        except NoContext as reason:
            if context != "auto" or drawing == "quads":
                raise
            report(f"Drawing with OpenCL alone: {reason}")
    try:
        with Renderer(ctx, drawing if ctx is not None else "tiles") as renderer:
            yield renderer, ctx
    finally:
        if ctx is not None:
            ctx.release()


def save_png(image: np.ndarray, path: Path) -> None:
    """(H, W, 3) display sRGB 0..1 to a PNG that says who made it, all or nothing."""
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    maker = PngInfo()
    maker.add_text("Software", SOFTWARE)
    pixels = (np.clip(np.nan_to_num(image), 0, 1) * 255 + 0.5).astype(np.uint8)
    with whole_file(path) as file:
        Image.fromarray(pixels).save(file, format="PNG", pnginfo=maker)


def is_our_png(path: Path) -> bool:
    """Whether `save_png` made this file: its Software entry stands before the pixels."""
    with path.open("rb") as file:
        return b"tEXtSoftware\0" + SOFTWARE.encode() in file.read(256)


def make_folder(path: Path) -> None:
    if path.exists() and not path.is_dir():
        raise UsageError(f"{path} is a file; name a folder, there or new.")
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cannot make the folder {path}: {error.strerror}.") from None
    if not os.access(path, os.W_OK):
        raise UsageError(f"cannot write into {path}; choose another --out.")


class LookOptions(Protocol):
    """The options of a command that say it."""

    @property
    def background(self) -> Color | None: ...
    @property
    def sky(self) -> Texts | None: ...
    @property
    def exposure(self) -> float: ...
    @property
    def gamma(self) -> float: ...
    @property
    def tint(self) -> Color: ...
    @property
    def opacity(self) -> float: ...


def read_look(options: LookOptions) -> tuple[Appearance, Background | None]:
    """The appearance of the whole scene, and what is asked for behind it.  Raises UsageError."""
    try:
        if options.background is not None:
            check_color(options.background, "background")
        tint = three(options.tint)
        appearance = Appearance(options.exposure, options.gamma, tint, options.opacity)
    except ValueError as error:
        raise as_typed(error, type(options)) from None
    if options.sky is None:
        return appearance, options.background
    if options.background is not None:
        raise UsageError("--sky says what --background does; leave one of the two out.")
    return appearance, Sky(*map(read_color, options.sky))


def read_color(text: str) -> Color:
    """Display sRGB of a text like 87b5e8."""
    if not re.fullmatch("#?[0-9a-fA-F]{6}", text):
        raise UsageError(f"--sky has the colour '{text[:60]}'; six digits like 87b5e8 are wanted.")
    value = int(text.removeprefix("#"), 16)
    return three((value >> shift & 255) / 255 for shift in (16, 8, 0))


def appearing(scene: Scene, appearance: Appearance) -> Scene:
    """The scene with that of all on top of each object's own."""
    if appearance == NEUTRAL:
        return scene
    objects = (replace(obj, appearance=obj.appearance.under(appearance)) for obj in scene.objects)
    return replace(scene, objects=tuple(objects))


def read_cuts(texts: tuple[str, ...], models: Iterable[Model]) -> tuple[SceneSection, ...]:
    """The sections that --section asks for, of a scene of these models.  Raises UsageError."""
    stops = tuple(stop for model in models for stop in model.stops)
    try:
        return tuple(read_section(text, stops) for text in texts)
    except ValueError as error:
        raise UsageError(f"--section {error}") from None


def sectioned(scene: Scene, sections: tuple[SceneSection, ...]) -> Scene:
    """The scene with these of all objects, in addition to each object's own."""
    if not sections:
        return scene
    objects = (replace(obj, sections=(*obj.sections, *sections)) for obj in scene.objects)
    return replace(scene, objects=tuple(objects))
