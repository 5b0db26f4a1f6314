"""Cures of what a model shows between two stops, where no photo says how it should look.

photos: now and then a step shows an x between two stops that were photographed from the same place,
and is to look like the blend of both photos.  pictures: the same with the model's own pictures of
both stops, so that no place need be shared.  shapes: now and then a photo is shown with its stop's
own colours on splats that are on their way to a neighbouring stop, and is to look like itself: what
a viewer draws near a thermal stop, whose colours it takes from both ends.  splats: now and then a
step adds a pull of the splats at an x in between towards the straight way between what they are at
both stops.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from shapeshift.runtime_models.model import HEADS, BadFile, ControlEncoding, Stop
from shapeshift.scene.pose import View
from shapeshift.training.drawing import Color
from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.heads.networks import KERNELS
from shapeshift.training.photos import LoadedPhoto
from shapeshift.training.step import Step

CURES = ("none", "photos", "pictures", "shapes", "splats")
SAME_PLACE = 1e-4  # of the cameras' mean distance from their middle
SAME_LENS = 1e-4  # of the tangents: 0.05 pixels of 1000
SAME_TURN = 1 - 1e-7  # of the product of two quaternions: 0.05 degrees
Pair = tuple[LoadedPhoto, LoadedPhoto]


@dataclass(frozen=True)
class Way:
    """Where between two stops a step is; low is the first on the slider, or the photo's own."""

    low: Stop
    high: Stop
    share: float  # of the way from low to high, above 0 and below 1
    pick: float  # 0..1, which pair of photos

    def psi(self, encoding: ControlEncoding) -> np.ndarray:
        """(d,) float32 control encoding there: the blend that x between two stops stands for."""
        low, high = encoding.encode(self.low.x), encoding.encode(self.high.x)
        return np.float32(1 - self.share) * low + np.float32(self.share) * high

    def psi_of_heads(self, encoding: ControlEncoding) -> np.ndarray:
        """(5, d) float32: the shape's heads there, the colour's still at low."""
        rows = np.tile(self.psi(encoding), (len(HEADS), 1))
        rows[HEADS.index("color")] = encoding.encode(self.low.x)
        return rows


class Between:
    """Which steps of a run look between the stops, and what these learn from."""

    def __init__(
        self, cure: str, often: float, seed: int, stops: tuple[Stop, ...],
        photos: dict[str, list[LoadedPhoto]],
    ) -> None:  # fmt: skip
        """often: the share of steps.  Raises BadFile where photos share no place, but have to."""
        self.cure, self.seed, self.pairs = cure, seed, {}
        self.spans = list(pairwise(sorted(stops, key=lambda stop: stop.x)))
        self.often = often if cure != "none" else 0.0
        if cure == "photos" and self.spans:
            found = {(a.name, b.name): shared(photos[a.name], photos[b.name])
                     for a, b in self.spans}  # fmt: skip
            self.pairs = {names: pairs for names, pairs in found.items() if pairs}
            self.spans = [span for span in self.spans if (span[0].name, span[1].name) in self.pairs]
            if not self.spans:
                raise BadFile(
                    "no two photos of neighbouring modalities were taken from the same place with "
                    "the same lens, so there is nothing to blend; use --between shapes or pictures."
                )

    @property
    def replaces(self) -> bool:
        """Whether such a step learns from a blend, not from a photo."""
        return self.cure in ("photos", "pictures")

    @property
    def middle(self) -> Way | None:
        """A way that such a run may take; None: it takes none."""
        return Way(*self.spans[0], 0.5, 0.0) if self.often and self.spans else None

    def way(self, iteration: int, modality: str) -> Way | None:
        """Where this step looks; None: at its photo's stop.  Follows from seed and step."""
        if self.middle is None:
            return None
        chance, span, share, pick = np.random.default_rng([self.seed, 4, iteration]).random(4)
        if not chance < self.often:
            return None
        if self.cure != "shapes":
            low, high = self.spans[int(span * len(self.spans))]
            return Way(low, high, float(share), float(pick))
        ends = [(a, b) for pair in self.spans for a, b in (pair, pair[::-1]) if a.name == modality]
        own, other = ends[int(span * len(ends))]
        # As often as the photo's colours have a part in what is shown there.
        return Way(own, other, 1 - float(share) ** 0.5, float(pick))

    def pair(self, way: Way) -> Pair:
        """Photos of both stops from one place."""
        pairs = self.pairs[way.low.name, way.high.name]
        return pairs[int(way.pick * len(pairs))]


