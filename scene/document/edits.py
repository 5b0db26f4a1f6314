"""Edits of a scene file as a person makes them: pure, each gives another SceneFile, so that every
one can be undone.  Items that an edit does not touch stay the very same objects.
"""

import math
import re
from dataclasses import dataclass, fields, replace
from typing import Any

from shapeshift.runtime_models.shapes import three
from shapeshift.runtime_models.stop_weights import Control, StopWeights, check_control
from shapeshift.scene.appearance import Appearance, Sky
from shapeshift.scene.document.scene_file import (
    BACKGROUND,
    FAR_M,
    FirstView,
    NamedView,
    SceneFile,
    SceneItem,
)
from shapeshift.scene.pose import Pose
from shapeshift.scene.sections.section import SceneSection

LONGEST_NAME = 100  # letters, as the reader takes them
MOST_OBJECTS = 1000  # as the reader takes them
MOST_VIEWS = 100  # as the reader takes them
DECIMALS, FINER = 6, 9  # of metres and of a quaternion: hands are no finer, files are short
MOST_SECTIONS = 16  # as the reader takes them
MOST_STEPS = 500  # that can be undone
MOST_BYTES = 256 << 20  # of what the steps keep besides the file: painted regions of large scenes


def find(file: SceneFile, name: str) -> SceneItem | None:
    """The object or background of that name."""
    return next((item for item in file.all_items if item.name == name), None)


def free_name(taken: set[str], wanted: str) -> str:
    """The wanted name, with the next free number behind it where it is taken."""
    taken = taken | {BACKGROUND}
    wanted = " ".join(wanted.split())[:LONGEST_NAME] or "object"
    if wanted not in taken:
        return wanted
    stem = re.sub(r" \d+$", "", wanted)[: LONGEST_NAME - 5]
    return next(f"{stem} {n}" for n in range(2, len(taken) + 3) if f"{stem} {n}" not in taken)


def add(file: SceneFile, item: SceneItem) -> SceneFile:
    """With one object more, the last, under a free name.  ValueError where there is no room."""
    if len(file.items) >= MOST_OBJECTS:
        raise ValueError(f"There are {len(file.items)} objects, the most a scene file has.")
    names = {other.name for other in file.all_items}
    item = replace(item, name=free_name(names, item.name))
    return replace(file, items=(*file.items, item))


def duplicate(file: SceneFile, name: str, by: tuple[float, float, float]) -> SceneFile:
    """With a copy right behind the object, moved by metres; the background's is an object."""
    item = item_named(file, name)
    position = three(a + b for a, b in zip(item.position, by, strict=True))
    file = add(file, replace(item, position=position))
    if item.name == BACKGROUND:
        return file
    at = file.items.index(item) + 1  # the first that is equal is the object itself
    return replace(file, items=(*file.items[:at], file.items[-1], *file.items[at:-1]))


def remove(file: SceneFile, name: str) -> SceneFile:
    """Without an object or the background."""
    item = item_named(file, name)
    if item is file.background:
        return replace(file, background=None)
    return replace(file, items=tuple(other for other in file.items if other is not item))


def hide(file: SceneFile, name: str, hidden: bool = True) -> SceneFile:
    return change(file, name, visible=not hidden)


def set_pose(file: SceneFile, name: str, pose: Pose) -> SceneFile:
    """With the object elsewhere.  ValueError for a place that the physics does not reach."""
    position = tuple(round(float(metres), DECIMALS) for metres in pose.position)
    if not all(-FAR_M <= metres <= FAR_M for metres in position):
        raise ValueError(f"'{name}' would stand farther away than {FAR_M:g} m.")
    wxyz = tuple(round(float(n), FINER) for n in pose.wxyz)
    return change(file, name, position=position, wxyz=wxyz)


def set_x(file: SceneFile, name: str, x: Control) -> SceneFile:
    """With the object's x at the start.  ValueError beyond 0 to 1."""
    check_control(x, f"object '{name}'")
    return change(file, name, x=x if isinstance(x, StopWeights) else float(x))


def rename(file: SceneFile, before: str, after: str) -> SceneFile:
    """With another name.  ValueError, one sentence, for one that the file cannot have."""
    after = " ".join(after.split())
    if item_named(file, before) is file.background:
        raise ValueError(f"The background is always called '{BACKGROUND}'.")
    if not 0 < len(after) <= LONGEST_NAME or not after.isprintable():
        raise ValueError(f"A name has 1 to {LONGEST_NAME} letters on one line.")
    if after == before:
        return file
    if after == BACKGROUND:
        raise ValueError(f"'{BACKGROUND}' is taken for the background alone; choose another name.")
    if find(file, after) is not None:
        raise ValueError(f"'{after}' is taken; choose another name.")
    return change(file, before, name=after)


