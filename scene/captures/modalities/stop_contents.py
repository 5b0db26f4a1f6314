"""Which stop of a capture has how many photos, of which camera and folder: a sentence a stop."""

from collections import defaultdict
from pathlib import Path

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.scene.captures.capture import Capture, Photo

MOST = 4  # cameras and folders of a stop that are listed


def contents_of(capture: Capture) -> list[str]:
    """A sentence a stop, in the order of the slider, with a photo of it as an example; of a stop
    by formula, which has no photos, the formula.
    """
    return [
        f"{stop.name}: by formula, {stop.formula}" if stop.formula
        else sentence_of(capture, stop.name)
        for stop in sorted((*capture.stops, *capture.formulas), key=lambda stop: stop.x)
    ]  # fmt: skip


def sentence_of(capture: Capture, stop: str) -> str:
    photos = {photo.path: photo for photo in capture.photos if photo.modality == stop}
    groups: dict[tuple, int] = defaultdict(int)
    for photo in photos.values():
        groups[photo.file_size, lens_name(photo), folder_of(capture, photo)] += 1
    if not photos:
        return f"{stop}: no photo"
    listed = [f"{count} of {described(*about)}" for about, count in list(groups.items())[:MOST]]
    if len(groups) == 1:
        listed = [f"{len(photos)} photos of {described(*next(iter(groups)))}"]
    else:
        listed.insert(0, f"{len(photos)} photos")
    if len(groups) > MOST:
        listed.append(f"{sum(list(groups.values())[MOST:])} in {len(groups) - MOST} more folders "
                      "or of other cameras")  # fmt: skip
    first = next(iter(photos))
    return f"{stop}: {', '.join(listed)}; for example {path_end(below(capture, first))}"


def described(size: tuple[int, int], lens: str, folder: str) -> str:
    through = f" through {lens}" if lens else ""
    return "{}x{} pixels".format(*size) + through + (f" in {path_end(folder)}" if folder else "")


def lens_name(photo: Photo) -> str:
    """The model of a lens that bends lines, with its focal length in whole pixels."""
    return "" if photo.lens is None else f"{photo.lens.model} {photo.lens.focal[0]:.0f}"


def folder_of(capture: Capture, photo: Photo) -> str:
    folder = below(capture, photo.path.parent)
    return "" if folder == "." else folder


def below(capture: Capture, path: Path) -> str:
    """A path as seen from the capture's folder, where it lies in it."""
    inside = path.is_relative_to(capture.folder)
    return (path.relative_to(capture.folder) if inside else path).as_posix()
