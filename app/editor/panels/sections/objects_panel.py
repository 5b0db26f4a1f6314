"""The panel's section "Objects": the list, what of the chosen one can be edited, the floor."""

from collections.abc import Callable

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import (
    button_row,
    choice,
    item_label,
    right_aligned,
    slider,
    tip,
)
from shapeshift.app.editor.state.arrange import place, stands_elsewhere
from shapeshift.app.editor.state.editor_state import HANDLES, EditorState
from shapeshift.app.editor.state.files.saving import Saving
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.state.object_edits import ObjectEdits
from shapeshift.app.editor.texts.table import said, said_deed
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import BACKGROUND, FAR_M, HULLS, SceneItem
from shapeshift.scene.four_views import FOUR_VIEWS, has_objects
from shapeshift.scene.pose import Pose

Vec = imgui.ImVec2
MOST_ROWS = 8  # of the list that are seen at once
MASSES = (0.05, 5.0)  # kilograms, between which the physics holds them
NONE = "none"  # as a collider
_, MOVE, TURN = HANDLES
MODES = {MOVE: "Move", TURN: "Turn"}
FOUR_VIEW_NAMES = {
    "full": "everything",
    "overlay": "objects in colours",
    "background": "without objects",
    "isolated": "objects alone",
}
DEEDS = {
    "Add": "Another file or folder as an object of this scene.",
    "Copy": "The chosen object once more, beside it. Ctrl+D.",
    "Delete": "The chosen object. Key Delete; Ctrl+Z brings it back.",
}


def draw_objects(
    objects: ObjectEdits, saving: Saving, ask_to_add: Callable[[], None], ui_scale: float
) -> None:
    """All of the section."""
    state = objects.state
    _history(objects, saving, ui_scale)
    draw_object_list(objects, ui_scale)
    clicked = button_row(DEEDS, ui_scale, 3)
    if clicked:
        deeds = {"Add": ask_to_add, "Copy": objects.duplicate, "Delete": objects.delete}
        deeds[clicked]()
    item = edits.find(state.edited.file, state.chosen)
    if item is not None and state.chosen_index is not None:
        imgui.push_item_width(-1)
        imgui.push_id(item.name)
        _chosen(objects, item, ui_scale)
        imgui.pop_id()
        imgui.pop_item_width()
    if state.world is not None:
        _scene(objects, ui_scale)


def _history(objects: ObjectEdits, saving: Saving, ui_scale: float) -> None:
    """Undo, redo, save."""
    edited = objects.state.edited
    history = edited.history
    width = (imgui.get_content_region_avail().x - 2 * imgui.get_style().item_spacing.x) / 3
    for word, what, act in (
        ("Undo", history.undoes, objects.undo),
        ("Redo", history.redoes, objects.redo),
    ):
        imgui.begin_disabled(not what)
        if imgui.button(item_label(word), Vec(width, 0)):
            act()
        imgui.end_disabled()
        if what:
            tip(said_deed(what), ui_scale)
        else:
            tip("Nothing to undo." if word == "Undo" else "Nothing to redo.", ui_scale)
        imgui.same_line()
    if imgui.button(item_label("Save" if saving.in_place else "Save\u2026"), Vec(-1, 0)):
        saving.save()
    tip("Ctrl+S writes the scene file; Ctrl+Shift+S asks for another name.", ui_scale)


def draw_object_list(objects: ObjectEdits, ui_scale: float) -> None:
    """A line an object, of a long list those that are in sight; then which of the four views."""
    count = len(objects.state.scene.objects)
    if count <= MOST_ROWS:
        for index in range(count):
            _row(objects, index, ui_scale)
        draw_four_views(objects.state, ui_scale)
        return
    line = imgui.get_frame_height_with_spacing()
    imgui.begin_child("list", Vec(0, MOST_ROWS * line))
    clipper = imgui.ListClipper()
    clipper.begin(count, line)
    while clipper.step():
        for index in range(clipper.display_start, clipper.display_end):
            _row(objects, index, ui_scale)
    clipper.end()
    imgui.end_child()
    draw_four_views(objects.state, ui_scale)


def draw_four_views(state: EditorState, ui_scale: float) -> None:
    """Full, overlay, background, isolated; nothing where there are no objects to tell apart."""
    look = state.shown_scene
    if not has_objects(state.scene):
        return
    imgui.push_item_width(-1)
    names = [said("view: {what}", what=said(FOUR_VIEW_NAMES[show])) for show in FOUR_VIEWS]
    look.show = choice("four views", look.show, FOUR_VIEWS, names)
    tip("How objects are looked at; it changes nothing, and is not saved. Key I.", ui_scale)
    imgui.pop_item_width()


def _row(objects: ObjectEdits, index: int, ui_scale: float) -> None:
    """Seen or not, the name that chooses it, its x."""
    state = objects.state
    if index >= len(state.scene.objects):
        return
    obj = state.scene.objects[index]
    item = edits.find(state.edited.file, obj.name)
    doubt = item.doubt if item is not None else ""
    imgui.push_id(index)
    changed, seen = imgui.checkbox("##seen", obj.visible)
    tip("Seen or hidden; a hidden object is touched as before.", ui_scale)
    if changed:
        word = "show" if seen else "hide"
        objects.edit(edits.hide, obj.name, not seen, what=f"{word} {obj.name}")
    imgui.same_line()
    chosen = obj.name == state.chosen
    ink = theme.ACCENT if chosen else theme.TEXT if obj.visible else theme.MUTED
    ink = theme.WARNING if doubt and not chosen else ink
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*ink, 1))
    width = imgui.get_content_region_avail().x - 56 * ui_scale
    if imgui.selectable(f"{obj.name}###name", chosen, 0, Vec(width, 0))[0]:
        state.chosen = "" if chosen else obj.name
    imgui.pop_style_color()
    splats = number(obj.model.splat_count)
    told = said("{name}: {count} splats", name=obj.name, count=splats)
    tip(f"{told}\n{doubt}" if doubt else told, ui_scale)
    imgui.same_line()
    right_aligned(f"x {obj.slider_x:.2f}")
    imgui.pop_id()


