"""How every command opens its scene or its photos: the options of reading, progress, doubts."""

import os
import re
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import EXPERT, Opt
from shapeshift.app.terminal import say
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import Finding, Model
from shapeshift.runtime_models.program import program
from shapeshift.runtime_models.splats.plain_splats import Reading

if TYPE_CHECKING:
    from shapeshift.scene.captures.capture import Capture, Photo

LEAST_CACHE = 64  # MB: a file of half a million splats takes 9 to 20
MOST_CACHE = 1 << 20
LEAST_BUDGET = 1000  # splats
MOST_BUDGET = 1_000_000_000
PATIENCE_S = 1.0  # what takes longer shows a progress bar
MOST = 4  # cameras and folders of a stop that are listed


def contents_of(capture: "Capture") -> list[str]:
    """A sentence a stop, in the order of the slider, with a photo of it as an example; of a stop
    by formula, which has no photos, the formula.
    """
    return [
        f"{stop.name}: by formula, {stop.formula}" if stop.formula
        else sentence_of(capture, stop.name)
        for stop in sorted((*capture.stops, *capture.formulas), key=lambda stop: stop.x)
    ]  # fmt: skip


def sentence_of(capture: "Capture", stop: str) -> str:
    photos = {photo.path: photo for photo in capture.photos if photo.modality == stop}
    groups: dict[tuple, int] = defaultdict(int)
    for photo in photos.values():
        groups[photo.file_size, lens_name(photo), folder_of(capture, photo)] += 1
    if not photos:
        return f"{stop}: no photo"
    listed = [f"{count} of {described(*about)}" for about, count in list(groups.items())[:MOST]]
    if len(groups) == 1:
        listed = [f"{len(photos)} photos of {described(*next(iter(groups)))}"]
    else:
        listed.insert(0, f"{len(photos)} photos")
    if len(groups) > MOST:
        listed.append(f"{sum(list(groups.values())[MOST:])} in {len(groups) - MOST} more folders "
                      "or of other cameras")  # fmt: skip
    first = next(iter(photos))
    return f"{stop}: {', '.join(listed)}; for example {path_end(below(capture, first))}"


def described(size: tuple[int, int], lens: str, folder: str) -> str:
    through = f" through {lens}" if lens else ""
    return "{}x{} pixels".format(*size) + through + (f" in {path_end(folder)}" if folder else "")


def lens_name(photo: "Photo") -> str:
    """The model of a lens that bends lines, with its focal length in whole pixels."""
    return "" if photo.lens is None else f"{photo.lens.model} {photo.lens.focal[0]:.0f}"


def folder_of(capture: "Capture", photo: "Photo") -> str:
    folder = below(capture, photo.path.parent)
    return "" if folder == "." else folder


def below(capture: "Capture", path: Path) -> str:
    """A path as seen from the capture's folder, where it lies in it."""
    inside = path.is_relative_to(capture.folder)
    return (path.relative_to(capture.folder) if inside else path).as_posix()


@dataclass(frozen=True, kw_only=True)
class ReadingOptions:
    """What a command that opens scenes takes in addition to its own options."""

    up: Literal["", "+X", "-X", "+Y", "-Y", "+Z", "-Z"] = ""
    """The axis of the file that points up.  Default: the one that its format says."""
    flip: bool = False
    """Turn the scene upside down."""
    mode: Annotated[Literal["", "cumulative", "exclusive"], EXPERT] = ""
    """How layers add up: each with those below it, or each alone.  Default: as the files suggest,
    a thermal pair exclusive, other layers cumulative."""
    strict: Annotated[bool, EXPERT] = False
    """Refuse a file that needs repair instead of repairing it."""
    allow_huge: Annotated[bool, EXPERT] = False
    """Open a file even where thousands of its splats would lie over every pixel."""
    max_splats: Annotated[int, EXPERT] = 0
    """Show at most so many splats: neighbours become one, where it shows least; 0: all."""
    memory: Annotated[float, EXPERT] = 0.0
    """GB of memory that files may take while they are read, however few bytes they have; 0: 64
    bytes for each byte of a file, and three quarters of this machine's in all."""

    def reading(self) -> Reading:
        """The same for readers.  Raises UsageError."""
        from shapeshift.app.errors import UsageError

        if self.max_splats < 0:
            raise UsageError(f"--max-splats is {self.max_splats}, expected 0 (all) or more.")
        refuse_memory(self.memory)
        return Reading(
            self.mode,
            self.up,
            self.flip,
            self.strict,
            allow_huge=self.allow_huge,
            most_splats=self.max_splats,
            memory_gb=self.memory,
        )


@dataclass(frozen=True, kw_only=True)
class DrawingOptions(ReadingOptions):
    """What a command that draws scenes takes besides."""

    budget: Annotated[str, Opt(metavar="SPLATS")] = ""
    """Of scenes in levels of detail (of the command lod, streamed SOG) draw at most so many splats,
    such as 2M, finer where more pixels show it; auto: what suits this machine.  Default: one level
    for the whole scene."""
    cache_mb: Annotated[int, EXPERT] = 2048
    """MB of memory for such a scene: what is drawn of it, and its decoded files, those used last,
    as far as there is room; 64 at least for them."""

    def reading(self) -> Reading:
        """The same for readers.  Raises UsageError."""
        from dataclasses import replace

        from shapeshift.app.errors import UsageError
        from shapeshift.runtime_models.files.part_cache import PartCache
        from shapeshift.runtime_models.splats.plain_splats import LeafReading

        reading = super().reading()
        if not LEAST_CACHE <= self.cache_mb <= MOST_CACHE:
            raise UsageError(
                f"--cache-mb is {self.cache_mb}, expected {LEAST_CACHE} to {MOST_CACHE:,}."
            )
        if not self.budget:
            return reading
        if self.max_splats:
            raise UsageError("--budget says how many splats are drawn; leave --max-splats out.")
        budget = read_splat_budget(self.budget)
        return replace(reading, leaves=LeafReading(budget, PartCache(self.cache_mb << 20)))


