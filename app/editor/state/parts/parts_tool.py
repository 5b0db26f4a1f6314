"""The tool "Parts": which anchors of an object are chosen, what a click would add, what to do."""

from collections.abc import Callable

import numpy as np

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.state.parts.cutting import delete_rows, hide_rows, make_object
from shapeshift.app.editor.state.parts.finder import Finder, Found, Query, in_box
from shapeshift.app.editor.state.parts.parts_lit import Lighting, same, same_look
from shapeshift.app.editor.state.parts.selecting import ALL, Selecting
from shapeshift.app.editor.state.regions import brushed
from shapeshift.app.editor.texts.table import said
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.pick import anchor_places
from shapeshift.scene.pose import View
from shapeshift.scene.scene import SceneObject, Tint

REPLACE, ADD, REMOVE = "replace", "add", "remove"  # what is done with what was met
GROWS = 1.2  # more or fewer anchors with every notch of the wheel
LARGEST = 40.0  # times what a click takes, or less by as much
HOW = (
    "Click a thing: it lights up. Shift adds, Alt removes, Ctrl+wheel takes more or less of it; "
    "drag a box. Enter makes it an object."
)
Corners = tuple[float, float, float, float]  # left, top, right, low: pixels of the view


class PartsTool:
    """What is chosen is no edit; what is made of it is one."""

    def __init__(self, state: EditorState, count_changed: Callable[[], None]) -> None:
        """`count_changed` hears that the scene has more or fewer objects, or others."""
        self.state, self._count_changed = state, count_changed
        self.on = False
        self.name = ""  # of the object whose anchors are chosen
        self.chosen = np.zeros(0, bool)  # (A,)
        self.found: Found | None = None  # what a click would take
        self.how = REPLACE  # what it would do
        self.factor = 1.0  # of what a click takes, by the wheel
        self.crop: np.ndarray | None = None  # (2, 3) metres, object frame: low and high corner
        self.finder = Finder()
        self.selecting = Selecting(state, self.choose, self._meant)
        self._asked: Query | None = None  # whose answer is to be taken at once
        self._undone: list[tuple[str, np.ndarray]] = []  # what was chosen before
        self._lit: tuple = ()  # what the tint was made of

    # ---- on and off

    def toggle(self) -> None:
        """Opens the tool, or leaves it with nothing chosen."""
        self.on = not self.on and bool(self.state.scene.objects)
        self.clear()
        self.crop = None
        if self.on:
            self.state.say(said(HOW), 8.0)
        self.light()

    def forget(self) -> None:
        """Another scene."""
        self.finder.forget()
        self.selecting.measuring.forget()
        self.on, self.crop, self.name = False, None, ""
        self.clear()

    def clear(self) -> None:
        """Nothing is chosen."""
        self.chosen, self.found, self._asked = np.zeros(0, bool), None, None
        self.factor = 1.0
        self._undone.clear()

    def status(self) -> str:
        """Words for the status line."""
        if not self.on:
            return ""
        if status := self.finder.status or self.selecting.measuring.status:
            return f"{status} \u2026"
        if self.count:
            return said(
                "{count} anchors of {name} chosen", count=number(self.count), name=self.name
            )
        return said("parts: point at a thing")

    @property
    def count(self) -> int:
        """How many anchors are chosen."""
        return int(np.count_nonzero(self.chosen))

    @property
    def index(self) -> int | None:
        """Of the object whose anchors are chosen, while it is what it was."""
        for index, obj in enumerate(self.state.scene.objects):
            if obj.name == self.name and len(self.chosen) == len(anchor_places(obj.model)):
                return index
        return None

    # ---- what is pointed at

    def point(self, view: View, place: tuple[float, float], how: str) -> None:
        """The mouse, or a ray, is over a place of the picture: pixels of the view."""
        self.how = how
        if self._asked is not None:
            return  # a click waits for its answer
        corners = (*place, *place)
        self.finder.ask(Query(self.state.shown(view), view, corners, self._against(how)))

    def look_away(self) -> None:
        """Nothing is pointed at any more."""
        self.found = None

    def click(self, view: View, place: tuple[float, float], how: str) -> None:
        """Takes what lies there: what is lit up already where that is it, else once it is found."""
        self.how = how
        found = self.found
        if found is not None and found.query.is_click and self._is_at(found.query, view, place):
            self._take_found(found)
        else:
            self._asked = Query(self.state.shown(view), view, (*place, *place), self._against(how))
            self.finder.ask(self._asked)

    def click_lit(self, how: str) -> None:
        """Takes what is lit up: for a hand, which is never quite still."""
        self.how = how
        if self.found is not None:
            self._take_found(self.found)

    def _is_at(self, query: Query, view: View, place: tuple[float, float]) -> bool:
        near = np.hypot(query.corners[0] - place[0], query.corners[1] - place[1]) < 1.5
        same = np.array_equal(query.view.eye_from_world(), view.eye_from_world())
        return bool(near) and same and query.view.size == view.size

    def box(self, view: View, corners: Corners, how: str) -> None:
        """A box was drawn: the thing in it, or everything."""
        self.how = how
        left, top, right, low = corners
        corners = (min(left, right), min(top, low), max(left, right), max(top, low))
        shown = self.state.shown(view)
        if self.selecting.drag != ALL:
            self._asked = Query(shown, view, corners, self._against(how))
            self.finder.ask(self._asked)
            return
        obj = self._meant()
        if obj is not None:
            self.choose(obj, in_box(view, anchor_places(obj.model), obj, corners), how)

    def _against(self, how: str) -> tuple[str, np.ndarray] | None:
        """What is chosen already is no part of what a click adds."""
        return (self.name, self.chosen) if how == ADD and self.count else None

    def _largest(self) -> int | None:
        """Of the visible objects the one with the most anchors: boxes and brushes mean it."""
        objects = self.state.scene.objects
        counts = [len(anchor_places(obj.model)) if obj.visible else -1 for obj in objects]
        return int(np.argmax(counts)) if counts and max(counts) > 0 else None

    def _meant(self) -> SceneObject | None:
        """Whose anchors a box, a brush or a histogram means: the object of those chosen now."""
        index = self.index if self.index is not None else self._largest()
        return None if index is None else self.state.scene.objects[index]

    def brush(
        self, view: View, cursor: tuple[float, float], radius: float, how: str, starts: bool
    ) -> None:
        """Adds or removes the anchors of the nearest surface under a brush, pixels of the view."""
        obj = self._meant()
        if obj is None:
            return
        rows = np.zeros(len(anchor_places(obj.model)), bool)
        rows[brushed(view, anchor_places(obj.model), obj, cursor, radius)] = True
        self.choose(obj, rows, how, starts)

    def grow(self, notches: float) -> None:
        """More of what is pointed at, or less."""
        self.factor = float(np.clip(self.factor * GROWS**notches, 1 / LARGEST, LARGEST))

    def poll(self) -> bool:
        """Once a frame: takes what was found; True while it is looked for."""
        if not self.on:
            return False
        answer = self.finder.take_answer()
        if answer is not None:
            query, found = answer
            self.found = found
            if query is self._asked:
                self._asked = None
                if found is not None:
                    self._take_found(found)
                elif query.is_click and self.how == REPLACE:
                    self._keep()
                    self.chosen = np.zeros(0, bool)
        measuring = self.selecting.measuring
        measures = measuring.poll()
        for part in (self.finder, measuring):
            if part.problem:
                self.state.problem, part.problem = part.problem, ""
        self.light()
        return self.finder.busy or measures

    def _take_found(self, found: Found) -> None:
        for obj in self.state.scene.objects:
            if obj.name == found.name and len(found.owner) == len(anchor_places(obj.model)):
                self.choose(obj, found.rows(self.factor), self.how)
        if not found.query.is_click:
            self.found = None
        self.factor = 1.0

    def choose(self, obj: SceneObject, rows: np.ndarray, how: str, starts: bool = True) -> None:
        """Does with some anchors (A,) bool of an object what was meant."""
        if starts:
            self._keep()
        if obj.name != self.name or len(self.chosen) != len(rows):
            self.name, self.chosen = obj.name, np.zeros(len(rows), bool)
        if how == REPLACE:
            self.chosen = rows.copy()
        elif how == ADD:
            self.chosen = self.chosen | rows
        else:
            self.chosen = self.chosen & ~rows

    def invert(self) -> None:
        """Everything else of the object."""
        index = self.index
        if index is not None:
            self._keep()
            self.chosen = ~self.chosen

    def _keep(self) -> None:
        self._undone = [*self._undone, (self.name, self.chosen)][-50:]

    def step_back(self) -> bool:
        """What was chosen before the last click; False where nothing was."""
        if not (self.on and self._undone):
            return False
        self.name, self.chosen = self._undone.pop()
        return True

    # ---- what is done with it

    def make(self) -> None:
        """What is chosen becomes an object, which is chosen then."""
        name = self._do(make_object)
        if name:
            self.state.chosen = name
            self.state.say(
                said(
                    "{name} is an object now. Ctrl+Z puts it back; its name is in Objects.",
                    name=name,
                )
            )

    def hide(self) -> None:
        """What is chosen is no longer seen; it is an object that is hidden."""
        self._do(hide_rows)

    def delete(self) -> None:
        """What is chosen is gone, from what is saved, too."""
        count = self.count
        if self._do(delete_rows) is not None:
            self.state.say(
                said("{count} anchors deleted. Ctrl+Z brings them back.", count=number(count))
            )

    def _do(self, act: Callable[..., str | None]) -> str | None:
        """An edit of what is chosen; "" where it was done without a name, None where it was not."""
        index = self.index
        if index is None or not self.count:
            self.state.say(said("Nothing is chosen. Click a thing, or draw a box around it."))
            return None
        try:
            name = act(self.state, index, self.chosen)
        except BadFile as error:
            self.state.problem = str(error)
            return None
        self.clear()
        self._count_changed()
        self.light()
        return name or ""

    # ---- the crop box

    def begin_crop(self) -> None:
        """A box about what is chosen, else about the largest object without its few strays."""
        index = self.index if self.count else self._largest()
        if index is None:
            return
        obj = self.state.scene.objects[index]
        places = anchor_places(obj.model)
        if self.count:
            places = places[self.chosen]
        self.name = obj.name
        self.crop = np.percentile(places, (2, 98) if not self.count else (0, 100), axis=0)
        if len(self.chosen) != len(anchor_places(obj.model)):
            self.chosen = np.zeros(len(anchor_places(obj.model)), bool)

    def move_crop_side(self, axis: int, side: int, metres: float) -> None:
        """One of the six sides elsewhere, never beyond the one across."""
        assert self.crop is not None
        crop = self.crop.copy()
        other = crop[1 - side, axis]
        crop[side, axis] = min(metres, other) if side == 0 else max(metres, other)
        self.crop = crop

    def outside(self) -> np.ndarray:
        """(A,) bool: anchors of the object outside the crop box."""
        assert self.crop is not None and self.index is not None
        places = anchor_places(self.state.scene.objects[self.index].model)
        return ~((places >= self.crop[0]) & (places <= self.crop[1])).all(axis=1)

    def apply_crop(self) -> None:
        """All outside the box goes, in one step."""
        if self.crop is None or self.index is None:
            self.crop = None
            return
        rows = self.outside()
        self.crop = None
        if not rows.any():
            self.state.say(said("Nothing lies outside the box."))
            return
        self.chosen = rows
        self._do(lambda state, index, rows: delete_rows(state, index, rows, "crop"))

    # ---- how it is seen

    def light(self) -> None:
        """The state shows what is chosen, what a click would take, and what a crop would."""
        shown = self.state.shown_scene
        found = self.found if self.on else None
        made_of = (
            self.on, self.name, self.chosen, found, self.how, self.factor, self._crop_key,
            self.state.scene,
        )  # fmt: skip
        if same(made_of, self._lit):
            return
        self._lit = made_of
        lit = self._tint(found) if self.on else None
        if not same_look(lit, shown.lit):
            shown.lit = lit

    @property
    def _crop_key(self) -> bytes:
        return b"" if self.crop is None else self.crop.tobytes()

    def _tint(self, found: Found | None) -> tuple[str, Tint] | None:
        """What lies over which object; one at a time, the one that is pointed at before others."""
        obj = self._lit_object(found)
        if obj is None:
            return None
        count = len(anchor_places(obj.model))
        mine = self.name == obj.name and len(self.chosen) == count
        hover = None
        if found is not None and found.name == obj.name and len(found.owner) == count:
            hover = found.rows(self.factor)
            if self.how == REMOVE:  # of what is chosen alone
                hover = hover & self.chosen if mine else None
        lighting = Lighting(
            chosen=self.chosen if mine else None,
            hover=hover,
            removes=self.how == REMOVE,
            gone=self.outside() if self.crop is not None and mine else None,
        )
        return obj.name, lighting.tint(count)

    def _lit_object(self, found: Found | None) -> SceneObject | None:
        wanted = found.name if found is not None and self.how != REMOVE else self.name
        if self.crop is not None:
            wanted = self.name
        objects = {obj.name: obj for obj in self.state.scene.objects}
        if wanted in objects:
            return objects[wanted]
        index = self._largest()
        return None if index is None else self.state.scene.objects[index]
