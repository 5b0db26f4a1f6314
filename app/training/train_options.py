"""Options of train, those that fit, table and update share with it, and the settings they ask for.

What few people ever set is no option of its own but a line of a TOML file, --settings FILE, as
`features = 24`.  It is checked as an option is, and what is typed beside it counts more.
"""

import json
import re
import tomllib
import typing
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, cast

from shapeshift.app.cluster.open_cluster import ClusterOptions
from shapeshift.app.command_line import (
    EXPERT,
    MODALITY,
    POSITIONAL,
    Argument,
    FieldsOf,
    Opt,
    dicts_of,
    expected,
    lines_of,
    nearest,
)
from shapeshift.runtime_models.files.memory import read_text_file
from shapeshift.runtime_models.model import BadFile
from shapeshift.training.baselines.plain_settings import PlainSettings
from shapeshift.training.settings import LEFT, TrainSettings, adjusted, resumed

# Fields of TrainSettings that are typed; the others are set by fit, by --calibrate and from Python.
USUAL = (
    "seconds", "iterations", "max_anchors", "max_mb", "points", "downscale", "masks", "background",
    "poses",
)  # fmt: skip
EXPERTS = (
    "seed", "blended_shapes",
)  # fmt: skip
# That only the file of --settings takes: few runs gain by them.
LINES = (
    "splats_per_anchor", "features", "hidden", "fixed", "anchor_attributes", "depth_share",
    "normal_share", "min_scale_px",
)  # fmt: skip
OF_SPLATS = ("max_splats", "sh_degree")  # of PlainSettings
Asked = dict[str, Any]  # settings that were given, by name
MOST_BYTES = 1 << 16
ADVICE = 'a line is NAME = VALUE, with "" around a text'
KINDS: dict[Any, type | tuple[type, ...]] = {int: int, float: (int, float), bool: bool}  # of TOML
Given = TypeVar("Given")  # options of a command
SETTINGS = Opt(metavar="FILE")


def as_given(name: str) -> str:
    """A setting as it is given to a command: as an option, or as a line of --settings."""
    return name if name in (*LINES, *OF_SPLATS) else f"--{name.replace('_', '-')}"


@dataclass(frozen=True, kw_only=True)
class MachineOptions:
    """What computes, and how much memory it takes."""

    device: Literal["cpu", "gpu"] | None = None
    """Kind of OpenCL device that must be used.  Default: the fastest that there is."""
    memory: Annotated[float | None, EXPERT] = None
    """GB of memory that files may take: photos half of it, for as long as the training lasts.
    Default: three quarters of this machine's."""


@dataclass(frozen=True)
class Options(MachineOptions, ClusterOptions):
    """Train a shape-shifting scene.

    A first run needs only --out.
    """

    capture: Annotated[Path, POSITIONAL]
    """A folder of posed photos: COLMAP, transforms.json or cameras.json (docs/capture.md)."""
    out: Path
    """The package to write: NAME.shift or a folder.  NAME.checkpoint.npz is written beside it."""
    asked: Annotated[Asked, FieldsOf(TrainSettings, USUAL, EXPERTS, LINES, LEFT)] = field(
        default_factory=dict
    )
    splats: Annotated[Asked, FieldsOf(PlainSettings, lines=OF_SPLATS)] = field(default_factory=dict)
    settings: Annotated[Path | None, SETTINGS] = None
    """A TOML file with a setting a line, such as features = 24, for what is no option of its own;
    docs/training.md lists them.  An option that is typed counts more.  Default: none."""
    blocks: str = "1"
    """Train in so many blocks, for captures that one memory cannot hold (docs/training.md,
    "Blocks"): auto, a number, or a grid such as 4x2; --out is a folder NAME.blocks.  1: as a
    whole."""
    coarse_iterations: int | None = None
    """With --blocks: steps of the run of the whole that comes first; each block then has
    --iterations.  Default: 2000."""
    photo_mb: Annotated[float | None, EXPERT] = None
    """MB of memory that photos may take.  What does not fit is kept in NAME.photos beside --out
    until the training is done, and read from there as it is needed: the scene is the same to the
    byte.  Default: half of --memory."""
    resume: bool = False
    """Continue from the checkpoint with its settings; --iterations or --seconds may be larger."""
    calibrate: Annotated[str | None, MODALITY] = None
    """A modality whose cameras all sit a little beside their stated poses, as on a rig: that turn
    and shift is found first, from the photos.  `eval` reads it from the package.  Default: none."""
    model: Annotated[Literal["anchors", "splats"], EXPERT] = "anchors"
    """splats: plain 3DGS splats, one set for each modality, to compare with; --out is a folder of
    PLY files, and the modalities share the budget."""
    block_photos: Annotated[int, EXPERT] = 50
    """With --blocks: a block that fewer training photos show stays as the run of the whole left
    it."""
    cut: Annotated[Path | None, EXPERT] = None
    """One part of --blocks by hand: cut the run of the whole whose package this is; --out is a
    folder with a start for each block.  Default: nothing is cut."""
    block: Annotated[Path | None, EXPERT] = None
    """One part of --blocks by hand: train the block that begins with this file, N.start.npz.
    Default: none."""
    separate: Annotated[bool, EXPERT] = False
    """Train one anchor model for each modality, to compare with; --out is a folder of packages, and
    the modalities share the budget."""


