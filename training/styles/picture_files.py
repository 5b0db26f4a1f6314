"""Pictures that another program has made of a scene's views, one a camera, as a new stop's look."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.photo import BROKEN, open_image
from shapeshift.training.styles.image_network import resized
from shapeshift.training.styles.style_pictures import StyleView, Turns

ENDINGS = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff")
LEAST_PX, MOST_PX = 16, 4096  # a side


class PictureFiles:
    """A StylePictures: the files of a folder."""

    turns = Turns()

    def __init__(self, files: Sequence[Path]) -> None:
        """A file for each view of the run, in their order."""
        self.files = list(files)

    def make(self, views: Sequence[StyleView], done: float) -> list[np.ndarray]:
        return [resized(read_picture(self.files[v.number]), v.view.size) for v in views]


def files_for(folder: Path, names: Sequence[str]) -> list[Path]:
    """The picture of each camera: that of its name, or, of as many files, those in order.

    Raises BadFile where there is not one for each.
    """
    if not folder.is_dir():
        raise BadFile(
            f"{folder} is no folder; --pictures names one with a picture for each camera."
        )
    files = sorted(f for f in folder.iterdir() if f.suffix.lower() in ENDINGS and f.is_file())
    by_name = {file.stem: file for file in files}
    stems = [Path(name).stem for name in names]
    if all(stems) and all(stem in by_name for stem in stems):
        return [by_name[stem] for stem in stems]
    if len(files) == len(names):
        return files
    missing = next((stem for stem in stems if stem and stem not in by_name), "")
    hint = f"; there is none for '{missing}'" if missing else ""
    raise BadFile(
        f"{folder} holds {len(files)} pictures for {len(names)} cameras{hint}; name each as its "
        "camera, or give one for each in the order of their names."
    )


def read_picture(path: Path) -> np.ndarray:
    """(H, W, 3) float32 display sRGB of a picture of LEAST_PX to MOST_PX a side.  BadFile."""
    if not path.is_file():
        raise BadFile(f"{path} is no file; a picture is wanted.")
    with open_image(path) as image:
        width, height = image.size
        if not (LEAST_PX <= min(width, height) and max(width, height) <= MOST_PX):
            raise BadFile(
                f"{path} has {width}x{height} pixels; {LEAST_PX} to {MOST_PX} a side are wanted."
            )
        try:
            return np.asarray(image.convert("RGB"), np.float32) / 255
        except BROKEN as error:
            raise BadFile(f"{path} is broken ({error}); a whole picture is wanted.") from None
