"""What a chart is measured on: scenes side by side, a path of the camera, a sweep of x."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.app.charts.chart_settings import Distances, Named
from shapeshift.app.charts.comparison import exact
from shapeshift.app.charts.quick_chart import turned
from shapeshift.app.document import Document, open_document
from shapeshift.app.opening import MOST_BUDGET, DrawingOptions, ReadingOptions
from shapeshift.renderer.limits import arena_rows
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.splats.sog.streamed_leaves import StreamedLeaves
from shapeshift.scene.cameras.framing import (
    distances_from,
    frame_points,
    framing_view,
    scene_points,
)
from shapeshift.scene.pose import Pose, View, eyes_apart
from shapeshift.scene.scene import IDENTITY, Scene, SceneObject

WARM_UP = 3  # frames before the path that do not count: first use compiles and allocates
GAP = 1.05  # of the sum of two radii, between neighbours
NEAR_PART, FAR_PART = 0.6, 0.9  # of the splats, see distances_of
DISTANCE_VIEWS = 5


@dataclass(frozen=True)
class Walk:
    """How the camera and x move."""

    frames: int = 32  # on an arc about the scene
    sweep: int = 7  # values of x from 0 to 1
    step: float = 0.75  # degrees between two frames: 45 a second at 60 Hz, a brisk hand


QUICK = Walk(frames=8, sweep=3, step=2.0)  # as wide an arc as kept colours need to show


@dataclass(frozen=True)
class ChartScene:
    """Everything that is drawn for one row of a chart."""

    scene: Scene
    path: tuple[View, ...]  # warm-up first: WARM_UP views that do not count
    xs: tuple[float, ...]  # of the sweep, seen from the middle of the path
    distances: Distances
    eye_distance: float  # metres between the eyes, of rows with two

    @property
    def middle(self) -> View:
        return self.path[WARM_UP + (len(self.path) - WARM_UP) // 2]

    def at(self, x: float) -> Scene:
        """The scene with every object at control value x."""
        return Scene(tuple(replace(obj, x=x) for obj in self.scene.objects))


def make_chart_scene(
    subjects: Sequence[Document],
    x: float | None,
    size: tuple[int, int],
    walk: Walk,
    cameras: Sequence[View] = (),
) -> ChartScene:
    """`subjects` in a row along x, seen from an arc before them or from the views of `cameras`.

    x: of all objects; None: each at its own.
    """
    scene = side_by_side(subjects, x)
    points = scene_points(scene)
    centre, _ = frame_points(*points)
    if cameras:
        counted = tuple(cameras)
        path = (counted[0],) * WARM_UP + counted
    else:
        first = subjects[0].view(size) if len(subjects) == 1 else framing_view(*points, size)
        path = arc(first, centre, walk)
    xs = tuple(np.linspace(0, 1, walk.sweep).tolist())
    apart = eyes_apart(distances_from(points, path[len(path) // 2]))
    return ChartScene(scene, path, xs, distances_of(points, path), apart)


def arc(first: View, centre: np.ndarray, walk: Walk) -> tuple[View, ...]:
    """Views about the vertical axis through `centre`, `first` in the middle of those that count."""
    step, half = np.radians(walk.step), walk.frames // 2
    return tuple(turned(first, centre, step * (i - half)) for i in range(-WARM_UP, walk.frames))


def side_by_side(subjects: Sequence[Document], x: float | None) -> Scene:
    """Along the world's x, framed radii touching; the first stays where it is."""
    objects: list[SceneObject] = []
    at, before = 0.0, None
    for subject in subjects:
        centre, radius = subject.bounds()
        if before is None:
            pose, left = IDENTITY, float(centre[0])
        else:
            at += GAP * (before + radius)
            pose = Pose(np.array([left + at - centre[0], 0.0, 0.0]), IDENTITY.wxyz)
        before = radius
        objects += subject.at(x, pose).objects
    return Scene(tuple(objects))


def distances_of(points: tuple[np.ndarray, np.ndarray], path: Sequence[View]) -> Distances:
    """tau_dist in this scene's own scale, metres.

    near and far: within them lie 60 % and 90 % of the splats, in the median over views of the path.
    The paper's 20 and 40 m are such parts of its scenes, and mean nothing in one of 2 m.
    """
    looks = [path[i] for i in np.linspace(0, len(path) - 1, DISTANCE_VIEWS).astype(int)]
    distances = [distances_from(points, view) for view in looks]
    if not len(distances[0]):
        return Distances(1.0, 2.0)
    near, far = np.median([np.quantile(d, (NEAR_PART, FAR_PART)) for d in distances], axis=0)
    return Distances(float(f"{near:.4g}"), float(f"{far:.4g}"))


def digest(*objects: object) -> str:
    """16 hex digits of what models hold: equal contents, equal digits, wherever they came from."""
    hasher = hashlib.sha256()
    for obj in objects:
        _feed(hasher, obj)
    return hasher.hexdigest()[:16]


def _feed(hasher, value: object) -> None:
    if is_dataclass(value):
        for each in fields(value):
            if each.name != "provenance":  # where it came from draws nothing
                _feed(hasher, getattr(value, each.name))
    elif isinstance(value, StreamedLeaves):  # its files are read as they are seen
        _feed(hasher, (value.levels, value.part, value.budget))
    elif isinstance(value, np.ndarray):
        hasher.update(f"{value.dtype}{value.shape}".encode())
        hasher.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, dict):
        for name in sorted(value):
            _feed(hasher, (name, value[name]))
    elif isinstance(value, list | tuple):
        hasher.update(f"[{len(value)}".encode())
        for each in value:
            _feed(hasher, each)
    else:
        hasher.update(repr(value).encode())


# Rows of a chart for budgets of splats: scenes in levels of detail, drawn leaf by leaf.

PARTS = (2, 4, 8)  # of all splats
MILLIONS = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25)  # splats, where the scene has more


def has_levels(subject: Document) -> bool:
    """Whether a folder of leaves is among its models, whichever level of it was read."""
    return any("leaves" in model.provenance for model in subject.models)


def by_leaves(path: Path, options: ReadingOptions) -> Document:
    """The scene opened anew so that every leaf has all its levels, and all splats may be drawn.

    Raises BadFile, UsageError.
    """
    shared = {each.name: getattr(options, each.name) for each in fields(ReadingOptions)}
    return open_document(path, DrawingOptions(**shared, budget=str(MOST_BUDGET)))


def budgets_of(scene: Scene, drawing: str, quick: bool = False) -> tuple[Named, ...]:
    """The rows of a scene's chart, all splats first; quick: only all and parts.  None without
    leaves.

    Their target is that of the exact setting: a row says what its budget costs and nothing else.
    All comes first since both renderers have read the same leaves in the same order then.
    """
    models = [obj.model for obj in scene.objects]
    leaves = [m.leaves for m in models if isinstance(m, SplatLayers) and m.leaves is not None]
    if not leaves:
        return ()
    fixed = sum(map(arena_rows, models))  # of objects without levels, which are drawn in full
    whole = fixed + sum(int(source.levels.finest_counts.sum()) for source in leaves)
    budgets = {"budget all": whole} | {f"budget 1/{part}": whole // part for part in PARTS}
    if not quick:
        budgets |= {f"budget {m:g}M": int(m * 1e6) for m in MILLIONS if m * 1e6 < whole}
    target = exact(RenderSettings(), drawing).target
    return tuple(
        Named(name, {"budget": budget, "target": target})
        for name, budget in budgets.items()
        if budget > fixed
    )
