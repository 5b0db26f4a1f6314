"""Making objects of pieces of others, and taking junk away: each is one step of the history."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.app.editor.state.arrange import edit
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.edited_file import EditedFile, key_of
from shapeshift.app.editor.state.parts.piece import (
    MARK,
    Piece,
    check_pieces,
    name_of_piece,
    rows_by_label,
)
from shapeshift.app.editor.state.regions import Region, selector_of
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import four, three
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import BACKGROUND, FAR_M, HULLS, SceneFile, SceneItem
from shapeshift.scene.pick import anchor_places
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import IDENTITY, SceneObject
from shapeshift.scene.sections.section import SceneSection, moved_shape
from shapeshift.scene.selectors.selector import Box, HalfSpace, Painted, Selector, Sphere

STRAYS = 1.0  # percent of the anchors of a scene that may lie below its floor


@dataclass(frozen=True, eq=False)
class Taken:
    """What becomes an object of its own."""

    name: str
    rows: np.ndarray  # (A,) bool, of the object's anchors as it is shown
    visible: bool = True
    collider: str | None = HULLS


def make_object(state: EditorState, index: int, rows: np.ndarray, name: str = "object") -> str:
    """The anchors (A,) bool of object `index` become one of its own, with a body; its name.

    What it is taken from has a body from then on, too, where it is the background: things lie on
    it.  Raises BadFile, with all as it was, where that cannot be.
    """
    name = free_name_of(state, name)
    return cut(state, index, [Taken(name, rows)], np.zeros_like(rows), f"make {name}")[0]


def hide_rows(state: EditorState, index: int, rows: np.ndarray) -> str:
    """The same, hidden and without a body; its name."""
    taken = [Taken(free_name_of(state, "hidden"), rows, visible=False, collider=None)]
    return cut(state, index, taken, np.zeros_like(rows), f"hide {int(rows.sum()):,} anchors")[0]


def delete_rows(state: EditorState, index: int, rows: np.ndarray, word: str = "delete") -> None:
    """They are in no object any more, nor in what is saved."""
    cut(state, index, [], rows, f"{word} {int(rows.sum()):,} anchors")


def cut(
    state: EditorState, index: int, taken: Sequence[Taken], gone: np.ndarray, what: str
) -> list[str]:
    """Takes pieces of object `index` out of it, and what is `gone` (A,) bool away altogether.

    The objects that a package as a whole has labels of come out with them.  Returns the names of
    the pieces.  Raises BadFile, a sentence, where all is as it was.
    """
    obj = state.scene.objects[index]
    check_pieces(obj.model)
    whole = edits.item_named(state.edited.file, obj.name).part is None
    known = rows_by_label(obj.model) if whole else {}
    for pick in taken:
        known = {name: rows & ~pick.rows for name, rows in known.items()}
    taken = [*taken]
    for name, rows in known.items():
        if (rows & ~gone).any():
            name = free_name_of(state, name, {pick.name for pick in taken})
            taken.append(Taken(name, rows & ~gone, collider=None))
    kept = ~gone & ~np.any([pick.rows for pick in taken] or [gone], axis=0)
    if not any(pick.rows.any() for pick in taken) and not gone.any():
        raise BadFile("Nothing is chosen; click a thing, or draw a box around it.")
    if not kept.any():
        raise BadFile(f"That is all of '{obj.name}'; choose less of it, or delete the object.")
    before = state.regions.kept
    edited = state.edited
    names = set(edited.pieces)
    pieces: list[tuple[str, np.ndarray, np.ndarray]] = []  # name, rows and place of each
    try:
        file, rest, place = without_pieces(edited, obj, kept, bool(taken))
        pieces.append((rest, kept, place))
        for pick in taken:
            piece, place = add_piece(edited, obj, pick.rows, True)
            pieces.append((pick.name, pick.rows, place))
            file = edits.add(file, item_of_piece(edited, obj, pick, piece, place))
        heirs = dict.fromkeys([rest, *(pick.name for pick in taken)], obj.name)
        edit(state, file, what, heirs=heirs)
    except (BadFile, ValueError) as error:
        for name in set(edited.pieces) - names:
            del edited.pieces[name]
        raise BadFile(str(error)) from None
    split_regions(state, before, index, pieces)
    keep_used_pieces(edited, sum(pick.rows.nbytes for pick in taken) + kept.nbytes)
    return [pick.name for pick in taken]


def without_pieces(
    edited: EditedFile, obj: SceneObject, kept: np.ndarray, has_objects: bool
) -> tuple[SceneFile, str, np.ndarray]:
    """The file in which an object has the rows `kept` alone, what it is called then, its place.

    The one thing of a scene becomes its background once something is taken out of it.
    """
    file, item = edited.file, edits.item_named(edited.file, obj.name)
    parent = edited.pieces.get(item.model)
    piece, place = add_piece(edited, obj, kept, parent is not None and parent.is_object)
    rest = replace(
        item, model=piece.name, part=None, placed=True, **standing(obj, place),
        selectors=split_selectors(item.selectors, kept, place),
        sections=split_sections(item.sections, place),
    )  # fmt: skip
    alone = len(file.all_items) == 1 and not (item.reactions or item.states or item.two_axes)
    becomes = item is file.background or (has_objects and alone)
    if becomes:
        collider = rest.collider or (HULLS if has_objects else None)  # things are to lie on it
        rest = replace(rest, name=BACKGROUND, static=True, collider=collider)
        rest = replace(rest, mass_kg=SceneItem.mass_kg, ring=False)
        items = tuple(one for one in file.items if one is not item)
        file = replace(file, items=items, background=rest)
        if has_objects and file.floor_y is None:  # what is thrown off it falls no farther
            file = edits.ground(file, lowest_m(obj))
        return file, rest.name, place
    items = tuple(rest if one is item else one for one in file.items)
    return replace(file, items=items), rest.name, place


def lowest_m(obj: SceneObject) -> float:
    """Metres: how low an object reaches in the world, a few strays aside."""
    matrix = obj.world_from_object.matrix()
    heights = anchor_places(obj.model) @ matrix[1, :3] + matrix[1, 3]
    return float(np.clip(np.nanpercentile(heights, STRAYS), -FAR_M, FAR_M))


def add_piece(
    edited: EditedFile, obj: SceneObject, rows: np.ndarray, is_object: bool
) -> tuple[Piece, np.ndarray]:
    """Rows (A,) bool of an object, as it is shown, as a piece of what was read for it.

    And where the piece's zero lies in the object's frame, (3,) metres.
    """
    item = edits.item_named(edited.file, obj.name)
    parent = edited.pieces.get(item.model)
    base, start, of = edited.source(item), np.zeros(3), key_of(item)
    if parent is not None:
        base, start, of = parent.base, np.array(parent.place), parent.key
        of_base = np.zeros(len(parent.rows), bool)
        of_base[np.flatnonzero(parent.rows)[rows]] = True
        rows = of_base
    number = 1 + max((int(name.rsplit(MARK, 1)[1]) for name in edited.pieces), default=0)
    piece = Piece(base, rows, is_object, name_of_piece(base.path, number), of)
    edited.pieces[piece.name] = piece
    return piece, np.array(piece.place) - start


def standing(obj: SceneObject, place: np.ndarray) -> dict:
    """Fields of an item that begins at `place` (3,) of an object's frame, as that is now."""
    position = obj.world_from_object.matrix() @ np.append(place, 1.0)
    return {
        "position": three(np.round(position[:3], edits.DECIMALS)),
        "wxyz": four(obj.world_from_object.wxyz),
        "x": obj.x,
    }


