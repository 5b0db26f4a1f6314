"""Several plain splat files to one scene with a stop per file."""

from pathlib import Path

import numpy as np

from runtime_models.model import BadFile, SplatLayers, Stop
from runtime_models.read_ply import PlainSplats, read_ply
from runtime_models.read_splat import read_splat

MODES = ("cumulative", "exclusive")


def read_plain(path: Path) -> PlainSplats:
    return read_splat(path) if path.suffix == ".splat" else read_ply(path)


def read_layers(paths: list[Path], mode: str = "cumulative") -> SplatLayers:
    """One SplatLayers; stop i of n lies at i / (n - 1) and has its file's name."""
    if mode not in MODES:
        raise BadFile(f"layer mode is {mode!r}, expected one of {list(MODES)}.")
    parts = [read_plain(Path(p)) for p in paths]
    width = max(p.sh.shape[1] for p in parts)
    sh = [np.pad(p.sh, ((0, 0), (0, width - p.sh.shape[1]), (0, 0))) for p in parts]
    last = max(len(paths) - 1, 1)
    stops = tuple(Stop(Path(p).stem, i / last, "layer") for i, p in enumerate(paths))
    provenance = {"files": [Path(p).name for p in paths]}
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
