"""The first anchors: where they stand, how large they are, how they lie, and in which colours.

They keep the density of the points that they are taken from: where a capture has many points,
anchors are many and small, far away they are few and large.
"""

from typing import NamedTuple

import numpy as np

from shapeshift.training.first_anchors.hull import (
    median_neighbour,
    voxel_centres,
)
from shapeshift.training.first_anchors.initial import (
    InitialPoints,
)
from shapeshift.training.first_anchors.views import pixel_of
from shapeshift.training.heads.networks import ATTRIBUTE_WIDTH
from shapeshift.training.photos import BLACK, LoadedPhoto

NEIGHBOURS = 3  # whose distance is an anchor's size, as the first scale of 3DGS
SURFACE = 9  # nearest points, an anchor's own place among them, that say how a surface lies
FLATNESS = (0.3, 2.0)  # least and most of an axis, in the geometric mean of the three
SAME_PLACE = 1.0  # of its neighbours' distance, to a place of another shape
NEAR_PLACE = 2.0  # the same where shapes are counted: hulls out of other photos differ by cells
OTHER_SHAPE = 0.25  # of a hull's places: so many apart from all others make it a shape of its own
SIZES = 30.0  # times, from the median: what is nearer or farther than that is an outlier
COLOR_PHOTOS = 24  # that the first colours are taken from
DARKEST, BRIGHTEST = 0.02, 0.98  # of a base colour: beyond, its logit would not move any more


class FirstAnchors(NamedTuple):
    """What an optimiser starts with, float32."""

    anchors: np.ndarray  # (A, 3) metres
    frames: np.ndarray  # (A, 7) logarithms of sizes in voxels, then wxyz: see gaussians.cl
    colors: np.ndarray  # (A, 3) logits
    light: np.ndarray  # (A, 24) logits, none yet: colours are alike from everywhere
    voxel: float  # metres: the median size
    most: int  # anchors that there may be


def first_anchors(
    first: InitialPoints, most: int, photos: list[LoadedPhoto], background: tuple | None,
    by_shape: bool = False,
) -> FirstAnchors:  # fmt: skip
    """At most `most` anchors at the points of a capture, by_shape for each shape that it has.

    background: of the photos where they are see-through; None: black.
    """
    if by_shape:
        most = cap_of_shapes(first, most)
    places = choose_positions(first, most)
    size = neighbour_distance(places)
    voxel = max(float(np.median(size)), 1e-9)  # of places that float32 cannot tell apart: 0
    size = np.clip(size, voxel / SIZES, voxel * SIZES)
    axes, wxyz = surface_axes(places, np.concatenate([first.points, first.guesses]))
    frames = np.concatenate([np.log(size[:, None] / voxel * axes), wxyz], axis=1)
    at, axes = (a.astype(np.float32) for a in (places, frames))
    logits = base_colors(places, photos, background)
    light = np.zeros((len(at), ATTRIBUTE_WIDTH["light"]), np.float32)
    return FirstAnchors(at, axes, logits, light, voxel, most)


def base_colors(
    places: np.ndarray, photos: list[LoadedPhoto], background: tuple | None
) -> np.ndarray:
    """(A, 3) float32 logits of the mean colours that photos show at places (A, 3)."""
    seen = np.clip(photo_colors(places, photos, background or BLACK), DARKEST, BRIGHTEST)
    return np.log(seen / (1 - seen)).astype(np.float32)


def choose_positions(first: InitialPoints, most: int) -> np.ndarray:
    """(A, 3) at most so many places: of the points and of the guesses added to them."""
    points = np.unique(first.points, axis=0)  # scans have some of them twice
    if len(first.shapes) > 1:  # hulls lie over each other where stops have the same outlines
        points = voxel_centres(points, median_neighbour(points, np.random.default_rng(0)))
    share = int(first.guess_share * most)
    guesses = choose_guesses(first, share, most - min(len(points), most - share))
    return np.concatenate([subsample(points, most - len(guesses)), guesses])


def cap_of_shapes(first: InitialPoints, most: int) -> int:
    """`most` anchors for each shape that hulls beside triangulated points are.

    Hulls that lie over each other are one shape; of layers, one within the other, each asks for
    anchors of its own.
    """
    share = int(first.guess_share * most)
    if len(first.guess_shapes) < 2 or share < 1:
        return most
    apart = places_apart(first, share, NEAR_PLACE)
    return most * sum(len(places) >= OTHER_SHAPE * of for places, of in apart)


