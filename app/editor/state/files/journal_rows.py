"""Steps of a history as rows of JSON, and back: what a journal has in it.

A row is written once, however many steps have it: an edit leaves what it does not touch the very
same object.
"""

import base64
import binascii
import zlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from shapeshift.app.editor.state.files.edited_file import (
    NO_MARKS,
    EditedFile,
    ModelKey,
    key_of,
)
from shapeshift.app.editor.state.files.opened import Source
from shapeshift.app.editor.state.parts.piece import Piece
from shapeshift.app.editor.state.regions import KINDS, Region
from shapeshift.app.film.window.timeline import FilmKeys, Timeline
from shapeshift.runtime_models.files.json_fields import Fields, control_row, is_count
from shapeshift.runtime_models.model import AnchorModel, BadFile, SplatLayers
from shapeshift.scene.document.edits import HistoryStep
from shapeshift.scene.document.read_scene_file import read_background, read_head, read_item
from shapeshift.scene.document.scene_file import SceneFile, SceneItem
from shapeshift.scene.document.write_scene_file import background_item_row, head_row, item_row
from shapeshift.scene.film.film_path import film_of, film_rows
from shapeshift.scene.film.style_path import WrittenKey
from shapeshift.scene.inspection.length_marks import length_row
from shapeshift.scene.inspection.marks_file import MarksFile, marks_of, marks_rows

WHERE = "the journal"
MOST_ROWS_OF_MODEL = 1 << 30  # anchors of one model
SMALL = 256  # objects that are kept in any case


class RowWriter:
    """Numbers rows; those that were not there before are `fresh` until somebody has them."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[object, int]] = {}  # by id: the object, kept alive, its number
        self._next = self._wanted = 0
        self.fresh: dict[int, Any] = {}

    def number(self, thing: object, row: Callable[[], Any]) -> int:
        """The number of an object's row."""
        found = self._known.get(id(thing))
        if found is None:
            made = row()
            found = self._known[id(thing)] = (thing, self._next)
            self.fresh[self._next] = made
            self._next += 1
        return found[1]

    @property
    def is_large(self) -> bool:
        """Whether so many objects are kept that it is time to let go of what no step has."""
        return len(self._known) > 2 * self._wanted + SMALL

    def forget_but(self, wanted: set[int]) -> None:
        """Lets objects go by their ids; a row that comes again is written again."""
        self._known = {key: row for key, row in self._known.items() if key in wanted}
        self._wanted = len(self._known)


def step_row(writer: RowWriter, edited: EditedFile, step: HistoryStep) -> dict[str, Any]:
    """A step, its parts as numbers of rows."""
    file, background = step.file, step.file.background
    pieces = [edited.pieces[item.model] for item in file.all_items if item.model in edited.pieces]
    row: dict[str, Any] = {
        "what": step.what,
        "head": head_row(file),
        "objects": [
            writer.number(item, lambda item=item: item_row(item, file, file.folder))
            for item in file.items
        ],
        "regions": [writer.number(r, lambda r=r: region_row(r)) for r in step.regions],
        "pieces": [writer.number(p, lambda p=p: piece_row(p)) for p in pieces],
    }
    if background is not None:
        own = lambda: background_item_row(background, file, file.folder)  # noqa: E731
        row["background"] = writer.number(background, own)
    if isinstance(step.marks, MarksFile) and step.marks is not NO_MARKS:
        marks = step.marks
        row["marks"] = writer.number(marks, lambda: _marks_row(writer, marks))
    if isinstance(step.film, FilmKeys) and (step.film.cameras or step.film.stops):
        film = step.film
        row["film"] = writer.number(film, lambda: _film_row(film))
    return row


def things_of(edited: EditedFile, step: HistoryStep) -> set[int]:
    """Ids of all that has a row in a step."""
    found = {id(item) for item in step.file.all_items} | {id(r) for r in step.regions}
    found |= {id(edited.pieces.get(item.model)) for item in step.file.all_items}
    if isinstance(step.marks, MarksFile):
        found |= {id(mark) for mark in (*step.marks.marks, *step.marks.lengths)}
    return found | {id(step.marks), id(step.film)}


