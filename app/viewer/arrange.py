"""Edits of what the stage shows: the file, its history, the world and the scene change together."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.viewer.document import key_of
from shapeshift.app.viewer.track import next_stop, stepped
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.control import Sweep
from shapeshift.scene.document import edits
from shapeshift.scene.document.edits import Change, History
from shapeshift.scene.document.scene_file import SceneFile, SceneItem, labelled, object_of
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import SceneObject

if TYPE_CHECKING:
    from shapeshift.app.viewer.opened import Source
    from shapeshift.app.viewer.stage import Stage

LOOKS = {"model", "mode", "up", "flip"}  # fields that ask for another model
MOVED_M, TURNED = 1e-4, 1e-6  # metres, 1 - cosine of half the angle: less is not told
COPY_BESIDE = 1.1  # of an object's width: how far off its copy stands


def edit(stage: "Stage", file: SceneFile, what: str, together: str = "") -> None:
    """Takes an edited file over.  Raises BadFile, with all as it was, where it cannot be so."""
    record_regions(stage)
    turn_to(stage, stage.document.history.take(file, what, together))
    amend_regions(stage)


def undo(stage: "Stage") -> str:
    """Takes the last edit back; returns what it was, "" where there was none.

    Looks are no edits: the camera and every slider stay where they are.
    """
    record_regions(stage)
    what = stage.document.history.undoes
    go_back(stage, stage.document.history.undo())
    return what


def redo(stage: "Stage") -> str:
    record_regions(stage)
    what = stage.document.history.redoes
    go_back(stage, stage.document.history.redo())
    return what


def go_back(stage: "Stage", history: History) -> None:
    """Goes to a step that has been before, with every x as it is now."""
    now = stage.document.history
    turn_to(stage, history.amend(edits.with_x_of(history.file, now.file)))
    if history.regions != now.regions:
        stage.regions.restore(history.regions)
        for index, thing in enumerate(stage.scene.objects):
            stage.regions.fit_painted(index, thing)
    amend_regions(stage)


def record_regions(stage: "Stage") -> None:
    """Makes what was done to the regions since the last call a step of the history."""
    regions, history = stage.regions, stage.document.history
    if not regions.did:
        amend_regions(stage)
        return
    stage.document.history = history.take(
        history.file, regions.did, regions.together, regions.kept, regions.bytes
    )
    regions.did = ""


def amend_regions(stage: "Stage") -> None:
    """Takes regions over that nobody's hand has changed: their objects have."""
    history = stage.document.history
    stage.document.history = history.amend(history.file, stage.regions.kept)
    stage.regions.did = ""


def turn_to(stage: "Stage", history: History) -> None:
    """Goes to another step of the history: only what differs is touched."""
    before = stage.document.history
    stage.finish_shifts()
    stage.document.history = history
    if history.file is before.file:
        return
    changed = edits.changes(before.file, history.file)
    try:
        world = stage.world
        stage.bodies.follow(stage.document)
        arrange(stage, changed)
        if stage.world is not world:  # a new one stands at its start
            stage.follow_world()
    except BadFile:
        stage.document.history = before
        stage.bodies.follow(stage.document)
        raise


def arrange(stage: "Stage", changed: Sequence[Change]) -> None:
    """The scene's objects as the file has them now; the rest goes on as it stands."""
    of = {change.after.name: change for change in changed if change.after is not None}
    was = {thing.name: index for index, thing in enumerate(stage.scene.objects)}
    rows, moved = [], {}
    for number, (label, item) in enumerate(labelled(stage.document.file)):
        change = of.get(item.name)
        if change is None:
            index = was[item.name]
        elif change.before is None or change.fields & LOOKS:
            index = None
        else:
            index = was[change.before.name]
        if index is None:
            rows.append(fresh_row(stage, item, label))
        else:
            thing = changed_thing(stage.scene.objects[index], item, change)
            rows.append((thing, stage.filed[index], stage.sweeps[index], stage.sources[index]))
            moved[index] = number
    stage.take_rows(rows, moved)
    if any(
        {"visible"} & change.fields or None in (change.before, change.after) for change in changed
    ):
        stage.reframe()
    names = {change.before.name: change.after for change in changed if change.before}
    if stage.chosen in names:
        stage.chosen = names[stage.chosen].name if names[stage.chosen] else ""


