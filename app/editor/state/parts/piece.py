"""Pieces of what was read: rows of a model that an object of the scene has, before they are saved.

A scene file knows them as parts of a labelled model; until one is written, each piece has a name of
its own that stands for a path.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from shapeshift.app.editor.state.files.opened import Source
from shapeshift.runtime_models.model import (
    AnchorModel,
    BadFile,
    Model,
    ObjectLabel,
    ScaffoldModel,
    SplatLayers,
)
from shapeshift.runtime_models.parts import BACKGROUND, Place, part_of

OBJECT = 1  # any label above 0: part_of gives such rows a frame of their own
MARK = "#"  # in the name of a piece, which no path of a file needs to be read


@dataclass(frozen=True, eq=False)
class Piece:
    """Some anchors of a model that was read (of plain splats some splats)."""

    base: Source
    rows: np.ndarray  # (A,) bool, of the model as it was read
    is_object: bool  # in a frame of its own, as parts are; else in that of the model
    name: str  # that stands for its model in the scene file, until it is saved
    key: tuple = ()  # of the model as a scene file has it: path, mode, up, flip, part
    _made: list[tuple[Source, Place]] = field(default_factory=list)

    @property
    def place(self) -> Place:
        """Metres: where the piece's zero lies in the model."""
        return self._part()[1]

    @property
    def source(self) -> Source:
        """The piece as if it had been opened; the bytes of its file count once, for the rest."""
        return self._part()[0]

    def forget(self) -> None:
        """Gives its memory back; it is made again when it is asked for."""
        self._made.clear()

    def _part(self) -> tuple[Source, Place]:
        if not self._made:
            label = OBJECT if self.is_object else BACKGROUND
            model, place = part_of(labelled(self.base.model, self.rows, {label: self.rows}), label)
            facts = self.base.facts | ({"bytes": 0} if self.is_object else {})
            source = replace(self.base, model=without_labels(model), facts=facts)
            self._made.append((source, place))
        return self._made[0]


def labelled(model: Model, kept: np.ndarray, rows_of: dict[int, np.ndarray]) -> Model:
    """The rows (A,) bool of a model, labelled: `rows_of` has (A,) bool of each label."""
    labels = np.zeros(len(kept), np.int32)
    for label, rows in rows_of.items():
        labels[rows] = label
    if isinstance(model, SplatLayers):
        return replace(model.with_rows(kept), labels=labels[kept])
    assert isinstance(model, AnchorModel), "check_pieces refuses others"
    few = replace(model, labels=None, objects=()).with_anchors(kept)
    objects = tuple(ObjectLabel(label, f"object {label}") for label in rows_of if label)
    return replace(few, labels=labels[kept].astype(np.uint8), objects=objects)


def without_labels(model: Model) -> Model:
    """What an object of a scene is alone."""
    if isinstance(model, AnchorModel):
        return replace(model, labels=None, objects=())
    assert isinstance(model, SplatLayers), "check_pieces refuses others"
    return replace(model, labels=None)


def rows_by_label(model: Model) -> dict[str, np.ndarray]:
    """(A,) bool by name of each object that a whole model has labels of; the background's is no."""
    labels = model.labels if isinstance(model, AnchorModel | SplatLayers) else None
    if labels is None:
        return {}
    objects = model.objects if isinstance(model, AnchorModel) else ()
    names = {each.label: each.name for each in objects}
    found = [int(n) for n in np.unique(labels) if n != BACKGROUND]
    return {names.get(n, f"object {n}"): labels == n for n in found}


def check_pieces(model: Model) -> None:
    """Raises BadFile, one sentence, for a model that has no parts."""
    if isinstance(model, ScaffoldModel):
        raise BadFile(
            "A Scaffold-GS model has no parts, because its splats depend on the eye; export it as "
            "plain splats, or train a package of the same photos."
        )
    if isinstance(model, SplatLayers) and "level" in model.provenance:
        raise BadFile("A streamed scene has no parts, because only some of its detail is read.")


def name_of_piece(path: Path, number: int) -> str:
    """What stands for a path until there is one."""
    return f"{path.name}{MARK}{number}"
