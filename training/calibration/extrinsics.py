"""How the second camera of a rig sits: one rigid offset for all cameras of a modality.

Their stated poses are off by one and the same turn and shift in the camera's own axes.  What that
does to views and captures, how a run keeps it, and gradients by it; calibrate.py finds it.
"""

import json
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.pose import Pose, View


def moved_by(six: np.ndarray) -> np.ndarray:
    """(4, 4) exp of (turn (3,) radians, shift (3,) metres) along and about the eye's axes."""
    turn, shift = six[:3], six[3:]
    angle = float(np.linalg.norm(turn))
    cross = np.array([[0, -turn[2], turn[1]], [turn[2], 0, -turn[0]], [-turn[1], turn[0], 0]])
    a, b, c = 1.0, 0.5, 1 / 6
    if angle > 1e-6:
        a, b = np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2
        c = (1 - a) / angle**2
    out = np.eye(4)
    out[:3, :3] += a * cross + b * cross @ cross
    out[:3, 3] = (np.eye(3) + b * cross + c * cross @ cross) @ shift
    return out


def about_pivot(six: np.ndarray, distance: float) -> np.ndarray:
    """(4, 4) of a turn (3,) radians about the place `distance` metres ahead of an eye, and a shift
    (3,) as a share of that distance: about the eye, turn and shift would do nearly the same to the
    picture.
    """
    pivot = np.array([0, 0, -distance])
    moved = moved_by(six * np.repeat([1.0, distance], 3))
    moved[:3, 3] += pivot - moved[:3, :3] @ pivot
    return moved


def small_move(moved: np.ndarray, distance: float) -> np.ndarray:
    """(6,) the numbers of `about_pivot` that give `moved` (4, 4), a small one, to first order."""
    turn, pivot = moved[:3, :3], np.array([0, 0, -distance])
    spin = turn - turn.T
    shift = moved[:3, 3] + turn @ pivot - pivot
    return np.concatenate([np.array([spin[2, 1], spin[0, 2], spin[1, 0]]) / 2, shift / distance])


def slope_about_pivot(by_eye: np.ndarray, distance: float) -> np.ndarray:
    """(6,) gradient by the numbers of `about_pivot` of that by turn and shift of the eye."""
    out = by_eye * np.repeat([1.0, distance], 3)
    out[:3] -= np.cross((0, 0, -distance), by_eye[3:])
    return out


def offset_view(view: View, eye_from_found: np.ndarray) -> View:
    """The view from where a camera sits that is off by `eye_from_found` (4, 4) in its own axes."""
    pose = Pose.from_matrix(view.world_from_eye.matrix() @ eye_from_found)
    return replace(view, world_from_eye=pose)


def offset_capture(capture: Capture, modality: str, eye_from_found: np.ndarray) -> Capture:
    """The capture with all cameras of a modality moved by one offset."""
    photos = tuple(
        replace(p, view=offset_view(p.view, eye_from_found)) if p.modality == modality else p
        for p in capture.photos
    )
    return replace(capture, photos=photos)


def pose_gradient(
    view: View, means: np.ndarray, wxyz: np.ndarray, by_means: np.ndarray, by_wxyz: np.ndarray
) -> np.ndarray:
    """(6,) gradient by turn and shift of the eye in its own axes, of what splats' gradients say.

    Moving the eye is moving all splats the other way.  Colours are held.
    """
    world_from_eye = view.world_from_eye.matrix()
    axes, eye = world_from_eye[:3, :3], world_from_eye[:3, 3]
    place = (means - eye) @ axes  # (N, 3) in the eye's axes
    by_place = by_means @ axes
    w, v, by_w, by_v = wxyz[:, :1], wxyz[:, 1:], by_wxyz[:, :1], by_wxyz[:, 1:]
    spin = 0.5 * (w * by_v - by_w * v + np.cross(v, by_v))  # about the world's axes
    turn = np.cross(place, by_place).sum(0) + spin.sum(0) @ axes
    return -np.concatenate([turn, by_place.sum(0)])


@dataclass(frozen=True)
class ExtrinsicOffset:
    """What calibrate.py found; a (4, 4) eye_from_found that is rigid."""

    offset: np.ndarray
    turn_deg: float
    shift_m: float
    gain_db: float = 0.0  # by how much smaller the error of the modality's photos is with it


def offset_of_matrix(offset: np.ndarray, gain_db: float = 0.0) -> ExtrinsicOffset:
    cosine = np.clip((np.trace(offset[:3, :3]) - 1) / 2, -1, 1)
    turn_deg = float(np.rad2deg(np.arccos(cosine)))
    return ExtrinsicOffset(offset, turn_deg, float(np.linalg.norm(offset[:3, 3])), gain_db)


def rig_json(modality: str, found: ExtrinsicOffset) -> str:
    """What TrainSettings.rig keeps of it."""
    return json.dumps({modality: found.offset.ravel().round(9).tolist()})


def with_extrinsics(capture: Capture, rig: str) -> Capture:
    """The capture with the offsets that TrainSettings.rig keeps.  Raises BadFile."""
    if not rig:
        return capture
    try:
        for modality, numbers in json.loads(rig).items():
            offset = np.array(numbers, np.float64).reshape(4, 4)
            turn = offset[:3, :3]
            if not np.abs(turn @ turn.T - np.eye(3)).max() < 1e-6:  # NaN is not
                raise ValueError("no turn")
            capture = offset_capture(capture, modality, rigid(offset))
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise BadFile(f"the offset of a rig's cameras, '{rig!s:.60}', is none ({error}).") from None
    return capture


def rig_of(provenance: dict) -> str:
    """TrainSettings.rig of the run that a package was trained in; empty where it names none."""
    settings = provenance.get("settings")
    return settings.get("rig", "") if isinstance(settings, dict) else ""


def rigid(matrix: np.ndarray) -> np.ndarray:
    """The (4, 4) rigid one that is nearest to a matrix that nearly is."""
    out = matrix.copy()
    left, _, right = np.linalg.svd(matrix[:3, :3])
    out[:3, :3] = left @ right
    return out
