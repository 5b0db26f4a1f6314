"""The picture that a tool draws of a still view, and where the mouse is in it."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.layout import Layout
from shapeshift.app.editor.window.hands import TURN
from shapeshift.app.editor.window.window import CLICK_PIXELS, Drag, Window
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import View

Drawn = TypeVar("Drawn")
Place = tuple[float, float]  # of the mouse, logical pixels
STILL_S = 0.25  # so long nothing must move before a picture is drawn
MOST_PX = 640  # its longer side


@dataclass(frozen=True)
class Seen:
    """What the tools need of the window's own drawing."""

    renderer: Renderer
    forget: Callable[[], None]  # the renderer has drawn something else meanwhile
    moving: Callable[[], bool]
    layout: Callable[[], Layout]
    unit: Callable[[], str]  # of temperature, that is wanted


class PictureUnder:
    """Draws it by the window's renderer, and finds places and points of the world in it."""

    def __init__(self, window: Window, viewpoint: Viewpoint, seen: Seen) -> None:
        self._window, self._viewpoint, self._seen = window, viewpoint, seen
        self._key: tuple = ()  # of what is seen, and since when
        self._since = 0.0

    def is_still(self, key: tuple) -> bool:
        """Whether the view has been still for a while; key: of all that the picture depends on."""
        now = time.perf_counter()
        if key != self._key:
            self._key, self._since = key, now
        return now - self._since >= STILL_S

    def draw(self, draw: Callable[[Renderer, View], Drawn]) -> Drawn:
        """What a function draws of the view, made smaller.  Raises what that raises."""
        view, renderer = self._viewpoint.view(), self._seen.renderer
        renderer.settings = RenderSettings()
        try:
            return draw(renderer, replace(view, size=measured_size(view.size)))
        finally:
            self._seen.forget()

    def logical_view(self) -> View:
        width, height = self._window.logical_size
        return replace(self._viewpoint.view(), size=(int(width), int(height)))

    def pixel(self, place: Place) -> tuple[float, float]:
        """A place as a pixel of the picture."""
        width, height = self._window.logical_size
        columns, rows = measured_size(self._window.size)
        return place[0] * columns / width, place[1] * rows / height

    def point_at(self, picture: ValuePicture, points: np.ndarray, place: Place) -> int | None:
        """Which of some points (N, 3) metres is seen at a place; None: none is."""
        pixels, _ = replace(picture, view=self.logical_view()).pixel_of(points)
        away = np.nan_to_num(np.linalg.norm(pixels - place, axis=1), nan=np.inf)
        nearest = int(np.argmin(away))
        return nearest if away[nearest] <= 2 * CLICK_PIXELS else None

    def turn(self, event: Drag) -> None:
        """Moves the camera, as a drag does without a tool."""
        self._viewpoint.leave_camera()
        self._viewpoint.camera.turn(-event.dx * TURN, -event.dy * TURN)


def measured_size(size: tuple[int, int]) -> tuple[int, int]:
    """Of the picture of a view of `size` pixels (W, H)."""
    part = min(1.0, MOST_PX / max(size))
    return max(round(size[0] * part), 1), max(round(size[1] * part), 1)
