"""A triangle mesh from a file: .glb and .gltf by our own reader, .obj, .ply and .stl by trimesh.

trimesh works behind the gate, mesh_run.py.  Sizes are checked first: a header that promises more
than the file holds is refused, and nothing but the file itself is opened (no materials, no
textures).
"""

import re
import struct
from collections.abc import Collection
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.memory import Account, Memory, refuse_empty
from shapeshift.runtime_models.gate.gate import ask
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.gltf.gltf_files import Asset
from shapeshift.runtime_models.splats.gltf.gltf_nodes import OBEYED, placed_meshes
from shapeshift.runtime_models.splats.operations.rotate_splats import HALF_TURN_Y
from shapeshift.scene.colliders.triangle_mesh import MOST_FACES, TriangleMesh, joined

ENDINGS = (".glb", ".gltf", ".obj", ".ply", ".stl")
MOST_BYTES = 256 << 20
MOST_HEADER = 65536  # bytes of a PLY's header
PLY_SIZES = {"char": 1, "uchar": 1, "int8": 1, "uint8": 1, "short": 2, "ushort": 2, "int16": 2,
             "uint16": 2, "int": 4, "uint": 4, "int32": 4, "uint32": 4, "float": 4, "float32": 4,
             "double": 8, "float64": 8}  # fmt: skip
GLTF_VERTEX, GLTF_FACE = 120, 240  # bytes of memory with all copies
TRIANGLES = 4  # glTF's mode of separate triangles
STL_HEAD = struct.Struct("<80sI")  # any text, triangles
STL_TRIANGLE = 50  # bytes
OBJ_LINES = re.compile(rb"^[ \t]*([vf][ \t].*)$", re.MULTILINE)  # corners and faces alone
# Bytes of memory: a byte of an .obj or .stl, a corner and a face of a .ply, with all copies.
OBJ_A_BYTE, STL_A_BYTE, PLY_VERTEX, PLY_FACE = 32, 20, 160, 640


def read_mesh(path: Path, leave_out: Collection[int] = ()) -> TriangleMesh:
    """The triangles of a file, metres, equal vertices joined.  Raises BadFile.

    In the file's own axes, but of glTF (left, up, front) in ours (right, up, back).
    leave_out: meshes of a glTF file that do not count.
    """
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise BadFile(f"{path.name} is no mesh that is read here; {', '.join(ENDINGS)} are.")
    try:
        size = path.stat().st_size
    except OSError as error:
        raise BadFile(f"{path.name} cannot be read: {error.strerror}.") from None
    if size > MOST_BYTES:
        raise BadFile(f"{path.name} has {size:,} bytes; at most {MOST_BYTES:,}, simplify it.")
    refuse_empty(path)
    memory = Memory().of(path)
    if ending in (".glb", ".gltf"):
        return joined(*read_gltf_triangles(path, memory, leave_out), path.name)
    return read_by_trimesh(path, ending[1:], memory)


def read_by_trimesh(path: Path, kind: str, memory: Account) -> TriangleMesh:
    """The joined mesh of an .obj, .ply or .stl.  Raises BadFile.

    Joined behind the gate as well: a few large arrays fewer go through its pipe.
    """
    left = memory.left
    found = ask("mesh", path, [prepared(path, kind, memory), kind, path.name], memory=left)
    return TriangleMesh(found["vertices"], found["faces"])


def prepared(path: Path, kind: str, memory: Account) -> bytes:
    """The bytes that trimesh is given, charged with what it makes of them.  Raises BadFile."""
    size = path.stat().st_size
    memory.charge({"obj": OBJ_A_BYTE, "stl": STL_A_BYTE, "ply": 2}[kind] * size, "its triangles")
    data = path.read_bytes()
    if kind == "ply":
        vertices, faces = check_ply(data, path.name)
        memory.charge(PLY_VERTEX * vertices + PLY_FACE * faces, f"{faces:,} faces")
    elif kind == "obj":
        # Names of groups and materials say nothing here; of thousands trimesh takes minutes.
        whole = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
        data = b"\n".join(OBJ_LINES.findall(whole.replace(b"\r", b"\n"))) + b"\n"
        data = data.decode("ascii", "replace").encode()
        if not data.strip():
            raise BadFile(f"{path.name} has no line of an .obj that begins with v or f.")
    elif kind == "stl":
        data = check_stl(data, path.name)
    return data


