"""Reads a file of plain splats, whatever its format, also packed in another file."""

from pathlib import Path

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, RawSplats, Reading
from shapeshift.runtime_models.splats.read_wrapped import (
    is_gzip,
    is_zip_of_one,
    read_raw_gzip,
    read_raw_zip_of_one,
)
from shapeshift.runtime_models.splats.whole_formats import Format, head_of, whole_formats

PACKED = (
    Format("zip of one file", (".zip",), is_zip_of_one, read_raw_zip_of_one),
    Format("gzip", (".gz",), is_gzip, read_raw_gzip),
)


def formats() -> tuple[Format, ...]:
    """All of them, in the order in which they are tried: those without a mark last."""
    whole = whole_formats()
    marked = tuple(form for form in whole if form.has_mark is not None)
    return (*marked, *PACKED, *(form for form in whole if form.has_mark is None))


def format_of(path: Path) -> Format | None:
    """The format of a file of plain splats, or of a folder that stands for one; None: no format."""
    head = head_of(path)
    return next((form for form in formats() if form.fits(head, path)), None)


def read_raw(path: Path, reading: Reading) -> RawSplats:
    """One file of plain splats as it is written, with its labels.  Raises BadFile."""
    from shapeshift.runtime_models.checkpoint.run_settings import of_run, with_settings
    from shapeshift.runtime_models.splats.foreign_files import refusal
    from shapeshift.runtime_models.splats.read_labels import with_labels
    from shapeshift.runtime_models.splats.sog.sog_files import META

    reading = reading.within(path.parent if path.name == META else path)
    form = format_of(path)
    if form is None:
        raise BadFile(refusal(path, head_of(path), ", ".join(form.name for form in formats())))
    raw = with_labels(form.read(path, reading), path)
    return with_settings(raw, path) if of_run(path) else raw


def read_plain(path: Path, reading: Reading | None = None) -> PlainSplats:
    """One file of plain splats, judged and turned into our axes.  Raises BadFile."""
    from shapeshift.runtime_models.lint.lint import judge

    reading = reading or Reading()
    return judge(read_raw(path, reading), reading)
