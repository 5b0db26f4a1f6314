"""The views that a person keeps, in a file of this start."""

from pathlib import Path

from shapeshift.scene.cameras.camera_list import CameraList
from shapeshift.scene.cameras.write_cameras import COLMAP_FORMS, write_cameras
from shapeshift.scene.pose import View


class KeptViews:
    """The views that a person keeps; every one is written at once, into a file of this start."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._number = 0
        self.form = "ours"
        self.views: list[View] = []

    def keep(self, view: View) -> Path:
        """Adds a view; returns where all of them lie now.  Raises BadFile, OSError."""
        self._folder.mkdir(parents=True, exist_ok=True)
        if not self._number:
            taken = {path.name.split(".")[0] for path in self._folder.glob("views-*")}
            self._number = next(n for n in range(1, 10**6) if f"views-{n:04d}" not in taken)
        views = (*self.views, view)
        if self.form == "vr":  # a floor is one view: the last
            views = views[-1:]
        names = tuple(f"view {i + 1}" for i in range(len(views)))
        ending = "" if self.form in COLMAP_FORMS else f".{self.form}.json"
        path = self._folder / f"views-{self._number:04d}{ending}"
        write_cameras(CameraList(views, names, self.form), path, self.form)
        self.views.append(view)
        return path
