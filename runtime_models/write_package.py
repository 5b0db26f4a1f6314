"""A model to a package: a folder, or the same folder zipped with the ending .shift."""

import io
import json
import os
import shutil
import tempfile
import zipfile
from pathlib import Path

import numpy as np

from runtime_models.model import HEADS, AnchorModel, BadFile, Stop
from runtime_models.write_onnx import write_onnx

FORMAT = "shapeshift 1"
MANIFEST = "scene.json"
ANCHORS = "anchors.npz"


def write_package(model: AnchorModel, path: str | Path, features: str = "float16") -> int:
    """Write the package and return its bytes on disk.  Atomic: a reader sees all or nothing.

    `path` ending in .shift is a zip, anything else a folder.  Raises BadFile rather than replace
    something that is not a package.
    """
    path = Path(path)
    files = package_files(model, features)
    refuse_foreign(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".shift":
        write_zip(files, path)
        return path.stat().st_size
    write_folder(files, path)
    return sum(len(data) for data in files.values())


def package_files(model: AnchorModel, features: str) -> dict[str, bytes]:
    """File name to content, the manifest first."""
    arrays = io.BytesIO()
    np.savez_compressed(
        arrays, positions=model.anchors, features=model.features.astype(np.dtype(features))
    )
    heads = {
        name: {
            "file": f"{name}.onnx",
            "inputs": list(model.networks[name].inputs),
            "activation": model.networks[name].head,
        }
        for name in HEADS
    }
    manifest = {
        "format": FORMAT,
        "splats_per_anchor": model.splats_per_anchor,
        "feature_width": model.features.shape[1],
        "encoding": {
            "d": model.encoding.d,
            "sigma": model.encoding.sigma,
            "spacing": model.encoding.spacing,
        },
        "stops": [describe_stop(stop) for stop in model.stops],
        "heads": heads,
        "up": "+Y",
        "provenance": model.provenance,
    }
    files = {MANIFEST: json.dumps(manifest, indent=1, ensure_ascii=False).encode()}
    files[ANCHORS] = arrays.getvalue()
    for name in HEADS:
        files[f"{name}.onnx"] = write_onnx(model.networks[name], name)
    return files


def describe_stop(stop: Stop) -> dict:
    row = {"name": stop.name, "x": stop.x, "kind": stop.kind}
    if stop.palette:
        row["palette"] = stop.palette
    if stop.value_range is not None:
        row |= {"value_range": list(stop.value_range), "unit": stop.unit}
    return row


def refuse_foreign(path: Path) -> None:
    """Only a package, or an empty folder, may be replaced."""
    if path.is_dir():
        if path.suffix == ".shift" or (any(path.iterdir()) and not (path / MANIFEST).exists()):
            raise BadFile(f"{path} is a folder that is no package; choose another name.")
    elif path.exists() and not (path.suffix == ".shift" and zipfile.is_zipfile(path)):
        raise BadFile(f"{path} exists and is not a package; choose another name.")


def write_zip(files: dict[str, bytes], path: Path) -> None:
    """The same bytes for the same model: fixed dates, fixed order."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as out, zipfile.ZipFile(out, "w") as archive:
            for name, data in files.items():
                entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = 0o644 << 16
                archive.writestr(entry, data)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def write_folder(files: dict[str, bytes], path: Path) -> None:
    """The old folder is set aside until the new one stands, and comes back if that fails."""
    temporary = Path(tempfile.mkdtemp(dir=path.parent, prefix=path.name))
    aside = temporary.with_suffix(".old")
    try:
        for name, data in files.items():
            (temporary / name).write_bytes(data)
        temporary.chmod(0o755)
        if path.exists():
            os.replace(path, aside)
        os.replace(temporary, path)
    except BaseException:
        if aside.exists() and not path.exists():
            os.replace(aside, path)
        shutil.rmtree(temporary, ignore_errors=True)
        raise
    shutil.rmtree(aside, ignore_errors=True)
