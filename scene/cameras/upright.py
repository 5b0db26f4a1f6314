"""Which way is up: what a capture, its photos and the planes of things say, side by side.

Structure from motion knows no up, and files that state none are read by the axis that is usual for
them.  Here what there is to find is found, and one rule says which of it is believed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees, hypot, inf

import numpy as np
from numpy.typing import ArrayLike

from shapeshift.runtime_models.files.json_fields import Fields
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import three

STATED, ASSUMED, PHOTOS, PLANES = SOURCES = ("stated", "assumed", "photos", "planes")
DISAGREE = 5.0  # degrees between two ways that is worth a word
LEANS = 45.0  # degrees: photos that all look one way lean as far; a plane so far off is a wall
LEVEL = 1.0  # degrees: what is found so near to what was taken confirms it
ROUNDING = 1e-6  # degrees, so that a threshold itself is still within it
UNIT_M = "unit_m"  # a file's key, and in a capture's notes: metres of one unit of its world
CLEAR_UP = 0.2  # mean length of the photos' up vectors under which they say nothing
CLEAR_PLANE = 0.5  # of the second singular value that the third may have: rows lie in a plane
LEAST_TURN = 0.1  # of the first singular value in the second: photos look in different directions
LOOKS_DOWN = 0.1  # mean part of the lines of sight along the normal that tells its upper side
TRIES = 300  # planes through three points each
MOST_POINTS, LEAST_POINTS = 4000, 300  # that a plane is looked for among
FLAT = 0.04  # of the points' usual way from their middle: as near to the plane is on it
MOST_ON = 0.3  # of the points, that lie on a plane that says what is up: a plush on a bed has .27
SIDEWAYS = 1.5  # times as clear as their up vectors: photos were held upright and stored lying
# Up in a photo's own axes (x right, y down) by the EXIF orientation of its file
UP_BY_ORIENTATION = {1: (0, -1), 2: (0, -1), 3: (0, 1), 4: (0, 1),
                     5: (-1, 0), 6: (-1, 0), 7: (1, 0), 8: (1, 0)}  # fmt: skip


@dataclass(frozen=True)
class Up:
    """One way to know what is up, in a world whose +Y was taken to be it."""

    source: str  # one of SOURCES: assumed is the axis that is usual for such files
    direction: tuple[float, float, float]  # unit
    sure: bool = True  # False: of photos that all look one way; it leans as they do
    things: tuple[str, ...] = ()  # that stand on such planes

    def off(self, other: "Up | None" = None) -> float:
        """Degrees from another, or from +Y."""
        return angle(self.direction, (0, 1, 0) if other is None else other.direction)


@dataclass(frozen=True)
class Upright:
    """Of a scene: each way, in its capture's world, and the one by which it was turned."""

    ways: tuple[Up, ...]
    used: Up

    @property
    def turn(self) -> np.ndarray:
        """(3, 3) to the scene's world from the capture's."""
        return turn_upright(self.used.direction)


def angle(a: ArrayLike, b: ArrayLike) -> float:
    """Degrees between two directions (3,), 0 to 180, exact also near both ends."""
    one, other = np.asarray(a, np.float64), np.asarray(b, np.float64)
    return degrees(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))


