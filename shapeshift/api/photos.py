"""Photos without poses to a capture."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapeshift.api.arguments import PathText
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import plain

if TYPE_CHECKING:
    from shapeshift.decomposition.poses.pose_report import PoseReport

Progress = Callable[[str, int, int], None]  # what is done now, how many of how many


def poses(
    photos: PathText,
    out: PathText,
    *,
    every: int = 1,
    masks: PathText | None = None,
    progress: Progress | None = None,
    **settings: Any,
) -> "PoseReport":
    """Finds where photos were taken from, upright, and writes a COLMAP folder for `train`.

    photos: a folder, its sub-folders modalities; thermal photos get the poses of the photos of
    visible light with the same name.  out: a new or empty folder, or one with the same search
    unfinished, which goes on.  every: each n-th photo of a folder.  settings: any field of
    `shapeshift.decomposition.poses.find_poses.PoseSettings`, such as length, neighbours or
    straight.
    Lengths are arbitrary unless `length` names one.  Gives what was found: photos placed, left
    out, or placed by few points; mean error in pixels.

    Structure from motion: Schoenberger and Frahm 2016, by pycolmap.  Raises BadFile, UsageError.

        found = ss.poses("photos", "capture")
        model = ss.train("capture", seconds=60)
    """
    from shapeshift.decomposition.poses.find_poses import WORK, PoseSettings, find_poses
    from shapeshift.decomposition.poses.photo_list import list_photos

    if not every >= 1:
        raise UsageError(f"every is {every}; give 1 or more.")
    try:
        wished = replace(
            PoseSettings(masks=None if masks is None else plain(str(masks))), **settings
        )
    except (TypeError, ValueError) as error:
        raise UsageError(f"{error}.") from None
    folder = plain(str(out))
    if folder.is_dir() and any(path.name != WORK for path in Path(folder).iterdir()):
        raise UsageError(f"{folder} is not empty; name a new folder.")
    listed = list_photos(plain(str(photos)), every)
    return find_poses(listed, folder, wished, progress or (lambda what, done, of: None))
