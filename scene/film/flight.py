"""Camera paths of films: through photographed places, or exactly through keys of a person.

Either becomes a dense curve of poses on which equal places lie equally far apart for the eye:
metres over the distance of what is looked at, plus the turn in radians.  So the picture moves at
constant speed, and a camera that stands and turns gets its time.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shapeshift.scene.cameras.camera_path import along
from shapeshift.scene.pose import Pose, View

KEYS = 12  # of a tour: as many of the cameras as its curve is led by
DENSE = 60  # points of the curve from key to key
MOST_POINTS = 120_000  # of a curve
CORNER = 0.35  # of a way between two keys: how far corners are rounded, at smoothing 1
ROLL = 1.7  # times a turn of the look: how much a roll counts, which nobody likes to watch
PASSES = 3  # rounding and constant speed in turns
ORDERED = 1 / 3  # median step of photos in order, over the median distance of any two: at most
MOST_ORDERED = 400  # cameras that are put into an order; of more, these lie farthest apart
LEVEL = 0.966  # |cosine| to the vertical up to which a look has a horizon: 15 degrees
NEAR_PART = 0.01  # of the distance to what is looked at: the nearest that is drawn


@dataclass(frozen=True)
class Flight:
    """A dense curve of poses at constant apparent speed, and the lens along it."""

    eyes: np.ndarray  # (N, 3) metres
    wxyz: np.ndarray  # (N, 4) unit quaternions, neighbours on the same half
    tan_up: np.ndarray  # (N,) tangent of half the vertical field of view
    depth_range: tuple[float, float]  # metres: near, far
    key_places: np.ndarray  # (K,) 0..1: where the keys of a keyed flight lie, of a tour evenly
    farthest: float = 0.0  # from a photo, of the distance to what is looked at

    def view(self, place: float, size: tuple[int, int]) -> View:
        """The view at a place 0..1 of the way."""
        at = np.clip(place, 0, 1) * (len(self.eyes) - 1)
        first = max(int(at) - 2, 0)
        near = slice(first, int(at) + 4)  # the spline knows its neighbours alone
        eye, wxyz, tan_up = (
            along(keys[near], np.array([at - first]), False)[0]
            for keys in (self.eyes, self.wxyz, self.tan_up[:, None])
        )
        up = float(tan_up[0])
        right = up * size[0] / size[1]
        pose = Pose(eye, wxyz / np.linalg.norm(wxyz))
        return View(pose, (-right, right, -up, up), *self.depth_range, size)


def tour(views: Sequence[View], size: tuple[int, int], smooth: float = 1.0) -> Flight:
    """A smooth flight past cameras in an order that is a way, level where there is a horizon.

    smooth: 0 leads from camera to camera, 1 forgets the hand that held them.
    """
    views = ordered(views)
    eyes, aims, away = _looks(views)
    pick = np.unique(np.linspace(0, len(views) - 1, min(KEYS, len(views))).round().astype(int))
    width = smooth * len(views) / len(pick) / 2  # photos: the jitter of a hand is gone
    if smooth == 0:
        pick = np.arange(len(views))
    eye_keys, aim_keys = _filtered(eyes, width)[pick], _filtered(aims, width)[pick]
    t = np.linspace(0, len(pick) - 1, _points(len(pick)))
    e, a = along(eye_keys, t, False), along(aim_keys, t, False)
    width = CORNER * smooth * (len(t) - 1) / max(len(pick) - 1, 1)
    for turn in range(PASSES):
        e, a = (_at_even_places(c, _travelled(e, a)) for c in (e, a))
        if turn < PASSES - 1:
            e, a = (_filtered(c, width) for c in (e, a))
    q = _turns(_looking(a - e), views[0].world_from_eye.matrix()[:3, 1], 1.5 * width)
    for _ in range(PASSES):  # a roll where a way leads over the top takes its time, too
        places = _travelled(e, a, q)
        e, a, q = (_at_even_places(c, places) for c in (e, a, q))
    distance = np.linalg.norm(a - e, axis=1)
    nearest = np.sqrt(((e[:: DENSE // 4, None] - eyes[None]) ** 2).sum(2).min(1))
    return Flight(
        e,
        _normalized(q),
        np.full(len(e), _tan_up(views, size)),
        _depth_range(views, float(np.median(distance))),
        np.linspace(0, 1, len(pick)),
        float(nearest.max() / np.median(away)),
    )


def keyed_flight(views: Sequence[View]) -> Flight:
    """Through every view, just as it stands and turns, with its lens: splines through the keys."""
    poses = [view.world_from_eye for view in views]
    wxyz = _continuous(np.array([pose.wxyz for pose in poses], np.float64))
    eyes = np.array([pose.position for pose in poses], np.float64)
    tan_up = np.array([[(view.tangents[3] - view.tangents[2]) / 2] for view in views])
    _, _, away = _looks(views)
    t = np.linspace(0, len(views) - 1, _points(len(views)))
    e, q, up = (along(keys, t, False) for keys in (eyes, wxyz, np.log(tan_up)))
    q = _normalized(q)
    steps = np.linalg.norm(np.diff(e, axis=0), axis=1) / np.median(away) + _turned(q)
    places = _shares(steps)
    key_places = np.interp(np.arange(len(views)), t, places)
    e, q, up = (_at_even_places(c, places) for c in (e, q, up))
    near_far = _depth_range(views, float(np.median(away)))
    return Flight(e, _normalized(q), np.exp(up[:, 0]), near_far, key_places)


def ordered(views: Sequence[View]) -> list[View]:
    """Views in the order in which they were taken where that is a way, else in a short one."""
    eyes = np.array([view.world_from_eye.position for view in views])
    if len(views) < 4:
        return list(views)
    step = np.median(np.linalg.norm(np.diff(eyes, axis=0), axis=1))
    apart = np.linalg.norm(eyes[:: max(len(eyes) // 200, 1)][:, None] - eyes[None], axis=2)
    if step <= ORDERED * np.median(apart):
        return list(views)
    kept = _far_apart(eyes, MOST_ORDERED)
    return [views[kept[i]] for i in short_way(eyes[kept])]


def short_way(points: np.ndarray) -> list[int]:
    """An order of points (n, 3) that is a short open way: nearest neighbours, then 2-opt."""
    d = np.linalg.norm(points[:, None] - points[None], axis=2)
    start = int(np.argmax(d.sum(1)))  # an end, not the middle
    order, left = [start], np.ones(len(points), bool)
    left[start] = False
    while left.any():
        order.append(int(np.argmin(np.where(left, d[order[-1]], np.inf))))
        left[order[-1]] = False
    way, better = np.array(order), True
    while better:
        better = False
        for i in range(len(way) - 1):  # the step from i to i + 1 and each later one change ends
            a, b, c, e = way[i], way[i + 1], way[i + 1 :], np.append(way[i + 2 :], -1)
            after = np.where(e < 0, 0.0, d[c, e])
            joined = np.where(e < 0, 0.0, d[b, e])
            gain = d[a, b] + after - d[a, c] - joined
            j = int(np.argmax(gain))
            if gain[j] > 1e-9 * d.max():
                way[i + 1 : i + 2 + j] = way[i + 1 : i + 2 + j][::-1]
                better = True
    return way.tolist()


def apparent_steps(views: Sequence[View], distance: float) -> tuple[np.ndarray, np.ndarray]:
    """From view to view (n - 1,): metres over the distance plus the turn; and the turn, radians."""
    poses = [view.world_from_eye for view in views]
    eyes = np.array([pose.position for pose in poses])
    turn = _turned(_continuous(np.array([pose.wxyz for pose in poses])))
    return np.linalg.norm(np.diff(eyes, axis=0), axis=1) / distance + turn, turn


def subject_distance(views: Sequence[View]) -> float:
    """Median distance in metres from cameras to what they look at."""
    return float(np.median(_looks(views)[2]))


def _points(keys: int) -> int:
    return min(max(keys - 1, 1) * DENSE + 1, MOST_POINTS)


def _looks(views: Sequence[View]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eyes (n, 3), what they look at (n, 3) and how far that is (n,), metres.

    The point that is nearest to all lines of sight, least squares, seen along each own line; of
    cameras that look outwards it lies behind them, and the extent of their places stands for it.
    """
    matrices = [view.world_from_eye.matrix() for view in views]
    eyes = np.array([m[:3, 3] for m in matrices])
    ahead = -np.array([m[:3, 2] for m in matrices])
    across = np.eye(3) - ahead[:, :, None] * ahead[:, None, :]  # (n, 3, 3) takes the line away
    point = np.linalg.lstsq(across.sum(0), (across @ eyes[..., None]).sum(0)[:, 0], rcond=None)[0]
    extent = float(np.linalg.norm(eyes - eyes.mean(0), axis=1).max()) or 1.0
    away = ((point - eyes) * ahead).sum(1)
    if not np.median(away) > 0.2 * extent:
        away = np.full(len(eyes), extent)
    away = np.maximum(away, 0.2 * np.median(away))
    return eyes, eyes + ahead * away[:, None], away