def up_of_photos(
    world_from_camera: np.ndarray, orientations: Sequence[int] | None = None
) -> Up | None:
    """As photos (N, 4, 4; OpenCV axes) were held; None where they do not agree.

    orientations: EXIF's, None where nobody knows them.  The normal of the plane that the photos'
    horizontal axes lie in, where they lie in one and look in different directions; else the mean
    of their up vectors, which a person who looks down from above on one side makes lean.
    """
    turns = np.asarray(world_from_camera, np.float64)[:, :3, :3]
    if not len(turns):
        return None
    if orientations is None:
        mean_x, mean_y = turns[:, :, :2].mean(axis=0).T
        if np.linalg.norm(mean_x) > SIDEWAYS * max(np.linalg.norm(mean_y), CLEAR_UP):
            return _up_of_plane(turns[:, :, 1], mean_x, turns[:, :, 2], signed=False)
        orientations = [1] * len(turns)
    ups = np.array([UP_BY_ORIENTATION.get(o, (0, -1)) for o in orientations], float)  # (N, 2)
    up_w = np.einsum("nij,nj->ni", turns[:, :, :2], ups)
    across_w = np.einsum("nij,nj->ni", turns[:, :, :2], np.stack([-ups[:, 1], ups[:, 0]], axis=1))
    mean = up_w.mean(axis=0)
    if (found := _up_of_plane(across_w, mean, turns[:, :, 2], signed=True)) is not None:
        return found
    if not np.linalg.norm(mean) > CLEAR_UP:
        return None
    return Up(PHOTOS, three(mean / np.linalg.norm(mean)), sure=False)


def _up_of_plane(
    across: np.ndarray, mean: np.ndarray, ahead: np.ndarray, signed: bool
) -> Up | None:
    """The normal of the plane that the rows `across` (N, 3) lie in, its upper side towards `mean`
    (3,) if that is signed and clear, else where lines of sight `ahead` (N, 3) come from; or None.
    """
    if len(across) < 3:
        return None
    _, size, axes = np.linalg.svd(across, full_matrices=False)
    if not (size[1] >= LEAST_TURN * size[0] and size[2] <= CLEAR_PLANE * size[1]):
        return None
    normal, length = axes[2], np.linalg.norm(mean)
    looks = float(ahead.mean(axis=0) @ normal)
    if signed and length > CLEAR_UP:
        normal = normal * np.sign(normal @ mean)
        if not normal @ mean >= np.cos(np.radians(LEANS)) * length:
            return None
    elif abs(looks) > LOOKS_DOWN:  # people and drones look down on things, seldom up
        normal = -np.sign(looks) * normal
    else:
        return None
    # Of hands that lean by so much at random: how far the normal is off, once.
    noise = np.degrees(size[2] / np.sqrt(max(len(across) - 2, 1)) / size[1])
    return Up(PHOTOS, three(normal), sure=bool(2 * noise <= DISAGREE))


def up_of_planes(
    normals: dict[str, np.ndarray], others: Sequence[Up]
) -> tuple[Up | None, tuple[str, ...]]:
    """What most things stand on, and the things whose planes (name: unit normal (3,) towards the
    thing) are others.  Of as many on two planes, the one nearer to what else is known.
    """
    groups: list[list[str]] = []
    for name, normal in normals.items():
        for group in groups:
            if angle(normal, _middle(normals, group)) <= DISAGREE + ROUNDING:
                group.append(name)
                break
        else:
            groups.append([name])
    if not groups:
        return None, ()
    known = [way for way in others if way.source != ASSUMED] or others

    def rank(group: list[str]) -> tuple[int, float]:
        middle = _middle(normals, group)
        return -len(group), min((angle(middle, way.direction) for way in known), default=0.0)

    best = min(groups, key=rank)
    other = tuple(name for name in normals if name not in best)
    return Up(PLANES, three(_middle(normals, best)), things=tuple(best)), other


def plane_of_most(
    points: np.ndarray, within: float, seed: int = 0
) -> tuple[np.ndarray, float] | None:
    """Unit normal (3,) and offset of the plane that most points (N, 3) are near to; None of a few.

    The best of TRIES through three of them (RANSAC, Fischler and Bolles 1981), then least squares.
    """
    if len(points) < 3:
        return None
    random = np.random.default_rng(seed)
    first, second, third = points[random.integers(0, len(points), (3, TRIES))]
    normals = np.cross(second - first, third - first)
    length = np.linalg.norm(normals, axis=1)
    good = length > 1e-12
    if not good.any():
        return None
    normals = normals[good] / length[good, None]
    offsets = np.einsum("ti,ti->t", normals, first[good])
    counts = [
        (np.abs(points @ n - o) < within).sum() for n, o in zip(normals, offsets, strict=True)
    ]
    best = int(np.argmax(counts))
    normal, offset = normals[best], float(offsets[best])
    for _ in range(3):
        near = np.abs(points @ normal - offset) < within
        if near.sum() < 3:
            return None
        middle = points[near].mean(0)
        normal = np.linalg.svd(points[near] - middle, full_matrices=False)[2][2]
        offset = float(normal @ middle)
    return normal, offset


