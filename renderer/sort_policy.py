"""When splats are put in order anew, and along which line of sight: the same for both drawings."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import View

PARALLEL = np.radians(1.0)  # eyes whose forward axes agree within this share an order


@dataclass(frozen=True)
class SortPlan:
    """What a frame does about its order."""

    frames: tuple[np.ndarray, ...]  # eye_from_world (4, 4) of each sort; none: the order is kept
    keep_outside: bool  # the order must hold what no view sees, since it may be kept
    age: int  # frames since the order in use was made

    @property
    def sorts(self) -> int:
        return len(self.frames)


@dataclass(frozen=True)
class _Made:
    """Under what the order in use was made."""

    asked: tuple  # the settings it depends on, and the sizes of the views
    frames: tuple[np.ndarray, ...]
    distance: float  # metres from the eye to the median splat, for order "distance"


class SortPolicy:
    """Says frame by frame whether the order is kept: settings.resort_frames and resort_degrees."""

    def __init__(self) -> None:
        self._made: _Made | None = None
        self._age = 0

    def plan(
        self,
        views: list[View],
        settings: RenderSettings,
        changed: bool,
        median_distance: Callable[[np.ndarray], float],
        again: bool = False,
    ) -> SortPlan:
        """For one frame.  changed: a pose, a control value or the set of objects, since the last.

        median_distance(eye_from_world) is asked only where settings.order is "distance".  again:
        for more views of the frame before.
        """
        if again:
            return SortPlan((), True, self._age)
        frames = sort_frames(views, settings)
        may_keep = settings.resort_frames != 1
        asked = (
            settings.order, settings.key_bits, settings.stereo_sort, settings.min_alpha,
            len(frames), *(view.size for view in views),
        )  # fmt: skip
        made, age = self._made, self._age + 1
        if (
            may_keep
            and made is not None
            and not changed
            and asked == made.asked
            and not 0 < settings.resort_frames <= age
            and not _turned(made, frames, settings)
        ):
            self._age = age
            return SortPlan((), True, age)
        turns_count = may_keep and settings.order == "distance" and settings.resort_degrees > 0
        distance = median_distance(frames[0]) if turns_count else 0.0
        self._made = _Made(asked, frames, distance) if may_keep else None
        self._age = 0
        return SortPlan(frames, may_keep, 0)


def _turned(made: _Made, frames: tuple[np.ndarray, ...], settings: RenderSettings) -> bool:
    """Whether a view has turned by more than resort_degrees since; by distance: the eye moved."""
    if not settings.resort_degrees > 0:
        return False
    most = np.radians(settings.resort_degrees)
    for before, now in zip(made.frames, frames, strict=True):
        if settings.order == "distance":
            moved = np.linalg.norm(_eye(before) - _eye(now))
            if moved > made.distance * np.tan(min(most, np.pi / 2 - 1e-6)):
                return True
        elif np.arccos(np.clip(before[2, :3] @ now[2, :3], -1, 1)) > most:
            return True
    return False


def _eye(eye_from_world: np.ndarray) -> np.ndarray:
    """(3,) where a frame's eye is in the world."""
    return -eye_from_world[:3, :3].T @ eye_from_world[:3, 3]


def sort_frames(views: list[View], settings: RenderSettings) -> tuple[np.ndarray, ...]:
    """eye_from_world (4, 4) of each sort of a frame: one for parallel eyes, else one a view.

    The order by depth is exact for parallel eyes whatever their offset across the view; the order
    by distance is that of the centre of the eyes.
    """
    own = tuple(view.eye_from_world() for view in views)
    forward = np.array([frame[2, :3] for frame in own])
    if len(views) == 1 or settings.stereo_sort == "each":
        return own
    if not (forward @ forward[0] >= np.cos(PARALLEL)).all():
        return own
    centre = own[0].copy()
    if (forward != forward[0]).any():
        back = forward.mean(axis=0) / np.linalg.norm(forward.mean(axis=0))
        up = np.cross(back, own[0][0, :3])
        up /= np.linalg.norm(up)
        centre[:3, :3] = np.cross(up, back), up, back
    eye = np.mean([view.world_from_eye.position for view in views], axis=0)
    centre[:3, 3] = -centre[:3, :3] @ eye
    return (centre,)
