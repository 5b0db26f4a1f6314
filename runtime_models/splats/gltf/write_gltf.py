"""Plain splats to a .glb, glTF 2.0 with KHR_gaussian_splatting.

glTF's axes are left, up, front: half a turn about +Y from ours.
"""

import json
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.gltf.gltf_files import (
    BINARY_CHUNK,
    GENERATOR,
    JSON_CHUNK,
    MAGIC,
)
from shapeshift.runtime_models.splats.gltf.read_gltf import PREFIX, SPLATS
from shapeshift.runtime_models.splats.operations.rotate_splats import HALF_TURN_Y, rotate_splats
from shapeshift.runtime_models.splats.plain_splats import PlainSplats

KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
FLOAT, BYTE = 5126, 5121
POINTS = 0
ARRAY_BUFFER = 34962  # of a buffer view: vertex attributes
MOST_BYTES = (1 << 32) - (1 << 20)  # lengths are 32 bits, and the JSON wants a place


def write_gltf(splats: PlainSplats, path: str | Path) -> None:
    """Atomic.  Far places stay exact: the origin stands in the node, in float64.

    COLOR_0 is for programs that know no splats and show points.  Raises BadFile over 4 GB, which
    the format's lengths cannot say.
    """
    splats = rotate_splats(splats, HALF_TURN_Y)
    arrays = attributes_of(splats)
    views: list[dict[str, int]] = []
    accessors: list[dict[str, object]] = []
    place = 0
    for name, array in arrays.items():
        size = array.size * (1 if array.dtype == np.uint8 else 4)
        views.append({"buffer": 0, "byteOffset": place, "byteLength": size,
                      "target": ARRAY_BUFFER})  # fmt: skip
        accessor: dict[str, object] = {
            "bufferView": len(accessors),
            "componentType": BYTE if array.dtype == np.uint8 else FLOAT,
            "count": len(array),
            "type": KINDS[array.shape[1]],
        }
        if array.dtype == np.uint8:
            accessor["normalized"] = True
        if name == "POSITION":  # glTF demands its bounds
            accessor |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        accessors.append(accessor)
        place += size
    if place > MOST_BYTES:
        raise BadFile(f"{place:,} bytes do not fit a .glb (4 GB); write .ply or .spz.")
    primitive = {
        "attributes": {name: number for number, name in enumerate(arrays)},
        "mode": POINTS,
        "extensions": {
            SPLATS: {
                "kernel": "ellipse",
                "colorSpace": "srgb_rec709_display",
                "sortingMethod": "cameraDistance",
                "projection": "perspective",
            }
        },
    }
    node: dict[str, object] = {"mesh": 0}
    if any(splats.origin):
        node["translation"] = list(splats.origin)
    asset = {
        "asset": {"version": "2.0", "generator": f"{GENERATOR} 0.5"},
        "extensionsUsed": [SPLATS],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [node],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": place}],
    }
    write_whole(Path(path), pack(asset, arrays.values(), place))


def attributes_of(splats: PlainSplats) -> dict[str, np.ndarray]:
    """Attribute name -> (N, width), uint8 or floats, in the order in which they are written."""
    diffuse = np.clip(0.5 + C0 * splats.sh[:, 0], 0, 1)  # display
    linear = np.where(diffuse <= 0.04045, diffuse / 12.92, ((diffuse + 0.055) / 1.055) ** 2.4)
    points = np.column_stack([linear, splats.opacity.clip(0, 1)])
    arrays = {
        "POSITION": splats.means,
        "COLOR_0": np.round(points * 255).astype(np.uint8),
        # Two half turns of a quaternion are its minus: like this it comes back as it was.
        f"{PREFIX}ROTATION": -splats.wxyz[:, [1, 2, 3, 0]],
        f"{PREFIX}SCALE": splats.scales,
        f"{PREFIX}OPACITY": splats.opacity.clip(0, 1)[:, None],
    }
    for number in range(splats.sh.shape[1]):
        degree = int(number**0.5)
        name = f"{PREFIX}SH_DEGREE_{degree}_COEF_{number - degree**2}"
        arrays[name] = splats.sh[:, number]
    return arrays


def pack(asset: dict, arrays: Iterable[np.ndarray], size: int) -> Iterator[bytes]:
    """The two chunks of a binary glTF, each filled up to four bytes; one array at a time."""
    text = json.dumps(asset, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    fill = -size % 4
    total = 12 + 8 + len(text) + 8 + size + fill
    yield struct.pack("<4sII", MAGIC, 2, total) + struct.pack("<II", len(text), JSON_CHUNK) + text
    yield struct.pack("<II", size + fill, BINARY_CHUNK)
    for array in arrays:
        yield array.astype(array.dtype if array.dtype == np.uint8 else "<f4").tobytes()
    yield bytes(fill)
