"""The numbers of an object's anchors, and which are floaters, worked out beside the window."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from shapeshift.app.editor.state.parts.anchor_numbers import (
    QUANTITIES,
    AnchorNumbers,
    Histogram,
    anchor_numbers,
    histogram_of,
)
from shapeshift.app.editor.state.parts.piece import check_pieces
from shapeshift.app.editor.texts.table import said
from shapeshift.runtime_models.model import BadFile, Model
from shapeshift.runtime_models.stop_weights import Control, same_controls
from shapeshift.scene.scene import SceneObject

Use = Callable[[AnchorNumbers], None]


class Measuring:
    """One thread; the numbers of the object that was asked for last are kept."""

    def __init__(self) -> None:
        self.quantity = QUANTITIES[0]  # whose histogram is shown
        self.numbers: AnchorNumbers | None = None
        self.status = ""  # what is being done
        self.problem = ""  # one sentence: why nothing can be told
        self._asked: tuple[Model, Control] | None = None
        self._eye = np.zeros(3)
        self._work: Future[AnchorNumbers] | None = None
        self._search: tuple[Future[np.ndarray], Callable[[np.ndarray], None]] | None = None
        self._waiting: list[Use] = []  # what is done once the numbers are there
        self._histogram: tuple[AnchorNumbers, Histogram] | None = None
        self._thread = ThreadPoolExecutor(1, "anchor numbers")

    @property
    def busy(self) -> bool:
        return self._work is not None or self._search is not None

    def forget(self) -> None:
        """Another scene: what is still under way is not waited for."""
        self.numbers = self._asked = self._work = self._search = self._histogram = None
        self._waiting, self.status, self.problem = [], "", ""

    def want(self, obj: SceneObject, eye: np.ndarray) -> None:
        """The numbers of an object as it is now; colours as seen from `eye` (3,), world metres."""
        asked = self._asked
        if self._work is not None:
            return  # one after the other
        if asked is not None and asked[0] is obj.model and same_controls(asked[1], obj.x):
            return
        local = np.linalg.inv(obj.world_from_object.matrix()) @ np.append(eye, 1.0)
        self._asked = (obj.model, obj.x)
        self.status = said("{name}: sizes and colours", name=obj.name)
        self._work = self._thread.submit(numbers_of_piece, obj.model, obj.x, local[:3])

    def then(self, obj: SceneObject, eye: np.ndarray, use: Use) -> None:
        """Does something with the numbers: at once, or when they are there."""
        self.want(obj, eye)
        known = self.of(obj)
        if self._work is None and known is not None:
            use(known)
        else:
            self._waiting.append(use)

    def search(
        self, what: str, find: Callable[[AnchorNumbers], np.ndarray], numbers: AnchorNumbers,
        found: Callable[[np.ndarray], None],
    ) -> None:  # fmt: skip
        """Works out some anchors (A,) bool of these numbers and hands them over, in the window's
        thread; of two searches the last is meant.
        """
        self.status = what
        self._search = (self._thread.submit(find, numbers), found)

    def of(self, obj: SceneObject) -> AnchorNumbers | None:
        """The numbers that are there, of this object's model."""
        known = self.numbers
        return known if known is not None and known.model is obj.model else None

    def histogram(self, obj: SceneObject) -> Histogram | None:
        """Of the quantity that is looked at; None while it is worked out."""
        numbers = self.of(obj)
        if numbers is None:
            return None
        kept = self._histogram
        if kept is None or kept[0] is not numbers or kept[1].name != self.quantity:
            kept = self._histogram = (numbers, histogram_of(numbers, self.quantity))
        return kept[1]

    def poll(self) -> bool:
        """Once a frame: takes over what is ready; True while something is under way."""
        try:
            self._take_numbers()
            self._take_search()
        except (BadFile, ValueError, MemoryError) as error:
            self._waiting, self._search = [], None
            self.problem = str(error) or said("There is no memory for the numbers of all anchors.")
        if not self.busy:
            self.status = ""
        return self.busy

    def _take_numbers(self) -> None:
        if self._work is None or not self._work.done():
            return
        work, self._work = self._work, None
        self.numbers = work.result()
        waiting, self._waiting = self._waiting, []
        for use in waiting:
            use(self.numbers)

    def _take_search(self) -> None:
        if self._search is None or not self._search[0].done():
            return
        (work, found), self._search = self._search, None
        found(work.result())


def numbers_of_piece(model: Model, x: Control, eye: np.ndarray) -> AnchorNumbers:
    """As `anchor_numbers`.  Raises BadFile for a model that has no parts."""
    check_pieces(model)
    return anchor_numbers(model, x, eye)
