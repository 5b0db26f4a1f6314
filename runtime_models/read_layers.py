"""Several plain splat files to one scene with a stop per file."""

import re
from pathlib import Path

import numpy as np

from runtime_models.formats import read_plain
from runtime_models.model import BadFile, SplatLayers, Stop
from runtime_models.plain_splats import PlainSplats, Reading

MODES = ("cumulative", "exclusive")


def layer_files(folder: Path) -> list[Path]:
    """layer*.ply of a folder, else every .ply, else every .splat; layer2 before layer10."""
    for pattern in ("layer*.ply", "*.ply", "*.splat"):
        if found := sorted(folder.glob(pattern), key=number_aware):
            return found
    return []


def number_aware(path: Path) -> list[tuple[int, str]]:
    parts = re.split(r"([0-9]+)", path.name)  # text, digits, text, ...
    return [(int(part) if i % 2 else 0, part) for i, part in enumerate(parts)]


def read_layers(
    paths: list[Path], reading: Reading | None = None, stops: tuple[Stop, ...] | None = None
) -> SplatLayers:
    """One SplatLayers; without `stops` file i of n lies at i / (n - 1) and has its file's name.

    cumulative (or no mode): stop i shows files 0..i; exclusive: file i alone.  Raises BadFile.
    """
    reading = reading or Reading()
    if not paths:
        raise BadFile("no files were given; at least one file of splats is needed.")
    paths = [Path(path) for path in paths]
    last = max(len(paths) - 1, 1)
    stops = stops or tuple(Stop(p.stem, i / last, "layer") for i, p in enumerate(paths))
    check_mode(reading.mode)
    parts = [read_plain(path, reading) for path in paths]
    return join_layers(parts, stops, reading.mode, [path.name for path in paths])


def check_mode(mode: str) -> None:
    if mode and mode not in MODES:
        raise BadFile(f"layer mode is {mode!r}, expected one of {list(MODES)}.")


def join_layers(
    parts: list[PlainSplats], stops: tuple[Stop, ...], mode: str, files: list[str]
) -> SplatLayers:
    """Part i as the layer of stop i; `files` are what they were read from, for the provenance."""
    width = max(p.sh.shape[1] for p in parts)  # files of a lower degree get zeros
    sh = [np.pad(p.sh, ((0, 0), (0, width - p.sh.shape[1]), (0, 0))) for p in parts]
    kinds = sorted({part.format for part in parts})
    provenance = {"format": " + ".join(kinds), "files": list(files)}
    if dropped := sum(p.dropped for p in parts):
        provenance["dropped_rows"] = dropped
    return SplatLayers(
        np.concatenate([p.means for p in parts]),
        np.concatenate([p.scales for p in parts]),
        np.concatenate([p.wxyz for p in parts]),
        np.concatenate([p.opacity for p in parts]),
        np.concatenate(sh),
        np.repeat(np.arange(len(parts), dtype=np.int32), [len(p.means) for p in parts]),
        stops,
        mode or "cumulative",
        provenance,
        antialiased=any(p.antialiased for p in parts),
        findings=tuple(f for p in parts for f in p.findings),
    )
