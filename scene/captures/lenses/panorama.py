"""Panorama photos (equirectangular, nerfstudio's form) as the six faces of a cube of pinholes.

The middle of the photo lies ahead of its camera, its left and right edges meet behind it.  The
four faces around are turned by an eighth, so that no face has that seam within; those above and
below have it, and the samples of a pixel then come from either side.
"""

import math
from dataclasses import replace

import numpy as np

from shapeshift.scene.captures.colmap_tables import PANORAMA, ColmapCamera

FACES = ((45.0, 0.0), (135.0, 0.0), (-135.0, 0.0), (-45.0, 0.0), (0.0, 90.0), (0.0, -90.0))
#         degrees to the right, and upwards: of where a face looks


def is_panorama(lens: ColmapCamera | None) -> bool:
    return lens is not None and lens.model == PANORAMA


def face_lens(lens: ColmapCamera, face: tuple[float, float]) -> ColmapCamera:
    """The lens of one face: fx, fy, cx, cy of the panorama's middle, then the face's angles."""
    return replace(lens, params=(*lens.params[:4], *face))


def panorama_from_face(face: tuple[float, float]) -> np.ndarray:
    """(3, 3) rotation between cameras with OpenCV axes."""
    right, up = np.radians(face)
    c, s = math.cos(right), math.sin(right)
    about_y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])  # ahead (0, 0, 1) goes to the right
    c, s = math.cos(up), math.sin(up)
    about_x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])  # ahead goes up, to -y
    return about_y @ about_x


def face_pose(world_from_camera: np.ndarray, face: tuple[float, float]) -> np.ndarray:
    """(4, 4) world from the camera of a face, OpenCV axes."""
    turn = np.eye(4)
    turn[:3, :3] = panorama_from_face(face)
    return world_from_camera @ turn


def panorama_pixels(lens: ColmapCamera, tangents: np.ndarray) -> np.ndarray:
    """(N, 2) pixels of the panorama that lie at tangents (N, 2) of its face."""
    fx, fy, cx, cy, *face = lens.params
    ahead = np.column_stack([tangents, np.ones(len(tangents))])
    x, y, z = (ahead @ panorama_from_face((face[0], face[1])).T).T
    longitude, latitude = np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))  # down is positive
    return np.stack([cx + fx * longitude, cy + fy * latitude], axis=1)
