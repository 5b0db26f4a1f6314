"""A package (folder or .shift) to a model; everything is checked here, nothing is trusted."""

import io
import json
import math
import zipfile
import zlib
from itertools import pairwise
from pathlib import Path

import numpy as np

from runtime_models.model import (
    HEADS,
    SIZE_PER_SPLAT,
    STOP_KINDS,
    AnchorModel,
    BadFile,
    ControlEncoding,
    Mlp,
    Stop,
)
from runtime_models.read_onnx import read_onnx
from runtime_models.write_package import ANCHORS, FORMAT, MANIFEST

LARGEST_FILE = 4 << 30  # bytes of one unpacked file: a lying zip must not fill the memory
PART_WIDTH = {"direction": 3}


def read_package(path: str | Path) -> AnchorModel:
    """The model of a package.  Raises BadFile with one sentence for every way it can be broken."""
    path = Path(path)
    read = folder_reader(path) if path.is_dir() else zip_reader(path)
    manifest = read_manifest(read(MANIFEST), path)
    want = Wanted(manifest, f"{path.name}/{MANIFEST}")
    width, k = want.count("feature_width"), want.count("splats_per_anchor")
    encoding = read_encoding(want.object("encoding"))
    anchors, features = read_anchors(read(ANCHORS), width, f"{path.name}/{ANCHORS}")
    heads = want.object("heads")
    networks = {}
    for name in HEADS:
        head = heads.object(name)
        networks[name] = read_head(name, head, read, width, encoding.d, k)
    stops = read_stops(manifest.get("stops"), f"{path.name}/{MANIFEST}")
    provenance = manifest.get("provenance") or {}
    return AnchorModel(anchors, features, networks, k, encoding, stops, provenance)


class Wanted:
    """A JSON object whose missing or wrong entries become sentences."""

    def __init__(self, entries: dict, where: str) -> None:
        self.entries, self.where = entries, where

    def get(self, key: str):
        if key not in self.entries:
            raise BadFile(f"{self.where} lacks '{key}'; docs/package.md lists what must be there.")
        return self.entries[key]

    def object(self, key: str) -> "Wanted":
        value = self.get(key)
        if not isinstance(value, dict):
            raise BadFile(f"{self.where}: '{key}' is {value!r}, expected an object.")
        return Wanted(value, f"{self.where} '{key}'")

    def count(self, key: str) -> int:
        value = self.get(key)
        if not (isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= 4096):
            raise BadFile(f"{self.where}: '{key}' is {value!r}, expected a whole number from 1.")
        return value

    def number(self, key: str) -> float:
        value = self.get(key)
        if not (isinstance(value, int | float) and math.isfinite(value)):
            raise BadFile(f"{self.where}: '{key}' is {value!r}, expected a finite number.")
        return float(value)


def folder_reader(path: Path):
    def read(name: str) -> bytes:
        if not (path / name).is_file():
            raise BadFile(f"{path} lacks {name}; a package is {MANIFEST}, {ANCHORS} and five ONNX.")
        return (path / name).read_bytes()

    return read


def zip_reader(path: Path):
    if not zipfile.is_zipfile(path):
        raise BadFile(f"{path} is not a package: no zip was found in it, or it is cut off.")

    def read(name: str) -> bytes:
        with zipfile.ZipFile(path) as archive:
            try:
                with archive.open(name) as file:
                    data = file.read(LARGEST_FILE + 1)
            except KeyError:
                raise BadFile(f"{path} lacks {name}; copy or export it again.") from None
            except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError):
                raise BadFile(f"{path}: {name} is damaged; copy or export it again.") from None
        if len(data) > LARGEST_FILE:
            raise BadFile(f"{path}: {name} unpacks to over {LARGEST_FILE >> 30} GiB; not read.")
        return data

    return read


def read_manifest(data: bytes, path: Path) -> dict:
    try:
        manifest = json.loads(data)
    except ValueError:
        raise BadFile(f"{path.name}/{MANIFEST} is not JSON.") from None
    found = manifest.get("format") if isinstance(manifest, dict) else None
    if found != FORMAT:
        raise BadFile(
            f"{path.name}/{MANIFEST} has format {found!r}, this program reads {FORMAT!r}; "
            "a newer program may be needed."
        )
    if manifest.get("up", "+Y") != "+Y":
        raise BadFile(f"{path.name}/{MANIFEST} has up axis {manifest['up']!r}, expected '+Y'.")
    return manifest


