"""How evenly films move, and whether they flicker: docs/bench/film.csv.

    python3 tools/scene/film.py --out docs/bench/film.csv

path: the tours past the cameras of real captures as `film` makes them at 30 frames a second for
10 s, beside 3SGS's way (linear R and T, equations 1 to 3 of its section 3.3) and the plain spline
through all cameras.  speed: apparent, metres over the distance plus the turn, max over median of
the middle two thirds; turn: degrees a frame, rolls counted; shear: |det R - 1|; far: from the
nearest camera, of the distance to the subject.

flicker: RMSE between neighbouring frames of a film of the demo where both see the same place, the
one carried into the other by depth (1 % depth test, coverage over 0.95), at pairs spread over the
film; beside the same pairs with the first frame's scene held still, and with a still stop.
"""

import argparse
import io
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.document import open_document  # noqa: E402
from shapeshift.app.film.film_plan import Clock, FilmPlan, orbit_plan  # noqa: E402
from shapeshift.app.opening import ReadingOptions  # noqa: E402
from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.runtime_models.files.whole_file import write_whole  # noqa: E402
from shapeshift.scene.cameras.camera_path import poses_between  # noqa: E402
from shapeshift.scene.cameras.read_cameras import read_cameras  # noqa: E402
from shapeshift.scene.film.film_path import eased_places, frame_times  # noqa: E402
from shapeshift.scene.film.flight import apparent_steps, subject_distance, tour  # noqa: E402
from shapeshift.scene.film.style_path import read_style_path  # noqa: E402
from shapeshift.scene.pose import Pose, View  # noqa: E402
from shapeshift.scene.scene import Scene  # noqa: E402

CAPTURES = ("plush_snowmiku", "maryrose_tankard", "fern_llff")
FRAMES, FPS = 300, 30.0
SIZE = (480, 270)
STYLE = "RGB@1s Thermal@4s Opened@7s RGB@9.5s"
PAIRS = 24  # of neighbouring frames
SEEN, DEPTH = 0.95, 0.01  # coverage, and part of the depth: the same place is seen twice


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared" / "data")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "bench" / "film.csv")
    parser.add_argument("--scene", type=Path, default=ROOT / "assets" / "workshop.shift")
    options = parser.parse_args()
    text = io.StringIO()
    text.write("# python3 tools/scene/film.py --out docs/bench/film.csv\n")
    text.write("# 300 frames at 30 a second; flicker at 480x270; wanted: speed <= 1.3, turn <= 3, ")
    text.write("ratio <= 1.2\n")
    text.write("measure,what,way,speed_max_over_median,speed_min_over_median,turn_degrees,shear,")
    text.write("far,warp_rmse,still_rmse,ratio,cpu_s\n")
    for capture in CAPTURES:
        for row in path_rows(capture, read_cameras(options.data / capture / "cameras.json")):
            text.write(row + "\n")
            sys.stderr.write(row + "\n")
    for row in flicker_rows(options.scene):
        text.write(row + "\n")
        sys.stderr.write(row + "\n")
    write_whole(options.out, text.getvalue().encode())


def path_rows(capture: str, views: list[View]) -> list[str]:
    """A row a way through the cameras of a capture."""
    distance = subject_distance(views)
    shuffled = [views[i] for i in np.random.default_rng(0).permutation(len(views))]
    rows = []
    for name, make in {
        "film": lambda: flown(views, 1.0),
        "film, photos shuffled": lambda: flown(shuffled, 1.0),
        "film --smooth 0": lambda: flown(views, 0.0),
        "spline through all cameras": lambda: splined(views),
    }.items():
        start = time.process_time()
        path = make()
        rows.append(path_row(capture, name, path, 0.0, views, distance, start))
    start = time.process_time()
    path, shear = linear(views)
    rows.append(path_row(capture, "3SGS: linear R and T", path, shear, views, distance, start))
    return rows


