"""Reads a file of plain splats, whatever its format, also packed in another file."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.memory import Account
from shapeshift.runtime_models.model import BadFile, Finding
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
    from shapeshift.runtime_models.checkpoint.read_checkpoint import of_run, with_settings
    from shapeshift.runtime_models.splats.foreign_files import refusal
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


# Which object each splat is of: the classifier of Gaussian Grouping, or a column of numbers.

CLASSIFIER = "classifier.pth"  # beside the cloud: a 1x1 convolution, object features to classes
FEATURE = "obj_dc_"
COLUMNS = ("label", "object_id", "segment")  # of whole numbers: taken as they are
MOST = 2**31 - 1


def with_labels(raw: RawSplats, path: Path) -> RawSplats:
    """The splats with the labels that their file, or the classifier beside it, gives them."""
    if raw.labels is not None:
        return raw
    for name in COLUMNS:
        if name in raw.extra and (labels := whole_numbers(raw.extra[name])) is not None:
            others = {key: column for key, column in raw.extra.items() if key != name}
            return replace(raw, labels=labels, extra=others)
    if FEATURE + "0" not in raw.extra:
        return raw
    classifier = path.parent / CLASSIFIER
    if not classifier.is_file():
        finding = Finding(
            f"it has object features ({FEATURE}*) but no {CLASSIFIER} beside it", 0,
            f"shown without labels; copy {CLASSIFIER} of the run beside it", file=raw.file,
        )  # fmt: skip
        return replace(raw, findings=(*raw.findings, finding))
    raw.memory.widen(classifier.stat().st_size)
    weight, bias = read_classifier(classifier, raw.memory)
    names = [f"{FEATURE}{i}" for i in range(weight.shape[1])]
    found = sum(name.startswith(FEATURE) for name in raw.extra)
    if found != len(names) or not set(names) <= raw.extra.keys():
        raise BadFile(
            f"{raw.file} has {found} columns {FEATURE}*, its {CLASSIFIER} takes {len(names)}; "
            "put the two of one run together."
        )
    raw.memory.charge(4 * len(raw.means) * (len(names) + 1), f"labels of {len(raw.means):,} splats")
    with np.errstate(all="ignore"):
        features = np.stack([raw.extra[name] for name in names], 1).astype(np.float32)  # (N, F)
    return replace(raw, labels=most_likely(features, weight, bias))


def whole_numbers(column: np.ndarray) -> np.ndarray | None:
    """(N,) int32 of a column that holds nothing but whole numbers from 0 on, else None."""
    good = np.isfinite(column) & (column >= 0) & (column <= MOST)
    if not good.all() or (np.floor(column) != column).any():
        return None
    return column.astype(np.int32)


def most_likely(features: np.ndarray, weight: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """(N,) int32: the class with the largest of weight (C, F) . features (N, F) + bias (C,)."""
    labels = np.empty(len(features), np.int32)
    for start in range(0, len(features), 1 << 14):  # (rows, C) at once, not (N, C)
        rows = slice(start, start + (1 << 14))
        with np.errstate(all="ignore"):  # what is beyond float32 wins or is NaN: some label
            labels[rows] = (features[rows] @ weight.T + bias).argmax(axis=1)
    return labels


def read_classifier(path: Path, memory: Account | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Weight (C, F) and bias (C,) of a 1x1 convolution saved by torch.  Raises BadFile."""
    from shapeshift.runtime_models.checkpoint.read_torch import read_tensors

    tensors = read_tensors(path, memory)
    weight, bias = tensors.get("weight"), tensors.get("bias")
    if weight is None or bias is None or not fits_convolution(weight, bias):
        shapes = [None if t is None else t.shape for t in (weight, bias)]
        raise BadFile(
            f"{path.name} holds weights of shapes {shapes}, expected a 1x1 convolution: "
            "(classes, features, 1, 1) and (classes,)."
        )
    with np.errstate(all="ignore"):
        weight, bias = weight[:, :, 0, 0].astype(np.float32), bias.astype(np.float32)
    if not (np.isfinite(weight).all() and np.isfinite(bias).all()):
        raise BadFile(f"{path.name} holds NaN or Inf; save the classifier again.")
    return weight, bias


def fits_convolution(weight: np.ndarray, bias: np.ndarray) -> bool:
    """Whether they are those of a 1x1 convolution with at least one feature and one class."""
    if weight.ndim != 4 or weight.shape[2:] != (1, 1):
        return False
    return weight.shape[0] > 0 and weight.shape[1] > 0 and bias.shape == weight.shape[:1]
