"""Edits of what the state shows: the file, its history, the world and the scene change together."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.opened import Source
from shapeshift.app.editor.state.scene_objects import with_background
from shapeshift.app.editor.state.shown_scene import leader_of
from shapeshift.app.editor.state.track import next_stop, stepped
from shapeshift.app.film.window.timeline import FilmKeys
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.control import Shift, Sweep
from shapeshift.scene.document import edits
from shapeshift.scene.document.edits import Change, History
from shapeshift.scene.document.scene_file import (
    SceneFile,
    SceneItem,
    labelled,
    object_of,
    sections_of,
)
from shapeshift.scene.inspection.marks_file import MarksFile
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import SceneObject

LOOKS = {"model", "mode", "up", "flip", "part"}  # fields that ask for another model
MOVED_M, TURNED = 1e-4, 1e-6  # metres, 1 - cosine of half the angle: less counts as unmoved
COPY_BESIDE = 1.1  # of an object's width: how far off its copy stands


def edit(
    state: EditorState, file: SceneFile, what: str, together: str = "",
    heirs: Mapping[str, str] | None = None,
) -> None:  # fmt: skip
    """Takes an edited file over; heirs: name of an object -> of the one that it was made of, whose
    emissivity it has.  Raises BadFile, with all as it was, where it cannot be so.
    """
    state.record_regions()
    history = state.edited.history
    names = renamed(edits.changes(history.file, file))
    heirs = {after: before for before, after in names.items()} | dict(heirs or {})
    marks = inherited(state.edited.marks, heirs, {item.name for item in file.all_items})
    turn_to(state, history.record(file, what, together, marks=marks))
    state.edited.amend_regions(state.regions)


def renamed(changed: Sequence[Change]) -> dict[str, str]:
    """Names before and after, of objects that have another one now."""
    pairs = [(each.before, each.after) for each in changed]
    return {a.name: b.name for a, b in pairs if a is not None and b and a.name != b.name}


def inherited(marks: MarksFile, heirs: Mapping[str, str], there: set[str]) -> MarksFile:
    """What marks keep of objects by their names, as heirs have it; `there` are all names of now."""
    shares, gone = dict(marks.objects), {*heirs.values()} - there
    kept = {name: share for name, share in shares.items() if name not in {*heirs, *gone}}
    kept |= {name: shares[before] for name, before in heirs.items() if before in shares}
    first = {before: name for name, before in reversed([*heirs.items()]) if before in gone}
    laid = [mark.laid and mark.laid.of_objects(first) for mark in marks.marks]
    rows = tuple(
        mark if mark.laid is now else replace(mark, laid=now)
        for mark, now in zip(marks.marks, laid, strict=True)
    )
    same = kept == shares and all(a is b for a, b in zip(rows, marks.marks, strict=True))
    return marks if same else replace(marks, objects=tuple(kept.items()), marks=rows)


def follow_names(state: EditorState, names: Mapping[str, str]) -> None:
    """All that the window keeps of objects by their names goes along, also where it is undone."""
    if not names:
        return
    state.chosen = names.get(state.chosen, state.chosen)
    state.steered = names.get(state.steered, state.steered)
    state.split.name = names.get(state.split.name, state.split.name)
    state.chain.loose = {names.get(name, name) for name in state.chain.loose}
    state.bodies.call_anew(names)
    for hear in state.renamed:
        hear(names)


def undo(state: EditorState) -> str:
    """Takes the last edit back; returns what it was, "" where there was none.

    Looks are no edits: the camera and every slider stay where they are.
    """
    state.record_regions()
    what = state.edited.history.undoes
    go_back(state, state.edited.history.undo())
    return what


def redo(state: EditorState) -> str:
    state.record_regions()
    what = state.edited.history.redoes
    go_back(state, state.edited.history.redo())
    return what


def go_back(state: EditorState, history: History) -> None:
    """Goes to a step that has been before, with every x as it is now."""
    now = state.edited.history
    go_to(state, history.amend(edits.with_x_of(history.file, now.file)))


def go_to(state: EditorState, history: History) -> None:
    """Another history, in which the step of now may be any other.  Raises BadFile, with all as it
    was, where it cannot be so.
    """
    now = state.edited.history
    turn_to(state, history)
    if isinstance(history.film, FilmKeys) and history.film is not state.timeline.keys:
        state.timeline.restore(history.film)
    if history.regions != now.regions:
        state.regions.restore(history.regions)
        for index, obj in enumerate(state.scene.objects):
            state.regions.fit_painted(index, obj)
    state.edited.amend_regions(state.regions)


def turn_to(state: EditorState, history: History) -> None:
    """Goes to another step of the history: only what differs is touched."""
    before = state.edited.history
    state.finish_shifts()
    state.edited.history = history
    if history.file is before.file:
        return
    changed = edits.changes(before.file, history.file)
    names = renamed(changed)
    follow_names(state, names)
    try:
        world = state.world
        state.bodies.follow(state.edited)
        arrange(state, changed)
        if state.world is not world:  # a new one stands at its start
            state.follow_world()
        if history.file.sky != before.file.sky:
            state.settings = with_background(state.settings, history.file.sky, state.scene)
    except BadFile:
        state.edited.history = before
        follow_names(state, {after: name for name, after in names.items()})
        state.bodies.follow(state.edited)
        raise


def arrange(state: EditorState, changed: Sequence[Change]) -> None:
    """The scene's objects as the file has them now; the rest goes on as it stands."""
    of = {change.after.name: change for change in changed if change.after is not None}
    was = {obj.name: index for index, obj in enumerate(state.scene.objects)}
    rows, moved = [], {}
    for number, (label, item) in enumerate(labelled(state.edited.file)):
        change = of.get(item.name)
        if change is None:
            index = was[item.name]
        elif change.before is None or change.fields & LOOKS:
            index = None
        else:
            index = was[change.before.name]
        if index is None:
            rows.append(fresh_row(state, item, label))
        else:
            obj = changed_object(state.scene.objects[index], item, change)
            obj = appearing(obj, item, state.edited.file)
            cuts = sections_of(item, obj.model, state.edited.file.sections)
            obj = obj if obj.sections == cuts else replace(obj, sections=cuts)
            rows.append((obj, state.filed[index], state.sweeps[index], state.sources[index]))
            moved[index] = number
    state.reorder_rows(rows, moved)
    if any(
        {"visible"} & change.fields or None in (change.before, change.after) for change in changed
    ):
        state.reframe()
    if state.chosen in [each.before.name for each in changed if each.before and not each.after]:
        state.chosen = ""