def _filtered(values: np.ndarray, width: float) -> np.ndarray:
    """(n, d) smoothed by a Gaussian over the index; the ends stay where they are."""
    radius = min(int(3 * width), len(values) - 1)
    if radius < 1 or len(values) < 3:
        return values
    kernel = np.exp(-0.5 * (np.arange(-radius, radius + 1) / width) ** 2)
    before = 2 * values[:1] - values[radius:0:-1]  # mirrored about the ends
    after = 2 * values[-1:] - values[-2 : -radius - 2 : -1]
    longer = np.concatenate([before, values, after])
    return np.stack([np.convolve(c, kernel / kernel.sum(), "valid") for c in longer.T], axis=1)


def _travelled(eyes: np.ndarray, aims: np.ndarray, wxyz: np.ndarray | None = None) -> np.ndarray:
    """(n,) 0..1: how far the picture has moved at each point; with wxyz also by rolling."""
    distance = np.linalg.norm(aims - eyes, axis=1)
    look = _looking(aims - eyes)
    turn = np.arccos(np.clip((look[1:] * look[:-1]).sum(1), -1, 1))
    if wxyz is not None:
        roll = np.sqrt(np.maximum(_turned(wxyz) ** 2 - turn**2, 0))
        turn = np.hypot(turn, ROLL * roll)
    distance = np.maximum(distance[1:], 0.2 * np.median(distance))
    return _shares(np.linalg.norm(np.diff(eyes, axis=0), axis=1) / distance + turn)


