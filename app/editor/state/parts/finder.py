"""Finds in a thread what a click or a box means, so that the window never waits for it."""

import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.editor.texts.table import said
from shapeshift.runtime_models.model import BadFile, Model
from shapeshift.scene.pick import Hit, Picker, anchor_places
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene, SceneObject

if TYPE_CHECKING:
    from shapeshift.decomposition.masks.anchor_click import Growth
    from shapeshift.decomposition.masks.anchor_walk import AnchorGraph

MOST_ANCHORS = 2_000_000  # of a model: the graph of more takes gigabytes
KEPT_GRAPHS = 4  # of models that were pointed at last
SPREAD_PX = 2.0  # pixels that a hand can mean
GRID = 3  # rays a side into the inner half of a box
PATIENCE_S = 3.0  # longest wait at the end


@dataclass(frozen=True, eq=False)
class Query:
    """A place, or a box, of the picture: pixels of the view from its top left."""

    scene: Scene  # as it is drawn
    view: View
    corners: tuple[float, float, float, float]  # left, top, right, low; of a click no wider than 0
    against: tuple[str, np.ndarray] | None = None  # an object, and (A,) bool what it is not

    @property
    def is_click(self) -> bool:
        left, top, right, low = self.corners
        return right <= left and low <= top


@dataclass(frozen=True, eq=False)
class Found:
    """Nested sets of anchors of one object, of which `count` nodes are the likeliest."""

    query: Query
    name: str  # of the object
    model: Model
    growth: "Growth"
    graph: "AnchorGraph"
    owner: np.ndarray  # (A,) node of each anchor

    def rows(self, factor: float = 1.0) -> np.ndarray:
        """(A,) bool: what was meant, made larger or smaller by a factor."""
        from shapeshift.decomposition.masks.anchor_click import anchors_of

        most = len(self.growth.nodes)
        count = min(max(round(self.growth.count * factor), 1), most)
        return anchors_of(self.graph, self.growth.nodes[:count], self.owner)


@dataclass
class _Graph:
    model: Model  # kept, so that its id is its own
    graph: "AnchorGraph"
    owner: np.ndarray