def change(file: SceneFile, name: str, /, **values: Any) -> SceneFile:
    """With other values of an object's fields; the same file where nothing is different."""
    before = item_named(file, name)
    if all(getattr(before, field) == value for field, value in values.items()):
        return file
    after = replace(before, **values)
    if before is file.background:
        return replace(file, background=after)
    return replace(file, items=tuple(after if item is before else item for item in file.items))


def ground(file: SceneFile, floor_y: float | None) -> SceneFile:
    """With an endless floor at that height, metres, or without one."""
    if floor_y is not None:
        if not -FAR_M <= floor_y <= FAR_M:
            raise ValueError(f"A floor lies within {FAR_M:g} m.")
        floor_y = round(float(floor_y), DECIMALS)
    return file if floor_y == file.floor_y else replace(file, floor_y=floor_y)


def look_from(file: SceneFile, view: FirstView) -> SceneFile:
    """With another first look.  ValueError for one straight up or down."""
    check_view(view)
    return file if view == file.view else replace(file, view=view)


def keep_view(file: SceneFile, view: FirstView, name: str = "view") -> SceneFile:
    """With one named view more, under a free name.  ValueError where there is no room."""
    check_view(view)
    if len(file.views) >= MOST_VIEWS:
        raise ValueError(f"There are {len(file.views)} named views, the most a scene file has.")
    taken = {each.name for each in file.views}
    if name == "view" or name in taken:
        name = next(f"{name} {n}" for n in range(1, MOST_VIEWS + 2) if f"{name} {n}" not in taken)
    return replace(file, views=(*file.views, NamedView(name, view)))


def rename_view(file: SceneFile, before: str, after: str) -> SceneFile:
    """With a view under another name.  ValueError, one sentence, for one that it cannot have."""
    after = " ".join(after.split())
    if not 0 < len(after) <= LONGEST_NAME or not after.isprintable():
        raise ValueError(f"A name has 1 to {LONGEST_NAME} letters on one line.")
    if after != before and after in [each.name for each in file.views]:
        raise ValueError(f"'{after}' is taken; choose another name.")
    views = (replace(v, name=after) if v.name == before else v for v in file.views)
    return replace(file, views=tuple(views))


def remove_view(file: SceneFile, name: str) -> SceneFile:
    return replace(file, views=tuple(each for each in file.views if each.name != name))


def check_view(view: FirstView) -> None:
    """ValueError for a view whose upper side nobody knows."""
    if math.dist(view.eye[::2], view.target[::2]) < 1e-6:
        raise ValueError("A view that is kept goes not straight up or down; tilt it a little.")


def rounded(view: FirstView) -> FirstView:
    """The view with places as a file has them."""
    eye, target = (three(round(n, DECIMALS) for n in place) for place in (view.eye, view.target))
    return replace(view, eye=eye, target=target)


def set_appearance(file: SceneFile, name: str, appearance: Appearance) -> SceneFile:
    """With another appearance of an object, or of all objects where the name is ""."""
    if name:
        return change(file, name, appearance=appearance)
    return file if appearance == file.appearance else replace(file, appearance=appearance)


def set_sections(file: SceneFile, name: str, sections: tuple[SceneSection, ...]) -> SceneFile:
    """With other sections of an object, or of the whole scene where the name is "".  ValueError
    where there are too many.
    """
    if len(sections) > MOST_SECTIONS:
        raise ValueError(f"There are {MOST_SECTIONS} sections, the most that a scene file has.")
    if name:
        return change(file, name, sections=sections)
    return file if sections == file.sections else replace(file, sections=sections)


def set_sky(file: SceneFile, sky: Sky | None) -> SceneFile:
    """With another sky, or with none of its own."""
    return file if sky == file.sky else replace(file, sky=sky)


def item_named(file: SceneFile, name: str) -> SceneItem:
    """The item of that name; ValueError where there is none."""
    item = find(file, name)
    if item is None:
        raise ValueError(f"There is no object '{name}' any more.")
    return item


@dataclass(frozen=True)
class Change:
    """What became of one object from one file to another; None: it is not there."""

    before: SceneItem | None
    after: SceneItem | None

    @property
    def fields(self) -> set[str]:
        """Names of what is different, of an object that is in both."""
        if self.before is None or self.after is None:
            return set()
        names = (field.name for field in fields(SceneItem))
        return {name for name in names if getattr(self.before, name) != getattr(self.after, name)}


