"""Colliders as files: a skin and its convex pieces in one .glb, as game engines exchange them.

A mesh whose name begins with UCX_, or that hangs on a node of such a name, is one convex piece of
the collider (the convention of Unreal Engine, which others follow); every other mesh is the skin.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.gltf.gltf_files import Asset
from shapeshift.runtime_models.splats.gltf.gltf_nodes import placed_meshes
from shapeshift.runtime_models.splats.operations.rotate_splats import HALF_TURN_Y
from shapeshift.scene.colliders.collider_wrap import join_meshes
from shapeshift.scene.colliders.read_mesh import read_mesh
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh

PIECE = "UCX_"
SKIN = "collider"
MOST_PIECES = 16  # as many as we make ourselves: an engine tests each against each


@dataclass(frozen=True)
class Pieces:
    """What a file says of a collider."""

    points: list[np.ndarray]  # (V, 3) float32 metres of each convex piece
    skin: TriangleMesh  # everything else in the file; the pieces themselves where that is nothing


def read_pieces(path: Path) -> Pieces | None:
    """The convex pieces of a .glb or .gltf, and its skin; None of other files.  Raises BadFile."""
    if path.suffix.lower() not in (".glb", ".gltf") or not path.is_file():
        return None
    asset = Asset(path, Memory().of(path))
    placed = placed_meshes(asset)
    pieces = {mesh for mesh, _ in placed if is_piece(asset, mesh)}
    if not pieces:
        return None
    if len(pieces) > MOST_PIECES:
        raise BadFile(
            f"{path.name} has {len(pieces):,} convex pieces ({PIECE}...); at most {MOST_PIECES} "
            "are taken, join some."
        )
    every = {mesh for mesh, _ in placed}
    points = [read_mesh(path, every - {mesh}).vertices for mesh in sorted(pieces)]
    if every > pieces:
        return Pieces(points, read_mesh(path, pieces))
    return Pieces(points, join_meshes([TriangleMesh(p, hull_faces(p)) for p in points]))


def is_piece(asset: Asset, mesh: int) -> bool:
    """Whether a mesh of the asset is a convex piece, by its name or that of its node."""
    nodes = [node for node in asset.item(asset.json, "nodes", list, []) if isinstance(node, dict)]
    named = [asset.entry("meshes", mesh), *(node for node in nodes if node.get("mesh") == mesh)]
    return any(str(entry.get("name", "")).upper().startswith(PIECE) for entry in named)


def write_collider(hulls: tuple[np.ndarray, ...], mesh: TriangleMesh, path: Path) -> None:
    """A skin and its convex pieces (V, 3), metres, to a .glb: the same arrays, the same bytes.

    Turned into glTF's axes (left, up, front), as read_mesh turns them back.
    """
    import trimesh

    scene = trimesh.Scene()
    parts = [(SKIN, mesh.vertices, mesh.faces)]
    for number, hull in enumerate(hulls):
        parts.append((f"{PIECE}{SKIN}_{number:02}", hull, hull_faces(hull)))
    for name, vertices, faces in parts:
        turned = vertices @ HALF_TURN_Y.astype(np.float32)
        part = trimesh.Trimesh(turned, faces, process=False, validate=False)
        scene.add_geometry(part, node_name=name, geom_name=name)
    data = scene.export(file_type="glb", include_normals=False)
    assert isinstance(data, bytes), "as of every binary format"
    write_whole(path, data)


def hull_faces(points: np.ndarray) -> np.ndarray:
    """(F, 3) int32 of the hull of points (V, 3), anticlockwise seen from outside.

    Raises BadFile where they lie in a plane.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points.astype(np.float64))
    except (QhullError, ValueError):  # ValueError: fewer than four
        raise BadFile("it has a convex piece that is flat; give it a thickness.") from None
    faces = hull.simplices.astype(np.int32)
    a, b, c = (points[faces[:, i]].astype(np.float64) for i in range(3))
    inward = np.einsum("fi,fi->f", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces
