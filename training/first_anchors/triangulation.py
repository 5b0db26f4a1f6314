"""Points out of the photos themselves, where a capture has poses and nothing else.

Which photos are matched with which follows from their poses; triangulate_run.py does the rest.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shapeshift.runtime_models.files.whole_file import temporary_folder
from shapeshift.scene.captures.colmap.colmap_child import Progress, run_child
from shapeshift.scene.pose import View
from shapeshift.training.first_anchors.views import common_box, pixel_of
from shapeshift.training.photos import LoadedPhoto, sampled

SCRIPT = Path(__file__).with_name("triangulate_run.py")
FAILURE = (
    "matching the photos ended with code {code}, perhaps for want of memory; --points random does "
    "without."
)
MOST_PHOTOS = 120  # of all modalities together; half a second to a second of one core each
NEIGHBOURS = 8  # photos that each is matched with, and those that chose it
SHARE = 0.2  # of a run's seconds that the matching may take: docs/bench/start.csv
# What it takes of one core, as measured on tankard and plush at 500 and 250 pixels.
PIXEL_S, PAIR_S = 0.9e-6, 1.6e-8  # seconds a pixel for features, and a pair of features compared
FEATURES_A_PIXEL, MOST_FEATURES = 8e-3, 4096
GRID = 5  # sampled pixels along each side of a photo by which its neighbours are chosen
DEPTHS = (0.5, 1.0, 2.0)  # of the distance at which the cameras look together
ANGLES = (2.0, 35.0)  # degrees between two rays: below no depth is told, above SIFT fails
ENOUGH_PHOTOS = 4  # of a modality: then three must show a point, else two
OUTSIDE = 0.1  # of the photos that have a point in them may show background there


class Effort(NamedTuple):
    """How closely the photos are looked at."""

    first_octave: int = -1  # -1: photos are doubled first, which finds four times the features
    neighbours: int = NEIGHBOURS  # photos that each is matched with, and those that chose it
    most: int = MOST_PHOTOS  # photos of all modalities together


# From dear to cheap.  Of the tankard at 500 pixels these take 29, 20, 4, 2.6 and 1.3 s of a core.
EFFORTS = (
    Effort(), Effort(neighbours=4), Effort(0), Effort(0, 4), Effort(0, 4, MOST_PHOTOS // 4),
)  # fmt: skip


def choose_effort(photos: list[LoadedPhoto], seconds: float | None) -> Effort:
    """The closest look that takes no more than SHARE of a run's seconds; the cheapest else.

    It follows from the photos and the budget alone: no clock is looked at.
    """
    if seconds is None:
        return EFFORTS[0]
    return next((e for e in EFFORTS if cost_s(photos, e) <= SHARE * seconds), EFFORTS[-1])


def cost_s(photos: list[LoadedPhoto], effort: Effort) -> float:
    """About how many seconds of one core the matching takes."""
    chosen = thinned(photos, effort.most)
    less = 1.0 if effort.first_octave < 0 else 0.25
    pixels = np.array([math.prod(photo.view.size) for photo in chosen], float)
    features = less * np.minimum(FEATURES_A_PIXEL * pixels, MOST_FEATURES)
    pairs = 0.6 * effort.neighbours * len(chosen)
    return float(less * PIXEL_S * pixels.sum() + PAIR_S * pairs * (features**2).mean())


def triangulated_points(
    photos: list[LoadedPhoto], background: tuple | None, progress: Progress,
    seconds: float | None = None,
) -> np.ndarray:  # fmt: skip
    """(P, 3) metres, sorted, each once; (0, 3) where nothing matches.

    seconds: of the whole run; None: as many as it takes.  Raises BadFile where pycolmap is absent
    or fails.
    """
    effort = choose_effort(photos, seconds)
    chosen = thinned(photos, effort.most)
    pairs = [
        (rows[i], rows[j])
        for rows in by_modality(chosen).values()
        for i, j in choose_pairs([chosen[row].view for row in rows], effort.neighbours)
    ]
    if not pairs:
        return np.zeros((0, 3))
    with temporary_folder() as folder:
        given, wanted = Path(folder, "photos.npz"), Path(folder, "points.npz")
        write_job(given, chosen, pairs, background, effort.first_octave)
        log = Path(folder, "log.txt")
        run_child(SCRIPT, [str(given), str(wanted)], log, progress, FAILURE)
        with np.load(wanted) as file:
            points = np.unique(file["xyz"], axis=0)  # features have up to two orientations
    return points[np.isfinite(points).all(axis=1) & on_object(points, photos)]


def by_modality(photos: list[LoadedPhoto]) -> dict[str, list[int]]:
    """Which of the photos are of each modality."""
    found: dict[str, list[int]] = {}
    for row, photo in enumerate(photos):
        found.setdefault(photo.modality, []).append(row)
    return found


def thinned(photos: list[LoadedPhoto], most: int = MOST_PHOTOS) -> list[LoadedPhoto]:
    """At most so many photos, evenly out of each modality."""
    rows = by_modality(photos).values()
    most = max(most // max(len(rows), 1), 2)
    counts = [min(len(mine), most) for mine in rows]
    return [
        photos[mine[i * len(mine) // count]]
        for mine, count in zip(rows, counts, strict=True)
        for i in range(count)
    ]


def choose_pairs(views: list[View], neighbours: int = NEIGHBOURS) -> list[tuple[int, int]]:
    """Each view with those that see most of what it sees from a different place, i < j, sorted."""
    if len(views) <= neighbours + 1:
        return [(i, j) for j in range(len(views)) for i in range(j)]
    centre, _ = common_box(views)
    eyes = np.array([view.world_from_eye.position for view in views])
    away = float(np.median(np.linalg.norm(eyes - centre, axis=1)))
    pairs: set[tuple[int, int]] = set()
    for i, view in enumerate(views):
        points = places_before(view, away)
        shared = np.array([shared_part(points, eyes[i], other) for other in views])
        shared[i] = -1
        for j in np.argsort(-shared, kind="stable")[:neighbours].tolist():
            if shared[j] > 0:
                pairs.add((min(i, j), max(i, j)))
    return sorted(pairs)


def places_before(view: View, away: float) -> np.ndarray:
    """(P, 3) places in the world that pixels of a view may show, `away` metres before it or so."""
    left, right, down, up = view.tangents
    part = (np.arange(GRID) + 0.5) / GRID
    x, y, z = np.meshgrid(
        left + part * (right - left), down + part * (up - down), away * np.array(DEPTHS)
    )
    eye = np.stack([x * z, y * z, -z, np.ones_like(z)], axis=-1).reshape(-1, 4)
    return (eye @ view.world_from_eye.matrix().T)[:, :3]


def shared_part(points: np.ndarray, eye: np.ndarray, other: View) -> float:
    """How much of what lies at points (P, 3) before an eye another view shows at a good angle.

    A hundredth counts what it shows at any angle: of photos that stand too near or too far apart
    those that overlap are still the better ones.
    """
    _, inside = pixel_of(other, points)
    here, there = points - eye, points - other.world_from_eye.position
    lengths = np.linalg.norm(here, axis=1) * np.linalg.norm(there, axis=1)
    cosine = (here * there).sum(axis=1) / np.maximum(lengths, 1e-12)
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    good = inside & (angle >= ANGLES[0]) & (angle <= ANGLES[1])
    return float(good.mean() + inside.mean() / 100)


def write_job(
    path: Path, photos: list[LoadedPhoto], pairs: list[tuple[int, int]], background: tuple | None,
    first_octave: int = -1,
) -> None:  # fmt: skip
    """What triangulate_run.py reads of N photos.

    gray0 ... (H, W) uint8; counts0 ... (H, W) bool where not all of a photo counts;
    camera_from_world (N, 4, 4); pinholes (N, 4) fx fy cx cy; sizes (N, 2); pairs (M, 2) numbers
    of photos; least (N,) photos that must show a point of this one's modality; first_octave of
    SIFT.
    """
    arrays: dict[str, np.ndarray] = {}
    cameras = [photo.view.pinhole() for photo in photos]
    arrays["camera_from_world"] = np.array([camera[0] for camera in cameras])
    arrays["pinholes"] = np.array([camera[1:] for camera in cameras])
    arrays["sizes"] = np.array([photo.view.size for photo in photos])
    arrays["pairs"], arrays["first_octave"] = np.array(pairs), np.array(first_octave)
    many = {name: len(rows) >= ENOUGH_PHOTOS for name, rows in by_modality(photos).items()}
    arrays["least"] = np.array([3 if many[photo.modality] else 2 for photo in photos])
    for i, photo in enumerate(photos):
        arrays[f"gray{i}"] = gray_of(photo, background)
        if (counts := counting(photo)) is not None:
            arrays[f"counts{i}"] = counts
    save: Callable[..., None] = np.savez  # numpy takes its keywords for one flag
    save(path, **arrays)


def gray_of(photo: LoadedPhoto, background: tuple | None) -> np.ndarray:
    """(H, W) uint8 the photo over its background; Rec. 601 weights, as COLMAP's own reader has."""
    gray = photo.over(background or (0.0, 0.0, 0.0)) @ np.array([0.299, 0.587, 0.114], np.float32)
    return np.ascontiguousarray(np.rint(255 * gray).astype(np.uint8))


def counting(photo: LoadedPhoto) -> np.ndarray | None:
    """(H, W) bool where a photo shows what is modelled; None: everywhere."""
    counts = None if photo.weight is None else photo.weight > 0
    if photo.see_through:
        there = photo.rgba[..., 3] >= 128
        counts = there if counts is None else counts & there
    return counts


def on_object(points: np.ndarray, photos: list[LoadedPhoto]) -> np.ndarray:
    """(P,) bool: not on what masks of photos say to be background."""
    inside, outside = np.zeros((2, len(points)), int)
    for photo in sampled(photos):
        if photo.see_through:
            pixel, seen = pixel_of(photo.view, points)
            column, row = pixel[seen].astype(int).T
            inside[seen] += 1
            outside[seen] += photo.rgba[row, column, 3] < 128
    return outside <= OUTSIDE * inside
