"""What every reader of captures does with the file of a photo: its size, its lens, its view."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Photo
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.lenses.panorama import (
    face_lens,
    face_pose,
    faces_of,
    is_panorama,
)
from shapeshift.scene.captures.photo import open_image
from shapeshift.scene.captures.radiometric.no_value import may_lack_values
from shapeshift.scene.captures.undistort import is_straight, lost, pinhole_of
from shapeshift.scene.pose import View

SHOWN = 0.02  # of a face of a panorama: those with less are left out
LOOKED_AT_PX = 32  # a side of a face, to tell


# Photos that EXIF turns by a quarter, in captures that mean them upright.
#
# Pixels are read as they lie in the file, so the camera is turned instead, and its lens with it.

ORIENTATION = 0x0112  # of EXIF
# Orientation: upright from file, x right, y down.  6: a clockwise turn makes it upright, 8: one the
# other way.  The others are mirrored, or have the same sides upright and cannot be told.
TURNS = {6: ((0, -1), (1, 0)), 8: ((0, 1), (-1, 0))}
# Lenses that bend alike all around; OpenCV's two have p1 and p2 besides.
ROUND = {
    "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV_FISHEYE", "FOV", "EUCM",
    "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "SIMPLE_DIVISION", "DIVISION", "SIMPLE_FISHEYE",
    "FISHEYE",
}  # fmt: skip
TANGENTIAL = ("OPENCV", "FULL_OPENCV")


def quarter_of(image: Image.Image, lens: ColmapCamera) -> np.ndarray | None:
    """(3, 3) upright from file, axes x right, y down, z forward; None where EXIF says no such turn,
    or where the lens bends in a way that is not turned here.
    """
    turn = TURNS.get(image.getexif().get(ORIENTATION, 1))
    if turn is None or lens.model not in (*ROUND, *TANGENTIAL):
        return None
    matrix = np.eye(3)
    matrix[:2, :2] = turn
    return matrix


def turned_lens(lens: ColmapCamera, upright_from_file: np.ndarray) -> ColmapCamera:
    """The lens of the upright photo as it is for the pixels in the file."""
    (width, height), (x, y) = lens.size, lens.centre
    (_, across), (down, _) = upright_from_file[:2, :2]  # one of them is 1, the other -1
    centre = (y if down > 0 else height - y, x if across > 0 else width - x)
    rest = list(lens.params[len(lens.focals) + 2 :])
    if lens.model in TANGENTIAL:  # x'' = ... + 2 p1 x y + p2 (r^2 + 2 x^2), and so for y with p1
        p1, p2 = rest[2:4]
        rest[2:4] = (across * p2, down * p1)
    return replace(lens, size=(height, width), params=(*lens.focals[::-1], *centre, *rest))


def image_size(path: Path, claimed: tuple[int, int] | None) -> tuple[int, int]:
    """(width, height) from the file's header, which must be what the capture claims."""
    with open_image(path) as image:
        size = image.size
    if claimed is not None and claimed != size:
        raise BadFile(
            f"{path_end(path)}: the image has {size[0]}x{size[1]} pixels, the capture says "
            f"{claimed[0]}x{claimed[1]}; resize the images or scale the intrinsics with them"
        )
    return size


def posed_photos(
    path: Path, modality: str, world_from_camera: np.ndarray, lens: ColmapCamera, where: str
) -> list[Photo]:
    """One photo; of a panorama the straight ones that it is cut into.  As posed_photo."""
    if not is_panorama(lens):
        return [posed_photo(path, modality, world_from_camera, lens, where)]
    photos = []
    for face in faces_of(lens):
        pose = face_pose(world_from_camera, face)
        photo = posed_photo(path, modality, pose, face_lens(lens, face), where)
        assert photo.lens is not None, "faces are no photos of their own"
        by = max(photo.view.size) / LOOKED_AT_PX
        small = (LOOKED_AT_PX, max(round(photo.view.size[1] / by), 1))
        if lost(photo.lens, small, by).mean() <= 1 - SHOWN:
            photos.append(photo)
    if not photos:
        raise BadFile(f"{where} shows nothing of a panorama; check its 'fl_x', 'cx' and 'cy'")
    return photos


