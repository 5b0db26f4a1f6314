"""The visual hull: the surface of what the silhouettes of all photos allow."""

from pathlib import Path

import numpy as np

from shapeshift.scene.pose import View
from shapeshift.training.first_anchors.views import common_box, pixel_of, pixel_size, seen_first
from shapeshift.training.photos import LoadedPhoto, sampled
from shapeshift.training.supervision.backgrounds import NOISE

COARSE_SIDE, FINE_SIDE = 64, 96  # grid cells along each side of a cube of the carved box's volume
VOTE_SIDE = 40  # the same, where photos contradict each other
FINEST = 2.0  # pixels of the photo that sees a cell finest: an anchor's splats fill no smaller one
HULL_PHOTOS = 40  # a modality at most; more sharpen little and take as long as they are many
LEAST_SEEN = 0.5  # of a hull's points; of objects seen from all around 0.65 to 0.85 are
UNCOVERED = 0.02  # of a silhouette: of photos that agree, a hull leaves nothing but rims
WRONG_SHARE = 0.1  # of the photos at most; more are no outliers
WRONG = 0.1  # of a silhouette that misses the hull, or of the hull that a photo denies
UNKNOWN = 2  # in a silhouette
# (H, W) where the photo shows the object: 1 or True; where it shows nothing: 0; or UNKNOWN, which
# carves nothing and asks for nothing.
Silhouette = tuple[View, np.ndarray]


def silhouette(photo: LoadedPhoto, background: tuple | None) -> np.ndarray | None:
    """(H, W) as of Silhouette; None where nothing of it is known."""
    if photo.see_through:
        shape = photo.rgba[..., 3] >= 128
    elif background is None:
        return None
    else:
        behind = np.asarray(background, np.float32)
        shape = np.abs(photo.over(background) - behind).max(axis=2) > NOISE
    return shape if photo.weight is None else np.where(photo.weight > 0, shape, np.uint8(UNKNOWN))


