"""Where the meshes of a glTF scene stand, and splats moved there."""

from dataclasses import replace

import numpy as np

from runtime_models.gltf_files import Asset
from runtime_models.plain_splats import RawSplats
from runtime_models.rotation import normalize, rotation_matrices
from runtime_models.turn import quaternion_of, turn_harmonics

PLACES = {"matrix", "translation", "rotation", "scale"}
EVEN = 1e-5  # how much the scales of a node may differ and still be one
BLOCK = 1 << 16  # splats at a time whose shapes are decomposed


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


@np.errstate(over="ignore", invalid="ignore")  # numbers that are none are for the judge to find
def moved(raw: RawSplats, world_from_mesh: np.ndarray, asset: Asset) -> RawSplats:
    """The splats (in metres, not logarithms) after a node's matrix (4, 4), whatever it is.

    Places become float64 where the node lies elsewhere: a far one keeps its millimetres.
    """
    if np.array_equal(world_from_mesh, np.eye(4)):
        return raw
    linear, offset = world_from_mesh[:3, :3], world_from_mesh[:3, 3]
    left, sizes, right = np.linalg.svd(linear)
    if not sizes[2] > 1e-12 * sizes[0] > 0:
        raise asset.refuse("a node squeezes its splats to a plane or to nothing.")
    turn = left @ right  # the nearest rotation; a reflection where the matrix mirrors
    raw = replace(raw, means=raw.means @ linear.T + offset)
    if not np.allclose(turn, np.eye(3), atol=1e-7):
        harmonics = turn_harmonics(turn, raw.sh.shape[1])
        sh = np.einsum("ij,njc->nic", harmonics, raw.sh, optimize=True)
        raw = replace(raw, sh=sh)
    if sizes[0] - sizes[2] <= EVEN * sizes[0] and np.linalg.det(turn) > 0:
        w, x, y, z = quaternion_of(turn)
        times = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
        wxyz = (raw.wxyz @ times.T).astype(np.float32)
        return replace(raw, scales=raw.scales * np.float32(sizes.mean()), wxyz=wxyz)
    scales, wxyz = stretched(raw.scales, raw.wxyz, linear)
    return replace(raw, scales=scales, wxyz=wxyz)


def stretched(
    scales: np.ndarray, wxyz: np.ndarray, linear: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Scales (N, 3) and quaternions (N, 4) of ellipsoids after any linear map (3, 3).

    Sigma' = M C C^T M^T: the singular values and left vectors of M C.
    """
    new_scales, new_wxyz = np.empty_like(scales, np.float32), np.empty_like(wxyz, np.float32)
    for start in range(0, len(scales), BLOCK):
        part = slice(start, start + BLOCK)
        axes = rotation_matrices(normalize(wxyz[part].astype(np.float64)))
        shape = np.nan_to_num(linear @ (axes * scales[part, None, :]), posinf=0, neginf=0)
        left, sizes, _ = np.linalg.svd(shape)
        left[np.linalg.det(left) < 0, :, 2] *= -1  # any sign of an axis is the same ellipsoid
        good = np.isfinite(scales[part]).all(1) & np.isfinite(wxyz[part]).all(1)
        good &= (wxyz[part] != 0).any(1)
        new_scales[part] = np.where(good[:, None], sizes, np.nan)
        new_wxyz[part] = quaternions_of(left)
    return new_scales, new_wxyz


def quaternions_of(matrices: np.ndarray) -> np.ndarray:
    """(N, 4) wxyz of rotations (N, 3, 3): each component's square is known, take the largest."""
    m = matrices
    xx, yy, zz = m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]
    squares = np.stack([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz], 1)
    products = np.empty((len(m), 4, 4))  # 4 q q^T
    products[:, range(4), range(4)] = squares
    pairs = {
        (0, 1): m[:, 2, 1] - m[:, 1, 2], (0, 2): m[:, 0, 2] - m[:, 2, 0],
        (0, 3): m[:, 1, 0] - m[:, 0, 1], (1, 2): m[:, 0, 1] + m[:, 1, 0],
        (1, 3): m[:, 0, 2] + m[:, 2, 0], (2, 3): m[:, 1, 2] + m[:, 2, 1],
    }  # fmt: skip
    for (i, j), value in pairs.items():
        products[:, i, j] = products[:, j, i] = value
    rows = products[np.arange(len(m)), squares.argmax(1)]
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)
