"""The case of what jumps from frame to frame although nothing in the scene does."""

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from shapeshift.app.stability_cases.case_context import CaseContext, difference, turned
from shapeshift.app.stability_cases.finding import (
    Panel,
    Result,
    at_least,
    at_most,
    clean,
    decibels,
    not_here,
)
from shapeshift.app.stability_cases.motion import KEPT, STALE_YAW, WAS_OLD, is_old
from shapeshift.app.stability_cases.scenes import alone, front, splats
from shapeshift.scene.pose import View, perspective
from shapeshift.scene.scene import Scene

WIDE = 1.92  # radians, 110 degrees across: what was in front stays in view over most of a turn
TURN = 90.0  # degrees
LIMIT_STEP = 0.01  # of a limit: how far it moves from frame to frame, as an eye at walking pace
FADE = 0.2  # of a limit
FRAMES = 8  # of a moving limit in the user's scene
VISIBLE = 8 / 255  # of a pixel: what smaller changes do is no pop
SMALL = (160, 96)


def popping(case: CaseContext) -> Result:
    """A 90-degree turn: what changes from frame to frame beyond the motion itself.

    The motion is taken out exactly: each view is drawn in its own order and in that of the view
    before.  For limits the picture stands still and the limit moves, as when the eye steps back.
    """
    depth, distance = (turn_in_order(case, order) for order in ("depth", "distance"))
    step = TURN / case.steps
    allowed = float(np.interp(step, list(STALE_YAW), list(STALE_YAW.values())))
    findings = [
        at_least(
            f"depth order, pop of a step of {step:.3g} degrees, dB", depth.db, allowed,
            "what an order of that age costs splats of random colours (case stale-yaw)",
        ),
        at_least(
            f"distance order, pop of a step of {step:.3g} degrees, dB", distance.db, 70,
            "a turn changes no distance to the eye; only rounding may swap neighbours",
        ),
        at_least(
            "frames drawn in an old order", depth.kept + distance.kept, 2 * case.steps,
            WAS_OLD,
        ),
        *fades_alone(case), *fades_in_the_scene(case),
    ]  # fmt: skip
    panels = [
        case.panel("order of the view before", depth.old),
        case.panel("its own order", depth.own),
        Panel("8 times the difference", difference(depth.old, depth.own)),
    ]
    return Result([clean(*depth.images, *distance.images), *findings], panels)


class TurnInOrder(NamedTuple):
    """The worst step of a turn, and all its pictures in the order of the view before."""

    db: float
    old: np.ndarray  # (H, W, 4) of the worst step
    own: np.ndarray  # (H, W, 4) in its own order
    kept: int  # pictures that were really drawn in an old order
    images: list[np.ndarray]  # each (H, W, 4)


def turn_in_order(case: CaseContext, order: str) -> TurnInOrder:
    scene, wide = case.scene(), widened(case.view())
    least, kept, images = np.inf, 0, []
    for before, angle in pairwise(np.linspace(-TURN / 2, TURN / 2, case.steps + 1)):
        here, there = turned(wide, before), turned(wide, angle)
        own = case.draw(scene, there, order=order)
        case.draw(scene, here, order=order, **KEPT)
        old = case.draw(scene, there, order=order, **KEPT)
        kept += is_old(case)
        images.append(old)
        db = decibels(old, own)
        if not db >= least:
            least, worst_old, worst_own = db, old, own
    return TurnInOrder(least, worst_old, worst_own, kept, images)


def widened(view: View) -> View:
    """The same eye with 110 degrees across."""
    width, height = view.size
    fov_y = 2 * np.arctan(np.tan(WIDE / 2) * height / width)
    return replace(view, tangents=perspective(fov_y, view.size))


def fades_alone(case: CaseContext) -> list:
    """Splats side by side, of many sizes and distances, each crossing a limit by itself."""
    columns, rows = np.meshgrid(np.linspace(-1, 1, 8), np.linspace(-0.6, 0.6, 5))
    rng = np.random.default_rng(5)
    away = rng.uniform(2.5, 3.5, columns.size)  # metres from the eye, at 3 m from the origin
    places = np.stack([columns.ravel(), rows.ravel(), 3 - away], axis=1)
    sizes = rng.uniform(0.02, 0.045, columns.size) * away / 3
    model = splats(places, sizes[:, None], 0.9)
    view = front(SMALL)
    focal = SMALL[1] / (view.tangents[3] - view.tangents[2])  # pixels
    starts = {
        "max_distance": 2.7, "max_pixels": 0.025 * focal / 3, "min_pixels": 3 * 0.025 * focal / 3
    }  # fmt: skip
    findings = []
    for name, start in starts.items():
        hard, soft = (pops(case, alone(model), view, name, start, f, 30) for f in (0.0, FADE))
        findings.append(
            at_most(
                f"{name}, splats apart, largest pop of a pixel with fade {FADE} over without",
                soft / hard if hard else np.nan, 0.12,
                f"the ramp spans {FADE / LIMIT_STEP:.0f} steps of the limit: a twentieth of a "
                "splat a step, twice that where it thins out below 1/255",
            )
        )  # fmt: skip
    return findings


def fades_in_the_scene(case: CaseContext) -> list:
    """The same in the user's scene, where many splats meet a limit at once."""
    view = case.view()
    centre, _ = case.bounds()
    away = float(np.linalg.norm(np.asarray(view.world_from_eye.position) - centre))
    starts = {"max_distance": away, "max_pixels": 0.012 * max(view.size), "min_pixels": 1.5}
    findings = []
    for name, start in starts.items():
        hard, soft = (pops(case, case.scene(), view, name, start, f) for f in (0.0, FADE))
        if not hard > VISIBLE:
            reason = f"its largest pop without a fade is {255 * hard:.1f} of 255: nobody sees it"
            findings.append(not_here(f"{name} {start:.3g}, the scene, fade {FADE}", reason))
            continue
        findings.append(
            at_most(
                f"{name} {start:.3g}, the scene, largest pop with fade {FADE} over without",
                soft / hard, 1.0, "more splats change at once, each by less: never a larger pop",
            )
        )  # fmt: skip
    return findings


def pops(
    case: CaseContext, scene: Scene, view: View, name: str, start: float, fade: float,
    frames: int = FRAMES,
) -> float:  # fmt: skip
    """Largest change of a pixel from frame to frame while a limit moves by LIMIT_STEP a frame."""
    limits = [float(start * (1 + LIMIT_STEP) ** i) for i in range(frames)]
    images = [case.draw(scene, view, fade=fade, **{name: limit}) for limit in limits]
    return max(float(np.abs(a - b).max()) for a, b in pairwise(images))
