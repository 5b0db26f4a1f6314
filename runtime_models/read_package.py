"""A package (folder or .shift) to a model; everything is checked here, nothing is trusted."""

import io
import tokenize
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from runtime_models.feature_codes import decode_features
from runtime_models.model import HEADS, SIZE_PER_SPLAT, AnchorModel, BadFile, Mlp
from runtime_models.package_files import (
    ANCHORS,
    DAMAGED,
    LARGEST,
    MANIFEST,
    open_package,
    refuse_bomb,
)
from runtime_models.read_manifest import Manifest, read_manifest
from runtime_models.read_onnx import read_onnx

BAD_HEADER = (TypeError, SyntaxError, tokenize.TokenError)  # numpy reads it as Python's literal
TYPES = {"positions": ("float32",), "features": ("float32", "float16", "uint8")}
RANGE = "feature_range"  # there where features are bytes


def read_package(path: str | Path) -> AnchorModel:
    """The model of a package.  Raises BadFile with one sentence for every way it can be broken."""
    path = Path(path)
    return read_files(open_package(path), path.name)


def read_files(read: Callable[[str], bytes], package: str) -> AnchorModel:
    """The model out of read(file name) -> bytes; `package` is for messages."""
    manifest = read_manifest(read(MANIFEST), f"{package}/{MANIFEST}")
    where = f"{package}/{ANCHORS}"
    anchors, features = read_anchors(read(ANCHORS), manifest.feature_width, where)
    networks = {
        name: read_network(name, manifest, read(manifest.heads[name].file)) for name in HEADS
    }
    return AnchorModel(
        anchors, features, networks, manifest.splats_per_anchor, manifest.encoding,
        manifest.stops, manifest.provenance, (), manifest.pace, manifest.between_stops,
    )  # fmt: skip


def read_anchors(data: bytes, width: int, where: str) -> tuple[np.ndarray, np.ndarray]:
    """positions (A, 3) metres and features (A, F), both float32."""
    arrays = read_arrays(data, where)
    for name, columns in (("positions", 3), ("features", width)):
        array = arrays[name]
        if str(array.dtype) not in TYPES[name]:
            raise BadFile(f"{where}: {name} is {array.dtype}, expected {' or '.join(TYPES[name])}.")
        if array.ndim != 2 or array.shape[1] != columns:
            raise BadFile(f"{where}: {name} has shape {array.shape}, expected (A, {columns}).")
        if len(array) == 0:
            raise BadFile(f"{where} holds no anchors: {name} has shape {array.shape}.")
        bad = ~np.isfinite(array).all(axis=1)  # of bytes: none
        if bad.any():
            raise BadFile(
                f"{where}: {name} has NaN or Inf in {bad.sum()} of {len(array)} rows, "
                f"first in row {int(bad.argmax())}; export it again."
            )
    positions = np.ascontiguousarray(arrays["positions"], np.float32)
    features = decode_features(arrays["features"], arrays.get(RANGE), where)
    if len(positions) != len(features):
        raise BadFile(f"{where}: {len(positions)} positions but {len(features)} features.")
    return positions, features


def read_arrays(data: bytes, where: str) -> dict[str, np.ndarray]:
    """The arrays of TYPES, as stored, and RANGE where it is there; never unpickled."""
    if not zipfile.is_zipfile(io.BytesIO(data)):
        raise BadFile(f"{where} is cut off or no npz; copy or export it again.")
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            size = sum(entry.file_size for entry in archive.zip.infolist())
            refuse_bomb(where, size, len(data))
            lacking = [name for name in TYPES if name not in archive]
            small = size <= LARGEST[ANCHORS]
            wanted = [name for name in (*TYPES, RANGE) if name in archive]
            arrays = {name: archive[name] for name in wanted} if small and not lacking else {}
    except BadFile:
        raise
    except (*DAMAGED, *BAD_HEADER, MemoryError):
        raise BadFile(f"{where} is damaged or holds other than plain numbers.") from None
    if not small:
        raise BadFile(f"{where} unpacks to {size:,} bytes, at most {LARGEST[ANCHORS]:,} are read.")
    lacking += [name for name, array in arrays.items() if not isinstance(array, np.ndarray)]
    if lacking:
        raise BadFile(f"{where} lacks the array '{lacking[0]}'; export it again.")
    return arrays


def read_network(name: str, manifest: Manifest, data: bytes) -> Mlp:
    """One head, of the widths and the activation that the manifest states."""
    head, k = manifest.heads[name], manifest.splats_per_anchor
    mlp = read_onnx(data, head.file, head.inputs)
    widths = {"feature": manifest.feature_width, "control": manifest.encoding.d, "direction": 3}
    takes, gives = sum(widths[part] for part in head.inputs), k * SIZE_PER_SPLAT[name]
    if (mlp.width_in, mlp.width_out) != (takes, gives):
        raise BadFile(
            f"{head.file} maps {mlp.width_in} to {mlp.width_out} values, the manifest asks for "
            f"{takes} ({' + '.join(head.inputs)}) to {gives} (k = {k}); export it again."
        )
    if mlp.head != head.activation:
        raise BadFile(
            f"{head.file} ends in the activation {mlp.head!r}, the manifest says "
            f"{head.activation!r}; export it again."
        )
    return mlp