def read_encoding(want: Wanted) -> ControlEncoding:
    encoding = ControlEncoding(want.count("d"), want.number("spacing"), want.number("sigma"))
    if not (encoding.sigma > 0 and encoding.spacing > 0):
        raise BadFile(f"{want.where}: sigma and spacing must be above 0.")
    return encoding


def read_anchors(data: bytes, width: int, where: str) -> tuple[np.ndarray, np.ndarray]:
    """positions (A, 3) and features (A, F), both float32."""
    arrays = {}
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            for name in ("positions", "features"):
                if name not in archive:
                    raise BadFile(f"{where} lacks the array '{name}'.")
                arrays[name] = archive[name]
    except BadFile:
        raise
    except (ValueError, OSError, zipfile.BadZipFile, zlib.error, EOFError, MemoryError):
        raise BadFile(f"{where} is cut off or no npz; copy or export it again.") from None
    positions, features = arrays["positions"], arrays["features"]
    for name, array, columns in (("positions", positions, 3), ("features", features, width)):
        if array.ndim != 2 or array.shape[1] != columns or len(array) == 0:
            raise BadFile(f"{where}: {name} has shape {array.shape}, expected (A, {columns}).")
        if array.dtype not in (np.float32, np.float16):
            raise BadFile(f"{where}: {name} is {array.dtype}, expected float32 or float16.")
        bad = ~np.isfinite(array).all(axis=1)
        if bad.any():
            raise BadFile(
                f"{where}: {name} has NaN or Inf in {bad.sum()} of {len(array)} rows, "
                f"first in row {int(bad.argmax())}; export it again."
            )
    if len(positions) != len(features):
        raise BadFile(f"{where}: {len(positions)} positions but {len(features)} features.")
    return positions.astype(np.float32), features.astype(np.float32)


def read_head(name: str, want: Wanted, read, width: int, d: int, k: int) -> Mlp:
    file, inputs = want.get("file"), want.get("inputs")
    if not (isinstance(file, str) and file == Path(file).name):
        raise BadFile(f"{want.where}: file is {file!r}, expected a file name in the package.")
    allowed = {"feature": width, "control": d} | (PART_WIDTH if name == "color" else {})
    if not (isinstance(inputs, list) and inputs and all(p in allowed for p in inputs)):
        raise BadFile(f"{want.where}: inputs are {inputs!r}, expected some of {list(allowed)}.")
    mlp = read_onnx(read(file), file, tuple(inputs))
    takes, gives = sum(allowed[p] for p in inputs), k * SIZE_PER_SPLAT[name]
    if (mlp.width_in, mlp.width_out) != (takes, gives):
        raise BadFile(
            f"{file} maps {mlp.width_in} to {mlp.width_out} values, the manifest asks for "
            f"{takes} ({' + '.join(inputs)}) to {gives} (k = {k}); export it again."
        )
    return mlp


def read_stops(rows, where: str) -> tuple[Stop, ...]:
    if not (isinstance(rows, list) and rows and all(isinstance(r, dict) for r in rows)):
        raise BadFile(f"{where}: 'stops' must be a list of at least one stop.")
    stops = []
    for i, row in enumerate(rows):
        want = Wanted(row, f"{where} stop {i}")
        name, x, kind = want.get("name"), want.number("x"), row.get("kind", "rgb")
        if not 0 <= x <= 1:
            raise BadFile(f"{want.where}: x is {x}, expected 0 to 1.")
        if kind not in STOP_KINDS:
            raise BadFile(f"{want.where}: kind is {kind!r}, expected one of {list(STOP_KINDS)}.")
        values = row.get("value_range")
        if values is not None and not (
            isinstance(values, list)
            and len(values) == 2
            and all(isinstance(v, int | float) and math.isfinite(v) for v in values)
        ):
            raise BadFile(f"{want.where}: value_range is {values!r}, expected two numbers.")
        pair = (float(values[0]), float(values[1])) if values is not None else None
        text = str(row.get("palette", "")), pair, str(row.get("unit", ""))
        stops.append(Stop(str(name), x, kind, *text))
    if any(a.x >= b.x for a, b in pairwise(stops)):
        raise BadFile(f"{where}: the stops' x must rise, they are {[s.x for s in stops]}.")
    return tuple(stops)
