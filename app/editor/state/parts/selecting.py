"""Choosing anchors by a lasso, a sphere, a colour, a range of a histogram, or as floaters."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.state.parts.finder import SPREAD_PX, ray_through
from shapeshift.app.editor.state.parts.parts_lit import (
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


# Floaters: junk that training leaves in the air, proposed for deletion; nothing is removed here.
#
# Two kinds, as captures show them: small groups of anchors apart from everything, and large faint
# splats that hang off the surface.  What is connected with much else is the scene.

NEIGHBOURS = 8  # of an anchor, among which connections are looked for
LINK = 3.0  # times the usual distance to the last of them: as far two anchors still touch
REACH = 2.0  # sigmas of both: large splats of a coarse surface touch over a longer way
GROUP = 0.002  # of all anchors: a group with fewer that touches no other is apart
LEAST_GROUP = 8  # anchors, however few there are in all
HUGE = 4.0  # times the usual size of those around it
FAINT = 0.4  # opacity below which a huge splat is a haze and no wall
OFF = 1.5  # times the usual distance to the last neighbour: as far off a haze hangs


def floaters(numbers: AnchorNumbers) -> np.ndarray:
    """(A,) bool: anchors that look like floaters.  About 10 s of a core for a million."""
    count = len(numbers.places)
    from scipy.spatial import cKDTree  # loaded when first wanted: half a second

    usable = np.isfinite(numbers.places).all(axis=1) & np.isfinite(numbers.size)
    out = np.zeros(count, bool)
    if np.count_nonzero(usable) <= NEIGHBOURS:
        return out
    rows = np.flatnonzero(usable)
    places = numbers.places[rows].astype(np.float64)
    size, opacity = numbers.size[rows], numbers.opacity[rows]
    away, near = cKDTree(places).query(places, NEIGHBOURS + 1)
    away, near = away[:, 1:], near[:, 1:]  # (n, NEIGHBOURS) metres, rows
    usual = float(np.median(away[:, -1]))
    around = np.median(size[near], axis=1)
    huge = (size > HUGE * np.maximum(around, np.median(size))) & (opacity < FAINT)
    group, largest = groups(away, near, np.where(huge, 0, size), LINK * usual, ~huge)
    apart = (largest[group] < max(GROUP * len(rows), LEAST_GROUP)) & ~huge
    surface = np.flatnonzero(~apart & ~huge)
    haze = np.zeros(len(rows), bool)
    if len(surface):
        hung = np.flatnonzero(huge)
        off = cKDTree(places[surface]).query(places[hung])[0]
        haze[hung[off > OFF * usual]] = True
    out[rows[apart | haze]] = True
    return out


def groups(
    away: np.ndarray, near: np.ndarray, size: np.ndarray, link: float, counts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) group of each anchor, and (groups,) how many of those that `counts` (n,) each has.

    away, near: (n, NEIGHBOURS) metres to the nearest others, and which these are.
    """
    from scipy.sparse import coo_matrix  # loaded when first wanted: half a second
    from scipy.sparse.csgraph import connected_components

    reach = 2 * REACH * np.minimum(size[:, None], size[near])  # both must be large
    touches = (away <= np.maximum(link, reach)) & counts[:, None] & counts[near]
    start, which = np.nonzero(touches)
    end = near[start, which]
    edges = coo_matrix((np.ones(len(start), np.int8), (start, end)), shape=(len(away),) * 2)
    number, group = connected_components(edges, directed=False)
    return group, np.bincount(group[counts], minlength=number)


# Which anchors a hand means: what shows inside a lasso, what lies within a sphere.

BLOCK = 1 << 18  # anchors at a time: their numbers stay in the cache


def on_picture(view: View, places: np.ndarray, obj: SceneObject) -> np.ndarray:
    """(N, 2) float32 pixels from the top left of places (N, 3) metres, object frame.

    NaN for what lies behind the near plane, or is at no place at all.
    """
    eye_from_object = (view.eye_from_world() @ obj.world_from_object.matrix()).astype(np.float32)
    left, right, low, up = view.tangents
    width, height = view.size
    out = np.empty((len(places), 2), np.float32)
    for start in range(0, len(places), BLOCK):
        block = np.asarray(places[start : start + BLOCK], np.float32)
        in_eye = eye_from_object[:3, :3] @ block.T + eye_from_object[:3, 3:]  # (3, n) metres
        depth = -in_eye[2]
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.where(depth > view.near, 1 / depth, np.float32(np.nan))
        part = out[start : start + BLOCK]
        part[:, 0] = (in_eye[0] * inverse - left) * (width / (right - left))
        part[:, 1] = (up - in_eye[1] * inverse) * (height / (up - low))
    return out


def in_lasso(view: View, places: np.ndarray, obj: SceneObject, outline: np.ndarray) -> np.ndarray:
    """(N,) bool: which places (N, 3), object frame, show within a closed line (P, 2), pixels.

    The line is drawn into a mask of the picture first, so that the number of its corners costs
    nothing an anchor; a place is inside where its pixel's middle is.
    """
    size = view.size
    mask = polygon_mask(np.asarray(outline, np.float64), size)
    pixel = on_picture(view, places, obj)
    with np.errstate(invalid="ignore"):
        seen = (pixel[:, 0] >= 0) & (pixel[:, 0] < size[0])
        seen &= (pixel[:, 1] >= 0) & (pixel[:, 1] < size[1])
    rows = np.flatnonzero(seen)
    column, row = pixel[rows].astype(np.int32).T
    inside = np.zeros(len(places), bool)
    inside[rows[mask[row, column]]] = True
    return inside


def polygon_mask(outline: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W) bool: pixels whose middles lie within a closed line (P, 2), by the even-odd rule.

    Each edge toggles all pixels right of it in the rows that it crosses.
    """
    width, height = size
    toggles = np.zeros((height, width + 1), np.int32)
    for (x0, y0), (x1, y1) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if y0 == y1:
            continue
        if y0 > y1:
            x0, y0, x1, y1 = x1, y1, x0, y0
        first, last = max(int(np.ceil(y0 - 0.5)), 0), min(int(np.ceil(y1 - 0.5)), height)
        rows = np.arange(first, last)
        at = x0 + (rows + 0.5 - y0) * ((x1 - x0) / (y1 - y0))
        columns = np.clip(np.ceil(at - 0.5), 0, width).astype(int)
        np.add.at(toggles, (rows, columns), 1)
    return (np.cumsum(toggles[:, :width], axis=1) & 1).astype(bool)


def in_sphere(places: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    """(N,) bool: which places (N, 3) lie at most `radius` metres from `centre` (3,)."""
    off = np.asarray(places, np.float32) - np.asarray(centre, np.float32)
    return np.einsum("nc,nc->n", off, off) <= np.float32(radius) ** 2


# The numbers of an object's anchors, and which are floaters, worked out beside the window.

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