def shared(first: list[LoadedPhoto], second: list[LoadedPhoto]) -> list[Pair]:
    """Pairs of photos of the same size from the same place through the same lens."""
    if not first or not second:
        return []
    places = np.array([photo.view.world_from_eye.position for photo in first + second])
    near = SAME_PLACE * max(float(np.linalg.norm(places - places.mean(0), axis=1).mean()), 1e-9)
    found = []
    for a, place in zip(first, places, strict=False):
        away = np.linalg.norm(places[len(first) :] - place, axis=1)
        found += [(a, second[i]) for i in np.flatnonzero(away <= near)]
    return [(a, b) for a, b in found if alike(a.view, b.view) and counts(a, b)]


def alike(a: View, b: View) -> bool:
    """Whether two views from one place show the same."""
    return bool(
        a.size == b.size
        and np.abs(np.subtract(a.tangents, b.tangents)).max() <= SAME_LENS
        and abs(np.dot(a.world_from_eye.wxyz, b.world_from_eye.wxyz)) >= SAME_TURN
    )


def counts(a: LoadedPhoto, b: LoadedPhoto) -> bool:
    """Whether any pixel counts in both."""
    return a.weight is None or b.weight is None or bool(np.minimum(a.weight, b.weight).any())


def blended(first: LoadedPhoto, second: LoadedPhoto, share: float) -> LoadedPhoto:
    """Over any background the blend of both photos; nothing is known of its depth."""
    laid, alphas = [], []
    for photo, part in ((first, 1 - share), (second, share)):
        alpha = part * photo.rgba[..., 3:].astype(np.float32) / 255
        laid.append(alpha * photo.rgba[..., :3])
        alphas.append(alpha)
    alpha = alphas[0] + alphas[1]
    rgb = (laid[0] + laid[1]) / np.maximum(alpha, 1e-6)
    rgba = np.clip(np.rint(np.concatenate([rgb, 255 * alpha], axis=2)), 0, 255).astype(np.uint8)
    weights = [photo.weight for photo in (first, second) if photo.weight is not None]
    weight = np.minimum.reduce(weights) if weights else None
    return replace(
        first, rgba=rgba, weight=weight, depth=None, name=f"{first.name} to {second.name}"
    )


def own_blend(
    step: Step, photo: LoadedPhoto, way: Way, encoding: ControlEncoding, background: Color
) -> LoadedPhoto:
    """The blend of the model's own pictures of both stops from where a photo was taken."""
    ends = [
        step.device.download(
            step.draw(photo.view, encoding.encode(stop.x), background).frame.image
        ).transpose(1, 2, 0)
        for stop in (way.low, way.high)
    ]
    rgb = np.clip(np.rint(255 * ((1 - way.share) * ends[0] + way.share * ends[1])), 0, 255)
    rgba = np.concatenate([rgb, np.full_like(rgb[..., :1], 255)], axis=2).astype(np.uint8)
    return replace(photo, rgba=rgba, weight=None, depth=None, name=f"{photo.name} between")


def straight_pull(
    step: Step, way: Way, encoding: ControlEncoding, eye: np.ndarray, voxel: float, pull: float
) -> dict[str, Any]:
    """Gradients of the pull on the splats at way.psi, by weights and features; copies.

    The mean over the splats of |v - ((1 - share) v_low + share v_high)|^2 summed over means and
    scales in voxels, wxyz, opacity and colour, times `pull`.  Both ends are taken as they are, so
    the pull moves them only by what they share with what lies between; and anchors, which every x
    has in common, are not pulled at all.
    """
    device = step.device
    low, high = (
        [field.copy() for field in step.decode(encoding.encode(stop.x), eye).fields()]
        for stop in (way.low, way.high)
    )
    here = step.decode(way.psi(encoding), eye)
    kernels, count = device.program(KERNELS / "between.cl"), len(here.opacity)
    shares = np.array([voxel**-2.0, voxel**-2.0, 1, 1, 1]) * (pull / count)
    grads = []
    for a, b, value, share in zip(low, high, here.fields(), shares, strict=True):
        grad = device.empty(value.shape)
        device.launch(
            kernels["chord"], value.size, 64, value.size, np.float32(share),
            np.float32(way.share), a, b, value, grad,
        )  # fmt: skip
        grads.append(grad)
    found = step.backward(Gaussians(*grads))
    return {name: found[name].copy() for name in ("weights", "features")}


def add(device, grads: dict[str, Any], more: dict[str, Any]) -> None:
    """`more` to the gradients of the same name, in place."""
    kernel = device.program(KERNELS / "between.cl")["add"]
    for name, grad in more.items():
        device.launch(kernel, grad.size, 64, grad.size, grad, grads[name])
