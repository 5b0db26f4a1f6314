"""glTF files made by hand, plainly: what the reader's tests change piece by piece."""

import base64
import json
import struct
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.splats.plain_splats import PlainSplats

P = "KHR_gaussian_splatting:"
CODES = {"i1": 5120, "u1": 5121, "<i2": 5122, "<u2": 5123, "<u4": 5125, "<f4": 5126}


def splat_arrays(count: int = 5, degree: int = 0, seed: int = 0) -> dict[str, np.ndarray]:
    """Attribute name -> array, as a careful exporter has them."""
    rng = np.random.default_rng(seed)
    xyzw = rng.normal(size=(count, 4))
    arrays = {
        "POSITION": rng.normal(size=(count, 3)),
        P + "ROTATION": xyzw / np.linalg.norm(xyzw, axis=1, keepdims=True),
        P + "SCALE": rng.uniform(0.01, 0.2, (count, 3)),
        P + "OPACITY": rng.uniform(0.1, 1, (count, 1)),
    }
    for band in range(degree + 1):
        for n in range(2 * band + 1):
            arrays[f"{P}SH_DEGREE_{band}_COEF_{n}"] = rng.normal(size=(count, 3)) * 0.3
    return {name: array.astype("<f4") for name, array in arrays.items()}


def make_asset(arrays: dict[str, np.ndarray], normalized: tuple = ()) -> tuple[dict, bytes]:
    """The JSON and the binary chunk of one node with these attributes."""
    views, accessors, data = [], [], b""
    for name, array in arrays.items():
        data += b"\0" * (-len(data) % 4)
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[array.shape[1]]
        code = CODES[array.dtype.str.replace("|", "")]
        row = {"bufferView": len(accessors), "componentType": code, "count": len(array)}
        accessors.append(
            row | {"type": kind} | ({"normalized": True} if name in normalized else {})
        )
        data += array.tobytes()
    extension = {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}
    primitive = {
        "attributes": {name: i for i, name in enumerate(arrays)},
        "mode": 0,
        "extensions": {"KHR_gaussian_splatting": extension},
    }
    asset = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_gaussian_splatting"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    return asset, data


def asset_of_spz(
    data: bytes, count: int, name: str = "KHR_gaussian_splatting_compression_spz_2"
) -> tuple[dict, bytes]:
    """The JSON and the binary chunk of one node whose splats are an .spz, by an extension."""
    asset, _ = make_asset(splat_arrays(1))
    asset["bufferViews"] = [{"buffer": 0, "byteLength": len(data)}]
    asset["buffers"] = [{"byteLength": len(data)}]
    asset["accessors"] = [{"componentType": 5126, "count": count, "type": "VEC3"}] * 5
    extension = asset["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]
    extension["extensions"] = {name: {"bufferView": 0}}
    asset["extensionsRequired"] = [name]
    return asset, data


def glb(asset: dict | bytes, data: bytes = b"") -> bytes:
    text = asset if isinstance(asset, bytes) else json.dumps(asset).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(data), 0x004E4942) + data if data else b""
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def write_glb(path: Path, asset: dict | bytes, data: bytes = b"") -> Path:
    path.write_bytes(glb(asset, data))
    return path


def as_data_uri(data: bytes) -> str:
    return "data:application/octet-stream;base64," + base64.b64encode(data).decode()


def plain_splats(count: int, degree: int = 3, seed: int = 0) -> PlainSplats:
    arrays = splat_arrays(count, degree, seed)
    sh = np.stack([a for name, a in arrays.items() if "SH_" in name], 1)
    return PlainSplats(
        arrays["POSITION"], arrays[P + "SCALE"], arrays[P + "ROTATION"],
        arrays[P + "OPACITY"][:, 0], sh,
    )  # fmt: skip


def attributes_in(path: Path) -> dict[str, np.ndarray]:
    """The arrays of the only primitive by pygltflib's reading of offsets and counts."""
    pygltflib = pytest.importorskip("pygltflib")
    found = pygltflib.GLTF2().load(path)
    blob, (primitive,) = found.binary_blob(), found.meshes[0].primitives
    assert primitive.mode == pygltflib.POINTS
    names = {name: i for name, i in vars(primitive.attributes).items() if i is not None}
    arrays = {}
    for name, index in names.items():
        accessor = found.accessors[index]
        view = found.bufferViews[accessor.bufferView]
        kind = {pygltflib.FLOAT: "<f4", pygltflib.UNSIGNED_BYTE: "u1"}[accessor.componentType]
        start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
        assert start % 4 == 0
        array = np.frombuffer(blob, kind, view.byteLength // np.dtype(kind).itemsize, start)
        arrays[name] = array.reshape(accessor.count, -1)
    box = found.accessors[names["POSITION"]]
    assert box.min == arrays["POSITION"].min(0).tolist()
    assert box.max == arrays["POSITION"].max(0).tolist()
    return arrays
