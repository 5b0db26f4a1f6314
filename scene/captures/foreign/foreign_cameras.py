"""Cameras of Metashape, RealityScan, OpenMVG and others: the poses that captures are read from."""

from dataclasses import replace
from pathlib import Path

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import CameraList, CameraReading
from shapeshift.scene.cameras.read_transforms_cameras import cameras_of
from shapeshift.scene.captures.foreign.read_foreign import read_foreign, refuse_known
from shapeshift.scene.captures.lenses.panorama import is_panorama


def read_foreign_cameras(path: Path, reading: CameraReading) -> CameraList | None:
    """The views of a file, or of a folder with one; None where it has none of these forms.

    Photos need not be there, unless the file does not say how many pixels they have.  Raises
    BadFile.
    """
    refuse_known(path)
    posed = read_foreign(path)
    if posed is None:
        return None
    sized = [frame for frame in posed.frames if "lens" in frame]
    usable = [frame for frame in sized if not is_panorama(frame["lens"])]
    first = path_end(posed.frames[0]["file_path"])
    if not sized:
        raise BadFile(
            f"{posed.where}: it does not say how many pixels its photos have; put {first} and the "
            "others beside it."
        )
    if not usable:
        raise BadFile(
            f"{posed.where}: all cameras are panoramas, which no view can be; train reads them."
        )
    notes = posed.doubts
    if left := len(posed.frames) - len(usable):
        notes += (
            f"{left} of {len(posed.frames)} cameras are panoramas, or of photos that are not there "
            "and whose size the file does not say; they are left out.",
        )
    said = {key: posed.frames[0][key] for key in ("up",) if key in posed.frames[0]}
    found = cameras_of(said, usable, Path(posed.where), reading)
    return replace(found, format=posed.program, notes=notes + found.notes)
