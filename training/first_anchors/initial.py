"""Where the first anchors stand: at points, on a visual hull, or in the cameras' common view."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.upright import UNIT_M, turn_of_world
from shapeshift.scene.captures.capture import LEFT_HANDED, Capture
from shapeshift.scene.captures.point_clouds import read_las, read_points
from shapeshift.scene.pose import View
from shapeshift.training.first_anchors.hull import FINEST, visual_hulls
from shapeshift.training.first_anchors.triangulation import triangulated_points
from shapeshift.training.first_anchors.views import common_box, distance_of, pixel_of, pixel_size
from shapeshift.training.photos import LoadedPhoto, sampled

SOURCES = ("auto", "capture", "depth", "hull", "triangulated", "random")  # or a file: see CLOUDS
FILLER_PHOTOS, FILLER_CELLS = 40, 16  # photos looked at, cells along each side of a photo
RANDOM_POINTS = 20_000
NO_POINTS = np.zeros((0, 3))
GUESSES = 0.08  # of the anchors at most: guesses where the photos show what has no points
ON_HULL = 0.3  # of the anchors at most, where the others stand at triangulated points
FEWEST = 100  # triangulated points; fewer are chance ...
FEWEST_ALONE = 20  # ... but better than none where nothing else says how far things are
LEAST_WATCHED = 0.1  # of the place that cameras look at together: else they look at several
NEAREST, FARTHEST = 0.3, 4.0  # guesses along rays, in median distances to what cameras look at
Report = Callable[[str], None]  # what is done now, in words


class InitialPoints(NamedTuple):
    """Where a run starts."""

    points: np.ndarray  # (P, 3) metres
    origin: str  # of them, in words
    shapes: tuple[np.ndarray, ...]  # the points of each shape that stands for itself
    guesses: np.ndarray = NO_POINTS  # (G, 3) metres, for what has no points
    guess_share: float = GUESSES  # of the anchors, at most
    guess_shapes: tuple[np.ndarray, ...] = ()  # the guesses of each shape, where there are several
    doubts: tuple[str, ...] = ()  # what a person should know of it, a sentence each


def filler_points(
    points: np.ndarray, photos: list[LoadedPhoto], rng: np.random.Generator
) -> np.ndarray:
    """(P, 3) guesses for what has no points: walls without texture, the sky.

    A photo is cut into cells; through each that no point falls into goes a ray, with one guess
    between the median and the far end of what the photo sees.  Without them the splats that there
    are blow up until they cover the wall.
    """
    found = []
    for photo in photos[:: -(-len(photos) // FILLER_PHOTOS)]:
        view = photo.view
        pixel, inside = pixel_of(view, points)
        if not inside.any():
            continue
        camera_from_world, fx, fy, cx, cy = view.pinhole()
        depth = points[inside] @ camera_from_world[2, :3] + camera_from_world[2, 3]
        cells = np.floor(pixel[inside] / view.size * FILLER_CELLS).astype(int)
        empty = np.ones((FILLER_CELLS, FILLER_CELLS), bool)
        empty[cells[:, 1], cells[:, 0]] = False
        row, column = np.nonzero(empty)
        x, y = (np.stack([column, row]) + rng.random((2, len(row)))) / FILLER_CELLS
        near, far = np.percentile(depth, [50, 99])
        z = 1 / rng.uniform(1 / (1.3 * far), 1 / near, len(row))
        eye = np.stack(
            [(x * view.size[0] - cx) / fx * z, (y * view.size[1] - cy) / fy * z, z, np.ones_like(z)]
        )
        found.append((np.linalg.inv(camera_from_world) @ eye)[:3].T)
    if not found:
        return np.zeros((0, 3))
    guesses = np.concatenate(found)
    return guesses[free_sight(guesses, points, [photo.view for photo in sampled(photos)])]


def free_sight(guesses: np.ndarray, points: np.ndarray, views: list[View]) -> np.ndarray:
    """(G,) whether a guess stands right before none of the cameras, where few would hide all that
    they see and nothing behind would learn any more.

    Right before: nearer than half of what the nearest of the view's points (P, 3) are.
    """
    free = np.ones(len(guesses), bool)
    for view in views:
        _, inside = pixel_of(view, points)
        if not inside.any():
            continue
        along = view.pinhole()[0][2]
        nearest = np.percentile(points[inside] @ along[:3] + along[3], 5)
        depth = guesses @ along[:3] + along[3]
        free &= ~(pixel_of(view, guesses)[1] & (depth < nearest / 2))
    return free


def initial_points(
    capture: Capture, photos: list[LoadedPhoto], rng: np.random.Generator, source: str = "auto",
    report: Report | None = None, seconds: float | None = None,
) -> InitialPoints:  # fmt: skip
    """The first points, from the best source that there is.  Raises BadFile.

    source: one of SOURCES, or the path of a cloud; auto takes the first of these that there is:
    the capture's own points, depth photos, points triangulated from the photos and the visual
    hull, one of the two, random ones.  report: called with words while it takes long.
    """
    if source not in SOURCES:
        return visible_cloud(Path(source), capture, photos, rng)
    if source in ("auto", "capture") and capture.points is not None and len(capture.points):
        points = np.asarray(capture.points, np.float64)
        return with_guesses(points, "points", capture, photos, rng)
    if source in ("auto", "depth"):
        points = depth_points(photos, rng)
        if len(points):
            return with_guesses(points, "depth photos", capture, photos, rng)
    hull = hull_points(capture, photos) if source in ("auto", "hull") else None
    if hull and source == "hull":
        return hull
    doubts: tuple[str, ...] = ()
    if source in ("auto", "triangulated"):
        try:
            least = FEWEST if hull or source == "triangulated" else FEWEST_ALONE
            found = from_photos(capture, photos, rng, report, seconds, least)
            return with_hull(found, hull) if hull else found
        except BadFile as why:
            if source == "triangulated":
                raise
            where = "on the hull alone" if hull else "at random places"
            doubts = (f"{why}  The first anchors stand {where}.",)
    if hull:
        return hull._replace(doubts=hull.doubts + doubts)
    if source not in ("auto", "random"):
        lacking = {
            "capture": "has no points of its own (COLMAP's points3D, or 'points' in its JSON)",
            "depth": "has no depth photos that know anything",
            "hull": "has neither masks nor a known background, so that nothing can be carved",
        }[source]
        raise BadFile(f"{capture.folder} {lacking}; take other --points, or leave them out.")
    points = random_points(photos, rng)
    return InitialPoints(points, "random", (points,), doubts=doubts)


def hull_points(capture: Capture, photos: list[LoadedPhoto]) -> InitialPoints | None:
    """The visual hull of each modality; None where nothing tells object from background.

    Raises BadFile where masks contradict each other.
    """
    hulls, doubts = visual_hulls(photos, capture.background)
    if shapes := tuple(hull for hull in hulls if len(hull)):
        return InitialPoints(np.concatenate(shapes), "hull", shapes, doubts=doubts)
    if hulls and any(p.see_through for p in sampled(photos)):
        raise BadFile(
            f"{capture.folder}: the masks have no volume in common; check that masks and poses "
            "belong together, or train with --masks ignore."
        )
    return None


def with_hull(found: InitialPoints, hull: InitialPoints) -> InitialPoints:
    """Measured points, and the hull for what has too little texture to have some."""
    return found._replace(
        origin=f"{found.origin} and the hull",
        guesses=hull.points,
        guess_share=ON_HULL,
        guess_shapes=hull.shapes,
        doubts=hull.doubts,
    )


def from_photos(
    capture: Capture, photos: list[LoadedPhoto], rng: np.random.Generator, report: Report | None,
    seconds: float | None = None, least: int = FEWEST,
) -> InitialPoints:  # fmt: skip
    """Points triangulated out of the photos.  Raises BadFile where they are fewer than `least`."""

    def progress(stage: str, done: int, of: int) -> None:
        if report is not None:
            report(f"points out of the photos: {stage}, {done} of {of}")

    points = triangulated_points(photos, capture.background, progress, seconds)
    if len(points) < least:
        raise BadFile(
            f"{capture.folder}: only {len(points)} points could be triangulated out of its photos "
            f"({least} are needed); they show too little texture, overlap too little, or do not "
            "belong to their poses."
        )
    origin = f"{len(points):,} triangulated points"
    return with_guesses(points, origin, capture, photos, rng)


def with_guesses(
    points: np.ndarray, origin: str, capture: Capture, photos: list[LoadedPhoto],
    rng: np.random.Generator,
) -> InitialPoints:  # fmt: skip
    """The points, with guesses added where the photos have no known background."""
    if capture.background is not None or any(p.see_through for p in sampled(photos)):
        return InitialPoints(points, origin, (points,))
    guesses = filler_points(points, photos, rng)
    return InitialPoints(points, f"{origin} and guesses", (points,), guesses)


def visible_cloud(
    path: Path, capture: Capture, photos: list[LoadedPhoto], rng: np.random.Generator
) -> InitialPoints:
    """What the photos see of a cloud file: scanners see farther than what was photographed."""
    if path.suffix.lower() not in CLOUDS:
        raise BadFile(
            f"--points {path}: give {', '.join(SOURCES)}, or a file that ends in "
            f"{', '.join(CLOUDS)}."
        )
    points, count = cloud_points(path, capture, rng)
    seen = np.zeros(len(points), bool)
    for photo in photos:
        seen |= pixel_of(photo.view, points)[1]
    if not seen.any():
        raise BadFile(
            f"{path}: no photo sees any of its {count:,} points; they must be in the world and the "
            "metres of the capture's poses."
        )
    origin = f"{path.name} ({seen.sum():,} of {count:,} points)"
    return with_guesses(points[seen], origin, capture, photos, rng)


def random_points(photos: list[LoadedPhoto], rng: np.random.Generator) -> np.ndarray:
    """(P, 3) anywhere in the place that the cameras look at together; where they look at no one
    place, as along a corridor or from the air, anywhere before them.
    """
    views = [photo.view for photo in photos]
    centre, half = common_box(views)
    cloud = centre + half * rng.uniform(-1, 1, (RANDOM_POINTS, 3))
    seen = np.sum([pixel_of(view, cloud)[1] for view in views], axis=0)
    watched = seen >= max(1, len(views) // 3)
    if watched.mean() >= LEAST_WATCHED:
        return cloud[watched]
    return points_before(views, rng)


def points_before(views: list[View], rng: np.random.Generator) -> np.ndarray:
    """(P, 3) along rays through the photos' pixels, as dense in each photo as in every other.

    None stands right before a camera, where a few would hide all that it sees.
    """
    away, each = distance_of(views), -(-RANDOM_POINTS // len(views))
    found = []
    for view in views:
        camera_from_world, fx, fy, cx, cy = view.pinhole()
        x, y = rng.random((2, each)) * np.array(view.size)[:, None]
        z = away / rng.uniform(1 / FARTHEST, 1 / NEAREST, each)
        ray = np.stack([(x - cx) / fx * z, (y - cy) / fy * z, z, np.ones(each)])
        found.append((np.linalg.inv(camera_from_world) @ ray)[:3].T)
    points = np.concatenate(found)
    free = np.ones(len(points), bool)
    for view in views:
        camera_from_world = view.pinhole()[0]
        depth = points @ camera_from_world[2, :3] + camera_from_world[2, 3]
        # A point of the view's own is as near as NEAREST but for rounding.
        free &= ~(pixel_of(view, points)[1] & (depth < 0.999 * NEAREST * away))
    return points[free]


# InitialPoints points out of clouds that somebody measured and out of depth photos.

MOST_POINTS = 100_000  # beyond it neither the first anchors nor their distance change
LASER = (".las", ".laz")
CLOUDS = (".ply", ".npz", *LASER)


def cloud_points(path: Path, capture: Capture, rng: np.random.Generator) -> tuple[np.ndarray, int]:
    """(P, 3) metres in our world, at most MOST_POINTS, and how many the file has.

    The file's axes are those of the capture's own files, so its points are turned as they are.
    """
    if path.suffix.lower() in LASER:
        points, count = read_las(path, MOST_POINTS)
    else:
        points = read_points(path)[0]
        count = len(points)
    if not (len(points) and np.isfinite(points).all()):
        raise BadFile(f"{path}: holds no points, or some that are no numbers; export it again.")
    up = capture.notes.get("up_in_file", (0.0, 1.0, 0.0))
    turn = turn_of_world(up, bool(capture.notes.get(LEFT_HANDED)), str(path))
    turned = subsampled(points, rng) @ turn[:3, :3].T * capture.notes.get(UNIT_M, 1.0)
    return turned - np.array(capture.origin), count


def subsampled(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """MOST_POINTS of the points at random, in their order: dense places stay denser."""
    if len(points) <= MOST_POINTS:
        return points
    return points[np.sort(rng.choice(len(points), MOST_POINTS, replace=False))]


def depth_points(photos: list[LoadedPhoto], rng: np.random.Generator) -> np.ndarray:
    """(P, 3) metres where depth photos saw something, at most MOST_POINTS; (0, 3) without any.

    As on a hull, nothing is gained by anchors closer together than FINEST pixels: many photos
    measure the same surface, each pixel of each once.
    """
    deep = [photo for photo in sampled(photos) if photo.has_depth]
    known = sum(int(np.count_nonzero(known_depth(photo) > 0)) for photo in deep)
    share, found = min(1.0, MOST_POINTS / max(known, 1)), [np.zeros((0, 3))]
    for photo in deep:
        view, depth = photo.view, known_depth(photo)
        row, column = np.nonzero(depth > 0)
        kept = rng.random(len(row)) < share
        row, column = row[kept], column[kept]
        camera_from_world, fx, fy, cx, cy = view.pinhole()
        z = depth[row, column].astype(np.float64)
        x, y = (column + 0.5 - cx) / fx * z, (row + 0.5 - cy) / fy * z
        in_camera = np.stack([x, y, z, np.ones_like(z)])
        found.append((np.linalg.inv(camera_from_world) @ in_camera)[:3].T)
    points = np.concatenate(found)
    return one_a_cell(points, FINEST * pixel_size(points, [photo.view for photo in deep]))


def one_a_cell(points: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """The first of the points (P, 3) in each cube, in their order.

    edge: (P,) metres of a cube where a point lies, rounded to powers of two so that neighbours
    share a grid; Inf, of what no photo shows: the point stays.
    """
    measured = np.flatnonzero(np.isfinite(edge))
    power = np.round(np.log2(edge[measured]))[:, None]
    keys = np.concatenate([power, np.floor(points[measured] / 2.0**power)], axis=1)
    _, first = np.unique(keys, axis=0, return_index=True)
    kept = ~np.isfinite(edge)
    kept[measured[first]] = True
    return points[kept]


def known_depth(photo: LoadedPhoto) -> np.ndarray:
    """(H, W) metres of a photo that has depth, 0 where it is not known."""
    return np.zeros(photo.view.size[::-1]) if (depth := photo.depth) is None else depth
