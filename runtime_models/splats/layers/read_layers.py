"""Files of plain splats to one scene: one file with its own stops, several with a stop each."""

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import COEFFICIENTS
from shapeshift.runtime_models.lint.lint import judge
from shapeshift.runtime_models.model import BadFile, Finding, SplatLayers, Stop
from shapeshift.runtime_models.splats.formats import read_plain, read_raw
from shapeshift.runtime_models.splats.moving_splats import TIME_STOPS, held_still
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, RawSplats, Reading
from shapeshift.runtime_models.stop_names import stems_named

MODES = ("cumulative", "exclusive")
BLOCK = 1 << 14  # splats at a time: nearly always the first of them tell


def layer_files(folder: Path) -> list[Path]:
    """layer*.ply of a folder, else every .ply, else every .splat, else every .spz and so on;
    layer2 before layer10.
    """
    for pattern in ("layer*.ply", "*.ply", "*.splat", "*.spz", "*.sog", "*.ksplat", "*.glb"):
        if found := sorted(filter(Path.is_file, folder.glob(pattern)), key=number_aware):
            return found
    return []


def number_aware(path: Path) -> list[tuple[int, str]]:
    parts = re.split(r"([0-9]+)", path.name)  # text, digits, text, ...
    return [(int(part) if i % 2 else 0, part) for i, part in enumerate(parts)]


def read_file(path: Path, reading: Reading) -> SplatLayers:
    """One file of splats: one stop, or two where it holds thermal harmonics, too."""
    raw = read_raw(path, reading)
    if "t_dc_0" not in raw.extra:
        plain = judge(raw, reading)
        if plain.motion is not None:
            return join_layers([plain], TIME_STOPS, "cumulative", [path.name])
        stops = (Stop(path.stem, 0.0, "layer"),)
        return join_layers([plain], stops, reading.mode, [path.name])
    parts = [judge(each, reading) for each in (thermal_twin(raw), raw)][::-1]
    return join_layers(parts, stops_of_pair(), reading.mode or "exclusive", [path.name])