def check_stl(data: bytes, name: str) -> bytes:
    """The bytes of an STL, as ASCII where it is text; one that is cut off is refused."""
    count = STL_HEAD.unpack_from(data)[1] if len(data) >= STL_HEAD.size else 0
    if count and len(data) == STL_HEAD.size + count * STL_TRIANGLE:
        return data
    if data.lstrip()[:5].lower() == b"solid" and b"vertex" in data:
        return data.decode("latin-1").encode("ascii", "replace")
    there = max(len(data) - STL_HEAD.size, 0) // STL_TRIANGLE
    raise BadFile(
        f"{name} promises {count:,} triangles and holds {there:,}; it is cut off or no STL, copy "
        "or export it again."
    )


def check_ply(data: bytes, name: str) -> tuple[int, int]:
    """(vertices, faces) that a PLY promises, which fit into the file.  Raises BadFile."""
    end = data.find(b"end_header", 0, MOST_HEADER)
    if not data.startswith(b"ply") or end < 0:
        raise BadFile(f"{name} has no PLY header; it is damaged.")
    text = b"format ascii" in data[:end]
    count, least, name_of, counts = 0, 0, "", {"vertex": 0, "face": 0}
    for line in [*data[:end].decode("latin-1").splitlines(), "element end 0"]:
        words = line.split()
        if words[:1] == ["element"] and len(words) == 3:
            refuse_ply(count, least, len(data) - end, name, name_of)
            if not (words[2].isascii() and words[2].isdigit() and len(words[2]) < 12):
                raise BadFile(f"{name} has {words[2][:20]!r} elements '{words[1][:20]}'.")
            name_of, count, least = words[1], int(words[2]), 0
            counts[name_of] = count
        elif words[:1] == ["property"] and len(words) >= 3:
            kind = words[2] if words[1] == "list" else words[1]  # a list has its length at least
            least += 2 if text else PLY_SIZES.get(kind, 1)
    return counts["vertex"], counts["face"]


def refuse_ply(count: int, least: int, there: int, name: str, element: str) -> None:
    if count * max(least, 1) > there:
        raise BadFile(
            f"{name} promises {count:,} elements '{element[:20]}' and has {there:,} bytes after "
            "its header; it is cut off or the number is wrong."
        )


def read_gltf_triangles(
    path: Path, memory: Account, leave_out: Collection[int] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """The triangles of the shown scene where its nodes stand.  Raises BadFile."""
    asset = Asset(path, memory)
    for needed in asset.item(asset.json, "extensionsRequired", list, []):
        harmless = ("KHR_mesh_quantization", "KHR_materials_", "KHR_texture_", *OBEYED)
        if not str(needed).startswith(harmless):
            raise asset.refuse(f"it needs {str(needed)[:60]}, which is not read here.")
    vertices, faces, count, start = [], [], 0, 0
    ours_from_file = np.eye(4)
    if not asset.in_our_axes:  # as splats of that format are turned
        ours_from_file[:3, :3] = HALF_TURN_Y
    for mesh, world_from_mesh in placed_meshes(asset):
        if mesh in leave_out:
            continue
        matrix = ours_from_file @ world_from_mesh
        for primitive in asset.item(asset.entry("meshes", mesh), "primitives", list, []):
            if not isinstance(primitive, dict) or primitive.get("mode", TRIANGLES) != TRIANGLES:
                continue
            places, rows = read_primitive(asset, primitive)
            memory.charge(GLTF_VERTEX * len(places) + GLTF_FACE * len(rows), f"{len(rows):,} faces")
            count += len(rows)
            if count > MOST_FACES or start + len(places) > 3 * MOST_FACES:
                raise asset.refuse(f"it has more than {MOST_FACES:,} faces; simplify it.")
            with np.errstate(over="ignore", invalid="ignore"):
                vertices.append(places @ matrix[:3, :3].T + matrix[:3, 3])
            mirrored = np.linalg.det(matrix[:3, :3]) < 0
            faces.append((rows[:, ::-1] if mirrored else rows) + start)
            start += len(places)
    if not faces:
        raise asset.refuse("its scene shows no triangles; a collider needs some.")
    return np.concatenate(vertices), np.concatenate(faces)


def read_primitive(asset: Asset, primitive: dict) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) float64 and faces (F, 3) of one primitive.  Raises BadFile."""
    attributes = asset.item(primitive, "attributes", dict, {})
    places = asset.read(attributes.get("POSITION"), "POSITION", 3).astype(np.float64)
    if "indices" in primitive:
        rows = asset.read(primitive["indices"], "indices", 1).reshape(-1)
        if len(rows) and not rows.max() < min(len(places), 1 << 24):  # exact in float32 below
            raise asset.refuse("it has faces of vertices that it does not have; it is damaged.")
        rows = rows.astype(np.int64)
    else:
        rows = np.arange(len(places))
    if len(rows) % 3:
        raise asset.refuse(f"it has {len(rows)} corners of triangles, which is no multiple of 3.")
    return places, rows.reshape(-1, 3)
