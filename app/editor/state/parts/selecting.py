"""Choosing anchors by a lasso, a sphere, a colour, a range of a histogram, or as floaters."""

from collections.abc import Callable

import numpy as np

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.state.parts.anchor_numbers import AnchorNumbers, Histogram
from shapeshift.app.editor.state.parts.choosing import in_lasso, in_sphere
from shapeshift.app.editor.state.parts.finder import SPREAD_PX, ray_through
from shapeshift.app.editor.state.parts.floaters import floaters
from shapeshift.app.editor.state.parts.measuring import Measuring
from shapeshift.app.editor.texts.table import said
from shapeshift.scene.pick import Hit, anchor_places
from shapeshift.scene.pose import View
from shapeshift.scene.scene import SceneObject

THING, ALL, LASSO, SPHERE, COLOR = "thing", "box", "lasso", "sphere", "color"
DRAGS = (THING, ALL, LASSO, SPHERE, COLOR)  # what the left button does, in the order of key U
LIKENESS = 0.08  # of Oklab, where black and white are 1 apart: a shade, not another colour
Place = tuple[float, float]  # pixels of the view, from the top left
Choose = Callable[[SceneObject, np.ndarray, str], None]  # an object, (A,) bool of it, and how


class Selecting:
    """Everything here takes what lies behind as well; a thing is what the finder finds."""

    def __init__(
        self, state: EditorState, choose: Choose, target: Callable[[], SceneObject | None]
    ) -> None:
        """`target`: the object that is meant where no place tells it."""
        self._state, self._choose, self._target = state, choose, target
        self.drag = THING
        self.likeness = LIKENESS
        self.measuring = Measuring()
        self.held: tuple[int, int] | None = None  # bins of the histogram under a drag
        self.counted: tuple[np.ndarray, Histogram, np.ndarray] | None = None  # of those chosen

    def next_drag(self, step: int) -> None:
        """The next of DRAGS, or the one before."""
        self.drag = DRAGS[(DRAGS.index(self.drag) + step) % len(DRAGS)]

    def lasso(self, view: View, outline: np.ndarray, how: str) -> None:
        """All that shows within a closed line (P, 2), pixels of the view."""
        obj = self._target()
        if obj is not None and len(outline) > 2:
            self._choose(obj, in_lasso(view, anchor_places(obj.model), obj, outline), how)

    def sphere(self, view: View, middle: Place, edge: Place, how: str) -> None:
        """All within a ball about the surface under `middle`, whose outline passes `edge`."""
        hit = self._hit(view, middle)
        if hit is None:
            self._state.say(said("A sphere begins on a surface: press where there is one."))
            return
        obj = self._state.scene.objects[hit.index]
        metres_per_px = (view.tangents[1] - view.tangents[0]) / view.size[0] * depth_m(view, hit)
        radius = float(np.hypot(edge[0] - middle[0], edge[1] - middle[1])) * metres_per_px
        object_from_world = np.linalg.inv(obj.world_from_object.matrix())
        centre = (object_from_world @ np.append(hit.point, 1.0))[:3]
        self._choose(obj, in_sphere(anchor_places(obj.model), centre, radius), how)

    def alike(self, view: View, place: Place, how: str) -> None:
        """All of the object with a colour like that under a place, wherever they are."""
        hit = self._hit(view, place)
        if hit is None:
            return
        obj = self._state.scene.objects[hit.index]
        each = obj.model.splat_count // max(len(anchor_places(obj.model)), 1)  # splats an anchor
        met = hit.splat // max(each, 1)

        def choose(numbers: AnchorNumbers) -> None:
            self._choose_if_there(obj, numbers.alike(numbers.oklab[met], self.likeness), how)

        self.measuring.then(obj, view.world_from_eye.position, choose)

    def range(self, histogram: Histogram, first: int, last: int, how: str) -> None:
        """The anchors in some bins of the histogram that is shown."""
        obj = self._target()
        if obj is not None and len(histogram.bin_of) == len(anchor_places(obj.model)):
            self._choose(obj, histogram.rows(first, last), how)

    def histogram(self, eye: np.ndarray) -> Histogram | None:
        """Of the object that is meant; None while it is worked out, which this begins."""
        obj = self._target()
        if obj is None:
            return None
        if not self._state.playing:
            self.measuring.want(obj, eye)
        return self.measuring.histogram(obj)

    def propose_floaters(self, eye: np.ndarray, how: str) -> None:
        """Chooses what looks like junk in the air; it is seen before it is deleted."""
        obj = self._target()
        if obj is None:
            return

        def found(rows: np.ndarray) -> None:
            count = int(np.count_nonzero(rows))
            if not count:
                self._state.say(said("Nothing looks like a floater."))
                return
            self._choose_if_there(obj, rows, how)
            share = f"{100 * count / len(rows):.2g} %"
            facts = {"count": number(count), "share": share}
            self._state.say(said("{count} anchors ({share}) look like floaters.", **facts), 6.0)

        def search(numbers: AnchorNumbers) -> None:
            what = said("{name}: floaters", name=obj.name)
            self.measuring.search(what, floaters, numbers, found)

        self.measuring.then(obj, eye, search)

    def _choose_if_there(self, obj: SceneObject, rows: np.ndarray, how: str) -> None:
        """The object may have become another one while something was worked out."""
        for now in self._state.scene.objects:
            if now.name == obj.name and len(anchor_places(now.model)) == len(rows):
                self._choose(now, rows, how)

    def _hit(self, view: View, place: Place) -> Hit | None:
        across = (view.tangents[1] - view.tangents[0]) / view.size[0]
        return self._state.pick(view, ray_through(view, place), SPREAD_PX * across)


def depth_m(view: View, hit: Hit) -> float:
    """Metres in front of the eye, along its axis, at which something was met."""
    in_eye = view.eye_from_world() @ np.append(hit.point, 1.0)
    return float(-in_eye[2])
