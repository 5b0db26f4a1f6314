"""One frame of a renderer with settings of its own, as tests of every drawing ask for it."""

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl
import numpy as np

from shapeshift.renderer.gl.context import is_software
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import FrameStats, RenderSettings
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene


def step_error(ctx) -> float:
    """How far, in steps of 1/255, a byte that GL writes may lie from what it rounds.

    Software rounds to the nearest; an H100 was up to 0.561 away in the same pictures.
    """
    return 0.51 if is_software(ctx) else 0.57


def draw_counted(
    renderer: Renderer, scene: Scene, views: list[View], **settings
) -> tuple[list[np.ndarray], FrameStats]:
    """(a picture a view, what the frame says of itself)."""
    renderer.settings = RenderSettings(**settings)
    renderer.update(scene)
    stats = renderer.draw(views)
    return [renderer.image(i).copy() for i in range(len(views))], stats


def draw(renderer: Renderer, scene: Scene, views: list[View], **settings) -> list[np.ndarray]:
    """A picture a view."""
    return draw_counted(renderer, scene, views, **settings)[0]


@contextmanager
def texture_target(ctx: moderngl.Context, size: tuple[int, int]) -> Iterator[moderngl.Framebuffer]:
    """A framebuffer of one RGBA texture; afterwards the context does not keep one that is gone."""
    texture = ctx.texture(size, 4)
    made = ctx.framebuffer([texture])
    yield made
    ctx.detect_framebuffer(0).use()
    made.release()
    texture.release()
