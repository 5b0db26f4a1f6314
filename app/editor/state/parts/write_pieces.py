"""Pieces that were cut in the window, written beside the scene file: packages with labels."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from shapeshift.app.editor.state.files.edited_file import EditedFile, stamp_of
from shapeshift.app.editor.state.parts.piece import Piece, labelled, without_labels
from shapeshift.app.paths import is_bundled
from shapeshift.runtime_models.model import (
    MOST_LABEL,
    AnchorModel,
    BadFile,
    Model,
    ObjectLabel,
    SplatLayers,
)
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.parts import BACKGROUND
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.scene.document.scene_file import ENDING, SceneFile, SceneItem


@dataclass
class LabelledFile:
    """One file that is to be written: pieces of one model, no two of which share a row."""

    pieces: dict[int, Piece] = field(default_factory=dict)  # by label
    names: dict[int, str] = field(default_factory=dict)  # of the objects

    @property
    def base(self) -> Model:
        return next(iter(self.pieces.values())).base.model

    @property
    def key(self) -> tuple:
        """Equal of files that hold the same."""
        return tuple((n, p.name, self.names.get(n)) for n, p in sorted(self.pieces.items()))

    def takes(self, piece: Piece) -> bool:
        """Whether the piece fits beside those that are here already."""
        others = list(self.pieces.values())
        if not others:
            return True
        full = BACKGROUND in self.pieces if not piece.is_object else len(others) > MOST_LABEL - 1
        alike = others[0].base is piece.base
        return alike and not full and not any((other.rows & piece.rows).any() for other in others)

    def add(self, piece: Piece, name: str) -> None:
        label = BACKGROUND
        if piece.is_object:
            label = next(n for n in range(1, MOST_LABEL + 1) if n not in self.pieces)
            self.names[label] = name
        self.pieces[label] = piece

    def model(self) -> Model:
        """What is written: the rows of all pieces, in the order that they were read in."""
        kept = np.any([piece.rows for piece in self.pieces.values()], axis=0)
        model = labelled(self.base, kept, {n: piece.rows for n, piece in self.pieces.items()})
        if not self.names:
            return without_labels(model)
        if isinstance(model, AnchorModel):
            objects = tuple(ObjectLabel(label, name) for label, name in self.names.items())
            return replace(model, objects=objects)
        return model


def with_written_pieces(edited: EditedFile, file: SceneFile, path: Path) -> SceneFile:
    """The file that is to be saved at `path`, with every piece as a part of what is written now.

    Files lie beside it, under a name that nothing had before, unless this window has written them
    there for this scene file and nobody has changed them since.  Raises BadFile and OSError.
    """
    at: dict[str, tuple[str, int | None]] = {}
    written = []
    for group in grouped(edited, file):
        target = edited.packages.get((path, group.key))
        if target is None or stamp_of(target[0]) != target[1]:
            place = replaceable(edited, file, path, group) or free_beside(path, group.base)
            write_labelled(group.model(), place)
            target = (place, stamp_of(place))
        written.append(((path, group.key), target))
        for label, piece in group.pieces.items():
            at[piece.name] = (target[0].as_posix(), label if group.names else None)
    others = {key: value for key, value in edited.packages.items() if key[0] != path}
    edited.packages = others | dict(written)
    return with_parts(file, at)


def with_parts(file: SceneFile, at: dict[str, tuple[str, int | None]]) -> SceneFile:
    """Pieces by their names become parts of files: path and label."""

    def filed(item: SceneItem) -> SceneItem:
        if item.model not in at:
            return item
        path, part = at[item.model]
        # What was read is turned already, and its layers are one.
        return replace(item, model=path, part=part, mode="", up="", flip=False)

    background = filed(file.background) if file.background else None
    return replace(file, items=tuple(map(filed, file.items)), background=background)


def grouped(edited: EditedFile, file: SceneFile) -> list[LabelledFile]:
    """The pieces that the file's objects have, in as few files as can be."""
    groups: list[LabelledFile] = []
    seen = set()
    for item in file.all_items:
        piece = edited.pieces.get(item.model)
        if piece is None or piece.name in seen:
            continue
        seen.add(piece.name)
        group = next((one for one in groups if one.takes(piece)), None)
        if group is None:
            group = LabelledFile()
            groups.append(group)
        group.add(piece, item.name)
    return groups


def replaceable(
    edited: EditedFile, file: SceneFile, path: Path, group: LabelledFile
) -> Path | None:
    """The file of the same model that this window wrote for this scene file before."""
    in_use = {file.path(item.model).absolute() for item in file.all_items}
    bases = {id(piece.base) for piece in group.pieces.values()}
    for (scene, key), (place, stamp) in edited.packages.items():
        pieces = [edited.pieces.get(name) for _, name, _ in key]
        same = any(piece is not None and id(piece.base) in bases for piece in pieces)
        ours = scene == path and stamp == stamp_of(place) and not is_bundled(place)
        if same and ours and place not in in_use:
            return place
    return None


def free_beside(path: Path, model: Model) -> Path:
    """A path beside the scene file that nothing has: "room parts.shift"."""
    ending = ".ply" if isinstance(model, SplatLayers) else ".shift"
    stem, count = path.name.removesuffix(ENDING), 1
    place = path.with_name(f"{stem} parts{ending}")
    while place.exists():
        count += 1
        place = path.with_name(f"{stem} parts {count}{ending}")
    return place


def write_labelled(model: Model, path: Path) -> None:
    """A package, or of plain splats a PLY, with labels.  Raises BadFile and OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(model, AnchorModel):
        features = model.features
        halves = np.array_equal(features.astype(np.float16), features)  # as it was filed
        write_package(model, path, "float16" if halves else "float32")
        return
    assert isinstance(model, SplatLayers), "check_pieces refuses others"
    if len(model.stops) > 1:
        raise BadFile(
            f"splats of {len(model.stops)} layers cannot be written as one file with labels; cut "
            "each layer in a scene of its own"
        )
    write_ply(plain(model), path)


def plain(model: SplatLayers) -> PlainSplats:
    """One layer, about the zero that its places are told from, so that poses stay."""
    return PlainSplats(
        model.means, model.scales, model.wxyz, model.opacity, model.sh,
        antialiased=model.antialiased, labels=model.labels, extra=model.extra,
    )  # fmt: skip