def _chosen(objects: ObjectEdits, item: SceneItem, ui_scale: float) -> None:
    """Name, what speaks against it, handles, place and body of the chosen object."""
    if item.name != BACKGROUND:
        _rename(objects, item, ui_scale)
    if item.doubt:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.WARNING, 1))
        imgui.text_wrapped(item.doubt)
        imgui.pop_style_color()
    gap, room = imgui.get_style().item_spacing.x, imgui.get_content_region_avail().x
    for mode, word in MODES.items():
        lit = objects.state.handles == mode
        if lit:
            imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.ACCENT, 1))
        if imgui.button(item_label(word), Vec((room - gap) / 2, 0)):
            objects.state.handles = "" if lit else mode
        if lit:
            imgui.pop_style_color()
        tip("Handles on the object in the picture. Key M.", ui_scale)
        if mode == MOVE:
            imgui.same_line()
    _place(objects, ui_scale)
    _body(objects, item, ui_scale)


def _rename(objects: ObjectEdits, item: SceneItem, ui_scale: float) -> None:
    """The name, taken over by Enter or by leaving the field."""
    before, typed = objects.typed
    if before != item.name:
        objects.typed = (item.name, item.name)
        if typed != before and edits.find(objects.state.edited.file, before) is not None:
            objects.edit(edits.rename, before, typed, what=f"rename {before}")
    _, text = imgui.input_text("##name", objects.typed[1])
    objects.typed = (item.name, text)
    left = imgui.is_item_deactivated_after_edit()
    tip("Its name; Enter takes it over.", ui_scale)
    if left:
        objects.typed = ("", "")  # the name that it has then
        objects.edit(edits.rename, item.name, text, what=f"rename {item.name}")


def _place(objects: ObjectEdits, ui_scale: float) -> None:
    """Metres, as numbers to drag; a double click types them."""
    state = objects.state
    index = state.chosen_index
    if index is None:  # renamed just now
        return
    pose = state.scene.objects[index].world_from_object
    values = [float(metres) for metres in pose.position]
    speed = 0.002 * state.radius
    moved, values = imgui.drag_float3("##place", values, speed, -FAR_M, FAR_M, "%.3f m")
    tip("Where it stands: x, y up, z. Drag, or double click to type.", ui_scale)
    if moved and np.isfinite(values).all():
        place(state, index, Pose(np.clip(np.array(values, np.float64), -FAR_M, FAR_M), pose.wxyz))


def _body(objects: ObjectEdits, item: SceneItem, ui_scale: float) -> None:
    """Whether it can be touched, whether it moves, how heavy it is."""
    found = edits.find(objects.state.edited.file, item.name)
    if found is None:  # renamed just now
        return
    item = found
    mesh = item.collider if item.collider not in (None, HULLS) else None
    kinds = [NONE, HULLS] + [mesh] * (mesh is not None)
    names = ["cannot be touched", "touched: its splats", said("touched: {mesh}", mesh=mesh)][
        : len(kinds)
    ]
    now = item.collider or NONE
    chosen = choice("collider", now, kinds, names)
    tip("What hands and other objects touch: nothing, or pieces made from its splats.", ui_scale)
    if chosen != now:
        collider = None if chosen == NONE else chosen
        objects.change(item, f"body of {item.name}", collider=collider)
    if item.collider is None or item.name == BACKGROUND:
        return
    changed, moves = imgui.checkbox(item_label("moves"), not item.static)
    if changed:
        objects.change(item, f"body of {item.name}", static=not moves)
    tip("What does not move is touched all the same: a table, a wall.", ui_scale)
    if not item.static:
        mass = slider("mass", item.mass_kg, *MASSES, "mass: %.2f kg")
        tip("How heavy it is in the hand and in collisions.", ui_scale)
        if mass != item.mass_kg:
            mass = round(mass, 3)
            objects.change(item, f"mass of {item.name}", f"mass {item.name}", mass_kg=mass)


def _scene(objects: ObjectEdits, ui_scale: float) -> None:
    """What belongs to no object: the floor, the first look, where everything starts."""
    state = objects.state
    floor_y = state.edited.file.floor_y
    changed, on = imgui.checkbox(item_label("floor"), floor_y is not None)
    tip("An endless floor that is not seen; without it what falls goes on for ever.", ui_scale)
    if changed:
        low = float(state.centre[1] - state.radius) if on else None
        objects.edit(edits.ground, low, what="floor")
    elif floor_y is not None:
        imgui.same_line()
        imgui.set_next_item_width(-1)
        speed = 0.002 * state.radius
        moved, y = imgui.drag_float("##floor", floor_y, speed, -FAR_M, FAR_M, "y %.3f m")
        tip("How high the floor lies. Drag, or double click to type.", ui_scale)
        if moved and np.isfinite(y):
            objects.edit(edits.ground, float(y), what="move the floor", together="floor")
    if stands_elsewhere(state):
        if imgui.button(item_label("Keep as it stands"), Vec(-1, 0)):
            objects.keep_standing()
        tip("Where everything is now, and its x, becomes where it starts.", ui_scale)