def _shares(steps: np.ndarray) -> np.ndarray:
    """(n + 1,) 0..1, rising strictly, in proportion to steps (n,)."""
    least = max(float(steps.sum()), 1e-9) * 1e-6 / len(steps)  # a path that stands goes on, too
    way = np.concatenate([[0], np.cumsum(steps + least)])
    return way / way[-1]


def _at_even_places(values: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Values (n, d) at places (n,), again at as many even places."""
    even = np.interp(np.linspace(0, 1, len(places)), places, np.arange(len(places)))
    return along(values, even, False)


def _normalized(wxyz: np.ndarray) -> np.ndarray:
    return wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True)


def _looking(along_sight: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(along_sight, axis=1, keepdims=True)
    return along_sight / np.maximum(length, 1e-300)


def _turns(looks: np.ndarray, first_up: np.ndarray, width: float) -> np.ndarray:
    """(n, 4) quaternions of eyes that look there: level, a roll on the way over the top spread over
    `width` points; or where most look up or down, without a horizon, with the first camera's up
    carried along without a twist.
    """
    ups = np.repeat([[0.0, 1.0, 0.0]], len(looks), axis=0)
    if np.median(np.abs(looks[:, 1])) > LEVEL:
        ups[0] = first_up - (first_up @ looks[0]) * looks[0]
        ups[0] /= np.linalg.norm(ups[0])
        for i in range(1, len(looks)):  # the part across the look: the least turn there is
            ups[i] = ups[i - 1] - (ups[i - 1] @ looks[i]) * looks[i]
            ups[i] /= np.linalg.norm(ups[i])
    right = _filtered(_looking(np.cross(looks, ups)), width)
    right = _looking(right - (right * looks).sum(1, keepdims=True) * looks)
    axes = np.stack([right, np.cross(right, looks), -looks], axis=2)  # (n, 3, 3) columns
    matrices = np.repeat([np.eye(4)], len(looks), axis=0)
    matrices[:, :3, :3] = axes
    return _continuous(np.array([Pose.from_matrix(m).wxyz for m in matrices]))


def _continuous(wxyz: np.ndarray) -> np.ndarray:
    """The same turns (n, 4), each quaternion on the half of the one before it."""
    flips = np.where((wxyz[1:] * wxyz[:-1]).sum(1) < 0, -1.0, 1.0)
    return wxyz * np.concatenate([[1.0], np.cumprod(flips)])[:, None]


def _turned(wxyz: np.ndarray) -> np.ndarray:
    """(n - 1,) radians from each unit quaternion of (n, 4) to the next."""
    half_chord = np.linalg.norm(np.diff(wxyz, axis=0), axis=1) / 2
    return 4 * np.arcsin(np.clip(half_chord, 0, 1))


def _tan_up(views: Sequence[View], size: tuple[int, int]) -> float:
    """A lens for pictures of `size` that shows as much as a photo does, whatever its sides."""
    tangents = np.array([view.tangents for view in views])
    area = (tangents[:, 1] - tangents[:, 0]) * (tangents[:, 3] - tangents[:, 2]) / 4
    return float(np.sqrt(np.median(area) * size[1] / size[0]))


def _depth_range(views: Sequence[View], distance: float) -> tuple[float, float]:
    near = min(*(view.near for view in views), NEAR_PART * distance)
    return near, max(view.far for view in views)


def _far_apart(points: np.ndarray, most: int) -> np.ndarray:
    """Indices of at most so many points (n, 3), each as far as can be from those before."""
    if len(points) <= most:
        return np.arange(len(points))
    kept, away = [0], np.linalg.norm(points - points[0], axis=1)
    while len(kept) < most:
        kept.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(points - points[kept[-1]], axis=1))
    return np.array(kept)