def _marks_row(writer: RowWriter, file: MarksFile) -> dict[str, Any]:
    head = marks_rows(replace(file, marks=(), lengths=()))
    marks = [
        writer.number(m, lambda m=m: marks_rows(MarksFile((m,)))["marks"][0]) for m in file.marks
    ]
    lengths = [writer.number(each, lambda each=each: length_row(each)) for each in file.lengths]
    return {"head": head, "marks": marks, "lengths": lengths}


def _film_row(keys: FilmKeys) -> dict[str, Any]:
    stops = [[key.word, key.at] for key in keys.stops]
    return film_rows(replace(keys, stops=()).path((0.0, 0.0, 0.0))) | {"stops": stops}


def region_row(region: Region) -> dict[str, Any]:
    row: dict[str, Any] = {
        "kind": region.kind, "name": region.name, "index": region.index,
        "enabled": region.enabled, "x": control_row(region.x), "border": float(region.border),
        "centre": region.centre.tolist(), "half": region.half.tolist(),
        "normal": region.normal.tolist(), "tangent": float(region.tangent),
    }  # fmt: skip
    return row if region.painted is None else row | {"painted": packed(region.painted)}


def piece_row(piece: Piece) -> dict[str, Any]:
    return {
        "name": piece.name, "of": list(piece.key), "is_object": piece.is_object,
        "rows": packed(piece.rows),
    }  # fmt: skip


def packed(rows: np.ndarray) -> dict[str, Any]:
    """(A,) bool as a short text."""
    text = base64.b85encode(zlib.compress(np.packbits(rows).tobytes(), 1)).decode()
    return {"count": len(rows), "bits": text}


