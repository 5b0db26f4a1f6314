"""A package (folder or .shift) to a model; everything is checked here, nothing is trusted."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import WIDTHS as LIGHT_WIDTHS
from shapeshift.runtime_models.files.memory import JSON_A_BYTE, Account, unlimited
from shapeshift.runtime_models.files.npy import read_array
from shapeshift.runtime_models.files.zip_files import opened_zip
from shapeshift.runtime_models.model import (
    HEADS,
    SIZE_PER_SPLAT,
    AnchorFrames,
    AnchorModel,
    BadFile,
    Mlp,
    ObjectLabel,
    check_labels,
)
from shapeshift.runtime_models.package.feature_codes import decode_features, range_of
from shapeshift.runtime_models.package.package_files import (
    ANCHORS,
    LABELS,
    LIGHT,
    MANIFEST,
    open_package,
)
from shapeshift.runtime_models.package.read_manifest import Manifest, read_manifest
from shapeshift.runtime_models.package.read_onnx import read_onnx
from shapeshift.runtime_models.rotation import normalize
from shapeshift.runtime_models.splats.plain_splats import Reading

STORED = ("float32", "float16", "uint8")
TYPES = {"positions": ("float32",), "features": STORED}
FRAME_TYPES = {"frame_log_scales": STORED, "frame_rotations": STORED}
LARGEST = {  # numbers and what they are: beyond it none was meant
    "frame_log_scales": (20.0, "natural logarithms of factors"),
    LIGHT: (1e4, "what is added before a sigmoid"),
}
SHOWN = 60  # bytes of a splat that is decoded


def read_package(path: str | Path, reading: Reading | None = None) -> AnchorModel:
    """The model of a package.  Raises BadFile with one sentence for every way it can be broken."""
    path, reading = Path(path), reading or Reading()
    memory = reading.within(path).account
    return read_files(open_package(path, memory), path.name, memory)


def read_files(
    read: Callable[[str], bytes], package: str, memory: Account | None = None
) -> AnchorModel:
    """The model out of read(file name) -> bytes, which charges them; `package` is for messages."""
    memory = memory or unlimited()
    data = read(MANIFEST)
    with memory.lend(JSON_A_BYTE * len(data), MANIFEST):
        manifest = read_manifest(data, f"{package}/{MANIFEST}")
    where = f"{package}/{ANCHORS}"
    data = read(ANCHORS)
    anchors, features, frames, light = read_anchors(
        data, manifest.feature_width, where, manifest.has_frames, memory, manifest.light_channels
    )
    labels = read_labels(data, manifest.objects, len(anchors), where, memory)
    memory.release(len(data))
    shown = len(anchors) * manifest.splats_per_anchor
    memory.charge(SHOWN * shown, f"{shown:,} splats")  # that is what they are for
    networks = {
        name: read_network(name, manifest, read(manifest.heads[name].file), memory)
        for name in HEADS
    }
    return AnchorModel(
        anchors, features, networks, manifest.splats_per_anchor, manifest.encoding,
        manifest.stops, manifest.provenance, (), manifest.pace, manifest.between_stops, frames,
        labels, manifest.objects or (), light,
    )  # fmt: skip


def read_anchors(
    data: bytes,
    width: int,
    where: str,
    with_frames: bool | None = False,
    memory: Account | None = None,
    light_channels: int = 0,
) -> tuple[np.ndarray, np.ndarray, AnchorFrames | None, np.ndarray | None]:
    """positions (A, 3) metres and features (A, F), both float32; frames and light (A, 8 C) of so
    many channels where asked for.

    with_frames: None where there may be frames or not; with one of their arrays both must be there.
    """
    memory = memory or unlimited()
    if with_frames is None:
        with opened_zip(data, where, memory) as archive:
            names = {f"{name}.npy" for name in FRAME_TYPES}
            with_frames = not names.isdisjoint(archive.namelist())
    types = TYPES | (FRAME_TYPES if with_frames else {})
    types |= {LIGHT: STORED} if light_channels else {}
    arrays = read_arrays(data, where, types, memory)
    columns = {
        "positions": 3, "features": width, "frame_log_scales": 3, "frame_rotations": 4,
        LIGHT: LIGHT_WIDTHS.get(light_channels, 0),
    }  # fmt: skip
    for name in types:
        refuse_array(arrays[name], name, columns[name], types[name], where, memory)
    for name in types:
        memory.charge(4 * arrays[name].size, f"{len(arrays[name]):,} {name}")
    positions = np.ascontiguousarray(arrays["positions"], np.float32)
    tables = {}
    for name in list(types)[1:]:
        table = decode_features(arrays[name], arrays.get(range_of(name)), where, name)
        if len(positions) != len(table):
            raise BadFile(f"{where}: {len(positions)} positions but {len(table)} {name}.")
        most, kind = LARGEST.get(name, (np.inf, ""))
        if name in LARGEST and not np.abs(table).max() <= most:
            raise BadFile(
                f"{where}: {name} reach {np.abs(table).max():.3g}, expected {kind}, at most "
                f"{most:g}; export it again."
            )
        tables[name] = table
    memory.release(sum(array.nbytes for array in arrays.values()))
    frames = None
    if "frame_rotations" in tables:
        scales = np.exp(tables["frame_log_scales"])
        frames = AnchorFrames(scales, normalize(tables["frame_rotations"]))
    return positions, tables["features"], frames, tables.get(LIGHT)


def read_labels(
    data: bytes, objects: tuple[ObjectLabel, ...] | None, count: int, where: str, memory: Account
) -> np.ndarray | None:
    """(count,) uint8 labels of the anchors; None where there are none.  Raises BadFile."""
    with opened_zip(data, where, memory) as archive:
        labels = read_array(archive, LABELS, where, memory)
    if labels is None and not objects:
        return None
    if labels is None or objects is None:
        has, lacks = (MANIFEST, where) if labels is None else (where, MANIFEST)
        key = "'objects'" if labels is None else f"'{LABELS}'"
        other = f"the array '{LABELS}'" if labels is None else "'objects'"
        raise BadFile(f"{has} has {key}, but {lacks} lacks {other}; write both or neither.")
    try:
        check_labels(labels, objects, count)
    except ValueError as error:
        raise BadFile(f"{where}: {error}; label the anchors anew.") from None
    return labels.copy()  # as many bytes as were charged; what it lay in is let go


def refuse_array(
    array: np.ndarray, name: str, columns: int, types: tuple[str, ...], where: str, memory: Account
) -> None:
    """BadFile where an array of the npz is not what its place asks for."""
    if str(array.dtype) not in types:
        raise BadFile(f"{where}: {name} is {array.dtype}, expected {' or '.join(types)}.")
    if array.ndim != 2 or array.shape[1] != columns:
        raise BadFile(f"{where}: {name} has shape {array.shape}, expected (A, {columns}).")
    if len(array) == 0:
        raise BadFile(f"{where} holds no anchors: {name} has shape {array.shape}.")
    with memory.lend(array.size, f"the check of {name}"):
        bad = ~np.isfinite(array).all(axis=1)  # of bytes: none
    if bad.any():
        raise BadFile(
            f"{where}: {name} has NaN or Inf in {bad.sum()} of {len(array)} rows, "
            f"first in row {int(bad.argmax())}; export it again."
        )


def read_arrays(data: bytes, where: str, types: dict, memory: Account) -> dict[str, np.ndarray]:
    """The arrays of `types`, as stored, and the ranges of such as are bytes; never unpickled."""
    names = (*types, *map(range_of, types))
    with opened_zip(data, where, memory) as archive:
        arrays = {name: read_array(archive, name, where, memory) for name in names}
    for name in types:
        if arrays[name] is None:
            raise BadFile(f"{where} lacks the array '{name}'; export it again.")
    return {name: array for name, array in arrays.items() if array is not None}


def read_network(name: str, manifest: Manifest, data: bytes, memory: Account) -> Mlp:
    """One head, of the widths and the activation that the manifest states."""
    head, k = manifest.heads[name], manifest.splats_per_anchor
    mlp = read_onnx(data, head.file, head.inputs, memory)
    memory.release(len(data))
    widths = {"feature": manifest.feature_width, "control": manifest.encoding.d, "direction": 3,
              LIGHT: manifest.light_channels}  # fmt: skip
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
