"""Sections: their picture beside the truth pixel by pixel, and what they cost a frame.

    python3 tools/renderer/sections.py > docs/bench/sections.csv

Picture: the demo cut by a plane, OpenCL tiles, against the sum along every ray with each splat's
integral over the kept half of the ray (float64): PSNR of that picture, of all pixels and of those
that the cut changes; and, seen along the plane, how far beyond it coverage reaches (share of the
coverage that lies outside, and metres to where a tenth of the pixels' coverage is left).
Times: CPU milliseconds of the process, all jobs in turns in one run, medians; times_a_frame is the
median over the turns of the ratio to the frame without a section.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

import numpy as np  # noqa: E402
from scipy.special import ndtr  # noqa: E402

from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.runtime_models.evaluate import evaluate  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.runtime_models.rotation import rotation_matrices  # noqa: E402
from shapeshift.scene.cameras.framing import (  # noqa: E402
    frame_points,
    orbit_path,
    scene_points,
)
from shapeshift.scene.pose import View, look_at  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402
from shapeshift.scene.sections.section import EDGES, PlaneShape, SceneSection  # noqa: E402
from tests.support.models import without_control  # noqa: E402

SIZE, RUNS = (1280, 720), 41
SMALL = (192, 144)
OFFSET_M = 0.05  # of the plane across the demo, along x
SOFT_M = 0.05
LOW_PASS, MIN_ALPHA, MOST_ALPHA = 0.3, 1 / 255, 0.99


def section(edge: str, offset_m: float = OFFSET_M, **more) -> SceneSection:
    width = SOFT_M if edge == "soft" else 0.0
    return SceneSection(
        shape=PlaneShape((1.0, 0.0, 0.0), offset_m), edge=edge, width_m=width, **more
    )


def true_picture(model, view: View, offset_m: float | None) -> np.ndarray:
    """(H, W, 4) float64 premultiplied: splats near to far, each alpha times the share of the ray's
    integral of the Gaussian that lies where x <= offset_m; None: all of it.
    """
    eye_from_world, eye = view.eye_from_world(), view.world_from_eye.position
    splats = evaluate(model, 0.0, eye)
    depth = -(splats.means @ eye_from_world[2, :3] + eye_from_world[2, 3])
    (left, right, low, high), (width, height) = view.tangents, view.size
    pixel = (right - left) / width  # a tangent
    x = left + (np.arange(width) + 0.5) * pixel
    y = high - (np.arange(height) + 0.5) * (high - low) / height
    axes = view.world_from_eye.matrix()[:3, :3]
    turns = rotation_matrices(splats.wxyz) * splats.scales[:, None, :]
    picture, through = np.zeros((height, width, 4)), np.ones((height, width))
    order = np.argsort(depth, kind="stable")
    for i in order[(depth[order] > view.near) & (splats.opacity[order] >= MIN_ALPHA)]:
        z, mean = depth[i], splats.means[i].astype(np.float64) - eye
        covariance = turns[i] @ turns[i].T + LOW_PASS * (pixel * z) ** 2 * np.eye(3)
        reach = 3.4 * np.sqrt(np.linalg.eigvalsh(covariance)[-1]) / z
        u, v = mean @ axes[:, 0] / z, mean @ axes[:, 1] / z
        columns = slice(*np.searchsorted(x, (u - reach, u + reach)))
        rows = slice(*(height - np.searchsorted(y[::-1], (v + reach, v - reach))))
        if columns.start == columns.stop or rows.start >= rows.stop:
            continue
        rays = x[columns, None] * axes[:, 0] - axes[:, 2]  # (w, 3) of depth 1
        rays = rays + y[rows, None, None] * axes[:, 1]  # (h, w, 3)
        precision = np.linalg.inv(covariance)
        along, to = rays @ precision, precision @ mean
        per = np.einsum("hwi,hwi->hw", along, rays)
        best = (rays @ to) / per  # depth at which the ray is nearest
        alpha = splats.opacity[i] * np.exp(-0.5 * (mean @ to - best**2 * per))
        if offset_m is not None:
            step = rays[..., 0]
            inside = (offset_m - eye[0] - best * step) / np.abs(step)
            alpha = alpha * ndtr(inside * np.sqrt(per))
        alpha = np.where(alpha >= MIN_ALPHA, np.minimum(alpha, MOST_ALPHA), 0)
        light = through[rows, columns] * alpha
        picture[rows, columns, :3] += light[..., None] * splats.color[i]
        picture[rows, columns, 3] += light
        through[rows, columns] *= 1 - alpha
    return picture


def drawn(renderer: Renderer, model, view: View, *sections: SceneSection) -> np.ndarray:
    renderer.update(Scene((SceneObject("demo", model, sections=sections),)))
    renderer.draw([view])
    return renderer.image().copy()


def db(one: np.ndarray, other: np.ndarray, where: np.ndarray | None = None) -> float:
    apart = (one - other)[..., :3] ** 2
    return float(-10 * np.log10(np.mean(apart if where is None else apart[where])))


def picture_rows(model) -> list[str]:
    """Each edge from the side that is cut open, and seen along the plane."""
    centre, radius = frame_points(*scene_points(Scene((SceneObject("demo", model),))))
    open_view = view_at(centre, radius, (2.0, 0.8, 1.2))
    side = view_at(np.array([OFFSET_M, *centre[1:]]), radius, (0.0, 0.3, 2.4))
    truth, whole = (true_picture(model, open_view, offset) for offset in (OFFSET_M, None))
    changed = np.abs(truth - whole).max(axis=-1) > 2 / 255
    out = []
    with_side = true_picture(model, side, OFFSET_M)
    renderer = Renderer(None)
    plain = drawn(renderer, model, open_view)
    out.append(f"picture,no section,,{db(plain, whole):.1f},,,\n")
    out.append(f"picture,truth,,,,{beyond(with_side, side, centre)}\n")
    for edge in EDGES:
        picture = drawn(renderer, model, open_view, section(edge))
        aside = drawn(renderer, model, side, section(edge))
        out.append(
            f"picture,{edge},,{db(picture, truth):.1f},{db(picture, truth, changed):.1f},"
            f"{beyond(aside, side, centre)}\n"
        )
    renderer.close()
    return out


def view_at(target: np.ndarray, radius: float, direction: tuple[float, float, float]) -> View:
    eye = target + np.array(direction) * radius
    half = 0.45
    tangents = (-half, half, -half * SMALL[1] / SMALL[0], half * SMALL[1] / SMALL[0])
    return View(look_at(eye, target), tangents, 0.01, 100.0, SMALL)


def beyond(picture: np.ndarray, view: View, centre: np.ndarray) -> str:
    """Share of coverage beyond the plane, which is the middle column, and metres of its reach."""
    columns = picture[..., 3].sum(axis=0)
    middle = view.size[0] // 2
    outside = columns[middle:]
    distance = np.linalg.norm(view.world_from_eye.position - [OFFSET_M, *centre[1:]])
    pixel_m = distance * (view.tangents[1] - view.tangents[0]) / view.size[0]
    inside = columns[:middle].mean()
    reach = np.flatnonzero(outside > 0.1 * inside)
    farthest_m = (reach[-1] + 1 if len(reach) else 0) * pixel_m
    return f"{outside.sum() / columns.sum():.4f},{farthest_m:.3f}"


def measured(jobs: dict[str, Callable[[int], None]]) -> dict[str, tuple[float, float]]:
    """CPU milliseconds of each job, and times the first job of the same turn: medians over turns,
    in which load meets all alike.
    """
    taken: dict[str, list[float]] = {name: [] for name in jobs}
    for turn in range(RUNS + 2):  # the first ones compile
        for name, job in jobs.items():
            start = time.process_time()
            job(turn)
            taken[name].append(1e3 * (time.process_time() - start))
    first = next(iter(taken.values()))[2:]
    return {
        name: (median(times[2:]), median(a / b for a, b in zip(times[2:], first, strict=True)))
        for name, times in taken.items()
    }


def time_rows(name: str, model) -> list[str]:
    """Frames of an orbit without a section, with one at rest, and with one that moves."""
    still = SceneObject("demo", model)
    views = orbit_path(90, *frame_points(*scene_points(Scene((still,)))), SIZE)
    box = replace(section("hard"), shape=PlaneShape((1.0, 0.0, 0.0), 100.0))
    cases: dict[str, Callable[[int], SceneObject]] = {
        "no section": lambda turn: still,
        "cuts nothing": lambda turn: replace(still, sections=(box,)),
    }
    for edge in EDGES:
        cases[f"{edge} at rest"] = lambda turn, e=edge: replace(still, sections=(section(e),))
        cases[f"{edge} dragged"] = lambda turn, e=edge: replace(
            still, sections=(section(e, OFFSET_M + 0.002 * turn),)
        )
    if len(model.stops) > 1:
        x = model.stops[1].x
        cases["x plays"] = lambda turn: replace(still, x=0.01 * (turn + 1))
        for edge in ("capped", "hard"):
            cases[f"x plays {edge}"] = lambda turn, e=edge: replace(
                still, x=0.01 * (turn + 1), sections=(section(e),)
            )
        cases["beyond at rest"] = lambda turn: replace(still, sections=(section("hard", beyond=x),))
        cases["beyond dragged"] = lambda turn: replace(
            still, sections=(section("hard", OFFSET_M + 0.002 * turn, beyond=x),)
        )
    renderers = {case: Renderer(None) for case in cases}

    def job(case: str) -> Callable[[int], None]:
        def draw(turn: int) -> None:
            renderers[case].update(Scene((cases[case](turn),)))
            renderers[case].draw([views[turn]])

        return draw

    costs = measured({case: job(case) for case in cases})
    for renderer in renderers.values():
        renderer.close()
    return [f"time,{case},{name},,,,,{ms:.1f},{by:.2f}\n" for case, (ms, by) in costs.items()]


def main() -> None:
    demo = read_model(ROOT / "assets" / "workshop.shift")
    say = sys.stdout.write
    say("# python3 tools/renderer/sections.py > docs/bench/sections.csv\n")
    say("what,case,model,psnr_db,psnr_changed_db,beyond_share,beyond_m,cpu_ms,times_a_frame\n")
    names = ("offset", "scale", "rotation", "opacity")
    for row in picture_rows(demo):
        say(row.rstrip("\n") + ",,\n")
    assert isinstance(demo, AnchorModel)
    alike = without_control(demo, *names)
    plain = tuple(replace(stop, kind="rgb", palette="") for stop in demo.stops)
    cases = {
        "shape differs": demo, "colours and heat": alike,
        "colours alone": replace(alike, stops=plain),
    }  # fmt: skip
    for name, model in cases.items():
        sys.stdout.writelines(time_rows(name, model))


if __name__ == "__main__":
    main()
