"""Triangles of an .obj, .ply or .stl by trimesh, behind the gate."""

import io

import numpy as np

from shapeshift.runtime_models.gate.refusal import Unreadable
from shapeshift.scene.colliders.triangle_mesh import joined


def mesh_arrays(data: bytes, kind: str, name: str) -> dict:
    """{"vertices": (V, 3) float32, "faces": (F, 3) int32} of a file's bytes, as triangle_mesh's
    `joined` makes them; kind: its ending; name: that of the file.  Raises Unreadable, BadFile.
    """
    import trimesh

    try:
        with np.errstate(all="ignore"):
            mesh = trimesh.load_mesh(
                io.BytesIO(data), file_type=kind, process=False, maintain_order=True,
                **({"skip_materials": True} if kind == "obj" else {}),
            )  # fmt: skip
            if isinstance(mesh, trimesh.Scene):
                mesh = mesh.to_mesh()
            vertices = np.asarray(mesh.vertices)
            faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    except MemoryError:
        raise
    except Exception as error:  # on damaged bytes its parsers raise whatever comes up
        reason = " ".join(str(error).split())[:80] or type(error).__name__
        raise Unreadable(f"cannot be read as a mesh ({reason}); it is damaged") from None
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise Unreadable(f"it has vertices of {vertices.shape[-1]} numbers; 3 are wanted")
    whole = joined(vertices, faces, name)
    return {"vertices": whole.vertices, "faces": whole.faces}
