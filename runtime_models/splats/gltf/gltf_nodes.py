"""Where the meshes of a glTF scene stand."""

import numpy as np

from shapeshift.runtime_models.rotation import normalize, rotation_matrices
from shapeshift.runtime_models.splats.gltf.gltf_files import Asset

PLACES = {"matrix", "translation", "rotation", "scale"}


def placed_meshes(asset: Asset) -> list[tuple[int, np.ndarray]]:
    """(mesh, world_from_mesh (4, 4) float64) of every node of the scene that has a mesh."""
    nodes = asset.item(asset.json, "nodes", list, [])
    if not nodes:
        return [(i, np.eye(4)) for i in range(len(asset.item(asset.json, "meshes", list, [])))]
    found, seen = [], set()
    waiting = [(root, np.eye(4)) for root in reversed(scene_roots(asset, len(nodes)))]
    while waiting:
        index, world_from_parent = waiting.pop()
        node = asset.entry("nodes", index)
        if index in seen:
            raise asset.refuse(f"node {index} hangs on two nodes or on itself.")
        seen.add(index)
        world_from_node = world_from_parent
        if PLACES & node.keys():
            with np.errstate(over="ignore", invalid="ignore"):
                world_from_node = world_from_parent @ local_matrix(asset, node, index)
            if not np.isfinite(world_from_node).all():
                raise asset.refuse(f"node {index} stands at infinity.")
        if "mesh" in node:
            found.append((node["mesh"], world_from_node))
        children = asset.item(node, "children", list, [])
        waiting += [(child, world_from_node) for child in reversed(children)]
    return found


def scene_roots(asset: Asset, count: int) -> list:
    """The nodes of the scene that is shown; without scenes, those that hang on no other."""
    if asset.item(asset.json, "scenes", list, []):
        scene = asset.entry("scenes", asset.item(asset.json, "scene", int, 0))
        return asset.item(scene, "nodes", list, [])
    children = set()
    for index in range(count):
        below = asset.item(asset.entry("nodes", index), "children", list, [])
        children |= {child for child in below if isinstance(child, int)}
    return [index for index in range(count) if index not in children]


def local_matrix(asset: Asset, node: dict, index: int) -> np.ndarray:
    """(4, 4) parent_from_node of a matrix, or of translation, rotation (xyzw) and scale."""
    if "matrix" in node:
        return numbers(asset, node, "matrix", 16, index).reshape(4, 4).T
    out = np.eye(4)
    if "rotation" in node:
        x, y, z, w = numbers(asset, node, "rotation", 4, index)
        out[:3, :3] = rotation_matrices(normalize(np.array([[w, x, y, z]])))[0]
    if "scale" in node:
        out[:3, :3] *= numbers(asset, node, "scale", 3, index)
    if "translation" in node:
        out[:3, 3] = numbers(asset, node, "translation", 3, index)
    return out


def numbers(asset: Asset, node: dict, name: str, count: int, index: int) -> np.ndarray:
    """(count,) float64 of a node's list."""
    found = asset.item(node, name, list)
    plain = all(isinstance(n, int | float) and abs(n) < 1e30 for n in found)
    if len(found) != count or not plain:
        raise asset.refuse(f"node {index} has a {name} that is not {count} finite numbers.")
    return np.array(found, np.float64)
