"""The settings of one training from a JSON file, as TrainSettings.as_dict gives them."""

from dataclasses import fields
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

from shapeshift.runtime_models.files.json_fields import LONGEST_TEXT, Fields, read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.training.first_anchors.initial import SOURCES
from shapeshift.training.settings import TrainSettings

MOST_BYTES = 1 << 16
ADVICE = "take it as `fit --cluster` wrote it"
# Whole numbers up to this, so that nothing asks for more memory than there could be.
MOST = {
    "iterations": 1 << 31, "max_anchors": 1 << 31, "seed": 1 << 62, "downscale": 1 << 16,
    "splats_per_anchor": 1 << 10, "features": 1 << 12, "hidden": 1 << 12, "grow_every": 1 << 31,
}  # fmt: skip


def read_settings(path: Path) -> TrainSettings:
    """Every field has to be there, and none besides.  Raises BadFile."""
    row = Fields(read_json(path, most_bytes=MOST_BYTES, unique=True), str(path), ADVICE)
    kinds = get_type_hints(TrainSettings)
    values = {each.name: read_value(row, each.name, kinds[each.name])
              for each in fields(TrainSettings)}  # fmt: skip
    row.refuse_unknown_keys()
    try:
        return TrainSettings(**values)
    except ValueError as error:
        raise BadFile(f"{path}: {str(error).rstrip('.')}; {ADVICE}.") from None


def read_value(row: Fields, name: str, kind: Any) -> Any:
    """One field of the type that TrainSettings has.  Raises BadFile."""
    if row.value(name) is None and type(None) in get_args(kind):
        return None
    kinds = {kind, *get_args(kind)}
    if name == "points":  # files of points are not among what a trial reads
        return row.line(name, known=SOURCES)
    if get_origin(kind) is Literal:
        return row.line(name, known=get_args(kind))
    if bool in kinds:
        return row.typed(name, bool)
    if int in kinds:
        return row.count(name, 0, MOST[name])
    if float in kinds:
        return row.number(name, wanted="a number from 0", low=0)
    text = row.typed(name, str)
    if not (text.isprintable() and (name == "rig" or len(text) <= LONGEST_TEXT)):
        raise row.error(name, "one line of text")
    return text
