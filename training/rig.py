"""How the second camera of a rig really sits: one rigid offset for a modality, from the photos.

Stated poses of a modality are off by one and the same turn and shift in the camera's own axes.  A
model whose shape all modalities share is trained, and the offset follows the gradient of that
modality's loss by its poses.
"""

import json
from dataclasses import dataclass, replace

import numpy as np

from runtime_models.model import BadFile
from scene.capture import Capture
from scene.pose import Pose, View
from training.drawing import Color, splats_backward
from training.initial import common_box
from training.photos import LoadedPhoto
from training.settings import TrainSettings
from training.train import Trainer

SHARED = "offset,scale,rotation,opacity"  # heads that do not see x: one shape for all modalities
ALONE = 0.3  # of the run, in which the other modalities shape the scene first
LAST = 0.2  # of the run, over which the offset is averaged
RATE, DECAY = 1.5e-3, 0.15  # radians a step, and shares of the distance; what is left at the end
MOST_PIXELS = 320  # a side of the photos that the offset is found from
BETA1, BETA2 = 0.9, 0.99


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


def offset_view(view: View, eye_from_found: np.ndarray) -> View:
    """The view from where a camera sits that is off by `eye_from_found` (4, 4) in its own axes."""
    pose = Pose.from_matrix(view.world_from_eye.matrix() @ eye_from_found)
    return View(pose, view.tangents, view.near, view.far, view.size)


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
    pull = by_means @ axes
    w, v, by_w, by_v = wxyz[:, :1], wxyz[:, 1:], by_wxyz[:, :1], by_wxyz[:, 1:]
    spin = 0.5 * (w * by_v - by_w * v + np.cross(v, by_v))  # about the world's axes
    turn = np.cross(place, pull).sum(0) + spin.sum(0) @ axes
    return -np.concatenate([turn, pull.sum(0)])


class Moving:
    """An offset that follows gradients: Adam for six numbers, shifts as shares of the distance.

    Turns are about what the camera looks at: about the eye, turn and shift would do nearly the same
    to the picture, and Adam would crawl along the valley between them.
    """

    def __init__(self, distance: float) -> None:
        self.unit = np.repeat([1.0, distance], 3)
        self.pivot = np.array([0, 0, -distance])
        self.offset, self.late = np.eye(4), []
        self.mean, self.square, self.turns = np.zeros(6), np.zeros(6), 0

    def follow(self, gradient: np.ndarray, done: float) -> None:
        """gradient: (6,) by turn about the eye and shift.  done: share of the run, 0..1."""
        gradient = gradient.copy()
        gradient[:3] -= np.cross(self.pivot, gradient[3:])
        gradient *= self.unit
        if not np.isfinite(gradient).all():
            return
        self.turns += 1
        self.mean += (1 - BETA1) * (gradient - self.mean)
        self.square += (1 - BETA2) * (gradient**2 - self.square)
        mean, square = self.mean / (1 - BETA1**self.turns), self.square / (1 - BETA2**self.turns)
        rate = RATE * DECAY ** ((done - ALONE) / (1 - ALONE))
        step = moved_by(-rate * self.unit * mean / (np.sqrt(square) + 1e-12))
        step[:3, 3] += self.pivot - step[:3, :3] @ self.pivot
        self.offset = self.offset @ step
        if done >= 1 - LAST:
            self.late.append(self.offset)

    def found(self) -> np.ndarray:
        """(4, 4) the mean over the last part of the run."""
        return mean_pose(self.late or [self.offset])