def up_of_points(points: np.ndarray, eyes: np.ndarray, others: Sequence[Up]) -> Up | None:
    """What most points (P, 3) of a capture lie on, its upper side towards the eyes (E, 3); None
    where they lie on no plane, or on one that is a wall by what the photos say, else by what was
    taken, `others`.
    """
    points = np.asarray(points, np.float64)
    points = points[np.isfinite(points).all(axis=1)]
    points = points[:: len(points) // MOST_POINTS + 1]
    if len(points) < LEAST_POINTS or not len(eyes):
        return None
    usual = float(np.median(np.linalg.norm(points - np.median(points, axis=0), axis=1)))
    found = plane_of_most(points, FLAT * usual)
    if found is None:
        return None
    normal, offset = found
    if not (np.abs(points @ normal - offset) < FLAT * usual).mean() >= MOST_ON:
        return None
    normal = normal * (1 if np.median(eyes @ normal) > offset else -1)
    way = Up(PLANES, three(normal))
    known = next((other for other in others if other.source == PHOTOS), others[0])
    return way if way.off(known) <= LEANS else None


def _middle(normals: dict[str, np.ndarray], names: Sequence[str]) -> np.ndarray:
    total = np.sum([np.asarray(normals[name], np.float64) for name in names], axis=0)
    return total / np.linalg.norm(total)


def believed(ways: Sequence[Up]) -> Up:
    """The one of them that counts: the capture's own word; else the planes that things stand on,
    unless photos say that they are walls; else the photos; else what is usual for such files.

    `ways` has one that is stated or assumed.  What is within LEVEL of it leaves it in force.
    """
    by = {way.source: way for way in ways}
    taken = by.get(STATED) or by[ASSUMED]
    if taken.source == STATED:
        return taken
    photos, planes = by.get(PHOTOS), by.get(PLANES)
    found = None
    if planes is not None:
        wall = photos is not None and planes.off(photos) > (LEANS if photos.sure else 2 * LEANS)
        found = None if wall else planes
    # Photos that all look one way lean by what they look down: to tell top from bottom they do.
    if found is None and photos is not None and (photos.sure or photos.off(taken) > 2 * LEANS):
        found = photos
    return taken if found is None or found.off(taken) <= LEVEL + ROUNDING else found


def disagree(one: Up, other: Up) -> bool:
    """Whether two ways are farther apart than what either can be off."""
    return one.off(other) > (DISAGREE if one.sure and other.sure else LEANS) + ROUNDING


def turn_upright(up: Sequence[float]) -> np.ndarray:
    """(3, 3) the shortest turn from the unit vector `up` to +Y; half a turn about x for -Y."""
    x, y, z = up
    if y < -1 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0, -x, 0], [x, 0, z], [0, -z, 0]])  # [up x Y]_x
    return np.eye(3) + cross + cross @ cross / (1 + y)


def turn_of_world(up: object, left_handed: bool, where: str) -> np.ndarray:
    """(4, 4) from a file's world to ours, in which `up` (of the file's) is +Y."""
    if not left_handed:
        return upright_rotation(up, where)
    upright_rotation(up, where)  # checks it
    x, y, z = np.asarray(up, np.float64)
    return upright_rotation((-x, y, z), where) @ np.diag([-1.0, 1.0, 1.0, 1.0])


