"""What the physics touches of the background: flat where things stood, a skin around the rest.

The skin is what is surely solid by the rays of photos (scene/colliders/carve.py); it is bumpy by
some millimetres, and open where a thing was taken out: what stands on it would rock, or fall
through.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from shapeshift.decomposition.completion.plane import CELL, ROOM, AnchorLooks, Plane
from shapeshift.decomposition.completion.verify import ModelPictures
from shapeshift.rasterizer.device import Device
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import AnchorModel
from shapeshift.runtime_models.parts import splat_labels
from shapeshift.scene.colliders.carve import (
    GRAZING,
    PhotoSight,
    SeenDepth,
    carved_mesh,
    is_free,
    is_within,
    votes,
)
from shapeshift.scene.colliders.collider import Making, mesh_of_splats
from shapeshift.scene.colliders.collider_wrap import join_meshes
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh

THICK = 4.0  # sides of a cell: of the slab below a plane
SUNK = 2.0  # sides of a cell that the skin near a plane is kept below it: out of all contacts
PINCH = 0.02  # of the way to its neighbours that a corner goes which others share
NEAR = 1.5  # sides of a cell above and below, in which the skin counts as the plane's
SAME_HEIGHT, SAME_WAY = 2.0, 0.9  # spacings of anchors, cosine: a pixel that shows a plane
FEWEST_PIXELS = 100  # that tell how high a plane is
SAME_ANGLE, SAME_OFFSET = 0.999, 1.0  # cosine, sides of a cell: planes that are one


def ground_mesh(
    background: AnchorModel,
    looks: AnchorLooks,
    labels: np.ndarray,
    planes: Sequence[Plane],
    x: float,
    making: Making,
    standing: Sequence[tuple[Plane, np.ndarray]] = (),
    seen: Sequence[SeenDepth] = (),
    loose: Sequence[np.ndarray] = (),
) -> TriangleMesh:
    """The background's mesh, in the model's frame: slabs under the planes, and the skin: around
    what rays end on, and where nobody looked around all splats.

    background: without the objects.  looks, labels (A,): of the whole model, so that a slab lies
    under the things, too.  standing: the plane that each object stands on, and the corners (V, 3)
    of what is touched of it; no skin is left within them, or the object would jump out of it.
    loose: corners (V, 3) of each piece of things that stand on no plane, with the same in mind.
    Raises BadFile where nothing can be touched.
    """
    skin = carved_mesh(seen, making.faces, loose) if seen else None
    if skin is None:
        skin = mesh_of_splats(*Evaluator(background).geometry(x), making)
    side = CELL * looks.spacing_m
    vertices, slabs = skin.vertices.astype(np.float64), []
    for plane in distinct(planes, side):
        low, covered = covered_cells(looks, labels, plane, side)
        if seen:
            covered = without_diagonals(covered & ~free_cells(seen, plane, low, covered, side))
        if not covered.any():
            continue
        slabs.append(slab(plane, low, covered, side))
        cells = ((vertices @ plane.axes().T - low) / side).astype(int)
        inside = np.asarray(((cells >= 0) & (cells < covered.shape)).all(1))
        inside[inside] = covered[tuple(cells[inside].T)]
        height = plane.height(vertices)
        low_skin = inside & (np.abs(height) < NEAR * side)
        vertices[low_skin] -= (height[low_skin, None] + SUNK * side) * plane.normal
    for plane, corners in standing:
        within = is_within(vertices, corners, side)
        height = plane.height(vertices[within])
        vertices[within] -= np.maximum(height + SUNK * side, 0)[:, None] * plane.normal
    return join_meshes([without_pinches(vertices.astype(np.float32), skin.faces), *slabs])


def without_pinches(vertices: np.ndarray, faces: np.ndarray) -> TriangleMesh:
    """Corners that several sheets of a skin share in place go a little back into their own.

    Who reads a mesh may join equal corners, and edges there would have more than two faces.
    """
    _, group, count = np.unique(vertices, axis=0, return_inverse=True, return_counts=True)
    shared = count[group.reshape(-1)] > 1
    sums, around = np.zeros(vertices.shape), np.zeros(len(vertices))
    for corner in range(3):
        others = vertices[faces].sum(axis=1, dtype=np.float64) - vertices[faces[:, corner]]
        np.add.at(sums, faces[:, corner], others)
        np.add.at(around, faces[:, corner], 2)
    middle = sums[shared] / np.maximum(around[shared], 1)[:, None]
    moved = vertices.copy()
    moved[shared] += (PINCH * (middle - vertices[shared])).astype(np.float32)
    return TriangleMesh(moved, faces)


def seen_depths(
    device: Device, model: AnchorModel, sights: Sequence[PhotoSight], x: float, making: Making
) -> list[SeenDepth]:
    """How far each photo sees, and which of its pixels end on background.

    Where the model shows nothing, nothing is known: what has the colour that is behind the scene,
    as a grey floor, has been left out of it.
    """
    pictures, objects = ModelPictures(device, model), splat_labels(model) != 0
    seen = []
    for done, sight in enumerate(sights):
        making.report("looking at what is free", done / len(sights))
        depth_m, share = pictures.depth(sight.view, x, objects)
        depth_m[np.isinf(depth_m)] = np.nan
        if sight.measured_m is not None:
            depth_m = np.where(sight.measured_m > 0, sight.measured_m, depth_m)
        seen.append(SeenDepth(sight.view, depth_m, share < 0.5))
    return seen


def seen_planes(
    planes: Mapping[int, Plane], seen: Sequence[SeenDepth], spacing_m: float
) -> dict[int, Plane]:
    """Each at the height of what photos see of it, at most SAME_HEIGHT spacings away.

    Anchors lie in the middle of a layer of splats, half its thickness under what one looks at.
    """
    near_m = SAME_HEIGHT * spacing_m
    heights: dict[int, list[np.ndarray]] = {label: [np.zeros(0)] for label in planes}
    for one in seen if planes else ():
        normals, cosines, _ = one.planes
        rows = one.solid & (cosines > GRAZING)
        normal, points = normals[rows], one.points[rows]
        for label, plane in planes.items():
            height = plane.height(points)
            flat = (normal @ plane.normal > SAME_WAY) & (np.abs(height) < near_m)
            heights[label].append(height[flat])
    out = {}
    for label, plane in planes.items():
        found = np.concatenate(heights[label])
        out[label] = plane
        if len(found) >= FEWEST_PIXELS:
            out[label] = Plane(plane.normal, plane.offset + float(np.median(found)))
    return out


def free_cells(
    seen: Sequence[SeenDepth], plane: Plane, low: np.ndarray, cells: np.ndarray, side: float
) -> np.ndarray:
    """(X, Y) bool: cells of a plane, chosen ones, that rays go through."""
    flat = low + (np.argwhere(cells) + 0.5) * side  # (n, 2)
    places = flat @ plane.axes() + (plane.offset - side / 2) * plane.normal
    out = np.zeros(cells.shape, bool)
    out[cells] = is_free(votes(seen, places, side))
    return out


def distinct(planes: Sequence[Plane], side: float) -> list[Plane]:
    """One of several that are nearly the same."""
    found: list[Plane] = []
    for plane in planes:
        same = (
            plane.normal @ other.normal > SAME_ANGLE
            and abs(plane.offset - other.offset) < SAME_OFFSET * side
            for other in found
        )
        if not any(same):
            found.append(plane)
    return found


def covered_cells(
    looks: AnchorLooks, labels: np.ndarray, plane: Plane, side: float
) -> tuple[np.ndarray, np.ndarray]:
    """(2,) metres along the plane's axes, and the cells (X, Y) bool from there that carry."""
    from scipy import ndimage

    height = plane.height(looks.places)
    on = looks.there & (np.abs(height) < side) & ((labels == 0) | (height < side))
    flat = looks.places[on] @ plane.axes().T
    low = flat.min(0) - ROOM * side
    shape = np.ceil((flat.max(0) - low) / side).astype(int) + ROOM
    cells = np.zeros(shape, bool)
    cells[tuple(((flat - low) / side).astype(int).T)] = True
    cells = ndimage.binary_fill_holes(ndimage.binary_closing(cells, iterations=2))
    pieces, count = ndimage.label(cells)
    sizes = np.bincount(pieces.ravel(), minlength=count + 1)
    sizes[0] = 0
    return low, without_diagonals(sizes[pieces] >= 0.05 * sizes.max())