def fresh_row(
    state: EditorState, item: SceneItem, label: int
) -> tuple[SceneObject, object, Sweep, Source]:
    """What the state holds of an object that was not there."""
    source = state.edited.source(item)
    obj = object_of(item, state.in_palette(source.model), label, state.edited.file)
    sweep = Sweep.over(source.model.blend)
    sweep.resume_at(item.x)
    return obj, source.model, sweep, source


def changed_object(obj: SceneObject, item: SceneItem, change: Change | None) -> SceneObject:
    """An object that is there already, with what was edited."""
    if change is None:
        return obj
    values: dict = {"name": item.name, "visible": item.visible, "selectors": item.selectors}
    if change.fields & {"position", "wxyz"}:
        values["world_from_object"] = item.pose
    if "x" in change.fields:
        values["x"] = item.x
    return replace(obj, **values)


def appearing(obj: SceneObject, item: SceneItem, file: SceneFile) -> SceneObject:
    """The object with the appearance that the file gives it; the very same where it has it."""
    appearance = item.appearance.under(file.appearance)
    return obj if obj.appearance == appearance else replace(obj, appearance=appearance)


def steer(state: EditorState, index: int, x: Control) -> None:
    """A hand moves x: where the object starts as well, unless the world is running.

    It is a look and no edit: undoing leaves it as it is.
    """
    obj = state.scene.objects[index]
    state.set_x(index, x)
    if not state.running and edits.find(state.edited.file, obj.name) is not None:
        history = state.edited.history
        state.edited.history = history.amend(edits.set_x(history.file, obj.name, x))
        state.bodies.follow(state.edited)


def steer_by_hand(state: EditorState, index: int, x: float) -> None:
    """The same by a slider, a key or a number: what played stops, and keys go on with this one."""
    chain = state.chain.of(state.scene, index)
    state.steered = state.scene.objects[chain[0]].name
    for each in chain:
        state.sweeps[each].playing = False
        steer(state, each, x)


def steer_chain(state: EditorState, index: int, x: Control) -> None:
    """The same of an object and all that goes along with it."""
    for each in state.chain.of(state.scene, index):
        steer(state, each, x)


def unchain(state: EditorState, index: int) -> None:
    """From now on an object has a slider of its own."""
    state.chain.loose.add(state.scene.objects[index].name)


def rejoin(state: EditorState, index: int) -> None:
    """An object goes along with its scene again, from where that is."""
    leader = leader_of(state.scene)
    if leader is not None:
        state.chain.loose.discard(state.scene.objects[index].name)
        state.sweeps[index].playing = False
        state.shifts.pop(index, None)
        steer(state, index, state.scene.objects[leader].x)


