"""The case of what jumps from frame to frame although nothing in the scene does."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from shapeshift.app.stability_cases.case_context import (
    CaseContext,
    CaseFinding,
    ComparedPicture,
    Panel,
    Result,
    at_least,
    at_most,
    clean,
    decibels,
    difference,
    not_here,
    turned,
    turned_about,
    worst_of,
)
from shapeshift.app.stability_cases.scenes import alone, front, splats
from shapeshift.renderer.pace import EVEN_ENOUGH
from shapeshift.runtime_models.evaluate import follows_eye
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


# Cases of what moves: the control value, and an order that is older than the view.

LONGEST_STEP = 0.01  # of x
LUMA = np.array([0.2126, 0.7152, 0.0722])  # Rec. 709
UNSEEN = 2 / 255  # two steps of a display: a change of the mean that nobody sees
KEPT = {"resort_frames": 0, "resort_degrees": 180.0}  # an order is made once and then kept
# Degrees and the least dB.  What an order that old costs where every splat has a colour of its own,
# measured on 100,000 splats: no scene of surfaces comes near it.  Two dB are for small pictures.
STALE_ORBIT: dict[float, float] = {0.25: 50, 0.5: 48, 1: 44, 2: 41, 4: 39, 8: 36, 16: 33}
STALE_YAW: dict[float, float] = {0.25: 51, 0.5: 49, 1: 45, 2: 41, 5: 37, 10: 34, 16: 32}
WAS_OLD = "else these figures compare a frame with itself"
STALE_REASON = (
    "the price of an order so old for splats of random colours, less 2 dB; surfaces pay less"
)


def sweep(case: CaseContext) -> Result:
    """x from stop to stop: no frame darker, emptier, or further off than both its ends allow."""
    xs = case.subject.stops
    if len(xs) < 2:
        only = not_here("frames between two stops", "the scene has a single stop")
        return Result([only], [])
    frames = {}
    view = case.view()
    for low, high in pairwise(xs):
        count = max(case.steps, math.ceil((high - low) / LONGEST_STEP))
        for x in np.linspace(low, high, count + 1):
            image = case.draw(case.scene(float(x)), view)
            frames[float(x)] = (image, case.shown())
    spans = [Span(frames, low, high) for low, high in pairwise(xs)]
    tables = zip(*(span.findings() for span in spans), strict=True)
    findings = [min(rows, key=lambda row: row.headroom) for rows in tables]
    worst = min(spans, key=lambda span: min(row.headroom for row in span.findings()))
    return Result([clean(*(image for image, _ in frames.values())), *findings], worst.panels())


class Span:
    """The frames between two stops: {x: (image, what a person sees)}.

    Were x to blend both ends pixel by pixel, every frame would lie between them in each pixel.
    """

    def __init__(self, frames: dict, low: float, high: float) -> None:
        self.xs = [x for x in frames if low <= x <= high]
        self.images = [frames[x][0] for x in self.xs]
        self.seen = [frames[x][1] for x in self.xs]
        first, last = self.seen[0], self.seen[-1]
        self.apart = float(np.abs(first - last).mean())
        self.steps = [float(np.abs(a - b).mean()) for a, b in pairwise(self.seen)]
        self.around = [np.abs(s - first).mean() + np.abs(s - last).mean() for s in self.seen]

    def findings(self) -> list[CaseFinding]:
        span = f"x {self.xs[0]:.3g} to {self.xs[-1]:.3g}"
        alpha = [float(image[..., 3].mean()) for image in self.images]
        lights = [seen @ LUMA for seen in (self.seen[0], self.seen[-1])]
        luma = [float((seen @ LUMA).mean()) for seen in self.seen]
        filled = float(np.minimum(self.images[0][..., 3], self.images[-1][..., 3]).mean())
        even = max(float(np.mean(self.steps)), UNSEEN / len(self.steps))
        return [
            at_least(
                f"least coverage, {span}", min(alpha), 0.98 * filled,
                "pixels that both ends fill stay filled, 2 % for edges on the move",
            ),
            at_least(
                f"least light, {span}", min(luma),
                0.98 * float(np.minimum(*lights).mean()) - UNSEEN / 2,
                "no darker than the darker end in every pixel, 2 % and a grey step for edges",
            ),
            at_most(
                f"most light, {span}", max(luma),
                1.02 * float(np.maximum(*lights).mean()) + UNSEEN / 2,
                "no brighter than the brighter end in every pixel, 2 % and a grey step for edges",
            ),
            at_most(
                f"largest step over an even one, {span}", max(self.steps) / even, EVEN_ENOUGH,
                f"steps of {self.xs[1] - self.xs[0]:.3g} of x: a shift changes the picture about "
                "evenly, a switch does nothing for most of its way and then all at once",
            ),
            at_most(
                f"longest way round, {span}", max(self.around),
                max(2 * self.apart, self.apart + 2 * UNSEEN),
                "a blend of the ends is 1 times their difference away from both, content that "
                "has left both places 2 times; more belongs to neither",
            ),
        ]  # fmt: skip

    def panels(self) -> list[Panel]:
        """The frame furthest from both ends, or of the largest step where that fails."""
        at = int(np.argmax(self.around))
        if not self.findings()[3].holds:
            at = int(np.argmax(self.steps))
        beside = min(at + 1, len(self.xs) - 1)
        captions = {at: "worst", beside: "its neighbour", 0: "end", len(self.xs) - 1: "end"}
        return [
            Panel(f"{what}: x = {self.xs[i]:.3f}", self.seen[i]) for i, what in captions.items()
        ]


def stale_orbit(case: CaseContext) -> Result:
    """An order made before the eye went 0.25 to 16 degrees around the scene."""
    centre, _ = case.bounds()
    return stale(case, lambda view, angle: turned_about(view, centre, angle), STALE_ORBIT)


def stale_yaw(case: CaseContext) -> Result:
    """An order made before the head turned by 0.25 to 16 degrees."""
    return stale(case, turned, STALE_YAW)


def stale(case: CaseContext, move, bounds: dict[float, float]) -> Result:
    """dB of a frame in an old order against the frame in its own, at every angle of `bounds`."""
    scene, view = case.scene(), case.view()
    findings, comparisons, kept = [], [], 0
    for angle, least in bounds.items():
        there = move(view, angle)
        exact = case.draw(scene, there)
        case.draw(scene, view)  # every setting but KEPT makes its order anew
        case.draw(scene, view, **KEPT)
        old = case.draw(scene, there, **KEPT)
        kept += is_old(case)
        db = decibels(old, exact)
        findings.append(at_least(f"order {angle:g} degrees old, dB", db, least, STALE_REASON))
        comparisons.append(ComparedPicture(db, f"order {angle:g} degrees old", old, exact))
    _, what, old, exact = worst_of(comparisons)
    # A model whose opacities follow the eye is put in order wherever that moves.
    moved = any(map(follows_eye, case.subject.models)) and move is not turned
    stale = at_least("frames drawn in an old order", kept, 0 if moved else len(bounds), WAS_OLD)
    panels = [
        case.panel(what, old),
        case.panel("its own order", exact),
        Panel("8 times the difference", difference(old, exact)),
    ]
    return Result([clean(*(c.image for c in comparisons)), stale, *findings], panels)


def is_old(case: CaseContext) -> bool:
    """Whether the last frame was drawn in an order of an earlier one."""
    return case.stats.sorts == 0 and case.stats.order_age >= 1
