"""Orthographic views, as pinhole views through a very long lens: every drawing has them at once.

The eye goes back along the line of sight and the lens becomes as much longer, so that the plane in
which the eye turned about something keeps its size.  What lies d metres off this plane and r pixels
off the axis is then displaced by r d / distance pixels; from 1 / PARALLAX_PX times the farthest r
and d on that is less than PARALLAX_PX anywhere, which nobody tells from a parallel projection.
Colours that depend on the direction of sight come out as those of parallel rays, too.
"""

import math
from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.shapes import four
from shapeshift.scene.pose import Pose, View

PARALLAX_PX = 0.25  # at most, of the projection of any point within the radius


def orthographic(view: View, distance: float, radius: float, near_m: float = 0.0) -> View:
    """The parallel projection along a view's line of sight, to the scale of `distance` metres.

    radius: metres from that plane within which the scene lies.  near_m: metres from the view's own
    eye before which nothing is drawn; 0: all of the scene is.
    """
    (left, right, low, high), (width, height) = view.tangents, view.size
    across = max(abs(left), abs(right)) * width / (right - left)  # pixels off the axis
    along = max(abs(low), abs(high)) * height / (high - low)
    reach = max(radius, 1e-6) * math.hypot(across, along) / PARALLAX_PX  # metres
    reach = max(reach, distance)
    back = reach - distance
    eye = view.world_from_eye
    position = eye.position + back * eye.matrix()[:3, 2]
    tangents = four(np.array(view.tangents) * distance / reach)
    near = back + near_m if near_m > 0 else max(reach - 50 * radius, view.near)
    far = reach + 50 * radius
    pose = Pose(position, eye.wxyz)
    return replace(view, world_from_eye=pose, tangents=tangents, near=near, far=max(far, 2 * near))