def visual_hulls(
    photos: list[LoadedPhoto], background: tuple | None
) -> tuple[list[np.ndarray], tuple[str, ...]]:
    """(P, 3) the hull of each modality, since one may hide what another shows; and a sentence for
    each modality with photos that do not fit the others.

    No hulls where no photo tells object from background.
    """
    centre, half = common_box([p.view for p in photos])
    photos, found, doubts = sampled(photos), [], []
    for modality in dict.fromkeys(p.modality for p in photos):
        told = ((p, silhouette(p, background)) for p in photos if p.modality == modality)
        mine = [(photo, shape) for photo, shape in told if shape is not None]
        mine = mine[:: -(-len(mine) // HULL_PHOTOS)] if mine else []
        shapes = [(photo.view, shape) for photo, shape in mine]
        if not shapes:
            continue
        if wrong := contradicting(shapes, centre, half):
            doubts.append(
                contradiction(modality, [Path(mine[i][0].name).name for i in sorted(wrong)])
            )
            shapes = [shape for i, shape in enumerate(shapes) if i not in wrong]
        found.append(visual_hull(shapes, centre, half))
    return found, tuple(doubts)


def contradiction(modality: str, names: list[str]) -> str:
    return (
        f"{modality}: {', '.join(names)} {'shows' if len(names) == 1 else 'show'} the subject "
        "where no other photo does, so that the first anchors are placed without; check their "
        "poses and masks."
    )


def visual_hull(photos: list[Silhouette], centre: np.ndarray, half: float) -> np.ndarray:
    """(P, 3) surface of what all silhouettes allow, carved coarsely first, then in its own box.

    It assumes that nothing is gained by anchors closer
    together than FINEST pixels; where photos show more, growing adds them.
    """
    coarse = carve(photos, centre - half, centre + half, COARSE_SIDE)
    if not len(coarse):
        return coarse
    views, margin = [view for view, _ in photos], 2 * half / COARSE_SIDE
    low, high = coarse.min(0) - margin, coarse.max(0) + margin
    finest = FINEST * float(np.median(pixel_size(seen_part(coarse, views), views)))
    side = min(FINE_SIDE, float(np.prod(high - low)) ** (1 / 3) / finest)
    return seen_part(carve(photos, low, high, side), views)


def carve(photos: list[Silhouette], low: np.ndarray, high: np.ndarray, side: float) -> np.ndarray:
    """(P, 3) centres of the surface cells of a box that no silhouette shows as background.

    The box from `low` to `high` has about side^3 cells, all cubes: in cells that are long one way,
    points would be nearest to each other the other way.
    """
    points, counts = cells_of(low, high, side)
    solid, seen = np.ones(len(points), bool), np.zeros(len(points), int)
    for view, shape in photos:
        left = np.flatnonzero(solid)
        pixel, inside = pixel_of(view, points[left])
        column, row = pixel[inside].astype(int).T
        solid[left[inside]] = shape[row, column] != 0
        seen[left[inside]] += 1
    solid &= seen >= least_views(photos)
    cells = np.pad(solid.reshape(counts), 1)
    buried = np.ones_like(cells)
    for shift in (-1, 1):
        for dimension in range(3):
            buried &= np.roll(cells, shift, dimension)
    surface = (cells & ~buried)[1:-1, 1:-1, 1:-1].reshape(-1)
    return points[surface]


def cells_of(low: np.ndarray, high: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
    """(P, 3) centres of about side^3 cubes in the box, and how many lie along each axis."""
    edge = float(np.prod((high - low) / side)) ** (1 / 3)  # metres
    counts = np.maximum(np.rint((high - low) / edge), 1).astype(int)
    axes = [(np.arange(count) + 0.5 - count / 2) * edge for count in counts]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3) + (low + high) / 2
    return points, counts


def least_views(photos: list[Silhouette]) -> int:
    """How many photos must show a place before their silhouettes say anything of it."""
    return max(2, len(photos) // 4)


def contradicting(photos: list[Silhouette], centre: np.ndarray, half: float) -> set[int]:
    """Which of the photos show the object where the others do not; none where they agree.

    Of silhouettes that belong to one object each is covered by their hull.  Where most are not,
    as many photos may deny a cell as it takes until they are; those that miss this hull, or deny
    much of it, are wrong.  It assumes that these are few: a tenth of the photos at most.
    """
    low, high = centre - half, centre + half
    coarse = carve(photos, low, high, VOTE_SIDE)
    if np.median(uncovered(photos, coarse, 2 * half / VOTE_SIDE)) <= UNCOVERED:
        return set()
    points, _ = cells_of(low, high, VOTE_SIDE)
    denied, seen = np.zeros((len(photos), len(points)), bool), np.zeros(len(points), int)
    for number, (view, shape) in enumerate(photos):
        pixel, inside = pixel_of(view, points)
        column, row = pixel[inside].astype(int).T
        denied[number, inside] = shape[row, column] == 0
        seen += inside
    against = np.where(seen >= least_views(photos), denied.sum(axis=0), len(photos))
    few = int(WRONG_SHARE * len(photos))
    for most in range(1, few + 1):
        hull = against <= most
        misses = uncovered(photos, points[hull], 2 * half / VOTE_SIDE)
        if hull.any() and np.median(misses) <= UNCOVERED:
            wrong = np.flatnonzero((misses > WRONG) | (denied[:, hull].mean(axis=1) > WRONG))
            return set(wrong.tolist()) if len(wrong) <= few else set()
    return set()


def uncovered(photos: list[Silhouette], points: np.ndarray, edge: float) -> np.ndarray:
    """(N,) share of each silhouette onto which no cell (P, 3) falls; `edge` metres a cell."""
    from scipy.ndimage import binary_dilation

    out = np.zeros(len(photos))
    for number, (view, shape) in enumerate(photos):
        pixel, inside = pixel_of(view, points)
        row, column = np.nonzero(shape == 1)
        if not len(row):
            continue
        side = 1.0
        if inside.any():
            camera_from_world, fx, _, _, _ = view.pinhole()
            depth = points[inside] @ camera_from_world[2, :3] + camera_from_world[2, 3]
            side = max(side, edge * fx / float(np.median(depth)))  # pixels a cell
        covered = np.zeros([int(length / side) + 1 for length in shape.shape], bool)
        covered[tuple((pixel[inside, ::-1] / side).astype(int).T)] = True
        covered = binary_dilation(covered, np.ones((3, 3)))  # a cell reaches over its pixel's rim
        out[number] = 1 - covered[(row / side).astype(int), (column / side).astype(int)].mean()
    return out


def seen_part(hull: np.ndarray, views: list[View]) -> np.ndarray:
    """The hull without what none of the photos sees of it, where that is the larger part.

    What was photographed from one side only has a hull like a wedge behind it: no step would ever
    change what stands there, and a view from another side shows it.
    """
    if len(hull) < 2:
        return hull
    edge = median_neighbour(hull, np.random.default_rng(0))
    seen = seen_first(hull, edge, views)
    return hull if seen.mean() >= LEAST_SEEN else hull[seen]


# How close points stand, and as many of them on a grid as are wanted.

SAMPLE = 1000  # points whose nearest neighbour is looked for


def median_neighbour(points: np.ndarray, rng: np.random.Generator) -> float:
    """Median distance in metres from a point to its nearest neighbour, over a sample."""
    picked = rng.choice(len(points), min(SAMPLE, len(points)), replace=False)
    square = (points**2).sum(1)
    nearest = []
    for chunk in np.array_split(picked, max(1, len(picked) // 100)):
        distance2 = square[chunk, None] + square[None] - 2 * points[chunk] @ points.T
        distance2[np.arange(len(chunk)), chunk] = np.inf
        nearest.append(distance2.min(axis=1))
    return float(np.sqrt(np.median(np.maximum(np.concatenate(nearest), 0))))


def voxel_centres(points: np.ndarray, voxel: float) -> np.ndarray:
    """(A, 3) float32 the grid nodes of spacing `voxel` that have a point, each once, sorted."""
    return (np.unique(np.round(points / voxel), axis=0) * voxel).astype(np.float32)


def choose_voxel(points: np.ndarray, most: int, rng: np.random.Generator) -> float:
    """Median neighbour distance, or as much more as it takes to come down to `most` anchors."""
    low = max(median_neighbour(points, rng), 1e-9)
    if len(voxel_centres(points, low)) <= most:
        return low
    high = low
    while len(voxel_centres(points, high)) > most:
        low, high = high, high * 2
    for _ in range(8):  # to 0.4 %
        middle = (low * high) ** 0.5
        low, high = (middle, high) if len(voxel_centres(points, middle)) > most else (low, middle)
    return high
