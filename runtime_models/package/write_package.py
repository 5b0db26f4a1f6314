"""A model to a package: a folder, or the same folder zipped with the ending .shift."""

import io
import json
import math
import zipfile
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.blocks.block_model import one_network
from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.files.npy import write_arrays
from shapeshift.runtime_models.files.plain_text import json_text
from shapeshift.runtime_models.files.whole_file import whole_folder, write_whole
from shapeshift.runtime_models.model import HEADS, AnchorModel, BadFile, Stop
from shapeshift.runtime_models.package.feature_codes import (
    EXACT,
    encode_features,
    encode_light,
    exact_frames,
    exact_kind,
)
from shapeshift.runtime_models.package.package_files import (
    ANCHORS,
    FORMAT,
    LABELS,
    MANIFEST,
    format_name,
    open_package,
    write_onnx,
)
from shapeshift.runtime_models.package.read_package import read_files

DATE = (1980, 1, 1, 0, 0, 0)  # of every zip entry: the same model gives the same bytes


def write_package(model: AnchorModel, path: str | Path, features: str = "float16") -> int:
    """Write the package and return its bytes on disk.  Atomic: a reader sees all or nothing.

    `path` ending in .shift is a zip, anything else a folder.  `features` is one of FEATURES, or
    EXACT: each table as the least that is read again as the numbers that it has.
    Raises BadFile rather than replace something that is not a package, or write one that
    read_package would refuse.
    """
    path = Path(path)
    files = package_files(model, features)
    read_files(files.__getitem__, path.name)  # what cannot be read back is not written
    refuse_foreign(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".shift":
        write_whole(path, zip_files(files))
        return path.stat().st_size
    with whole_folder(path) as folder:
        for name, data in files.items():
            (folder / name).write_bytes(data)
    return sum(len(data) for data in files.values())


def package_files(model: AnchorModel, features: str) -> dict[str, bytes]:
    """File name to content, the manifest first; blocks of a scene become one."""
    model = one_network(model)
    arrays = io.BytesIO()
    exact = features == EXACT
    tables = encode_features(model.features, exact_kind(model.features) if exact else features)
    if model.frames is not None and exact:
        tables |= exact_frames(model.frames)
    elif model.frames is not None:
        log_scales = np.log(model.frames.scales)
        tables |= encode_features(log_scales, features, "frame_log_scales")
        tables |= encode_features(model.frames.wxyz, features, "frame_rotations")
    if model.light is not None:
        tables |= encode_light(model.light, features)
    if model.labels is not None:
        tables[LABELS] = model.labels
    write_arrays(arrays, {"positions": model.anchors, **tables})
    manifest = json_text(describe_model(model)).encode()
    files = {MANIFEST: manifest, ANCHORS: arrays.getvalue()}
    for name in HEADS:
        files[f"{name}.onnx"] = write_onnx(model.networks[name], name)
    return files


def describe_model(model: AnchorModel) -> dict:
    """The manifest."""
    return {
        "format": format_name(model),
        "splats_per_anchor": model.splats_per_anchor,
        "feature_width": model.features.shape[1],
        "encoding": {
            "d": model.encoding.d,
            "sigma": model.encoding.sigma,
            "spacing": model.encoding.spacing,
        },
        "stops": [describe_stop(stop) for stop in model.stops],
        **describe_between(model),
        "heads": {
            name: {
                "file": f"{name}.onnx",
                "inputs": list(model.networks[name].inputs),
                "activation": model.networks[name].head,
            }
            for name in HEADS
        },
        "up": "+Y",
        "provenance": plain(model.provenance),
        **describe_objects(model),
    }


def describe_between(model: AnchorModel) -> dict:
    """What older readers pass over; left out where it is as usual."""
    rows: dict[str, object] = {}
    if model.between_stops != "blend":
        rows["between_stops"] = model.between_stops
    if model.pace:
        rows["pace"] = [
            {"from": pace.start, "to": pace.end, "blend": list(pace.blend)} for pace in model.pace
        ]
    return rows


def describe_objects(model: AnchorModel) -> dict:
    """What the labels of its anchors mean; nothing where there are none."""
    if model.labels is None:
        return {}
    return {"objects": [{"label": o.label, "name": o.name} for o in model.objects]}


def describe_stop(stop: Stop) -> dict:
    row: dict[str, object] = {"name": stop.name, "x": stop.x, "kind": stop.kind}
    if stop.palette:
        row["palette"] = stop.palette
    if stop.value_range is not None:
        row |= {"value_range": list(stop.value_range), "unit": stop.unit}
    if stop.formula:
        row["formula"] = stop.formula
    if stop.date:
        row["date"] = stop.date
    return row


def plain(value):
    """What JSON can hold of notes: arrays as lists, paths as text, NaN and Inf as null."""
    if isinstance(value, dict):
        return {str(key): plain(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, str | int) else str(value)


def refuse_foreign(path: Path) -> None:
    """Only a package, or an empty folder, may be replaced: both lose what is in them."""
    if not path.exists() or (path.is_dir() and not any(path.iterdir()) and path.suffix != ".shift"):
        return
    if path.is_dir() == (path.suffix == ".shift"):
        raise BadFile(f"{path} exists and is no package of that kind; choose another name.")
    try:
        manifest = json.loads(open_package(path, Memory().of(path))(MANIFEST))
        ours = str(manifest["format"]).startswith(FORMAT.split()[0])
    except (ValueError, KeyError, TypeError, RecursionError):
        ours = False
    if not ours:
        raise BadFile(f"{path} exists and is not a package; choose another name.")
    if path.is_dir():
        for file in path.iterdir():
            if file.name not in (MANIFEST, ANCHORS) and file.suffix != ".onnx":
                raise BadFile(
                    f"{path} holds {file.name} beside a package; move it or choose another name."
                )


def zip_files(files: dict[str, bytes]) -> bytes:
    """The same bytes for the same files: fixed dates, fixed order."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name, DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3  # Unix, on every system
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, data)
    return out.getvalue()
