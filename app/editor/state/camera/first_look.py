"""From where a scene is looked at first: by its file, its floor, its cameras, else all of it."""

from dataclasses import dataclass, replace

import numpy as np

from shapeshift.app.editor.state.camera.camera import fov_y_of
from shapeshift.scene.cameras.framing import default_view, framing_view
from shapeshift.scene.document.scene_file import SceneFile, first_view
from shapeshift.scene.pose import View, perspective
from shapeshift.scene.scene import Scene


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