def item_of_piece(
    edited: EditedFile, obj: SceneObject, pick: Taken, piece: Piece, place: np.ndarray
) -> SceneItem:
    """The item of the file for what is taken out of an object, where it is now and at its x."""
    item = edits.item_named(edited.file, obj.name)
    return SceneItem(
        name=pick.name,
        model=piece.name,
        mode=item.mode,
        up=item.up,
        flip=item.flip,
        **standing(obj, place),
        visible=pick.visible and obj.visible,
        appearance=item.appearance,
        selectors=split_selectors(item.selectors, pick.rows, place),
        sections=split_sections(item.sections, place),
        collider=pick.collider,
    )


def split_sections(
    sections: tuple[SceneSection, ...], place: np.ndarray
) -> tuple[SceneSection, ...]:
    """Those of an object for a piece of it, whose frame begins at `place` (3,)."""
    piece_from_object = Pose(-place, IDENTITY.wxyz)
    return tuple(
        replace(one, shape=moved_shape(one.shape, piece_from_object))
        if one.space == "object"
        else one
        for one in sections
    )


def split_selectors(
    selectors: tuple[Selector, ...], rows: np.ndarray, place: np.ndarray
) -> tuple[Selector, ...]:
    """Those of an object for some rows (A,) bool of it, whose frame begins at `place` (3,)."""
    out = []
    for one in selectors:
        if isinstance(one, Painted):
            one = replace(one, weight=one.weight[rows])
        elif one.space == "object" and isinstance(one, Box | Sphere):
            one = replace(one, centre=three(np.array(one.centre) - place))
        elif one.space == "object" and isinstance(one, HalfSpace):
            one = replace(one, point=three(np.array(one.point) - place))
        out.append(one)
    return tuple(out)


def split_regions(
    state: EditorState, before: tuple[Region, ...], index: int,
    pieces: Sequence[tuple[str, np.ndarray, np.ndarray]],
) -> None:  # fmt: skip
    """The regions of object `index`, as they were, for its pieces: all looks as it did.

    pieces: name, rows (A,) bool and place (3,) of each, what is left of the object first.
    """
    names = [obj.name for obj in state.scene.objects]
    view = state.first_view((640, 360))
    out: list[Region] = []
    for region in before:
        if region.index != index:
            out.append(region)
            continue
        for number, (name, rows, place) in enumerate(pieces):
            own = replace(
                region, index=names.index(name), centre=region.centre - place,
                painted=None if region.painted is None else region.painted[rows],
            )  # fmt: skip
            places = anchor_places(state.scene.objects[own.index].model)
            if not number:
                out.append(own)
            elif np.any(selector_of(own, view).weights(places) > 0):
                out.append(replace(own, name=f"{region.name} of {name}"))
    if tuple(out) != state.regions.kept:
        state.regions.restore(tuple(out))
        state.edited.amend_regions(state.regions)


def keep_used_pieces(edited: EditedFile, step_bytes: int) -> None:
    """Forgets pieces that no step of the history has, and gives back what is not shown."""
    history = edited.history
    step = replace(history.steps[history.at], bytes=step_bytes)
    steps = (*history.steps[: history.at], step, *history.steps[history.at + 1 :])
    edited.history = replace(history, steps=steps)
    used = {item.model for each in steps for item in each.file.all_items}
    used |= {item.model for item in edited.saved.all_items}
    shown = {item.model for item in edited.file.all_items}
    edited.pieces = {name: piece for name, piece in edited.pieces.items() if name in used}
    for name, piece in edited.pieces.items():
        if name not in shown:
            piece.forget()


def free_name_of(state: EditorState, wanted: str, more: set[str] | None = None) -> str:
    """A name that no object has: "object", "object 2", ..."""
    taken = {item.name for item in state.edited.file.all_items} | (more or set())
    return edits.free_name(taken, wanted)