def changes(before: SceneFile, after: SceneFile) -> list[Change]:
    """What an edit, or undoing it, did; an object that was renamed is one change, not two."""
    old = {item.name: item for item in before.all_items}
    new = {item.name: item for item in after.all_items}
    gone = [item for name, item in old.items() if name not in new]
    come = [item for name, item in new.items() if name not in old]
    out = []
    if len(gone) == len(come) == 1 and Change(gone[0], come[0]).fields - {"x"} == {"name"}:
        out, gone, come = [Change(gone[0], come[0])], [], []
    out += [Change(item, None) for item in gone]
    out += [
        Change(old[name], item)
        for name, item in new.items()
        if name in old and item is not old[name] and Change(old[name], item).fields
    ]
    return out + [Change(None, item) for item in come]


def with_x_of(file: SceneFile, other: SceneFile) -> SceneFile:
    """The file with each object's x as it is in the other: a look, which no undoing changes."""
    now = {item.name: item for item in other.all_items}
    pairs = ((change.before, change.after) for change in changes(other, file))
    now |= {after.name: before for before, after in pairs if before and after}  # renamed

    def looked(item: SceneItem) -> SceneItem:
        """With the x of now; the very object of the other file where that says the same."""
        known = now.get(item.name, item)
        moved = item if item.x == known.x else replace(item, x=known.x)
        return known if moved == known else moved

    items = tuple(looked(item) for item in file.items)
    background = looked(file.background) if file.background else None
    if items == file.items and background == file.background:
        return file
    return replace(file, items=items, background=background)


@dataclass(frozen=True)
class HistoryStep:
    """A file, and in words the edit that led to it."""

    file: SceneFile
    what: str = ""
    together: str = ""  # edits in a row with the same word are one step: a drag
    regions: tuple = ()  # edited apart from the file, until it is saved
    bytes: int = 0  # that this step alone keeps
    film: object = None  # the keys of a film, edited apart from the file, too
    marks: object = None  # and marks and lengths; the same only where they are the very same


@dataclass(frozen=True)
class History:
    """What the file was, is, and was before something was undone."""

    steps: tuple[HistoryStep, ...]
    at: int = 0  # the step that holds now

    @staticmethod
    def of(file: SceneFile, regions: tuple = ()) -> "History":
        return History((HistoryStep(file, regions=regions),))

    @property
    def file(self) -> SceneFile:
        return self.steps[self.at].file

    @property
    def regions(self) -> tuple:
        return self.steps[self.at].regions

    @property
    def undoes(self) -> str:
        """The edit that `undo` takes back; "" where there is none."""
        return self.steps[self.at].what if self.at else ""

    @property
    def redoes(self) -> str:
        return self.steps[self.at + 1].what if self.at + 1 < len(self.steps) else ""

    @property
    def film(self) -> object:
        return self.steps[self.at].film

    @property
    def marks(self) -> object:
        return self.steps[self.at].marks

    def record(
        self, file: SceneFile, what: str, together: str = "", regions: tuple | None = None,
        more_bytes: int = 0, film: object = None, marks: object = None,
    ) -> "History":  # fmt: skip
        """After another edit of the file, the regions, a film or marks; what was undone is
        forgotten.
        """
        step = self._step(file, regions, film, marks)
        if step is None:
            return self
        now = self.steps[self.at]
        keep = self.at if together and now.together == together else self.at + 1
        step = replace(step, what=what, together=together, bytes=more_bytes)
        steps = (*self.steps[:keep], step)
        steps = steps[-MOST_STEPS - 1 :]
        while len(steps) > 2 and sum(step.bytes for step in steps) > MOST_BYTES:
            steps = steps[1:]
        return History(steps, len(steps) - 1)

    def amend(
        self, file: SceneFile, regions: tuple | None = None, film: object = None,
        marks: object = None,
    ) -> "History":  # fmt: skip
        """What holds now is another, but no edit of its own: a slider has moved."""
        now = self._step(file, regions, film, marks)
        if now is None:
            return self
        return replace(self, steps=(*self.steps[: self.at], now, *self.steps[self.at + 1 :]))

    def _step(
        self, file: SceneFile, regions: tuple | None, film: object, marks: object
    ) -> HistoryStep | None:
        """The step of now with other contents, None: as they are; None where nothing is other."""
        now = self.steps[self.at]
        regions = now.regions if regions is None else regions
        film, marks = film or now.film, marks or now.marks
        same = file is now.file and film is now.film and marks is now.marks
        if same and regions == now.regions:
            return None
        return replace(now, file=file, regions=regions, film=film, marks=marks)

    def rest(self) -> "History":
        """The hand has let go: the next edit is a step of its own."""
        if not self.steps[self.at].together:
            return self
        rested = replace(self.steps[self.at], together="")
        return replace(self, steps=(*self.steps[: self.at], rested, *self.steps[self.at + 1 :]))

    def undo(self) -> "History":
        return replace(self.rest(), at=max(self.at - 1, 0))

    def redo(self) -> "History":
        return replace(self.rest(), at=min(self.at + 1, len(self.steps) - 1))