def path_row(
    capture: str, name: str, path: list[View], shear: float, views: list[View], distance: float,
    start: float,
) -> str:  # fmt: skip
    steps, turns = apparent_steps(path, distance)
    middle = steps[FRAMES // 6 : -FRAMES // 6]
    eyes = np.array([v.world_from_eye.position for v in path])
    taken = np.array([v.world_from_eye.position for v in views])
    far = np.linalg.norm(eyes[:, None] - taken[None], axis=2).min(1).max() / distance
    fast, slow = (each / np.median(middle) for each in (middle.max(), middle.min()))
    cpu = time.process_time() - start
    return (
        f'path,{capture} ({len(views)}),"{name}",{fast:.2f},{slow:.2f},'
        f"{np.degrees(turns.max()):.2f},{shear:.3f},{far:.2f},,,,{cpu:.2f}"
    )


def flown(views: Sequence[View], smooth: float) -> list[View]:
    flight = tour(views, SIZE, smooth)
    places = eased_places(frame_times(FRAMES, FRAMES / FPS), FRAMES / FPS, 0.12)
    return [flight.view(place, SIZE) for place in places.tolist()]


def splined(views: Sequence[View]) -> list[View]:
    """Even steps from camera to camera, as keyframes of a camera_path.json are read."""
    poses = poses_between([v.world_from_eye for v in views], np.linspace(0, len(views) - 1, FRAMES))
    return [replace(views[0], world_from_eye=pose) for pose in poses]


def linear(views: Sequence[View]) -> tuple[list[View], float]:
    """3SGS's way, its matrices made rotations again to be views; and how far they were from it."""
    matrices = np.array([v.world_from_eye.matrix() for v in views])
    t = np.linspace(0, len(views) - 1, FRAMES)
    i = np.minimum(t.astype(int), len(views) - 2)
    part = (t - i)[:, None, None]
    mixed = (1 - part) * matrices[i] + part * matrices[i + 1]
    shear = float(np.abs(np.linalg.det(mixed[:, :3, :3]) - 1).max())
    path = []
    for matrix in mixed:
        u, _, v = np.linalg.svd(matrix[:3, :3])
        rigid = np.eye(4)
        rigid[:3, :3], rigid[:3, 3] = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v, matrix[:3, 3]
        path.append(replace(views[0], world_from_eye=Pose.from_matrix(rigid)))
    return path, shear


def flicker_rows(scene: Path) -> list[str]:
    """A row for the film as a whole, and one a stop that stands still on the same way."""
    document = open_document(scene, ReadingOptions())
    clock = Clock(FRAMES / FPS, FPS, 0.0)
    plan = orbit_plan(document, clock, SIZE, read_style_path(STYLE, clock.seconds))
    pairs = [round(k) for k in np.linspace(0, FRAMES - 2, PAIRS)]
    rows = []
    with Renderer(None) as renderer:
        renderer.settings = replace(renderer.settings, background=document.background)
        start = time.process_time()
        moving, held = (
            np.array([pair_error(renderer, plan, k, still) for k in pairs])
            for still in (False, True)
        )
        cpu = time.process_time() - start
        rows.append(flicker_row(scene.name, f"film: {STYLE}", moving, held, cpu))
        for stop in document.models[0].stops:
            start = time.process_time()
            at = replace(plan, document=replace(document, scene=document.at(stop.x)), style=None)
            still = np.array([pair_error(renderer, at, k, True) for k in pairs])
            cpu = time.process_time() - start
            rows.append(flicker_row(scene.name, f"still: {stop.name}", still, still, cpu))
    return rows


def flicker_row(scene: str, what: str, errors: np.ndarray, still: np.ndarray, cpu: float) -> str:
    one, other = np.nanmean(errors), np.nanmean(still)
    return f'flicker,{scene},"{what}",,,,,,{one:.4f},{other:.4f},{one / other:.2f},{cpu:.1f}'


def pair_error(renderer: Renderer, plan: FilmPlan, frame: int, still: bool) -> float:
    """RMSE of a frame and the next one carried into it; still: both show the first one's scene."""
    one = seen(renderer, plan.scene(frame), plan.view(frame))
    after = plan.view(frame + 1)
    two = seen(renderer, plan.scene(frame if still else frame + 1), after)
    return warp_rmse(plan.view(frame), one, after, two)


def seen(renderer: Renderer, scene: Scene, view: View) -> tuple[np.ndarray, ...]:
    """Picture (H, W, 3), metres along the view and coverage (H, W)."""
    renderer.update(scene)
    renderer.draw([view])
    picture = np.clip(renderer.resolved(), 0, 1).copy()
    surface = renderer.surface(view)
    return picture, surface.metres / np.maximum(surface.coverage, 1e-6), surface.coverage


def warp_rmse(view: View, one: tuple, other_view: View, other: tuple) -> float:
    """RMSE over the pixels of a view that another one sees, too; NaN where these are too few."""
    (picture, depth, cover), (other_picture, other_depth, other_cover) = one, other
    height, width = depth.shape
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    other_from_world, gx, gy, hx, hy = other_view.pinhole()
    v, u = np.mgrid[:height, :width] + 0.5
    point = np.stack([(u - cx) / fx * depth, (v - cy) / fy * depth, depth, np.ones_like(depth)], -1)
    there = point @ (other_from_world @ np.linalg.inv(camera_from_world)).T
    z = there[..., 2]
    x, y = (
        there[..., 0] / np.maximum(z, 1e-6) * gx + hx,
        there[..., 1] / np.maximum(z, 1e-6) * gy + hy,
    )
    inside = (z > 0) & (x > 1) & (x < width - 1) & (y > 1) & (y < height - 1)
    good = inside & (cover > SEEN) & (bilinear(other_cover, x, y) > SEEN)
    good &= np.abs(bilinear(other_depth, x, y) - z) < DEPTH * z
    if good.sum() < 200:
        return float("nan")
    return float(np.sqrt(((bilinear(other_picture, x, y) - picture)[good] ** 2).mean()))


def bilinear(image: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Of (H, W) or (H, W, C) at pixels from the upper left corner."""
    height, width = image.shape[:2]
    x, y = np.clip(x - 0.5, 0, width - 1.001), np.clip(y - 0.5, 0, height - 1.001)
    i, j = x.astype(int), y.astype(int)
    a, b = x - i, y - j
    if image.ndim == 3:
        a, b = a[..., None], b[..., None]
    upper = (1 - a) * image[j, i] + a * image[j, i + 1]
    lower = (1 - a) * image[j + 1, i] + a * image[j + 1, i + 1]
    return (1 - b) * upper + b * lower


if __name__ == "__main__":
    main()