def unpacked(row: Fields, key: str) -> np.ndarray:
    """(A,) bool of `packed`.  Raises BadFile."""
    found = row.object(key)
    count = found.count("count", 0, MOST_ROWS_OF_MODEL)
    try:
        unzip = zlib.decompressobj()
        bits = unzip.decompress(base64.b85decode(found.text("bits")), (count + 7) // 8 + 1)
    except (ValueError, zlib.error, binascii.Error):
        raise row.error(key, "packed bits") from None
    if len(bits) != (count + 7) // 8:
        raise row.error(key, f"{count:,} packed bits")
    return np.unpackbits(np.frombuffer(bits, np.uint8), count=count).astype(bool)


class RowReader:
    """Objects of rows by their numbers, each made once; where a row says what `edited` had when it
    was opened, it is that very object: then nothing has been edited.
    """

    def __init__(self, rows: Mapping[int, Any], edited: EditedFile) -> None:
        self._rows, self._made = rows, dict[tuple[str, int], Any]()
        self.edited, saved = edited, edited.saved
        self._opened = [(item_row(item, saved, saved.folder), item) for item in saved.items]
        if saved.background is not None:
            row = background_item_row(saved.background, saved, saved.folder)
            self._opened.append((row, saved.background))
        self.pieces: dict[str, tuple[ModelKey, np.ndarray, bool]] = {}

    def _row(self, number: object) -> Any:
        if not (is_count(number) and number in self._rows):
            raise BadFile(f"{WHERE} has no row {number}.")
        return self._rows[number]

    def _each(self, kind: str, number: Any, make: Callable[[Any], Any]) -> Any:
        key = (kind, number if is_count(number) else -1)
        if key not in self._made:
            self._made[key] = make(self._row(number))
        return self._made[key]

    def step(self, row: Mapping[str, Any], folder: Path) -> HistoryStep:
        """The step that a row says.  Raises BadFile."""
        fields = Fields(row, WHERE)
        head = read_head(Fields({k: v for k, v in row.get("head", {}).items()}, WHERE))
        items = tuple(
            self._each("item", n, lambda r: self._item(r, False))
            for n in fields.typed("objects", list)
        )
        background = fields.value("background", None)
        if background is not None:
            background = self._each("background", background, lambda r: self._item(r, True))
        saved = self.edited.saved
        file = SceneFile(folder=folder, items=items, background=background, **head)
        if file == saved:
            file = saved
        for number in fields.typed("pieces", list, []):
            self._each("piece", number, self._piece)
        regions = (self._each("region", n, _region) for n in fields.typed("regions", list, []))
        marks, film = fields.value("marks", None), fields.value("film", None)
        return HistoryStep(
            file, fields.text("what", ""), regions=tuple(regions),
            film=self._each("film", film, self._film) if film is not None else None,
            marks=self._each("marks", marks, self._marks) if marks is not None else NO_MARKS,
        )  # fmt: skip

    def _item(self, row: Any, background: bool) -> SceneItem:
        for known, item in self._opened:
            if known == row:
                return item
        fields = Fields(row, WHERE)
        return read_background(fields) if background else read_item(fields, WHERE)

    def _marks(self, row: Any) -> MarksFile:
        fields, saved = Fields(row, WHERE), self.edited.saved_marks
        lists = {
            key: [self._row(n) for n in fields.typed(key, list)] for key in ("marks", "lengths")
        }
        data = {**dict(fields.object("head").data), **lists}
        if not data["lengths"]:
            del data["lengths"]
        return saved if data == marks_rows(saved) else marks_of(data, WHERE)

    def _film(self, row: Any) -> FilmKeys:
        saved = self.edited.saved_film
        if isinstance(saved, FilmKeys) and _film_row(saved) == row:
            return saved
        data = dict(Fields(row, WHERE).data)
        stops, timeline = data.pop("stops", []), Timeline()
        timeline.take_over(film_of(data, WHERE, cameras=0), (0.0, 0.0, 0.0))
        try:
            made = tuple(WrittenKey(str(word), float(at)) for word, at in stops)
        except (TypeError, ValueError):
            raise BadFile(f"{WHERE}: a film's stops are words with seconds.") from None
        return replace(timeline.keys, stops=made)

    def _piece(self, row: Any) -> None:
        fields = Fields(row, WHERE)
        of = fields.typed("of", list)
        kinds = (str, str, str, bool, int | str | None)
        if len(of) != 5 or not all(map(isinstance, of, kinds)):
            raise fields.error("of", "what names a model")
        rows, is_object = unpacked(fields, "rows"), fields.flag("is_object")
        self.pieces[fields.line("name")] = tuple(of), rows, is_object

    def models_wanted(self, step: HistoryStep) -> set[ModelKey]:
        """Keys of the models that a step has, also by a piece; of those nothing is read yet."""
        found = set()
        for item in step.file.all_items:
            piece = self.pieces.get(item.model)
            found.add(key_of(item) if piece is None else piece[0])
        return found

    def piece(self, name: str, sources: Mapping[ModelKey, Source]) -> Piece:
        """A piece of what was read.  Raises BadFile where that is not what it was cut from."""
        key, rows, is_object = self.pieces[name]
        base = sources[key]
        model = base.model
        assert isinstance(model, AnchorModel | SplatLayers), "others have no parts"
        count = len(model.means if isinstance(model, SplatLayers) else model.anchors)
        if count != len(rows):
            raise BadFile(
                f"{base.path.name} has {count:,} anchors, and {len(rows):,} when it was cut; "
                "bring that file back."
            )
        return Piece(base, rows, is_object, name, key)


def _region(row: Any) -> Region:
    fields = Fields(row, WHERE)
    kind = fields.line("kind", known=KINDS)
    painted = unpacked(fields, "painted") if fields.has("painted") else None
    places = {name: np.array(fields.numbers(name, 3)) for name in ("centre", "half", "normal")}
    return Region(
        kind, fields.line("name"), fields.count("index", 0, 1 << 20), fields.flag("enabled"),
        fields.control("x"), fields.number("border"), **places,
        tangent=fields.number("tangent"), painted=painted,
    )  # fmt: skip