def without_diagonals(cells: np.ndarray) -> np.ndarray:
    """The cells with more taken where two touch at a corner alone: else no solid has that edge."""
    cells = cells.copy()
    while True:
        a, b, c, d = cells[:-1, :-1], cells[1:, :-1], cells[:-1, 1:], cells[1:, 1:]
        rising, falling = a & d & ~b & ~c, b & c & ~a & ~d
        if not (rising.any() or falling.any()):
            return cells
        cells[1:, :-1] |= rising
        cells[:-1, :-1] |= falling


def slab(plane: Plane, low: np.ndarray, cells: np.ndarray, side: float) -> TriangleMesh:
    """A closed plate under the cells (X, Y) bool, its upper face on the plane."""
    wide = np.pad(cells, 1)
    width = cells.shape[1] + 1
    x, y = np.nonzero(cells)
    corner = np.stack([x * width + y, (x + 1) * width + y, (x + 1) * width + y + 1,
                       x * width + y + 1], 1)  # fmt: skip
    below = (cells.shape[0] + 1) * width
    faces = [corner[:, [0, 1, 2]], corner[:, [0, 2, 3]]]
    faces += [corner[:, [0, 2, 1]] + below, corner[:, [0, 3, 2]] + below]
    for k, (i, j) in enumerate(((0, -1), (1, 0), (0, 1), (-1, 0))):  # the side from corner k on
        rim = ~wide[x + 1 + i, y + 1 + j]
        a, b = corner[rim, k], corner[rim, (k + 1) % 4]
        faces += [np.stack([a, a + below, b + below], 1), np.stack([a, b + below, b], 1)]
    grid = np.stack(np.meshgrid(*(np.arange(n + 1) for n in cells.shape), indexing="ij"), -1)
    flat = (low + grid.reshape(-1, 2) * side) @ plane.axes() + plane.offset * plane.normal
    vertices = np.concatenate([flat, flat - THICK * side * plane.normal])
    used, rows = np.unique(np.concatenate(faces), return_inverse=True)
    return TriangleMesh(vertices[used].astype(np.float32), rows.reshape(-1, 3).astype(np.int32))
