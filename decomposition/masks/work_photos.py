"""The photos of a capture as masks are made on them: by name, straight, of a bounded size."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from shapeshift.decomposition.label_folder import below_capture, sampled, stop_of
from shapeshift.decomposition.masks.label_maps import read_mask
from shapeshift.decomposition.masks.segmenter import Prompt
from shapeshift.decomposition.masks.specs import ObjectSpec, ObjectSpecs, PhotoPrompt
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.stop import Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.lenses.brown import brown_tangents, is_brown
from shapeshift.scene.captures.lenses.panorama import is_panorama
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.undistort import by_pycolmap, pinhole_of, pixels_of
from shapeshift.scene.pose import View

MOST_SIDE = 1024  # pixels: what segmenters look at
MOST_AWAY = 0.5  # pixels from where a lens sends a point's tangent to the point


@dataclass(frozen=True)
class WorkPhoto:
    """One photo, divided so that its longer side has MOST_SIDE pixels at most."""

    name: str  # below the capture's folder, forward slashes
    photo: Photo
    factor: int
    view: View  # of the divided photo
    stop: Stop  # of the model, that the photo shows

    def pixels(self) -> np.ndarray:
        """(H, W, 3) uint8.  Raises BadFile."""
        rgb = load_photo(self.photo, self.factor).rgb
        assert rgb.shape[:2] == self.view.size[::-1]
        return rgb

    def places(self, points: Sequence[tuple[float, float]]) -> np.ndarray:
        """(n, 2) pixels of the divided photo, of points in the file's pixels."""
        places = np.array(points, np.float64).reshape(-1, 2)
        if self.photo.lens is not None and len(places):
            places = straight_points(self.photo.lens, places)
        return places / self.factor

    def mask(self, path: Path, label: int | None) -> np.ndarray:
        """(H, W) bool of the divided photo, from a PNG of the file's shape.  Raises BadFile."""
        whole = read_mask(path, self.photo.file_size, label)
        mask, gone = sampled(whole, self.photo, self.factor)
        return mask if gone is None else mask & ~gone


def straight_points(lens: ColmapCamera, points: np.ndarray) -> np.ndarray:
    """(n, 2) pixels of the straight camera, of points in a bent photo's pixels; NaN of those that
    it does not see.

    Past 90 degrees of a fisheye pycolmap gives the angle as if it were a tangent, within the
    straight photo: what the lens does not send back to its point is no tangent of it.
    """
    straight = pinhole_of(lens)
    if is_brown(lens):
        tangents = brown_tangents(lens, points)
    else:
        tangents = by_pycolmap(lens, points, back=True)
    away = np.abs(pixels_of(lens, tangents) - points).max(axis=1)  # pixels
    tangents = np.where((away <= MOST_AWAY)[:, None], tangents, np.nan)  # NaN is away
    return tangents * straight.focal + straight.centre


def work_photos(capture: Capture, stops: Sequence[Stop]) -> list[WorkPhoto]:
    """The photos in the capture's order, without those of modalities that a model with these
    stops does not have.  Raises BadFile where none is left.
    """
    found: list[WorkPhoto] = []
    refusal: BadFile | None = None
    for photo in capture.photos:
        if is_panorama(photo.lens):
            raise BadFile(f"{photo.path} is a panorama; objects are marked in straight photos.")
        try:
            stop = stop_of(photo, tuple(stops))
        except BadFile as error:
            refusal = error
            continue
        factor = max(math.ceil(max(photo.view.size) / MOST_SIDE), 1)
        name = below_capture(photo, capture).as_posix()
        found.append(WorkPhoto(name, photo, factor, photo.view.divided(factor), stop))
    if not found and refusal is not None:
        raise refusal
    return found


def find_photo(photos: Sequence[WorkPhoto], asked: str, where: str) -> int:
    """The index of the photo that a prompt names: its path, or its file name if that is one's
    alone.  Raises BadFile.
    """
    names = [photo.name for photo in photos]
    if asked in names:
        return names.index(asked)
    files = [i for i, name in enumerate(names) if Path(name).name == asked]
    if len(files) == 1:
        return files[0]
    near = get_close_matches(asked, names, 1)
    if len(files) > 1:
        advice = f"{len(files)} photos are called so; write {names[files[0]]} or another"
    else:
        advice = f"did you mean '{near[0]}'" if near else f"the first one is '{names[0]}'"
    raise BadFile(f"{where}: '{asked}' is none of the capture's {len(names)} photos; {advice}.")


def prompt_of(spec: ObjectSpec, said: PhotoPrompt, photo: WorkPhoto) -> Prompt:
    """What a person said of the object in a photo, in its divided pixels.  Raises BadFile where
    that lies outside of it.
    """
    width, height = photo.photo.file_size
    corners = [said.box[:2], said.box[2:]] if said.box else []
    for x, y in (*corners, *said.inside, *said.outside):
        if not (0 <= x <= width and 0 <= y <= height):
            raise BadFile(
                f"object '{spec.name}': {x:g}, {y:g} lies outside of {photo.name}, which has "
                f"{width}x{height} pixels."
            )
        if not np.isfinite(photo.places([(x, y)])).all():
            raise BadFile(
                f"object '{spec.name}': {x:g}, {y:g} of {photo.name} lies outside of what the "
                "photo shows without its lens's bend; say a place nearer to the middle."
            )
    box = None
    if said.box:
        left, top, right, bottom = said.box
        edge = photo.places([(left, top), (right, top), (left, bottom), (right, bottom)])
        low, high = edge.min(0), edge.max(0)
        box = float(low[0]), float(low[1]), float(high[0]), float(high[1])
    return Prompt(box, photo.places(said.inside), photo.places(said.outside), text=spec.text)


def given_mask(specs: ObjectSpecs, said: PhotoPrompt, photo: WorkPhoto) -> np.ndarray | None:
    """The mask that a prompt names, (H, W) bool of the divided photo.  Raises BadFile."""
    return None if said.mask is None else photo.mask(specs.path(said), said.mask_label)
