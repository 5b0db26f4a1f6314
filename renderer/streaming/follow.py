"""A stream's splats into the arena, and what a look, a cut or a tint makes of them again."""

from collections.abc import Sequence

import numpy as np

from shapeshift.rasterizer.paging.pages import PAGE
from shapeshift.renderer.colors.color_cache import forget_colors
from shapeshift.renderer.decoded_object import DecodedObject, place_splats
from shapeshift.renderer.drawing import Drawing
from shapeshift.renderer.settings import StreamStats
from shapeshift.renderer.streaming.stream import Stream, has_leaves
from shapeshift.renderer.timing import PassTimer
from shapeshift.runtime_models.model import Model
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene


class Streaming:
    """The part of a renderer that deals with models in levels of detail; idle without any."""

    def __init__(self, drawing: Drawing) -> None:
        self._drawing = drawing
        self.stream: Stream | None = None
        self.converges = True  # a frame waits for all that it wants; False: it is one of many
        self.reads = True  # levels that are not at hand; False: the coarsest, and what is at hand

    def allocate(self, models: list[Model], budget: int) -> None:
        """Room for these objects in the drawing, none where they do not fit.  budget: 0 for the
        models' own.

        Raises ValueError, as BadFile where the budget leaves nothing for levels of detail.
        """
        self.close()
        try:
            if any(map(has_leaves, models)):
                self.stream = Stream(self._drawing, models, budget)
            else:
                self._drawing.allocate(models)
        except ValueError:
            self._drawing.allocate([])
            raise

    def differs(self, budget: int) -> bool:
        """Whether room was made for another budget."""
        return self.stream is not None and budget not in (0, self.stream.budget)

    @property
    def stats(self) -> StreamStats | None:
        """Of the last frame."""
        return self.stream.stats if self.stream is not None else None

    @property
    def due(self) -> bool:
        """Whether another frame of the same views would show more."""
        return self.stream is not None and self.stream.due

    def follow(
        self, scene: Scene, poses: np.ndarray, decoded: Sequence[DecodedObject],
        views: Sequence[View], timer: PassTimer,
    ) -> None:  # fmt: skip
        """What the views want is there afterwards, or on its way.  Raises BadFile.

        poses: (O, 4, 4) world_from_object of all objects, hidden ones, too.
        """
        if self.stream is not None:
            self.stream.converges = self.converges and self.reads
            self.stream.reads = self.reads
            with timer.time("stream", on_gpu=False):
                follow(self._drawing, self.stream, scene, poses, decoded, views)

    def close(self) -> None:
        if self.stream is not None:
            self.stream.close()
        self.stream = None


def follow(
    drawing: Drawing, stream: Stream, scene: Scene, poses: np.ndarray,
    decoded: Sequence[DecodedObject], views: Sequence[View],
) -> None:  # fmt: skip
    """Asks the stream, and gives what changed the look that its object has."""
    cut = [i for i in stream.objects if decoded[i].own is not None]
    before = {i: drawing.pages_of(i) for i in cut}
    stream.edit(cut)
    for i in stream.follow(scene, poses, views):
        obj, each = scene.objects[i], decoded[i]
        if i in before:
            keep_own(drawing, i, each, before[i], stream.placed)
            place_splats(drawing, i, obj, each)
        tinted = any(colored.untinted for colored in each.colored)
        if stream.follows_eye or each.grade is not None or tinted or obj.tint is not None:
            for colored in each.colored:
                colored.tint, colored.untinted = None, ()  # what lay under it lies elsewhere now
            forget_colors(each.colored)


def keep_own(
    drawing: Drawing, i: int, decoded: DecodedObject, before: np.ndarray, placed: np.ndarray
) -> None:
    """Makes `decoded.own` that of the pages which object i has now.

    before: the pages that it had; placed: those that were filled since, with splats as decoded.
    """
    assert decoded.own is not None
    pages = drawing.pages_of(i)
    own = drawing.read_splats(i)
    stay = np.isin(pages, before) & ~np.isin(pages, placed)
    at = np.searchsorted(before, pages[stay])
    for now, old in zip(own, decoded.own, strict=True):
        shape = (-1, PAGE, now.shape[1])
        now.reshape(shape)[stay] = old.reshape(shape)[at]
    decoded.own, decoded.cuts, decoded.opacity = own, (), 1.0