def posed_photo(
    path: Path, modality: str, world_from_camera: np.ndarray, lens: ColmapCamera, where: str
) -> Photo:
    """A photo with the view of its lens' straight camera.  Raises BadFile.

    world_from_camera: (4, 4) OpenCV axes, our world; lens: of the size that the capture states.
    """
    with open_image(path) as image:
        size, mode, gaps = image.size, image.mode, may_lack_values(image)
    if not fits(lens.size, size):
        world_from_camera, lens = as_it_lies(path, world_from_camera, lens)
    lens = of_size(lens, size, path)
    try:
        if is_straight(lens, where):
            view = View.from_pinhole(world_from_camera, lens.focal, lens.centre, lens.size)
            return Photo(view, path, modality, mode=mode, may_lack_values=gaps)
        straight = pinhole_of(lens)
        view = View.from_pinhole(world_from_camera, straight.focal, straight.centre, straight.size)
    except ValueError as error:
        raise BadFile(f"{where}: {error}") from None
    return Photo(view, path, modality, lens=lens, mode=mode, may_lack_values=gaps)


def as_it_lies(
    path: Path, world_from_camera: np.ndarray, lens: ColmapCamera
) -> tuple[np.ndarray, ColmapCamera]:
    """Camera and lens for the pixels in the file, where EXIF turns these by a quarter and the
    capture is about the upright photo; else as they are.
    """
    with open_image(path) as image:
        turn = quarter_of(image, lens)
    if turn is None:
        return world_from_camera, lens
    pose = np.array(world_from_camera, np.float64)
    pose[:3, :3] = pose[:3, :3] @ turn
    return pose, turned_lens(lens, turn)


def fits(stated: tuple[int, int], size: tuple[int, int]) -> bool:
    """Whether a file of `size` pixels may be one of `stated` that was made smaller or larger."""
    across, down = (new / old for new, old in zip(size, stated, strict=True))
    off = abs(stated[1] * across - size[1]), abs(stated[0] * down - size[0])
    return min(off) <= 1  # a pixel: sides are rounded


def of_size(lens: ColmapCamera, size: tuple[int, int], path: Path) -> ColmapCamera:
    """The lens for a file of `size` pixels: photos may have been made smaller after the poses.

    Raises BadFile where file and capture differ by more than that.
    """
    if lens.size == size:
        return lens
    if not fits(lens.size, size):
        image_size(path, lens.size)
    across, down = (new / old for new, old in zip(size, lens.size, strict=True))
    scales = (across, down) if len(lens.focals) == 2 else ((across + down) / 2,)
    scales = (*scales, across, down)
    params = [value * scale for value, scale in zip(lens.params, scales, strict=False)]
    crop = None if lens.crop is None else lens.crop * across
    return replace(lens, size=size, params=(*params, *lens.params[len(scales) :]), crop=crop)


def doubts_of(
    named: int,
    missing: list[str],
    photos: list[Photo],
    rescaled: list[str],
    no_depth: Sequence[str] = (),
    no_normals: Sequence[str] = (),
    turned: Sequence[str] = (),
) -> tuple[str, ...]:
    """What a person should know of a capture's files, a sentence each.

    named: photos that the capture names, of which the files `missing` are not there; rescaled:
    photos of another size than it says; no_depth, no_normals: photos whose depth photo or
    normal map is not there; turned: photos that were read by as_it_lies.
    """
    said = []
    if missing:
        said.append(
            f"{len(missing)} of {named} photos that the capture names are not there, for example "
            f"{path_end(missing[0])}; they are left out."
        )
    if rescaled:
        said.append(
            f"{len(rescaled)} photos have another size than the capture says, for example "
            f"{path_end(rescaled[0])}; the intrinsics are scaled with them."
        )
    if turned:
        said.append(
            f"{len(turned)} photos lie on their side in the file, as EXIF says, for example "
            f"{path_end(turned[0])}; the capture is about the upright ones, so their cameras are "
            "turned."
        )
    if no_depth:
        said.append(
            f"{len(no_depth)} depth photos are not there, for example of "
            f"{path_end(no_depth[0])}; those photos are used without."
        )
    if no_normals:
        said.append(
            f"{len(no_normals)} normal maps are not there, for example of "
            f"{path_end(no_normals[0])}; those photos are used without."
        )
    faces = [photo for photo in photos if is_panorama(photo.lens)]
    if faces:
        count = len({photo.path for photo in faces})
        said.append(f"{count} panoramas are read as {len(faces) / count:g} straight photos each.")
    bent = [p for p in photos if p.lens is not None and not is_panorama(p.lens)]
    if bent:
        models = ", ".join(sorted({photo.lens.model for photo in bent if photo.lens is not None}))
        said.append(f"{len(bent)} photos are undistorted as they are read ({models}).")
    return tuple(said)


def refuse_all_missing(missing: list[str], named: int, where: str) -> None:
    """Raises BadFile where none of the photos is there."""
    if len(missing) == named:
        raise BadFile(
            f"{where}: none of its {named} photos is there, for example {path_end(missing[0])}; "
            "put them beside it"
        )