def read_splat_budget(text: str, said: str = "--budget") -> int:
    """Splats of a text like 2M, 500k or 2000000; 0 for auto.  Raises UsageError."""
    from shapeshift.app.errors import UsageError

    if text.strip().lower() == "auto":
        return 0
    found = re.fullmatch(r"([0-9]{1,12}(?:\.[0-9]{1,6})?)([kKmM]?)", text.strip())
    count = float(found[1]) * {"": 1, "k": 1e3, "m": 1e6}[found[2].lower()] if found else 0.0
    if not LEAST_BUDGET <= count <= MOST_BUDGET:
        raise UsageError(
            f"{said} is '{text[:40]}', expected auto, or {LEAST_BUDGET:,} to {MOST_BUDGET:,} "
            "splats, such as 2M or 500k."
        )
    return int(count)


def refuse_memory(gigabytes: float) -> None:
    """Raises UsageError for what is no amount; 0 stands for what is usual."""
    from shapeshift.app.errors import UsageError
    from shapeshift.runtime_models.files.memory import MOST_GB

    if not 0 <= gigabytes <= MOST_GB:
        raise UsageError(
            f"--memory is {gigabytes:.12g}, expected GB, at most {MOST_GB:,}, or 0 for what is "
            "usual."
        )


def open_model(
    path: Path, options: ReadingOptions, progress: Callable[[str, float], None] | None = None
) -> Model:
    """The model in a file or folder; progress and findings go to stderr.  Raises BadFile.

    `progress` receives it instead: (what, part 0..1), from the thread that reads.
    """
    from dataclasses import replace

    from shapeshift.runtime_models.model import BadFile
    from shapeshift.runtime_models.read_scene import read_model
    from shapeshift.scene.document.scene_file import is_scene_file

    if is_scene_file(path):
        raise BadFile(
            f"{path} is a scene file of objects; one model is wanted here: name the file of one."
        )
    with nullcontext(progress) if progress else progress_after(PATIENCE_S) as shown_progress:
        model = read_model(path, replace(options.reading(), progress=shown_progress))
    for finding in model.findings:
        say(sentence(finding))
    say_levels([model], path, options)
    return model


def say_levels(models: Iterable[Model], path: Path, options: ReadingOptions) -> None:
    """A word where a budget was asked for and nothing has levels to choose from."""
    asked = isinstance(options, DrawingOptions) and options.budget
    if asked and all(getattr(model, "leaves", None) is None for model in models):
        say(
            f"{path.name} has no levels of detail, so --budget changes nothing; make them with "
            f"`{program()} lod`."
        )


def open_capture(
    path: Path, memory_gb: float | None = None, hear: Callable[..., object] = say
) -> "Capture":
    """Posed photos, not their pixels; progress goes to stderr.

    memory_gb: --memory, for all that this process reads from now on; None: what is usual.  hear:
    told what its stops hold, and doubts.  Raises BadFile, UsageError.
    """
    from shapeshift.app.errors import UsageError
    from shapeshift.app.progress import working
    from shapeshift.runtime_models.files.memory import MOST_GB, VARIABLE
    from shapeshift.scene.captures.read_capture import read_capture

    if memory_gb is not None:
        if not 0 < memory_gb <= MOST_GB:
            raise UsageError(
                f"--memory is {memory_gb:.12g}, expected GB above 0, at most {MOST_GB:,}; leave it "
                "out for what is usual."
            )
        os.environ[VARIABLE] = str(memory_gb)  # where its pixels are read, also by children
    with working("reading the capture"):
        capture = read_capture(path)
    hear(*contents_of(capture), *capture.doubts)
    return capture


def sentence(finding: Finding) -> str:
    """A finding in one line."""
    rows = f" (rows {', '.join(map(str, finding.rows))}" if finding.rows else ""
    if rows:
        rows += ", ...)" if finding.count > len(finding.rows) else ")"
    return f"{finding.file}: {finding.what}{rows}: {finding.done}."


@contextmanager
def progress_after(seconds: float) -> Iterator:
    """progress(what, part 0..1) that shows a bar from `seconds` on."""
    from shapeshift.app.progress import Words, listed, progress_bar

    began, bar, task, words = time.monotonic(), None, None, Words()

    def progress(what: str, part: float) -> None:
        nonlocal bar, task
        words.text = f"{what}, {part:.0%}"
        if bar is None or task is None:
            if time.monotonic() - began < seconds:
                return
            bar = progress_bar()
            bar.start()
            task = bar.add_task(what, total=1.0)
        bar.update(task, description=what, completed=part)

    try:
        with listed(words):
            yield progress
    finally:
        if bar is not None:
            bar.stop()