def fresh_row(
    stage: "Stage", item: SceneItem, label: int
) -> "tuple[SceneObject, object, Sweep, Source]":
    """What the stage holds of an object that was not there."""
    source = stage.document.sources[key_of(item)]
    thing = object_of(item, stage.in_palette(source.model), label)
    sweep = Sweep.over(source.model.blend)
    sweep.resume_at(item.x)
    return thing, source.model, sweep, source


def changed_thing(thing: SceneObject, item: SceneItem, change: Change | None) -> SceneObject:
    """An object that is there already, with what was edited."""
    if change is None:
        return thing
    values: dict = {"name": item.name, "visible": item.visible, "selectors": item.selectors}
    if change.fields & {"position", "wxyz"}:
        values["world_from_object"] = item.pose
    if "x" in change.fields:
        values["x"] = item.x
    return replace(thing, **values)


def steer(stage: "Stage", index: int, x: Control) -> None:
    """A hand moves x: where the object starts as well, unless the world is running.

    It is a look and no edit: undoing leaves it as it is.
    """
    thing = stage.scene.objects[index]
    stage.set_x(index, x)
    if not stage.running and edits.find(stage.document.file, thing.name) is not None:
        history = stage.document.history
        stage.document.history = history.amend(edits.set_x(history.file, thing.name, x))
        stage.bodies.follow(stage.document)


def steer_by_hand(stage: "Stage", index: int, x: float) -> None:
    """The same by a slider, a key or a number: what played stops, and keys go on with this one."""
    stage.sweeps[index].playing = False
    stage.steered = stage.scene.objects[index].name
    steer(stage, index, x)


def steered_index(stage: "Stage") -> int | None:
    """The object whose x the arrow keys move: the chosen one, else the one moved last."""
    movable = stage.movable
    names = [stage.scene.objects[index].name for index in movable]
    for name in (stage.chosen, stage.steered):
        if name in names:
            return movable[names.index(name)]
    return movable[0] if movable else None


def step_x(stage: "Stage", steps: int) -> None:
    """The arrow keys: hundredths of x to the right, or left."""
    if (index := steered_index(stage)) is not None:
        steer_by_hand(stage, index, stepped(stage.scene.objects[index].slider_x, steps))


def step_stop(stage: "Stage", direction: int) -> None:
    """To the nearest stop above (1) or below (-1)."""
    if (index := steered_index(stage)) is not None:
        stops = stage.stops(index)
        x = next_stop(stops, stage.scene.objects[index].slider_x, direction)
        numbers = [number for number, stop in enumerate(stops) if stop.x == x]
        if numbers:
            go_to_stop(stage, index, numbers[0])


def go_to_stop(stage: "Stage", index: int, number: int) -> None:
    """One object goes to a stop, counted from 0 by x; the arrow keys go on with that object."""
    stage.steered = stage.scene.objects[index].name
    stage.go_to_stop(number, index)


def place(stage: "Stage", index: int, pose: Pose) -> None:
    """A hand moves an object: where it starts as well, unless the world is running."""
    name = stage.scene.objects[index].name
    file = edits.place(stage.document.file, name, pose)
    stage.move(index, edits.wanted(file, name).pose)
    if not stage.running:
        history = stage.document.history
        stage.document.history = history.take(file, f"move {name}", f"place {name}")
        stage.bodies.follow(stage.document)


def as_it_stands(stage: "Stage") -> SceneFile:
    """The file with everything where it is now, at its x.  ValueError for what has flown off."""
    file = stage.document.file
    for thing in stage.scene.objects:
        file = edits.place(file, thing.name, thing.world_from_object)
        file = edits.set_x(file, thing.name, thing.x)
    return file


def copy_offset(thing: SceneObject, points: np.ndarray) -> tuple[float, float, float]:
    """Metres along the world's x that a copy of points (N, 3), object frame, stands beside it."""
    if not len(points):
        return (0.0, 0.0, 0.0)
    along = points @ thing.world_from_object.matrix()[0, :3]
    low, high = np.percentile(along, (2, 98))
    return (float(COPY_BESIDE * (high - low)), 0.0, 0.0)


def stands_elsewhere(stage: "Stage") -> bool:
    """Whether anything is not where it starts, or at another x."""
    items = {item.name: item for item in stage.document.file.all_items}
    for thing in stage.scene.objects:
        item, pose = items[thing.name], thing.world_from_object
        if thing.x != item.x or math.dist(pose.position, item.position) > MOVED_M:
            return True
        if abs(sum(a * b for a, b in zip(pose.wxyz, item.wxyz, strict=True))) < 1 - TURNED:
            return True
    return False