@dataclass
class Finder:
    """One thread and the newest question; what was asked before it is not answered."""

    eyes: Sequence[np.ndarray] = ()  # (3,) metres, world: from where the scene was taken, if known
    status: str = ""  # what is being done that takes longer than a moment
    problem: str = ""  # one sentence: why nothing can be found
    _query: Query | None = None
    _found: Found | None = None
    _answered: Query | None = None
    _busy: bool = False
    _closing: bool = False
    _graphs: list[_Graph] = field(default_factory=list)
    _picker: Picker = field(default_factory=Picker)
    _wake: threading.Condition = field(default_factory=threading.Condition)
    _thread: threading.Thread | None = None

    def __enter__(self) -> "Finder":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def ask(self, query: Query) -> None:
        """A new question; the one before is forgotten, unless it is being answered already."""
        with self._wake:
            self._query = query
            if self._thread is None or not self._thread.is_alive():
                self._closing = False
                self._thread = threading.Thread(target=self._work, name="parts", daemon=True)
                self._thread.start()
            self._wake.notify()

    def take_answer(self) -> tuple[Query, Found | None] | None:
        """The answer to the question that was asked last, once; None while there is none."""
        with self._wake:
            if self._answered is None:
                return None
            answer, self._answered = (self._answered, self._found), None
            self._found = None
            return answer

    @property
    def busy(self) -> bool:
        return self._busy or self._query is not None or self._answered is not None

    def forget(self) -> None:
        """Another scene: nothing of the old one is found or kept."""
        with self._wake:
            self._query = self._answered = self._found = None
            self._graphs, self.problem = [], ""

    def close(self) -> None:
        """Ends the thread after what it is doing."""
        with self._wake:
            self._closing, self._query = True, None
            self._wake.notify()
        if self._thread is not None:
            self._thread.join(PATIENCE_S)

    def _work(self) -> None:
        while True:
            with self._wake:
                while self._query is None and not self._closing:
                    self._wake.wait()
                if self._closing:
                    return
                assert self._query is not None, "it was waited for"
                query, self._query, self._busy = self._query, None, True
            found = None
            try:
                found = self.find(query)
            except (BadFile, ValueError, MemoryError) as error:
                self.problem = str(error) or said("There is no memory for what a click means.")
            with self._wake:
                self._busy, self.status = False, ""
                self._answered, self._found = query, found

    def find(self, query: Query) -> Found | None:
        hits = self._hits(query)
        if not hits:
            return None
        names = [hit.index for hit in hits]
        index = max(set(names), key=names.count)  # that most of the rays met
        obj = query.scene.objects[index]
        known = self._graph_of(obj, query.view)
        if not len(known.graph.nodes.rows):
            return None
        from shapeshift.decomposition.masks.anchor_click import grow

        each = obj.model.splat_count // max(len(known.owner), 1)  # splats an anchor
        met = np.array([hit.splat // each for hit in hits if hit.index == index])
        seeds = np.unique(known.owner[met])
        against, within = np.zeros(0, int), None
        if query.against is not None and query.against[0] == obj.name:
            against = np.setdiff1d(np.unique(known.owner[query.against[1]]), seeds)
        if not query.is_click:
            places = known.graph.nodes.means
            within = in_box(query.view, places, obj, query.corners)
        growth = grow(known.graph, seeds, against, within)
        return Found(query, obj.name, obj.model, growth, known.graph, known.owner)

    def _hits(self, query: Query) -> list[Hit]:
        """What rays meet: one under a click, some into the inner half of a box."""
        left, top, right, low = query.corners
        steps = [0.5] if query.is_click else np.linspace(0.25, 0.75, GRID)
        places = [(left + a * (right - left), top + b * (low - top)) for a in steps for b in steps]
        view, out = query.view, []
        across = (view.tangents[1] - view.tangents[0]) / view.size[0]
        for place in places:
            direction = ray_through(view, place)
            eye = view.world_from_eye.position
            hit = self._picker.under(query.scene, eye, direction, SPREAD_PX * across)
            if hit is not None:
                out.append(hit)
        return out

    def _graph_of(self, obj: SceneObject, view: View) -> _Graph:
        """The graph of a model, made once."""
        for known in self._graphs:
            if known.model is obj.model:
                return known
        places = anchor_places(obj.model)
        if len(places) > MOST_ANCHORS:
            raise BadFile(
                f"'{obj.name}' has {len(places):,} splats, more than the {MOST_ANCHORS:,} of which "
                "a click finds a thing; take it with the brush, or with boxes of everything."
            )
        from shapeshift.decomposition.masks.anchor_click import owners
        from shapeshift.decomposition.masks.anchor_walk import make_graph, nodes_of

        object_from_world = np.linalg.inv(obj.world_from_object.matrix())
        world = np.array([*self.eyes] or [view.world_from_eye.position])
        eyes = world @ object_from_world[:3, :3].T + object_from_world[:3, 3]
        self.status = said("{name}: colours of all stops", name=obj.name)
        nodes = nodes_of(obj.model, eyes.mean(axis=0))
        self.status = said("{name}: which anchors go together", name=obj.name)
        graph = make_graph(nodes, eyes)
        made = _Graph(obj.model, graph, owners(graph, places))
        self._graphs = [made, *self._graphs][:KEPT_GRAPHS]
        self.status = ""
        return made


def ray_through(view: View, place: tuple[float, float]) -> np.ndarray:
    """(3,) direction in the world of the ray through a place, pixels from the top left."""
    left, right, low, high = view.tangents
    across = left + (right - left) * place[0] / view.size[0]
    up = high + (low - high) * place[1] / view.size[1]
    return view.world_from_eye.matrix()[:3, :3] @ np.array([across, up, -1.0])


def in_box(
    view: View, places: np.ndarray, obj: SceneObject, corners: tuple[float, float, float, float]
) -> np.ndarray:
    """(N,) bool: which places (N, 3), object frame, show within a box of the picture, pixels."""
    eye_from_object = view.eye_from_world() @ obj.world_from_object.matrix()
    in_eye = places @ eye_from_object[:3, :3].T + eye_from_object[:3, 3]
    left, right, low, up = view.tangents
    width, height = view.size
    with np.errstate(divide="ignore", invalid="ignore"):
        across = (in_eye[:, 0] / -in_eye[:, 2] - left) / (right - left) * width
        down = (up - in_eye[:, 1] / -in_eye[:, 2]) / (up - low) * height
    inside = (across >= corners[0]) & (across <= corners[2])
    inside &= (down >= corners[1]) & (down <= corners[3])
    return inside & (-in_eye[:, 2] > view.near)
