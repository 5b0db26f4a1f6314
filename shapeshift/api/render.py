"""Drawing without a window: one Renderer for loops, and the one that all scenes share."""

import atexit
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np

from shapeshift.app.drawing import open_renderer
from shapeshift.rasterizer.device import check_fork
from shapeshift.renderer.gl.context import let_go
from shapeshift.renderer.settings import FrameStats, RenderSettings
from shapeshift.renderer.surface import Surface
from shapeshift.scene.appearance import Background
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    import moderngl

    from shapeshift.api.opened import OpenedScene
    from shapeshift.renderer.renderer import Renderer as FrameRenderer

Inspected = TypeVar("Inspected")
Drawing = Literal["auto", "quads", "tiles"]
Context = Literal["auto", "egl", "surfaceless", "osmesa", "none"]


class Renderer:
    """Keeps one scene decoded on the device and draws it again and again.

    drawing: `quads` are drawn with OpenGL, `tiles` with OpenCL, which need no GPU; `auto` takes
    what is faster here.  context: where the OpenGL context without a window comes from; `none`
    draws tiles without OpenGL.  settings: what may be left out, RenderSettings() is exact.  Raises
    NoContext or NoDevice where neither is to be had, UsageError for what does not go together.

    Only what has changed is computed: a scene that differs in its poses alone is not decoded again.
    The passes of a frame are those of `shapeshift.renderer.renderer`, in the order of the paper
    (3D Gaussian Splatting, Kerbl et al. 2023).

        with ss.Renderer() as renderer:
            pictures = [renderer.render(scene, view) for view in scene.views("orbit", 24)]
    """

    def __init__(
        self,
        drawing: Drawing = "auto",
        context: Context = "auto",
        settings: RenderSettings | None = None,
    ) -> None:
        self._stack, self._lock = ExitStack(), threading.RLock()
        self._frames: FrameRenderer
        self._ctx: moderngl.Context | None
        opened = open_renderer(context, drawing, report=lambda text: None)
        self._frames, self._ctx = self._stack.enter_context(opened)
        if self._ctx is not None:
            let_go(self._ctx)
        self._stats = FrameStats()
        if settings is not None:
            self.settings = settings

    @property
    def settings(self) -> RenderSettings:
        """What a frame leaves out, and its background; assign another one between two frames.

        renderer.settings = replace(renderer.settings, max_distance=20.0)
        """
        return self._frames.settings

    @settings.setter
    def settings(self, settings: RenderSettings) -> None:
        self._frames.settings = settings

    @property
    def backends(self) -> dict[str, str]:
        """What is in use: drawing, mlps, sort.

        renderer.backends["drawing"]  # "tiles (Portable Computing Language)"
        """
        return self._frames.backends

    @property
    def stats(self) -> FrameStats:
        """Milliseconds of each pass and counts of splats, of the frame drawn last.

        renderer.stats.ms["splat"], renderer.stats.drawn
        """
        return self._stats

    def render(self, scene: "OpenedScene", view: View, out: np.ndarray | None = None) -> np.ndarray:
        """(H, W, 3) float32 display sRGB of a view, row 0 on top, over the settings' background.

        out: written to and given back, (H, W, 3) float32 of the view's size; without it the array
        is new.  Raises ValueError where `out` has another shape or type.

            frame = np.empty((360, 640, 3), np.float32)
            renderer.render(scene, view, out=frame)
        """
        width, height = view.size
        if out is not None and (out.shape != (height, width, 3) or out.dtype != np.float32):
            raise ValueError(
                f"out is {out.shape} {out.dtype}; ({height}, {width}, 3) float32 is wanted."
            )
        with self._current():
            self._draw(scene, [view])
            picture = self._frames.resolved(0, out)
        if out is not None and picture is not out:  # a debug picture
            np.copyto(out, picture)
        return picture if out is None else out

    def render_views(self, scene: "OpenedScene", views: Sequence[View]) -> list[np.ndarray]:
        """The same of several views in one frame: what two eyes share is computed once.

        left, right = renderer.render_views(scene, ss.stereo_pair(view, 0.063))
        """
        with self._current():
            self._draw(scene, list(views))
            return [self._frames.resolved(i) for i in range(len(views))]

    def premultiplied(self, scene: "OpenedScene", view: View) -> np.ndarray:
        """(H, W, 4) float32 red, green, blue times alpha, and alpha, before any background.

        Tiles on a CPU hand over the memory that they drew into: read-only, not copied, and yours as
        long as you hold it.  At a value stop it holds values, which a palette has not coloured.

            rgba = renderer.premultiplied(scene, view)
        """
        with self._current():
            self._draw(scene, [view])
            return self._frames.image(0)

    def surface(self, scene: "OpenedScene", view: View) -> Surface:
        """Depth (metres along the view), normals and coverage of what a view sees.

        depth_m = renderer.surface(scene, view).depth()  # (H, W), NaN where nothing is
        """
        with self._current():
            self._frames.update(scene.drawn)
            return self._frames.surface(view)

    def inspect(self, read: "Callable[[FrameRenderer], Inspected]") -> "Inspected":
        """What a function reads of the program's own renderer, in its context.

        renderer.inspect(lambda frames: frames.backends)
        """
        with self._current():
            return read(self._frames)

    def _draw(self, scene: "OpenedScene", views: list[View]) -> None:
        self._frames.update(scene.drawn)
        self._frames.draw(views)
        self._stats = self._frames.exact_stats()  # its pixels are waited for anyway

    @contextmanager
    def _current(self) -> Iterator[None]:
        """One thread at a time draws, whichever it is; in between the context is nobody's."""
        check_fork()
        with self._lock, self._ctx or nullcontext():
            yield

    def close(self) -> None:
        """Gives the memory and the context back; a second time does nothing.

        renderer.close()
        """
        with self._lock:
            ctx, self._ctx = self._ctx, None
            if ctx is not None:
                ctx.__enter__()  # and the end of the stack lets it go for ever
            self._stack.close()

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(self, *failure) -> None:
        self.close()


_lock = threading.RLock()
_shared: dict[tuple[str, str], Renderer] = {}  # (drawing, context) -> what all scenes draw with
_of_parent: dict[tuple[str, str], Renderer] = {}  # kept: to give them back would wait for ever


@contextmanager
def shared_renderer(
    drawing: Drawing,
    context: Context,
    settings: RenderSettings | None,
    background: Background,
) -> Iterator[Renderer]:
    """The renderer that stays open from one picture to the next; one thread at a time has it.

    background: where no settings are given.
    """
    check_fork()
    with _lock:
        key = (drawing, context)
        if key not in _shared:
            _shared[key] = Renderer(drawing, context)
        renderer = _shared[key]
        renderer.settings = settings or replace(RenderSettings(), background=background)
        yield renderer


def forget_shared() -> None:
    """In a forked child: what was open is the parent's, and a lock may be held by no thread."""
    global _lock
    _lock = threading.RLock()
    _of_parent.update(_shared)
    _shared.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=forget_shared)


@atexit.register
def close_shared() -> None:
    """Gives the memory back; the next picture opens a renderer again."""
    with _lock:
        while _shared:
            _shared.popitem()[1].close()