class RigTrainer(Trainer):
    """A training run that also learns how the cameras of one modality are off.

    Half of the other modalities' photos are a control: their poses are right, and what the run
    takes for their offset is its own error, which the modality's offset has, too.
    """

    def __init__(self, device, capture: Capture, settings: TrainSettings, modality: str) -> None:
        self.modality, self.moving = modality, None
        super().__init__(device, capture, settings)
        found = [p.view for photos in self.schedule.photos.values() for p in photos]
        centre, _ = common_box(found)
        eyes = np.array([view.world_from_eye.position for view in found])
        distance = float(np.median(np.linalg.norm(eyes - centre, axis=1)))
        self.rig, self.control_group = Moving(distance), Moving(distance)
        self.controls = {
            (name, p.name)
            for name, photos in self.schedule.photos.items()
            if name != modality
            for p in photos[::2]
        }

    @property
    def done(self) -> float:
        return self.budget.fraction(self.iteration, self.elapsed)

    def next_photo(self) -> LoadedPhoto:
        photo = super().next_photo()
        if self.done < ALONE and photo.modality == self.modality:  # another modality's instead
            others = [n for n in self.schedule.photos if n != self.modality]
            turn = self.iteration // len(self.schedule.photos)
            photos = self.schedule.photos[others[turn % len(others)]]
            photo = photos[turn * 7919 % len(photos)]
        self.moving = None
        if self.done >= ALONE and photo.modality == self.modality:
            self.moving = self.rig
        elif self.done >= ALONE and (photo.modality, photo.name) in self.controls:
            self.moving = self.control_group
        if self.moving is None:
            return photo
        return replace(photo, view=offset_view(photo.view, self.moving.offset))

    def learn(self, photo: LoadedPhoto, background: Color) -> dict[str, object]:
        """As any step, and the offset of the photo's cameras follows its gradient."""
        step, settings, device, adam = self.step, self.settings, self.device, self.adam
        self.drawing = step.draw(photo.view, self.control(photo.modality), background)
        loss, target = self.targets.loss(photo), self.targets.target(photo, background)
        grad_image = loss.compare(self.drawing.frame.image, target, settings.ssim_share)
        grad, _ = splats_backward(device, self.drawing, grad_image)
        if self.moving is not None:
            splats = self.drawing.splats
            arrays = (
                device.download(a) for a in (splats.means, splats.wxyz, grad.means, grad.wxyz)
            )
            self.moving.follow(pose_gradient(photo.view, *arrays), self.done)
        grad_raw, grad_anchors = step.activation.backward(step.heads.raw, grad)
        weights, features = step.heads.backward(
            adam["weights"], adam["anchors"], adam["features"], grad_raw, grad_anchors
        )
        return {"weights": weights, "anchors": grad_anchors, "features": features}

    def found(self) -> np.ndarray:
        """(4, 4) the modality's offset without what the run takes for the control's."""
        return self.rig.found() @ np.linalg.inv(self.control_group.found())


@dataclass(frozen=True)
class Found:
    """What `calibrate` found; a (4, 4) eye_from_found that is rigid."""

    offset: np.ndarray
    turn_deg: float
    shift_m: float


def noted(modality: str, found: Found) -> str:
    """What TrainSettings.rig keeps of it."""
    return json.dumps({modality: found.offset.ravel().round(9).tolist()})


def with_found(capture: Capture, rig: str) -> Capture:
    """The capture with the offsets that TrainSettings.rig keeps.  Raises BadFile."""
    if not rig:
        return capture
    try:
        for modality, numbers in json.loads(rig).items():
            offset = np.array(numbers, np.float64).reshape(4, 4)
            turn = offset[:3, :3]
            if not np.abs(turn @ turn.T - np.eye(3)).max() < 1e-6:  # NaN is not
                raise ValueError("no turn")
            capture = offset_capture(capture, modality, mean_pose([offset]))
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise BadFile(f"the offset of a rig's cameras, '{rig!s:.60}', is none ({error}).") from None
    return capture


def rig_of(provenance: dict) -> str:
    """TrainSettings.rig of the run that a package was trained in; empty where none is told."""
    settings = provenance.get("settings")
    return settings.get("rig", "") if isinstance(settings, dict) else ""


def rig_settings(settings: TrainSettings, steps: int) -> TrainSettings:
    """Those of the run that finds the offset: one shape for all, no growing."""
    return replace(
        settings, iterations=steps, seconds=None, fixed=SHARED, view_dependent=False, grow=False,
        depth_share=0.0, coarse=1,
    )  # fmt: skip


def mean_pose(offsets: list[np.ndarray]) -> np.ndarray:
    """(4, 4) rigid, nearest to the mean of matrices that are close to each other."""
    mean = np.mean(offsets, axis=0)
    left, _, right = np.linalg.svd(mean[:3, :3])
    mean[:3, :3] = left @ right
    return mean


def calibrate(
    device, capture: Capture, settings: TrainSettings, modality: str, steps: int = 1200
) -> Found:
    """The offset of a modality's cameras.  Raises BadFile where there is nothing to hold it to."""
    names = [stop.name for stop in capture.stops]
    if modality not in names:
        raise BadFile(
            f"{capture.folder}: no modality '{modality}' to calibrate; it has {', '.join(names)}."
        )
    if len(names) < 2:
        raise BadFile(
            f"{capture.folder}: '{modality}' is its only modality; an offset of a rig's camera is "
            "found against another one."
        )
    longest = max(max(photo.view.size) for photo in capture.photos)
    factor = max(settings.downscale or 1, -(-longest // MOST_PIXELS))
    chosen = replace(rig_settings(settings, steps), downscale=factor)
    trainer = RigTrainer(device, capture, chosen, modality)
    for _ in trainer.steps():
        pass
    return told(trainer.found())


def told(offset: np.ndarray) -> Found:
    cosine = np.clip((np.trace(offset[:3, :3]) - 1) / 2, -1, 1)
    return Found(offset, float(np.rad2deg(np.arccos(cosine))), float(np.linalg.norm(offset[:3, 3])))
