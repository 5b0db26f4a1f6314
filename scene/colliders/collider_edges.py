"""The edges of a collider, for a debug view: where its faces meet at an angle."""

import numpy as np

from shapeshift.scene.colliders.collider import Collider
from shapeshift.scene.colliders.convex_parts import hull_triangles

FLAT = 0.9998  # cosine between two faces; flatter than that the edge between them is no edge


def hull_edges(collider: Collider) -> np.ndarray:
    """(S, 2, 3) float32 metres, object frame: of every convex piece."""
    faces = [hull_triangles(hull) for hull in collider.parts]
    edges = [edges_of(corners) for corners in faces if corners is not None]
    return np.concatenate([np.zeros((0, 2, 3), np.float32), *edges])


def mesh_edges(collider: Collider) -> np.ndarray:
    """(S, 2, 3) float32 metres, object frame: of the mesh that a background is touched as."""
    return edges_of(collider.mesh.vertices[collider.mesh.faces])


def edges_of(corners: np.ndarray) -> np.ndarray:
    """(S, 2, 3) float32: the edges of triangles (F, 3, 3), without those within a flat face."""
    points, rows = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces = rows.reshape(-1, 3)
    normals = np.cross(
        points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]
    )
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    pairs = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    face = np.repeat(np.arange(len(faces)), 3)
    edges, edge = np.unique(pairs, axis=0, return_inverse=True)
    edge = edge.ravel()
    order = np.argsort(edge, kind="stable")
    of_edge = normals[face[order]]  # (3F, 3), the faces of an edge side by side
    first = np.searchsorted(edge[order], np.arange(len(edges)))
    other = np.searchsorted(edge[order], np.arange(len(edges)), "right") - 1
    shared = other > first  # else it is a border
    # Whichever way round a face is wound: a hull's triangles come in no order.
    cosine = np.abs(np.einsum("ij,ij->i", of_edge[first], of_edge[other]))
    return points[edges[~(shared & (cosine > FLAT))]].astype(np.float32)
