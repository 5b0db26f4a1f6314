"""Draws the frames of a film that are not there yet."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.commands.outputs import as_steps, values_of
from shapeshift.app.film.film_plan import FilmPlan
from shapeshift.app.film.frame_folder import FrameFolder
from shapeshift.scene.pose import View
from shapeshift.scene.stereo import stereo_pair

if TYPE_CHECKING:
    from shapeshift.renderer.renderer import Renderer

STREAMS = ("depth", "normal", "coverage")


@dataclass(frozen=True)
class FrameForm:
    """How a frame is drawn."""

    eye_distance: float = 0.0  # metres; above 0 both eyes, side by side
    supersample: int = 1  # pixels a side of the picture that make one of the film's
    streams: tuple[str, ...] = ()
    depth_unit: float = 0.001  # metres a step of the depth stream


def draw_frames(
    renderer: "Renderer", plan: FilmPlan, numbers: list[int], folder: FrameFolder, form: FrameForm,
    done: Callable[[int], None] = lambda number: None,
) -> None:  # fmt: skip
    """Those frames of a plan into their files, one by one; `done` hears of each."""
    texts = {"metres_per_step": f"{form.depth_unit:g}"} if "depth" in form.streams else {}
    for number in numbers:
        picture, streams = frame_of(renderer, plan, number, form)
        folder.write_frame(number, picture, streams, texts)
        done(number)


def frame_of(
    renderer: "Renderer", plan: FilmPlan, number: int, form: FrameForm
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """(H, W, 3) float32 display sRGB of one frame, and uint16 of each stream."""
    renderer.update(plan.scene(number))
    eyes = eyes_of(plan.view(number), form)
    renderer.draw([_finer(eye, form.supersample) for eye in eyes])
    pictures = [averaged(renderer.resolved(i), form.supersample) for i in range(len(eyes))]
    streams: dict[str, np.ndarray] = {}
    if form.streams:
        surfaces = [renderer.surface(eye) for eye in eyes]
        for name in form.streams:
            values = np.concatenate([values_of(each, name) for each in surfaces], axis=1)
            streams[name] = as_steps(values, name, form.depth_unit)
    return np.concatenate(pictures, axis=1), streams


def eyes_of(view: View, form: FrameForm) -> list[View]:
    return stereo_pair(view, form.eye_distance) if form.eye_distance > 0 else [view]


def _finer(view: View, factor: int) -> View:
    width, height = view.size
    return replace(view, size=(width * factor, height * factor))


def averaged(picture: np.ndarray, factor: int) -> np.ndarray:
    """(H, W, 3) means of blocks of factor x factor pixels, as displayed."""
    if factor == 1:
        return picture
    height, width = picture.shape[0] // factor, picture.shape[1] // factor
    blocks = picture.reshape(height, factor, width, factor, 3)
    return blocks.mean((1, 3), dtype=np.float32)
