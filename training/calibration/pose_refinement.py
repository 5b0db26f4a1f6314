"""Poses that are learned with the scene: a small turn and shift of every training photo's camera.

A move of the camera is the inverse move of the world, so the loss's gradient by it is a sum over
what a step knows already: the gradients by the anchors and by the splats.  A step is Newton's with
one number for the curvature, measured now and then half a pixel aside.  Adam, which brings all six
numbers to one pace, turns cameras about what they look at by what noise says, since that changes
pictures little: docs/bench/README.md, "Poses".  Held-out photos keep the poses that are stated.
"""

import numpy as np

from shapeshift.scene.pose import OPENCV_FROM_EYE, View
from shapeshift.training.calibration.extrinsics import (
    about_pivot,
    offset_of_matrix,
    offset_view,
    slope_about_pivot,
    small_move,
)
from shapeshift.training.drawing import DrawnView
from shapeshift.training.first_anchors.views import distance_of
from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.heads.networks import KERNELS
from shapeshift.training.photos import LoadedPhoto

ITEMS = 512  # work-items that share the splats; never taken from the cores
FROM = 0.05  # share of the run from which on poses move: before it there is no picture
PACE, DECAY = 1.0, 0.1  # of Newton's step, and what is left of it at the end of the run
SPRING = 0.02  # of a correction goes with every step: what no photo holds comes back
MOST = 4e-3  # radians and shares of the distance that a step moves a camera at most
KEPT, EVERY = 5, 64  # probes a modality whose median counts; steps of a modality between two
PROBE_PX = 0.5
STATE = ("moved", "visits", "probes", "curvature")


class PoseGradient:
    """Gradient by the eye's pose of the last step that was handed in."""

    def __init__(self, device) -> None:
        self.device = device
        self.kernel = device.program(KERNELS / "pose.cl")["turn_gradient"]
        self.sums = device.empty((ITEMS, 3))
        self.by_eye = np.zeros(6)  # turn (3,) and shift (3,) of the eye in its own axes

    def collect(self, drawing: DrawnView, grad: Gaussians, grad_anchors) -> None:
        """Of a drawing, the gradients by its splats, and by its anchors with their directions.

        Eye and anchors shifted alike give the same picture: a shift of the eye is that of all
        anchors the other way.  It holds what colours see of the eye, too.
        """
        eye_from_world = OPENCV_FROM_EYE @ drawing.camera.camera_from_world
        axes = eye_from_world[:3, :3].T
        eye = -axes @ eye_from_world[:3, 3]
        splats, count = drawing.splats, len(drawing.splats.means)
        self.device.launch(
            self.kernel, ITEMS, 1, count, -(-count // ITEMS), *map(np.float32, eye),
            splats.means, splats.wxyz, grad.means, grad.wxyz, self.sums,
        )  # fmt: skip
        turn, shift = (
            self.device.view(array).sum(axis=0, dtype=np.float64)
            for array in (self.sums, grad_anchors)
        )
        self.by_eye = -np.concatenate([turn @ axes, shift @ axes])


class PoseRefinement:
    """The corrections of a run's training photos; none of photos that it does not know."""

    def __init__(self, photos: dict[str, list[LoadedPhoto]]) -> None:
        self.photos = [photo for each in photos.values() for photo in each]
        self.row = {(photo.modality, photo.name): row for row, photo in enumerate(self.photos)}
        self.modalities = list(photos)
        views = [photo.view for photo in self.photos]
        self.distance = distance_of(views) if views else 1.0  # metres
        self.moved = np.tile(np.eye(4), (len(views), 1, 1))  # eye_from_found, in the eye's axes
        self.visits, self.probes = np.zeros((2, len(photos)), np.int64)  # of each modality
        self.curvature = np.full((len(photos), KEPT), np.nan)  # of the last probes
        self.aside: tuple[np.ndarray, np.ndarray] | None = None  # of a probe before a step

    def view(self, photo: LoadedPhoto, aside: np.ndarray | None = None) -> View:
        """From where a photo is taken to be photographed now, or (6,) beside it (about_pivot)."""
        row = self.row.get((photo.modality, photo.name))
        if row is None:
            return photo.view
        moved = self.moved[row]
        if aside is not None:
            moved = moved @ about_pivot(aside, self.distance)
        return offset_view(photo.view, moved)

    def begins(self, photo: LoadedPhoto, fraction: float) -> bool:
        """Whether a photo's pose is refined at that share of the run."""
        return (photo.modality, photo.name) in self.row and fraction >= FROM

    def probe(self, photo: LoadedPhoto, fraction: float) -> np.ndarray | None:
        """(6,) half a pixel beside the photo's pose, where its gradient is wanted, too."""
        if not self.begins(photo, fraction):
            return None
        which = self.modalities.index(photo.modality)
        if self.probes[which] >= KEPT and self.visits[which] % EVERY:
            return None
        left, right, down, up = photo.view.tangents
        aside, along = np.zeros(6), int(self.probes[which] % 2)  # to the right, up
        span = (right - left, up - down)[along] / photo.view.size[along]
        aside[3 + along] = PROBE_PX * span
        return aside

    def note_probe(self, photo: LoadedPhoto, aside: np.ndarray, by_eye: np.ndarray) -> None:
        """The gradient (6,) by the eye's turn and shift `aside` of the photo's pose; the photo's
        step comes next, and has the one to compare with.
        """
        self.aside = aside, slope_about_pivot(by_eye, self.distance)

    def note_curvature(self, which: int, slope: np.ndarray) -> None:
        """What the last probe shows of a modality, where there was one before this step."""
        if self.aside is None:
            return
        aside, there = self.aside
        curvature = (there - slope) @ aside / (aside @ aside)
        self.curvature[which, self.probes[which] % KEPT] = curvature
        self.probes[which] += 1
        self.aside = None

    def step(self, photo: LoadedPhoto, by_eye: np.ndarray, fraction: float) -> None:
        """Moves a camera by the gradient (6,) of its turn and shift in its own axes.

        One that is not finite moves nothing, nor does any before the curvature is known.
        """
        if not (self.begins(photo, fraction) and np.isfinite(by_eye).all()):
            self.aside = None
            return
        row, which = self.row[photo.modality, photo.name], self.modalities.index(photo.modality)
        slope = slope_about_pivot(by_eye, self.distance)
        self.note_curvature(which, slope)
        self.visits[which] += 1
        curvature = np.median(self.curvature[which])
        if not 0 < curvature < np.inf:  # NaN is not
            return
        way = -slope / curvature
        way *= min(1.0, MOST / max(np.abs(way).max(), 1e-30))
        way -= SPRING * small_move(self.moved[row], self.distance)
        way *= PACE * DECAY**fraction
        self.moved[row] @= about_pivot(way, self.distance)

    def moves(self) -> tuple[float, float]:
        """Median degrees and metres by which cameras stand beside their stated poses."""
        turns = [offset_of_matrix(moved) for moved in self.moved]
        return (
            float(np.median([turn.turn_deg for turn in turns])),
            float(np.median([turn.shift_m for turn in turns])),
        )

    def state(self) -> dict[str, np.ndarray]:
        """Copies of everything that the next step depends on."""
        return {f"poses.{n}": getattr(self, n).copy() for n in STATE} if self.row else {}

    def load(self, state: dict[str, np.ndarray]) -> None:
        """Of `state`; one that has none of so many photos changes nothing."""
        if (kept := state.get("poses.moved")) is not None and kept.shape == self.moved.shape:
            for name in STATE:
                setattr(self, name, state[f"poses.{name}"].copy())
