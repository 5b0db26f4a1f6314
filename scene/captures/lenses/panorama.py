"""Panorama photos, of one eye or of one of two, as the straight photos that they are cut into.

Columns are longitudes and rows latitudes (nerfstudio's and COLMAP's form): the middle of the photo
lies ahead of its camera, the left and right edges of a whole one meet behind it.  The four faces
around are turned by an eighth, so that no face has that seam within; those above and below have it,
and the samples of a pixel then come from either side.

VR180: one eye's half of what lies ahead, from half the distance of the eyes beside the camera.
OMNIDIRECTIONALSTEREO: the eye goes round with the column, always beside what it looks at, so that
no straight photo has its rays.  A strip's camera stands where the eye does for its middle: the rays
of the strip's edges are EYE (1 - cos(15 degrees)), 1.1 mm, beside it.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.scene.captures.colmap_tables import PANORAMA, ColmapCamera

EYE = 0.032  # metres from the camera's place; nerfstudio's distance of the eyes is 0.064
VR180, STEREO = "VR180", "OMNIDIRECTIONALSTEREO"  # then _L or _R
STEREO_MODELS = tuple(f"{kind}_{side}" for kind in (VR180, STEREO) for side in "LR")
PANORAMAS = (PANORAMA, *STEREO_MODELS)
STRIP = 15.0  # degrees to either side; 45 up and down: towards the poles stereo has no sense


@dataclass(frozen=True)
class Face:
    """A straight photo out of a panorama."""

    right: float  # degrees, of where it looks
    up: float
    across: float = 1.0  # tangents of half its angles
    down: float = 1.0
    eye: tuple[float, float, float] = (0.0, 0.0, 0.0)  # metres from the camera, its OpenCV axes


CUBE = ((45, 0), (135, 0), (-135, 0), (-45, 0), (0, 90), (0, -90))
FACES = tuple(Face(float(right), float(up)) for right, up in CUBE)


def is_panorama(lens: ColmapCamera | None) -> bool:
    return lens is not None and lens.model in PANORAMAS


def is_whole(lens: ColmapCamera) -> bool:
    """Whether a panorama shows all directions."""
    (fx, fy), (width, height) = lens.focal, lens.size
    return abs(2 * math.pi * fx - width) <= 1.5 and abs(math.pi * fy - height) <= 1.5


def faces_of(lens: ColmapCamera) -> tuple[Face, ...]:
    """What a panorama is cut into; those that a part of one does not show are among them."""
    side = EYE if lens.model.endswith("_R") else -EYE
    if lens.model.startswith(VR180):
        return tuple(replace(face, eye=(side, 0.0, 0.0)) for face in FACES)
    if not lens.model.startswith(STEREO):
        return FACES
    strips = []
    for right in np.arange(-180 + STRIP, 180, 2 * STRIP):
        c, s = math.cos(math.radians(right)), math.sin(math.radians(right))
        eye = (side * c, 0.0, -side * s)
        strips.append(Face(float(right), 0.0, math.tan(math.radians(STRIP)), 1.0, eye))
    return tuple(strips)


def face_lens(lens: ColmapCamera, face: Face) -> ColmapCamera:
    """The lens of one face: the panorama's numbers, then the face's."""
    more = (face.right, face.up, face.across, face.down)
    return replace(lens, model=PANORAMA, params=(*lens.params[:4], *more))


def panorama_from_face(right: float, up: float) -> np.ndarray:
    """(3, 3) rotation between cameras with OpenCV axes; degrees."""
    right, up = math.radians(right), math.radians(up)
    c, s = math.cos(right), math.sin(right)
    about_y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])  # ahead (0, 0, 1) goes to the right
    c, s = math.cos(up), math.sin(up)
    about_x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])  # ahead goes up, to -y
    return about_y @ about_x


def face_pose(world_from_camera: np.ndarray, face: Face) -> np.ndarray:
    """(4, 4) world from the camera of a face, OpenCV axes."""
    turn = np.eye(4)
    turn[:3, :3] = panorama_from_face(face.right, face.up)
    turn[:3, 3] = face.eye
    return world_from_camera @ turn


def face_size(lens: ColmapCamera) -> tuple[int, int]:
    """Half the columns and rows of a face, as fine as the panorama is in its middle."""
    focal = max(round(lens.focal[0]), 1)
    across, down = lens.params[6:8]
    return max(round(focal * across), 1), max(round(focal * down), 1)


def panorama_pixels(lens: ColmapCamera, tangents: np.ndarray) -> np.ndarray:
    """(N, 2) pixels of the panorama that lie at tangents (N, 2) of its face."""
    fx, fy, cx, cy, right, up, *_ = lens.params
    ahead = np.column_stack([tangents, np.ones(len(tangents))])
    x, y, z = (ahead @ panorama_from_face(right, up).T).T
    longitude, latitude = np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))  # down is positive
    return np.stack([cx + fx * longitude, cy + fy * latitude], axis=1)


def stereo_sentences(lenses: list[ColmapCamera]) -> tuple[str, ...]:
    """What a person should know of panoramas of one eye of two."""
    said = []
    if count := sum(lens.model in STEREO_MODELS for lens in lenses):
        said.append(
            f"{count} panoramas are of one eye of two: the eyes are taken {2000 * EYE:.0f} mm "
            "apart, so their poses have to be in metres."
        )
    if any(lens.model.startswith(STEREO) for lens in lenses):
        off = 1000 * EYE * (1 - math.cos(math.radians(STRIP)))
        said.append(
            f"Stereo panoramas are cut into strips of {2 * STRIP:.0f} degrees, whose rays are at "
            f"most {off:.1f} mm beside theirs; what lies more than 45 degrees up or down is left "
            "out."
        )
    return tuple(said)
