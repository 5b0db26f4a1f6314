"""Several plain splat files to one scene with a stop per file."""

import re
from pathlib import Path

import numpy as np

from runtime_models.model import BadFile, SplatLayers, Stop
from runtime_models.read_ply import PlainSplats, read_ply
from runtime_models.read_splat import read_splat

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


def is_splat(path: Path) -> bool:
    """The .splat format has no mark inside: its name alone tells."""
    return path.suffix.lower() == ".splat"


def read_plain(path: Path) -> PlainSplats:
    return read_splat(path) if is_splat(path) else read_ply(path)


def read_layers(paths: list[Path], mode: str = "cumulative") -> SplatLayers:
    """One SplatLayers; stop i of n lies at i / (n - 1) and has its file's name.

    cumulative: stop i shows files 0..i; exclusive: file i alone.  Raises BadFile.
    """
    if mode not in MODES:
        raise BadFile(f"layer mode is {mode!r}, expected one of {list(MODES)}.")
    if not paths:
        raise BadFile("no files were given; at least one .ply or .splat is needed.")
    paths = [Path(path) for path in paths]
    parts = [read_plain(path) for path in paths]
    width = max(p.sh.shape[1] for p in parts)  # files of a lower degree get zeros
    sh = [np.pad(p.sh, ((0, 0), (0, width - p.sh.shape[1]), (0, 0))) for p in parts]
    last = max(len(paths) - 1, 1)
    stops = tuple(Stop(path.stem, i / last, "layer") for i, path in enumerate(paths))
    kinds = sorted({"splat" if is_splat(path) else "ply" for path in paths})
    provenance = {"format": " + ".join(kinds), "files": [path.name for path in paths]}
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
        mode,
        provenance,
    )
