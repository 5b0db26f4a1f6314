"""How well a shape that stays as it is shows the photos of a modality, as its cameras are moved.

How bright each splat is in that modality is solved for at every offset (least squares, by conjugate
gradients), so that the error is a function of the offset alone: brightness that was fitted at one
offset would hold the cameras there.  It changes with the side from which one looks: what is hot
glows less at a grazing angle, which else would look like an edge that lies elsewhere.
Photos count as grey.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.project import Projected, project, project_backward
from shapeshift.rasterizer.raster import rasterize, rasterize_backward
from shapeshift.scene.pose import View
from shapeshift.training.calibration.extrinsics import (
    about_pivot,
    offset_view,
    pose_gradient,
    slope_about_pivot,
)
from shapeshift.training.drawing import camera_of
from shapeshift.training.photos import LoadedPhoto

GRAY = 6  # of a record's numbers: the first of its colour's three
FIRST_GRAY = 0.3
SIDES = 4  # numbers of a splat's brightness: one from all basis, and how it changes with the side
LEAST_SEEN = 0.01  # pixels: splats that fill less in all photos change no faster than at this
# means (N, 3), scales (N, 3), wxyz (N, 4), opacity (N,) on the device, metres
Shape = tuple[Any, Any, Any, Any]
Answer = Callable[[int, np.ndarray], np.ndarray]  # of a photo and a picture (H, W): a gradient


class ShapeResiduals:
    """Splats of one shape before the photos of one modality, at one offset of its cameras."""

    def __init__(
        self, device, shape: Shape, photos: list[LoadedPhoto], behind: float, distance: float
    ) -> None:
        """behind: brightness of the background.  distance: metres to what is looked at."""
        self.device, self.shape, self.photos = device, shape, photos
        self.behind, self.distance = behind, distance
        self.count = shape[0].shape[0]
        self.gray = np.zeros((self.count, SIDES))  # see `basis`
        self.gray[:, 0] = FIRST_GRAY
        self.means = device.download(shape[0]).astype(np.float64)
        self.wanted = [
            p.over((behind, behind, behind)).mean(axis=2, dtype=np.float32) for p in photos
        ]
        self.weights = [np.float32(1) if p.weight is None else p.weight for p in photos]
        self.values = sum(
            float(np.broadcast_to(weight, wanted.shape).sum(dtype=np.float64))
            for weight, wanted in zip(self.weights, self.wanted, strict=True)
        )
        self.pace: np.ndarray | None = None

    def step(self, six: np.ndarray) -> np.ndarray:
        """(4, 4) of a turn (3,) radians about what is looked at and a shift (3,) as a share of
        the distance.
        """
        return about_pivot(six, self.distance)

    def move_cameras(self, eye_from_found: np.ndarray) -> None:
        """Put all cameras `eye_from_found` (4, 4) away from their stated poses."""
        self.views = [offset_view(photo.view, eye_from_found) for photo in self.photos]
        blank = self.device.zeros((self.count, 3))
        self.tiles = [
            bin_tiles(self.device, self.projected(view, blank), view.size) for view in self.views
        ]
        if self.pace is None:  # what A^T A does to ones bounds its eigenvalues
            ones = np.zeros_like(self.gray)
            ones[:, 0] = 1
            self.pace = np.maximum(self.normal_product(ones)[:, :1], LEAST_SEEN)

    def view_basis(self, photo: LoadedPhoto) -> np.ndarray:
        """(N, 4) 1 and the direction to each splat from where the photo is said to be taken; by
        an offset that turns by next to nothing.  Times `gray` and summed: how bright it looks.
        """
        way = self.means - photo.view.world_from_eye.position
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        return np.concatenate([np.ones((self.count, 1)), way], axis=1)

    def projected(self, view: View, color) -> Projected:
        means, scales, wxyz, opacity = self.shape
        return project(self.device, means, scales, wxyz, opacity, color, camera_of(view))

    def normal_product(self, gray: np.ndarray) -> np.ndarray:
        """(N, 4) A^T A gray, where A draws splats of that brightness in all photos."""
        return self.adjoint(gray, 0.0, lambda i, picture: picture * self.weights[i])

    def residual(self, i: int, picture: np.ndarray) -> np.ndarray:
        """What a picture lacks of a photo, by how much that counts."""
        return (self.wanted[i] - picture) * self.weights[i]

    def adjoint(
        self, gray: np.ndarray, behind: float, answer: Answer, by_step: np.ndarray | None = None
    ) -> np.ndarray:
        """(N, 4) the gradient by `gray` of what `answer` says of every photo's picture, summed.

        by_step: (6,) to which the gradient by `step` is added.
        """
        device, by_gray = self.device, np.zeros_like(gray)
        for i, (view, tiles) in enumerate(zip(self.views, self.tiles, strict=True)):
            basis = self.view_basis(self.photos[i])
            bright = (basis * gray).sum(axis=1, keepdims=True).astype(np.float32)
            color = device.upload(bright.repeat(3, axis=1))
            projected = self.projected(view, color)
            frame = rasterize(device, projected, tiles, view.size, (behind, behind, behind))
            grad = np.zeros(frame.image.shape, np.float32)
            grad[0] = answer(i, device.view(frame.image)[0])
            record = rasterize_backward(
                device, projected, tiles, frame, device.upload(grad), absolute=False
            )
            by_gray += device.view(record)[:, GRAY, None] * basis
            if by_step is not None:
                by_step += self.step_gradient(view, color, projected, record)
        return by_gray

    def step_gradient(self, view: View, color, projected: Projected, record) -> np.ndarray:
        """(6,) gradient by `step` of what the gradients of one view's records say."""
        means, scales, wxyz, opacity = self.shape
        by_means, _, by_wxyz, *_ = project_backward(
            self.device, means, scales, wxyz, opacity, color, camera_of(view), projected, record
        )
        means, wxyz, *by = map(self.device.view, (means, wxyz, by_means, by_wxyz))
        return slope_about_pivot(pose_gradient(view, means, wxyz, *by), self.distance)

    def solve_brightness(self, steps: int) -> None:
        """Brings `gray` nearer to what shows the photos best from where the cameras stand."""
        gradient = self.adjoint(self.gray, self.behind, self.residual)
        nearer = gradient / self.pace
        way, size = nearer.copy(), np.vdot(gradient, nearer)
        for _ in range(steps):
            moved = self.normal_product(way)
            curve = np.vdot(way, moved)
            if not curve > 0:  # nothing is left to explain
                return
            self.gray = self.gray + size / curve * way
            gradient -= size / curve * moved
            nearer, before = gradient / self.pace, size
            size = np.vdot(gradient, nearer)
            way = nearer + size / before * way

    def cost_and_gradient(self) -> tuple[float, np.ndarray]:
        """Half the mean square error from where the cameras stand, and its (6,) gradient by
        `step`; that of the best brightness, too, which has no gradient of its own.
        """
        cost, by_step = 0.0, np.zeros(6)

        def over(i: int, picture: np.ndarray) -> np.ndarray:
            nonlocal cost
            error = -self.residual(i, picture)
            cost += 0.5 * float((error * (picture - self.wanted[i])).sum(dtype=np.float64))
            return error

        self.adjoint(self.gray, self.behind, over, by_step)
        return cost / self.values, by_step / self.values