def choose_guesses(first: InitialPoints, share: int, most: int) -> np.ndarray:
    """(G, 3) of the guesses: `share`, or of several shapes so many of each and `most` in all.

    One stop's shape may lie within another's that has more points, and would get few anchors.
    """
    if len(first.guess_shapes) < 2 or share < 1:
        return subsample(first.guesses, share)
    apart = places_apart(first, share, SAME_PLACE)
    return subsample(np.concatenate([places for places, _ in apart]), most)


def places_apart(first: InitialPoints, share: int, same: float) -> list[tuple[np.ndarray, int]]:
    """Of each shape the places (G, 3) that no denser one has, and of how many these are.

    Each has `share` places, those of the densest serve all that lie over it.  same: up to so many
    times its neighbours' distance a place is another shape's as well.
    """
    from scipy.spatial import cKDTree

    each = [subsample(shape, share) for shape in first.guess_shapes]
    spaces = [neighbour_distance(places) for places in each]
    chosen, found = np.zeros((0, 3)), []
    for number in sorted(range(len(each)), key=lambda n: spaces[n].mean()):
        places = each[number]
        if len(chosen):
            distance, _ = cKDTree(chosen).query(places)
            places = places[distance > same * spaces[number]]
        chosen = np.concatenate([chosen, places])
        found.append((places, len(each[number])))
    return found


def subsample(points: np.ndarray, most: int) -> np.ndarray:
    """At most so many of the points, each standing for equally many: as dense as they are, evenly.

    The points are halved across their longest side until each part has one place, the point that is
    nearest to its middle (the leaves of a k-d tree).
    """
    if len(points) <= most:
        return points
    found, parts = [], [(np.arange(len(points)), most)]
    while parts:
        rows, count = parts.pop()
        part = points[rows]
        if count <= 1:
            away = ((part - part.mean(axis=0)) ** 2).sum(axis=1)
            found += [rows[away.argmin()]] * count
            continue
        half = count // 2
        middle = round(len(rows) * half / count)
        order = np.argsort(part[:, np.ptp(part, axis=0).argmax()], kind="stable")
        parts.append((rows[order[middle:]], count - half))
        parts.append((rows[order[:middle]], half))
    return points[np.sort(np.array(found, int))]


def neighbour_distance(points: np.ndarray) -> np.ndarray:
    """(P,) metres: root mean square distance to the nearest neighbours; of a lone point, 1."""
    from scipy.spatial import cKDTree

    near = min(NEIGHBOURS, len(points) - 1)
    if near < 1:
        return np.ones(len(points))
    distance, _ = cKDTree(points).query(points, k=near + 1)
    return np.sqrt((distance[:, 1:] ** 2).mean(axis=1))


def surface_axes(places: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How the points (P, 3) lie about places (A, 3): factors (A, 3) along axes, and these as wxyz.

    The axes are those of the nearest points' spread, the shortest first; the product of the factors
    is 1 but for the bounds of FLATNESS.
    """
    from scipy.spatial import cKDTree
    from scipy.spatial.transform import Rotation

    if len(points) <= NEIGHBOURS:  # no plane to be seen
        return np.ones((len(places), 3)), np.tile([1.0, 0, 0, 0], (len(places), 1))
    _, near = cKDTree(points).query(places, k=min(SURFACE, len(points)))
    around = points[near] - points[near].mean(axis=1, keepdims=True)  # (A, n, 3)
    variance, axes = np.linalg.eigh(np.einsum("ani,anj->aij", around, around))
    axes[np.linalg.det(axes) < 0, :, 0] *= -1
    largest = np.maximum(variance[:, 2:], 1e-30)
    spread = np.sqrt(np.maximum(variance / largest, 1e-8))
    spread /= np.exp(np.log(spread).mean(axis=1, keepdims=True))
    xyzw = Rotation.from_matrix(axes).as_quat()
    return np.clip(spread, *FLATNESS), xyzw[:, [3, 0, 1, 2]]


def photo_colors(points: np.ndarray, photos: list[LoadedPhoto], background: tuple) -> np.ndarray:
    """(P, 3) the mean colour of the pixels that count and points (P, 3) fall on; grey: on none."""
    total, times = np.zeros((len(points), 3)), np.zeros(len(points))
    for photo in photos[:: -(-len(photos) // COLOR_PHOTOS)]:
        pixel, inside = pixel_of(photo.view, points)
        column, row = pixel[inside].astype(int).T
        weight = 1.0 if (given := photo.weight) is None else given[row, column] > 0
        total[inside] += photo.over(background)[row, column] * np.reshape(weight, (-1, 1))
        times[inside] += weight
    return np.where(times[:, None] > 0, total / np.maximum(times, 1)[:, None], 0.5)
