"""Opens whatever this program can show, recognised by content where the format allows."""

import zipfile
from pathlib import Path

from runtime_models.model import AnchorModel, BadFile, SplatLayers
from runtime_models.package_files import MANIFEST
from runtime_models.read_layers import read_layers
from runtime_models.read_package import read_package

KNOWN = "a package (folder or .shift), a 3DGS .ply, a .splat, or a folder of such .ply files"


def read_model(path: str | Path, mode: str = "cumulative") -> AnchorModel | SplatLayers:
    """The model in a file or folder; `mode`: how a folder of layers adds up.  Raises BadFile."""
    path = Path(path)
    if not path.exists():
        raise BadFile(f"{path} does not exist; wanted is {KNOWN}.")
    if path.is_dir():
        if (path / MANIFEST).exists():
            return read_package(path)
        layers = sorted(path.glob("*.ply")) or sorted(path.glob("*.splat"))
        if not layers:
            raise BadFile(f"{path} holds nothing to show; wanted is {KNOWN}.")
        return read_layers(layers, mode)
    with path.open("rb") as file:
        start = file.read(4)
    if zipfile.is_zipfile(path) or start[:2] == b"PK":
        return read_package(path)
    if start[:3] == b"ply" or path.suffix == ".splat":
        return read_layers([path], mode)
    raise BadFile(f"{path} is of no known format; wanted is {KNOWN}.")


def describe(model: AnchorModel | SplatLayers, path: str | Path) -> dict:
    """What `launch.py info --json` prints."""
    path = Path(path)
    files = [f for f in path.rglob("*") if f.is_file()] if path.is_dir() else [path]
    out = {
        "format": "anchors" if isinstance(model, AnchorModel) else "splats",
        "anchors": 0,
        "splats": model.splat_count,
        "sh_degree": None,
        "stops": [{"name": s.name, "x": s.x, "kind": s.kind} for s in model.stops],
        "bytes": sum(f.stat().st_size for f in files),
    }
    if isinstance(model, SplatLayers):
        return out | {"sh_degree": int(model.sh.shape[1] ** 0.5) - 1, "mode": model.mode}
    return out | {
        "anchors": len(model.anchors),
        "splats_per_anchor": model.splats_per_anchor,
        "feature_width": model.features.shape[1],
        "encoding": {
            "d": model.encoding.d,
            "sigma": model.encoding.sigma,
            "spacing": model.encoding.spacing,
        },
        "heads": {
            name: {
                "layers": [mlp.width_in, *(len(w) for w in mlp.weights)],
                "inputs": list(mlp.inputs),
                "activation": mlp.head,
            }
            for name, mlp in model.networks.items()
        },
    }