def thermal_twin(raw: RawSplats) -> RawSplats:
    """The same splats with their thermal harmonics, the second set that ThermalGaussian's OMMG
    writes into its one PLY; takes those columns out of `raw`.  Raises BadFile.
    """
    names = [name for name in raw.extra if re.fullmatch(r"t_(dc|rest)_[0-9]+", name)]
    columns = {name: raw.extra.pop(name) for name in names}
    rest = len(names) - 3
    count = rest // 3 + 1
    wanted = [f"t_dc_{i}" for i in range(3)] + [f"t_rest_{i}" for i in range(rest)]
    if rest % 3 or count not in COEFFICIENTS or set(wanted) != set(names):
        raise BadFile(
            f"{raw.file} has {len(names)} columns t_dc and t_rest; thermal harmonics are 3, 12, "
            "27 or 48 of them, numbered from 0 on."
        )
    raw.memory.charge(len(raw.means) * raw.bytes_a_splat, f"{len(raw.means):,} splats once more")
    sh = np.empty((len(raw.means), count, 3), np.float32)
    for i, name in enumerate(wanted):  # t_rest is channel-major, as f_rest is
        row, channel = (0, i) if i < 3 else (1 + (i - 3) % (count - 1), (i - 3) // (count - 1))
        sh[:, row, channel] = columns[name]
    own = {name: getattr(raw, name).copy() for name in ("means", "scales", "wxyz", "opacity")}
    return replace(raw, **own, sh=sh, findings=())


def stops_of_pair() -> tuple[Stop, Stop]:
    """Of what has colours and heat."""
    return Stop("RGB", 0.0, "rgb"), Stop("Thermal", 1.0, "thermal")


def read_layers(
    paths: list[Path], reading: Reading | None = None, stops: tuple[Stop, ...] | None = None
) -> SplatLayers:
    """One SplatLayers; without `stops` file i of n lies at i / (n - 1) and is called as its file.

    cumulative (or no mode): stop i shows files 0..i; exclusive: file i alone.  Raises BadFile.
    """
    reading = reading or Reading()
    if not paths:
        raise BadFile("no files were given; at least one file of splats is needed.")
    paths = [Path(path) for path in paths]
    last = max(len(paths) - 1, 1)
    if not stops:
        names = stems_named([path.stem for path in paths])
        stops = tuple(Stop(name, i / last, "layer") for i, name in enumerate(names))
    check_mode(reading.mode)
    parts = [read_plain(path, reading) for path in paths]
    return join_layers(parts, stops, reading.mode, [path.name for path in paths])


def check_mode(mode: str) -> None:
    if mode and mode not in MODES:
        raise BadFile(f"layer mode is {mode!r}, expected one of {list(MODES)}.")


def join_layers(
    parts: list[PlainSplats], stops: tuple[Stop, ...], mode: str, files: list[str]
) -> SplatLayers:
    """Part i as the layer of stop i; `files` are what they were read from, for the provenance.

    Takes the parts over: the list is empty afterwards, so that each array goes once it is copied.
    """
    if len(parts) > 1:
        parts[:] = [held_still(part, 0.0) for part in parts]
    motion = parts[0].motion
    counts, last = [len(part.means) for part in parts], len(parts) - 1
    kinds = sorted({part.format for part in parts})
    provenance: dict[str, object] = {"format": " + ".join(kinds), "files": list(files)}
    if axes := sorted({part.axes for part in parts if part.axes}):
        provenance["axes"] = " / ".join(axes)
    if dropped := sum(part.dropped for part in parts):
        provenance["dropped_rows"] = dropped
    origin, antialiased = parts[0].origin, any(part.antialiased for part in parts)
    findings = tuple(finding for part in parts for finding in part.findings)
    if antialiased and not all(part.antialiased for part in parts):
        what = "only some of the layers were trained antialiased"
        findings += (Finding(what, 0, "all are drawn so"),)
    filed = max(part.sh.shape[1] for part in parts)
    width = max(used_coefficients(part.sh) for part in parts)  # files of a lower degree get zeros
    if width < filed:
        provenance["sh_degree"] = math.isqrt(filed) - 1  # of the files
    charge_joining(parts, width)
    pieces: list[dict[str, Any]] = [vars(part) | {"extra": dict(part.extra)} for part in parts]
    parts.clear()
    shifts = [np.subtract(piece["origin"], origin) for piece in pieces]  # metres, float64
    means: list[np.ndarray | None] = [
        moved(piece.pop("means"), shift) for piece, shift in zip(pieces, shifts, strict=True)
    ]
    columns = sorted({name for piece in pieces for name in piece["extra"]})
    labels = [piece.pop("labels") for piece in pieces]
    return SplatLayers(
        means=joined(means, counts),
        scales=joined([piece.pop("scales") for piece in pieces], counts),
        wxyz=joined([piece.pop("wxyz") for piece in pieces], counts),
        opacity=joined([piece.pop("opacity") for piece in pieces], counts),
        sh=joined([widened(piece.pop("sh"), width) for piece in pieces], counts),
        layer=np.repeat(np.arange(last + 1, dtype=np.int32), counts),
        stops=stops,
        mode=mode or "cumulative",
        provenance=provenance,
        origin=origin,
        antialiased=antialiased,
        labels=joined(labels, counts) if any(x is not None for x in labels) else None,
        extra={
            name: joined([piece["extra"].pop(name, None) for piece in pieces], counts)
            for name in columns
        },
        findings=findings,
        motion=motion,
    )


def charge_joining(parts: list[PlainSplats], width: int) -> None:
    """For what one scene of several files takes: zeros for harmonics, and an array at a time."""
    total = sum(len(part.means) for part in parts)
    parts[0].memory.charge(4 * total, f"{total:,} splats")
    if len(parts) > 1:
        for part in parts:
            more = 12 * (width - part.sh.shape[1]) * len(part.means)
            part.memory.charge(more, f"harmonics of {len(part.means):,} splats")
        with parts[0].memory.lend(12 * width * total, f"{total:,} splats in one"):
            pass  # given back before it is used: that it fits has been seen


def moved(means: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """(N, 3) float32 places after a shift (3,) in float64."""
    return (means + shift).astype(np.float32) if shift.any() else means


def used_coefficients(sh: np.ndarray) -> int:
    """1, 4, 9 or 16: how many of (N, M, 3) there are without the highest bands that are zero in
    every splat.  They would be shaded at full price, and take 12 bytes a coefficient.
    """
    count = sh.shape[1]
    while count > 1:
        lower = (math.isqrt(count) - 1) ** 2
        blocks = range(0, len(sh), BLOCK)
        if any(sh[first : first + BLOCK, lower:count].any() for first in blocks):
            return count
        count = lower
    return count


def widened(sh: np.ndarray, width: int) -> np.ndarray:
    """(N, width, 3): coefficients of a higher degree are zero; bands above are left out."""
    more = width - sh.shape[1]
    if more < 0:
        return np.ascontiguousarray(sh[:, :width])
    return np.pad(sh, ((0, 0), (0, more), (0, 0))) if more else sh


def joined(arrays: list[np.ndarray | None], counts: list[int]) -> np.ndarray:
    """One array of the parts, the only part itself; None stands for zeros.  Empties the list."""
    first_part = arrays[0]
    if len(arrays) == 1 and first_part is not None:
        arrays.clear()
        return first_part
    del first_part
    known = [array for array in arrays if array is not None]
    kind = np.result_type(*known)
    out = np.empty((sum(counts), *known[0].shape[1:]), kind)  # takes memory as it is filled
    del known
    first = 0
    for count in counts:
        part = arrays.pop(0)
        out[first : first + count] = 0 if part is None else part
        first += count
    return out