def settings_of(
    asked: Asked, before: dict[str, Any] | None = None, options: Mapping[str, str] | None = None
) -> TrainSettings:
    """The usual settings with those that were asked for; or a checkpoint's, with another budget.

    options: a setting -> the option that gives it, where that has another name.  Raises UsageError,
    also when a resumed run is asked for anything but another budget.
    """
    from shapeshift.app.errors import as_typed
    from shapeshift.app.paths import plain
    from shapeshift.training.first_anchors.initial import SOURCES

    if asked.get("points", SOURCES[0]) not in SOURCES:
        asked = asked | {"points": str(plain(asked["points"]))}
    try:
        if before is not None:
            return resumed(TrainSettings(), before, asked, "--")
        return adjusted(TrainSettings(), asked)
    except ValueError as error:
        raise as_typed(error, TrainSettings, options) from None


def with_settings(options: Given) -> Given:
    """The same options with what the file of --settings says, where they have such a file.

    Raises BadFile, one sentence that names the line and the setting.
    """
    groups, path = dicts_of(type(options)), getattr(options, "settings", None)
    if not groups or path is None:
        return options
    read = read_settings_file(path, lines_of(type(options)), groups)
    whole = {name: read[name] | getattr(options, name) for name in groups}
    return replace(cast(Any, options), **whole)


def read_settings_file(
    path: Path, known: Mapping[str, Argument], groups: Mapping[str, type]
) -> dict[str, dict[str, Any]]:
    """The values by group and setting.  known: every setting; groups: a dict of the options -> the
    dataclass whose fields it takes.  Raises BadFile.
    """
    if not path.is_file():  # reading a pipe would wait for ever
        raise BadFile(f"{path} is no file; --settings wants one of lines, as features = 24.")
    if (size := path.stat().st_size) > MOST_BYTES:
        raise BadFile(f"{path} has {size:,} bytes; of settings at most {MOST_BYTES:,} are read.")
    try:
        text = read_text_file(path).decode("utf-8-sig")
        rows = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        if isinstance(error, tomllib.TOMLDecodeError):
            raise BadFile(f"{path}: {doubled(text) or error}; {ADVICE}.") from None
        raise BadFile(f"{path}: it is no TOML in UTF-8; {ADVICE}.") from None

    def where(name: str) -> str:
        start = rf"""^[ \t"'\[]*{re.escape(name)}[ \t"'\]]*([.=]|$)"""
        found = re.search(start, text, re.MULTILINE)
        return f"{path}, line {text.count(chr(10), 0, found.start()) + 1}" if found else str(path)

    read: dict[str, dict[str, Any]] = {group: {} for group in groups}
    for name, value in rows.items():
        if name not in known:
            meant = nearest(name, list(known))
            hint = f"did you mean {meant}?" if meant else f"there are {', '.join(known)}."
            raise BadFile(f"{where(name)}: there is no setting '{shown(name)}'; {hint}")
        each = known[name]
        read[each.into][name] = checked(value, each, where(name))
    for group, kind in groups.items():
        try:
            kind(**read[group])
        except ValueError as error:
            name = next((n for n in read[group] if str(error).startswith(n)), "")
            raise BadFile(f"{where(name) if name else path}: {error}") from None
    return read


def doubled(text: str) -> str:
    """Which line sets what a line before has set, in words: TOML's reader does not always say."""
    seen: set[str] = set()
    for number, line in enumerate(text.splitlines(), 1):
        if (found := re.match(r"""\s*["']?([\w-]+)["']?\s*=""", line)) is not None:
            if found[1] in seen:
                return f"line {number} sets {shown(found[1])} again"
            seen.add(found[1])
    return ""


def checked(value: Any, each: Argument, where: str) -> Any:
    """The value as its option would give it.  Raises BadFile."""
    words = each.choices if typing.get_origin(each.kind) is typing.Literal else ()
    wanted = KINDS.get(each.kind, str)
    good = isinstance(value, wanted) and isinstance(value, bool) == (wanted is bool)
    if not good or (words and value not in words):
        found = shown(json.dumps(value, ensure_ascii=False, default=str))
        raise BadFile(f"{where}: {each.field.name} is {found}, expected {expected(each)}.")
    return float(value) if each.kind is float else value


def shown(text: str) -> str:
    """In a message: on one line, and not for ever."""
    text = "".join(letter if letter.isprintable() else "?" for letter in text)
    return text if len(text) <= 60 else f"{text[:57]}..."
