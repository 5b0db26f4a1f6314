"""The pages of an arena as shaders read them: common/pages.glsl."""

import moderngl
import numpy as np

from shapeshift.rasterizer.paging.pages import PAGE, DrawnPages
from shapeshift.renderer import layout
from shapeshift.renderer.gl.gpu import Gpu, overwrite

NO_PAGE = 0xFFFFFFFF  # nothing is drawn
POSE_VECS = 3 * (layout.MOST_VIEWS + 1)  # vec4 an object: of each view and of the order's frame


class MappedPages(DrawnPages):
    """The last rows of what is drawn, a page after the other, and the poses of all objects.

    Splats lie in stored pages, from the same row of the arena on; colours are of the pages that
    are drawn.
    """

    def __init__(
        self, gpu: Gpu, first: int, pages: int, stored: int, antialiased: tuple[bool, ...]
    ) -> None:
        """first: the row where both begin; antialiased: one an object."""
        super().__init__(pages, stored)
        self.first, self.antialiased = first, np.array(antialiased)
        self.first_entry = POSE_VECS * len(antialiased)  # vec4 of poses come before the pages
        self._words = np.zeros((self.first_entry + pages, 4), np.uint32)
        self.buffer = gpu.reserve(self._words.nbytes, "the map of pages")
        self._listed = gpu.reserve(4 * pages, "a list of pages")
        self._uploaded = -1  # the changes that the shaders know

    @property
    def rows(self) -> int:
        """Drawn, of pages that show nothing, too."""
        return PAGE * self.pages

    def upload(self, poses: np.ndarray | None = None) -> moderngl.Buffer:
        """What the shaders read now; poses: (O, frames, 3, 4) eye_from_object, as rows.

        Colours of a thousand copies ask for it a thousand times a frame: it is written where it
        has changed.
        """
        if poses is None and self._uploaded == self.changes:
            return self.buffer
        self._uploaded = self.changes
        entries = self._words[self.first_entry :]
        there = self.stored >= 0
        entries[:, 0] = np.where(there, self.first + PAGE * self.stored, NO_PAGE)
        entries[:, 1] = POSE_VECS * np.maximum(self.owner, 0)
        entries[:, 2] = self.weight.view(np.uint32)
        entries[:, 3] = self.antialiased[self.owner]
        if poses is not None:
            rows = np.ascontiguousarray(poses, np.float32).reshape(len(poses), -1, 4)
            of_objects = self._words[: self.first_entry].reshape(len(poses), POSE_VECS, 4)
            of_objects[:, : rows.shape[1]] = rows.view(np.uint32)
        overwrite(self.buffer, self._words)
        return self.buffer

    def listed(self, pages: np.ndarray) -> moderngl.Buffer:
        """The numbers of pages (n,), for a pass over these alone."""
        numbers = np.zeros(self.pages, np.uint32)
        numbers[: len(pages)] = pages
        overwrite(self._listed, numbers)
        return self._listed

    def release(self) -> None:
        self.buffer.release()
        self._listed.release()
