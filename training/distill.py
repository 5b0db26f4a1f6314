"""A coarser level of a package learns to look like the package, from where it is seen.

The networks stay; what is trained are the anchors' own numbers: place, features, frame, light.
Pictures are those of the package itself, at x of the stops and between them.  Between two stops
shapes are those of the blend and colours those of either stop, as the drawing mixes them where one
has a palette; else the colours are those of the blend as well.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from time import process_time
from typing import Any

import numpy as np

from shapeshift.runtime_models.lod.average_anchors import frames_of
from shapeshift.runtime_models.model import HEADS, AnchorFrames, AnchorModel, BadFile
from shapeshift.runtime_models.rotation import normalize
from shapeshift.scene.pose import View
from shapeshift.training.heads.networks import HeadLayout
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.settings import SHORT, parameter_rates
from shapeshift.training.step import TrainingStep
from shapeshift.training.update.trainable import layout_of, packed_weights, rows_of, voxel_of

BACKGROUNDS = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))  # in turns: what is absent must be so before both
CHECK_EVERY = 50  # steps between two looks at the clock


class PictureError:
    """Half of the squared difference to a picture: its gradient is the difference."""

    def __init__(self, device) -> None:
        self.device = device

    def compare(self, image, target) -> Any:
        """(3, H, W) the gradient, over the number of values."""
        return (image - target) * np.float32(1 / image.size)


@dataclass(frozen=True)
class Look:
    """What is drawn at once: a view, and Psi of each head."""

    view: View
    control: np.ndarray  # (5, d)


def controls_of(model: AnchorModel, parts: Sequence[float]) -> list[np.ndarray]:
    """(5, d) Psi of each head: of every stop, and at `parts` (0 to 1) of the way between
    neighbours.
    """
    stops = sorted(model.stops, key=lambda stop: stop.x)
    found = [np.tile(model.psi(stop.x), (len(HEADS), 1)) for stop in stops]
    found = found or [np.tile(model.psi(0.0), (len(HEADS), 1))]
    for a, b in pairwise(stops):
        for part in parts:
            shape = np.tile(model.psi((1 - part) * a.x + part * b.x), (len(HEADS), 1))
            if not (a.palette or b.palette):
                found.append(shape)
                continue
            for stop in (a, b):
                mixed = shape.copy()
                mixed[HEADS.index("color")] = model.psi(stop.x)[0]
                found.append(mixed)
    return found


class StillHeads:
    """A model as the training step draws it, its networks still."""

    def __init__(self, device, model: AnchorModel) -> None:
        self.layout: HeadLayout = layout_of(model)
        self.model = model
        voxel = voxel_of(model)
        values = rows_of(model, self.layout) | {"weights": packed_weights(model, self.layout)}
        rates = parameter_rates(self.layout, SHORT, voxel)
        rates["weights"] = np.zeros(1, np.float32)
        self.adam = Adam(device, values, rates)
        self.step = TrainingStep(device, self.layout, voxel, self.adam)
        self.step.activation.unit = np.float32(model.networks["scale"].gain)

    def trained(self) -> AnchorModel:
        """The model with what its anchors have learned."""
        state = self.adam.state()
        frames = state["frames.value"]
        light = state["light.value"] if self.model.light is not None else None
        return replace(
            self.model,
            anchors=state["anchors.value"],
            features=state["features.value"][:, : self.layout.features].copy(),
            frames=AnchorFrames(np.exp(frames[:, :3]), normalize(frames[:, 3:])),
            light=light,
        )


def distill(
    device, finest: AnchorModel, coarse: AnchorModel, views: Sequence[View], seconds: float,
    progress: Callable[[float], None] | None = None, seed: int = 0, most_steps: int = 100000,
    rate: float = 1.0,
) -> tuple[AnchorModel, int]:  # fmt: skip
    """`coarse` after so many processor seconds of steps, and how many steps they were."""
    if not seconds > 0:
        return coarse, 0
    start = process_time()
    try:
        teacher = StillHeads(device, finest)
    except BadFile as why:
        raise BadFile(
            f"coarser levels cannot learn with it, --distill 0 averages alone: {why}"
        ) from None
    pupil = StillHeads(device, replace(coarse, frames=frames_of(coarse)))
    rng = np.random.default_rng([seed, 31])
    controls = controls_of(finest, (0.25, 0.5, 0.75))
    looks = [(v, c) for v in range(len(views)) for c in range(len(controls))]
    pictures: dict[tuple[int, int], Any] = {}
    loss: Any = PictureError(device)
    order: list[tuple[int, int]] = []
    steps, done = 0, 0.0
    while done < 1 and steps < most_steps:
        if not order:
            order = [looks[i] for i in rng.permutation(len(looks))]
        v, c = order.pop()
        behind, key = (v + c) % len(BACKGROUNDS), (v, c)
        if key not in pictures:
            drawn = teacher.step.draw(views[v], controls[c], BACKGROUNDS[behind])
            pictures[key] = drawn.frame.image.copy()
        drawing = pupil.step.draw(views[v], controls[c], BACKGROUNDS[behind])
        grads = pupil.step.gradients(drawing, loss, pictures[key], min_opacity_share=0)
        pupil.step.update(grads, rate * 0.05**done)
        steps += 1
        if steps == 1:
            start = process_time()  # the first step compiles kernels where no cache has them
        done = (process_time() - start) / seconds
        if progress is not None and steps % CHECK_EVERY == 0:
            progress(min(done, 1.0))
    return pupil.trained(), steps