def steered_index(state: EditorState) -> int | None:
    """The object whose x the arrow keys move: the chosen one, else the one moved last."""
    movable = state.movable
    names = [state.scene.objects[index].name for index in movable]
    for name in (state.chosen, state.steered):
        if name in names:
            return movable[names.index(name)]
    return movable[0] if movable else None


def step_x(state: EditorState, steps: int) -> None:
    """The arrow keys: hundredths of x to the right, or left."""
    if (index := steered_index(state)) is not None:
        steer_by_hand(state, index, stepped(state.scene.objects[index].slider_x, steps))


def step_stop(state: EditorState, direction: int) -> None:
    """To the nearest stop above (1) or below (-1)."""
    if (index := steered_index(state)) is not None:
        stops = state.stops(index)
        x = next_stop(stops, state.scene.objects[index].slider_x, direction)
        numbers = [number for number, stop in enumerate(stops) if stop.x == x]
        if numbers:
            go_to_stop(state, index, numbers[0])


def go_to_stop(state: EditorState, index: int, number: int) -> None:
    """One object goes to a stop, counted from 0 by x; the arrow keys go on with that object."""
    state.steered = state.scene.objects[index].name
    leave_for_stop(state, index, number)


def all_go_to_stop(state: EditorState, number: int) -> None:
    """Every object that has a stop of that number, counted from 0, goes there."""
    followers = state.chain.followers(state.scene)
    for index in range(len(state.scene.objects)):
        if index not in followers:
            leave_for_stop(state, index, number)


def leave_for_stop(state: EditorState, index: int, number: int) -> None:
    """Straight there, to rest, with all that goes along; where they start is there at once."""
    chain = state.chain.of(state.scene, index)
    obj, stops = state.scene.objects[chain[0]], state.stops(index)
    if number >= len(stops):
        return
    for each in chain:
        state.sweeps[each].playing = False
    if (end := stops[number].x) != obj.x:
        for each in chain:
            steer(state, each, end)
            state.set_x(each, obj.x)
        state.shifts[chain[0]] = Shift(obj.x, end, obj.model.blend)


def place(state: EditorState, index: int, pose: Pose) -> None:
    """A hand moves an object: where it starts as well, unless the world is running."""
    name = state.scene.objects[index].name
    file = edits.set_pose(state.edited.file, name, pose)
    state.move(index, edits.item_named(file, name).pose)
    if not state.running:
        history = state.edited.history
        state.edited.history = history.record(file, f"move {name}", f"place {name}")
        state.bodies.follow(state.edited)


def as_it_stands(state: EditorState) -> SceneFile:
    """The file with everything where it is now, at its x.  ValueError for what has flown off."""
    file = state.edited.file
    for obj in state.scene.objects:
        file = edits.set_pose(file, obj.name, obj.world_from_object)
        file = edits.set_x(file, obj.name, obj.x)
    return file


def copy_offset(obj: SceneObject, points: np.ndarray) -> tuple[float, float, float]:
    """Metres along the world's x that a copy of points (N, 3), object frame, stands beside it."""
    if not len(points):
        return (0.0, 0.0, 0.0)
    along = points @ obj.world_from_object.matrix()[0, :3]
    low, high = np.percentile(along, (2, 98))
    return (float(COPY_BESIDE * (high - low)), 0.0, 0.0)


def stands_elsewhere(state: EditorState) -> bool:
    """Whether anything is not where it starts, or at another x."""
    items = {item.name: item for item in state.edited.file.all_items}
    for obj in state.scene.objects:
        if obj.x != items[obj.name].x or stands_elsewhere_at(obj, items[obj.name]):
            return True
    return False


def stands_elsewhere_at(obj: SceneObject, item: SceneItem) -> bool:
    """Whether one object is not where it starts."""
    pose = obj.world_from_object
    alike = abs(sum(a * b for a, b in zip(pose.wxyz, item.wxyz, strict=True)))
    return math.dist(pose.position, item.position) > MOVED_M or bool(alike < 1 - TURNED)


def poll_bodies(state: EditorState) -> bool:
    """Once a frame: a scene becomes one that can be touched; True while colliders are made."""
    bodies, before = state.bodies, state.world
    busy = bodies.poll(state.edited)
    if state.world is not before:
        state.follow_world()
    if bodies.problem:
        state.problem, bodies.problem = bodies.problem, ""
    if bodies.notes:
        notes, bodies.notes = bodies.notes, []
        state.say("\n".join(notes))
    return busy
