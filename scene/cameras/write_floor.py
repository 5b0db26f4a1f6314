"""splatapult's NAME_vr.json from a view: the floor lies an eye's height below it."""

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import data_from_ours
from shapeshift.scene.cameras.read_floor import EYE_HEIGHT
from shapeshift.scene.pose import View

LEAST_LEVEL = 1e-3  # length of the level part of a line of sight that still has a heading


def floor(view: View) -> dict:
    """The file: level, facing where the view faces.  Raises BadFile for one straight up or down."""
    eye = view.world_from_eye
    back = eye.matrix()[:3, 2] * (1.0, 0.0, 1.0)
    length = float(np.linalg.norm(back))
    if not length > LEAST_LEVEL:
        raise BadFile("the view looks straight up or down, a floor needs a heading; turn it first.")
    up = np.array([0.0, 1.0, 0.0])
    ours_from_floor = np.eye(4)
    ours_from_floor[:3, 0] = np.cross(up, back / length)
    ours_from_floor[:3, 1], ours_from_floor[:3, 2] = up, back / length
    ours_from_floor[:3, 3] = eye.position - EYE_HEIGHT * up
    return {"floorMat": (data_from_ours() @ ours_from_floor).tolist()}
