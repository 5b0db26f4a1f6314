"""The cameras that a command follows through a scene: found, read, moved to where the scene is."""

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from shapeshift.runtime_models.model import Model
    from shapeshift.scene.cameras.camera_list import CameraList, CameraReading

AUTO = "auto"


def camera_reading(options, size: tuple[int, int] | None = None) -> "CameraReading":
    """The same of options with up and flip, and fov_y (degrees) if they have that; UsageError."""
    from shapeshift.scene.cameras.camera_list import CameraReading

    fov_y = getattr(options, "fov_y", 0.0)
    refuse_fov(fov_y)
    return CameraReading(size, math.radians(fov_y), options.up, options.flip)


def refuse_fov(fov_y: float) -> None:
    """Raises UsageError for what is no angle, degrees, nor 0 for one that is not known."""
    from shapeshift.app.errors import UsageError

    if not 0 <= fov_y < 180:
        raise UsageError(f"--fov-y is {fov_y}, expected degrees between 0 and 180.")


def named_cameras(
    camera: str, scene: Path, options, size: tuple[int, int] | None = None
) -> "CameraList":
    """What --camera names, a path or auto, as its file says; the scene need not be open yet.

    Raises UsageError where nothing lies with the scene, BadFile where it cannot be read.
    """
    from shapeshift.app.errors import UsageError
    from shapeshift.app.paths import plain
    from shapeshift.scene.cameras.read_cameras import find_cameras, find_floor, read_camera_list

    path: Path | None = plain(camera)
    if camera == AUTO:
        path = find_cameras(scene) or find_floor(scene)
    if path is None:
        if not scene.exists():
            raise UsageError(f"{scene} does not exist; name a scene.")
        raise UsageError(f"no cameras lie with {scene}; give --camera a file of them.")
    return read_camera_list(path, camera_reading(options, size))


def in_scene(cameras: "CameraList", model: "Model") -> "CameraList":
    """The cameras where the model is: one that was re-centred has an origin of its own."""
    from shapeshift.scene.cameras.camera_list import moved

    origin = getattr(model, "origin", (0.0, 0.0, 0.0))
    return replace(cameras, views=tuple(moved(cameras.views, [-c for c in origin])))
