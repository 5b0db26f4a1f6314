"""Keeps the scene framed: once the free part of the window has another size, it is fitted anew."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.app.editor.state.camera.camera import fov_y_of
from shapeshift.scene.cameras.framing import default_view, framing_view
from shapeshift.scene.document.scene_file import SceneFile, first_view
from shapeshift.scene.pose import View, perspective
from shapeshift.scene.scene import Scene

Size = tuple[int, int]
SETTLED_S = 0.15  # without a change: fitting asks every splat where it is


class Framed:
    """Waits until a size has settled; whether to fit at all is `refit`'s to know."""

    def __init__(self, size: Callable[[], Size], refit: Callable[[Size], None]) -> None:
        self._size, self._refit = size, refit
        self._fitted = self._last = size()
        self._since = 0.0

    def poll(self, now: float) -> bool:
        """Once a frame; True while a size has yet to settle.  Seconds of any clock."""
        size = self._size()
        if size != self._last:
            self._last, self._since = size, now
        if size != self._fitted and now - self._since >= SETTLED_S:
            self._fitted = size
            self._refit(size)
        return size != self._fitted

    def forget(self) -> None:
        """Another scene was framed in the window as it is now."""
        self._fitted = self._last = self._size()


# From where a scene is looked at first: by its file, its floor, its cameras, else all of it.


@dataclass(frozen=True)
class FirstLook:
    """What was found next to a scene file that says from where to look."""

    home: View | None = None  # on a floor
    front: float | None = None  # the side that was photographed, radians about +Y from +Z

    def view(
        self, file: SceneFile, scene: Scene, points: tuple[np.ndarray, np.ndarray],
        size: tuple[int, int],
    ) -> View:  # fmt: skip
        """The view in size (W, H); `points` are those of the scene, and how opaque they are."""
        if self.home is not None:
            return replace(self.home, tangents=perspective(fov_y_of(self.home), size), size=size)
        if file.view is not None:
            plain = replace(file.view, orthographic=False)  # the camera makes its rays parallel
            return first_view(replace(file, view=plain), scene, size)
        if len(scene.objects) == 1:
            model = scene.objects[0].model
            if self.front is None or model.provenance.get("view"):
                return default_view(model, size)
        return framing_view(*points, size, self.front)