def upright_rotation(up: object, where: str) -> np.ndarray:
    """(4, 4) the shortest turn that brings `up` to +Y; half a turn about x for -Y."""
    try:
        up = np.asarray(up, np.float64)
        length = hypot(*up.ravel())
    except (TypeError, ValueError, OverflowError):
        up, length = np.zeros(0), 0.0
    if up.shape != (3,) or not 0 < length < inf:
        raise BadFile(f"{where}: 'up' must be three numbers that are not all zero")
    out = np.eye(4)
    out[:3, :3] = turn_upright(three(up / length))
    return out


def up_of_cameras(world_from_cameras: np.ndarray, otherwise: tuple) -> np.ndarray:
    """(3,) the world axis nearest to the photos' mean upward direction (OpenCV axes).

    For worlds as COLMAP leaves them this is -Y.  `otherwise` is taken where the photos disagree.
    """
    mean = -np.asarray(world_from_cameras)[:, :3, 1].mean(axis=0)
    if not np.linalg.norm(mean) > CLEAR_UP:
        return np.asarray(otherwise, np.float64)
    axis = int(np.argmax(np.abs(mean)))
    return np.sign(mean[axis]) * np.eye(3)[axis]


def doubts_of_up(ups: Sequence[Up], ours_from_file: np.ndarray) -> tuple[str, ...]:
    """A sentence with all ways where two of them disagree; what was taken is the first of `ups`."""
    if not any(disagree(a, b) for i, a in enumerate(ups) for b in ups[i + 1 :]):
        return ()
    words = []
    for other in ups[1:]:
        x, y, z = np.array(other.direction) @ ours_from_file[:3, :3]
        words.append(
            f"{ups[0].off(other):.1f} degrees from up by {name_of(other)}, "
            f"[{x:.3f}, {y:.3f}, {z:.3f}]"
        )
    return (
        f"Up by {name_of(ups[0])} is {' and '.join(words)} in its own axes; the first is kept. "
        "`segment` looks for what things stand on and turns a scene upright; 'up' in its file "
        "settles it for training.",
    )


def unit_from(entry: Mapping, where: str) -> float:
    """Metres of one unit of the file's world.  Raises BadFile."""
    wanted = "metres of one unit of its world, a number above 0 up to 1e6,"
    return Fields(entry, where).number(UNIT_M, 1.0, wanted, 1e-9, 1e6)


def ways_sentence(ways: Sequence[Up], used: Up) -> str:
    """What each way says, where two disagree; else "".  Degrees are from +Y of the capture."""
    pairs = [(a, b) for i, a in enumerate(ways) for b in ways[i + 1 :]]
    if not any(disagree(a, b) for a, b in pairs):
        return ""
    photos = next((way for way in ways if way.source == PHOTOS), None)
    taken, words = next(way for way in ways if way.source in (STATED, ASSUMED)), []
    for way in ways:
        if way is not taken:
            beside = way.source == PLANES and photos is not None
            more = f" ({way.off(photos):.1f} from the photos)" if beside else ""
            words.append(f"{way.off(taken):.1f} degrees from up by {name_of(way)}{more}")
    return f"Up by {name_of(taken)} is {' and '.join(words)}; {believed_words(used, taken)}."


def believed_words(used: Up, taken: Up) -> str:
    if used == taken:
        return f"{name_of(used)} is believed"
    is_one = used.source == PLANES and not used.things
    verb = "is" if is_one else "are"
    return f"{name_of(used)} {verb} believed, and the scene is turned upright"


def name_of(way: Up) -> str:
    """In a sentence."""
    if way.source == PLANES:
        few = ", ".join(way.things[:3]) + (" and others" if len(way.things) > 3 else "")
        return f"the planes under {few}" if way.things else "the plane of most points"
    if way.source == PHOTOS:
        lean = "" if way.sure else ", which all look one way and lean with it"
        return f"the photos as they were held{lean}"
    return "the capture's own word" if way.source == STATED else "the usual axis of such files"
