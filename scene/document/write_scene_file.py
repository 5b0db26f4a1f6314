"""A scene to the JSON file of docs/scene.md: the inverse of read_scene_file."""

import json
import os
from dataclasses import fields
from pathlib import Path, PurePosixPath, PureWindowsPath

from shapeshift.runtime_models.files.json_fields import control_row
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.scene.appearance import NEUTRAL
from shapeshift.scene.document.appearance_rows import appearance_row, sky_row
from shapeshift.scene.document.scene_file import FORMAT, HULLS, FirstView, SceneFile, SceneItem
from shapeshift.scene.sections.section_texts import section_row
from shapeshift.scene.selectors.selector_texts import selector_row
from shapeshift.scene.world.reactions import Reaction

PLAIN = SceneItem(name="plain", model="plain")


def write_scene_file(file: SceneFile, path: str | Path) -> None:
    """Atomic.  What has its usual value is left out; relative paths follow to another folder."""
    write_whole(Path(path), scene_bytes(file, Path(path).parent))


def scene_bytes(file: SceneFile, folder: Path) -> bytes:
    """What is written into that folder.  ValueError for numbers that JSON has not."""
    out = head_row(file)
    if file.background:
        out["background"] = background_item_row(file.background, file, folder)
    out["objects"] = [item_row(item, file, folder) for item in file.items]
    return (json.dumps(out, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()


def head_row(file: SceneFile) -> dict:
    """What a scene says apart from its objects and its background."""
    out: dict = {"format": FORMAT, "gravity_m_s2": file.gravity_m_s2, "floor_y": file.floor_y}
    if file.view:
        out["view"] = view_row(file.view)
    if file.views:
        out["views"] = [{"name": each.name} | view_row(each.view) for each in file.views]
    if file.appearance != NEUTRAL:
        out["appearance"] = appearance_row(file.appearance)
    if file.sky:
        out["sky"] = sky_row(file.sky)
    if file.upright:
        ways = [
            {"by": way.source, "up": list(way.direction)}
            | ({} if way.sure else {"sure": False})
            | ({"things": list(way.things)} if way.things else {})
            for way in file.upright.ways
        ]
        out["up"] = {"used": file.upright.used.source, "ways": ways}
    if file.sections:
        out["sections"] = [section_row(one, "world") for one in file.sections]
    return out


def background_item_row(item: SceneItem, file: SceneFile, folder: Path) -> dict:
    """The keys of the background, which has its name and is static in any case."""
    row = item_row(item, file, folder)
    return {key: value for key, value in row.items() if key not in ("name", "static")}


def view_row(view: FirstView) -> dict:
    row: dict = {"eye": list(view.eye), "target": list(view.target), "fov_y": view.fov_y}
    for name in ("orthographic", "near_m"):
        if getattr(view, name):
            row[name] = getattr(view, name)
    return row


def item_row(item: SceneItem, file: SceneFile, folder: Path) -> dict:
    """The keys of one object."""
    row: dict = {"name": item.name, "model": moved(item.model, file.folder, folder)}
    if item.part is not None:
        row["part"] = item.part
    posed = item.placed and item.part is not None  # without one it would stand elsewhere
    if posed or (item.position, item.wxyz) != (PLAIN.position, PLAIN.wxyz):
        row["pose"] = {"position": list(item.position), "wxyz": list(item.wxyz)}
    if item.collider is not None:
        path = item.collider
        row["collider"] = path if path == HULLS else moved(path, file.folder, folder)
    for name in ("mode", "up", "flip", "x", "visible", "static", "floats", "doubt", "mass_kg",
                 "friction", "restitution", "ring"):  # fmt: skip
        if getattr(item, name) != getattr(PLAIN, name):
            row[name] = getattr(item, name)
    if "x" in row:
        row["x"] = control_row(item.x)
    if item.appearance != NEUTRAL:
        row["appearance"] = appearance_row(item.appearance)
    if item.selectors:
        row["selectors"] = [selector_row(selector) for selector in item.selectors]
    if item.sections:
        row["sections"] = [section_row(one, "object") for one in item.sections]
    if item.states:
        row["states"] = [{"name": state.name, "x": control_row(state.x)} for state in item.states]
    if item.reactions:
        row["reactions"] = [reaction_row(reaction) for reaction in item.reactions]
    if item.two_axes:
        row["two_axes"] = vars(item.two_axes)
    return row


def reaction_row(reaction: Reaction) -> dict:
    to = reaction.to if isinstance(reaction.to, str) else control_row(reaction.to)
    row: dict = {"on": reaction.on, "to": to}
    for field in fields(Reaction):
        value = getattr(reaction, field.name)
        if field.name in ("on", "to") or value == field.default:
            continue
        if field.name == "after":
            row["from"] = list(value)
        elif field.name == "region":
            region = selector_row(value)
            row["region"] = {k: v for k, v in region.items() if k not in ("x", "space")}
        else:
            row[field.name] = value
    return row


def moved(text: str, before: Path, after: Path) -> str:
    """A path of a file in one folder for a file in another; absolute ones were meant so."""
    absolute = PurePosixPath(text).is_absolute() or PureWindowsPath(text).is_absolute()
    if absolute or before.absolute() == after.absolute():
        return text
    try:
        return Path(os.path.relpath(before / text, after)).as_posix()
    except ValueError:  # on another drive of Windows there is no way between them
        return (before / text).absolute().as_posix()
