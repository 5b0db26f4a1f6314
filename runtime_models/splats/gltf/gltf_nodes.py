"""Where the meshes of a glTF scene stand."""

from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.rotation import normalize, rotation_matrices
from shapeshift.runtime_models.splats.gltf.gltf_files import Asset

PLACES = {"matrix", "translation", "rotation", "scale"}
INSTANCES, VISIBILITY = "EXT_mesh_gpu_instancing", "KHR_node_visibility"
OBEYED = (INSTANCES, VISIBILITY)  # extensions of nodes
POINTER = "KHR_animation_pointer"
MOST_INSTANCES = 10_000  # of meshes in a scene


@dataclass(frozen=True, slots=True)
class Placed:
    """A node's mesh: once, or once for each of its instances."""

    mesh: int
    worlds: np.ndarray  # (K, 4, 4) float64, world_from_mesh
    hidden: bool = False  # by KHR_node_visibility, of the node or of one that it hangs on
    animated: bool = False  # likewise


def placed_meshes(asset: Asset) -> list[tuple[int, np.ndarray]]:
    """(mesh, world_from_mesh (4, 4) float64) of every node of the scene that has a mesh, each
    instance by itself; hidden ones, too.
    """
    return [(placed.mesh, world) for placed in placed_nodes(asset) for world in placed.worlds]


def placed_nodes(asset: Asset) -> list[Placed]:
    """The nodes of the scene that have a mesh.  Raises BadFile."""
    nodes = asset.item(asset.json, "nodes", list, [])
    if not nodes:
        meshes = len(asset.item(asset.json, "meshes", list, []))
        return [Placed(mesh, np.eye(4)[None]) for mesh in range(meshes)]
    moving = animated_nodes(asset)
    found: list[Placed] = []
    seen: set[int] = set()
    more, still = 0, np.eye(4)
    waiting = [(root, still, False, False) for root in reversed(scene_roots(asset, len(nodes)))]
    while waiting:
        index, world_from_parent, hidden, animated = waiting.pop()
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
        hidden |= not asset.item(extension(asset, node, VISIBILITY), "visible", bool, True)
        animated |= index in moving
        if "mesh" in node:
            worlds = world_from_node[None]
            if INSTANCES in asset.item(node, "extensions", dict, {}):
                worlds = worlds @ instance_matrices(asset, node, index)
            found.append(Placed(node["mesh"], worlds, hidden, animated))
            more += max(len(worlds) - 1, 0)
            if more > MOST_INSTANCES:
                raise asset.refuse(f"it has over {MOST_INSTANCES:,} instances of meshes.")
        children = asset.item(node, "children", list, [])
        waiting += [(c, world_from_node, hidden, animated) for c in reversed(children)]
    return found


def extension(asset: Asset, owner: dict, name: str) -> dict:
    return asset.item(asset.item(owner, "extensions", dict, {}), name, dict, {})


def instance_matrices(asset: Asset, node: dict, index: int) -> np.ndarray:
    """(K, 4, 4) node_from_instance by EXT_mesh_gpu_instancing; one identity without attributes."""
    attributes = asset.item(extension(asset, node, INSTANCES), "attributes", dict, {})
    parts = {
        name: asset.read(attributes[name], f"{INSTANCES} {name}", width)
        for name, width in (("TRANSLATION", 3), ("ROTATION", 4), ("SCALE", 3))
        if name in attributes
    }
    counts = {len(part) for part in parts.values()}
    if len(counts) > 1:
        raise asset.refuse(f"the instances of node {index} have {sorted(counts)} numbers each.")
    count = counts.pop() if counts else 1
    if count > MOST_INSTANCES:
        raise asset.refuse(f"node {index} has {count:,} instances; {MOST_INSTANCES:,} are shown.")
    if not all((np.abs(part) < 1e30).all() for part in parts.values()):
        raise asset.refuse(f"an instance of node {index} stands at infinity.")
    out = np.tile(np.eye(4), (count, 1, 1))
    if "ROTATION" in parts:
        wxyz = parts["ROTATION"][:, [3, 0, 1, 2]].astype(np.float64)
        out[:, :3, :3] = rotation_matrices(normalize(wxyz))
    if "SCALE" in parts:
        out[:, :3, :3] *= parts["SCALE"][:, None, :]
    if "TRANSLATION" in parts:
        out[:, :3, 3] = parts["TRANSLATION"]
    return out


def animated_nodes(asset: Asset) -> set[int]:
    """The nodes that an animation moves, shows or hides."""
    found = set()
    for number in range(len(asset.item(asset.json, "animations", list, []))):
        channels = asset.item(asset.entry("animations", number), "channels", list, [])
        for channel in (each for each in channels if isinstance(each, dict)):
            target = asset.item(channel, "target", dict, {})
            said = extension(asset, target, POINTER).get("pointer")
            root, _, named = str(said).removeprefix("/").partition("/")
            first = named.partition("/")[0]
            if root == "nodes" and first.isascii() and first.isdigit() and len(first) < 10:
                found.add(int(first))
            elif isinstance(target.get("node"), int):
                found.add(target["node"])
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
