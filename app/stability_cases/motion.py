"""Cases of what moves: the control value, and an order that is older than the view."""

import math
from itertools import pairwise

import numpy as np

from app.stability_cases.finding import (
    Panel,
    Result,
    at_least,
    at_most,
    clean,
    decibels,
    not_here,
)
from app.stability_cases.stage import Stage, difference, turned, turned_about
from runtime_models.model import AnchorModel

LONGEST_STEP = 0.02  # of x, half a Gaussian of the paper's encoding
SIGMA = 0.04  # of x: the paper's encoding; layers, which have none, are held to the same
LUMA = np.array([0.2126, 0.7152, 0.0722])  # Rec. 709
KEPT = {"resort_frames": 0, "resort_degrees": 180.0}  # an order is made once and then kept
# Degrees and the least dB.  What an order that old costs where every splat has a colour of its own,
# measured on 100,000 splats: no scene of surfaces comes near it.  Two dB are for small pictures.
STALE_ORBIT = {0.25: 50, 0.5: 48, 1: 44, 2: 41, 4: 39, 8: 36, 16: 33}
STALE_YAW = {0.25: 51, 0.5: 49, 1: 45, 2: 41, 5: 37, 10: 34, 16: 32}
WAS_OLD = "else these figures compare a frame with itself"
STALE_REASON = (
    "the price of an order so old for splats of random colours, less 2 dB; surfaces pay less"
)


def sweep(stage: Stage) -> Result:
    """x from stop to stop: no frame darker, emptier, or further off than both its ends allow."""
    xs = sorted({stop.x for stop in stage.model.stops})
    if len(xs) < 2:
        only = not_here("frames between two stops", "the scene has a single stop")
        return Result([only], [])
    frames = {}
    view = stage.view()
    for low, high in pairwise(xs):
        count = max(stage.steps, math.ceil((high - low) / LONGEST_STEP))
        for x in np.linspace(low, high, count + 1):
            image = stage.draw(stage.scene(float(x)), view)
            frames[float(x)] = (image, stage.shown())
    sigma = stage.model.encoding.sigma if isinstance(stage.model, AnchorModel) else SIGMA
    worst = [worst_between(frames, low, high, sigma) for low, high in pairwise(xs)]
    findings = [min((rows[i] for rows, _ in worst), key=headroom)[1] for i in range(5)]
    _, panels = max(worst, key=lambda pair: pair[0][4][1].measured)
    return Result([clean(*(image for image, _ in frames.values())), *findings], panels)


def headroom(row: tuple) -> float:
    return row[0]


def worst_between(frames: dict, low: float, high: float, sigma: float) -> tuple[list, list[Panel]]:
    """[(how far inside its bound, Finding)] of the frames between two stops, and panels.

    Were x to blend both ends pixel by pixel, every frame would lie between them in each pixel.
    """
    xs = [x for x in frames if low <= x <= high]
    alpha = np.array([frames[x][0][..., 3].mean() for x in xs])
    luma = np.array([(frames[x][1] @ LUMA).mean() for x in xs])
    first, last = frames[xs[0]], frames[xs[-1]]
    both = [first[0][..., 3], last[0][..., 3]]
    lights = [first[1] @ LUMA, last[1] @ LUMA]
    apart = float(np.abs(first[1] - last[1]).mean())
    steps = np.array([np.abs(frames[a][1] - frames[b][1]).mean() for a, b in pairwise(xs)])
    detour = np.array(
        [np.abs(frames[x][1] - first[1]).mean() + np.abs(frames[x][1] - last[1]).mean() for x in xs]
    )
    span = f"x {low:.3g} to {high:.3g}"
    noise = 2 / 255  # two steps of a display: less cannot be seen as a flash
    rows = [
        at_least(
            f"least coverage, {span}", alpha.min(), 0.98 * np.minimum(*both).mean(),
            "pixels that both ends fill stay filled, 2 % for edges on the move",
        ),
        at_least(
            f"least light, {span}", luma.min(), 0.98 * np.minimum(*lights).mean() - noise / 2,
            "no darker than the darker end in every pixel, 2 % and half a grey step for edges",
        ),
        at_most(
            f"most light, {span}", luma.max(), 1.02 * np.maximum(*lights).mean() + noise / 2,
            "no brighter than the brighter end in every pixel, 2 % and half a grey step",
        ),
        at_most(
            f"largest step, {span}", steps.max(), max(apart * (xs[1] - xs[0]) / sigma, noise),
            f"all the way between the ends within {sigma:g} of x, the width of one Gaussian of "
            "the encoding: faster is a jump that no encoding asked for",
        ),
        at_most(
            f"longest way round, {span}", detour.max(), max(2 * apart, apart + 2 * noise),
            "a blend of the ends is 1 times their difference away from both, content that has "
            "left both places 2 times; more belongs to neither",
        ),
    ]  # fmt: skip
    limits = [float(row.bound.split()[1]) for row in rows]
    inside = [
        (m - b if row.bound.startswith(">") else b - m) / max(b, 1e-9)
        for row, b in zip(rows, limits, strict=True)
        for m in [row.measured]
    ]
    at = int(detour.argmax())
    beside = min(at + 1, len(xs) - 1)
    panels = [
        Panel(f"furthest from both ends: x = {xs[at]:.3f}", frames[xs[at]][1]),
        Panel(f"its neighbour: x = {xs[beside]:.3f}", frames[xs[beside]][1]),
        Panel(f"end: x = {xs[0]:.3f}", first[1]),
        Panel(f"end: x = {xs[-1]:.3f}", last[1]),
    ]
    return list(zip(inside, rows, strict=True)), panels


def stale_orbit(stage: Stage) -> Result:
    """An order made before the eye went 0.25 to 16 degrees around the scene."""
    centre, _ = stage.bounds()
    return stale(stage, lambda view, angle: turned_about(view, centre, angle), STALE_ORBIT)


def stale_yaw(stage: Stage) -> Result:
    """An order made before the head turned by 0.25 to 16 degrees."""
    return stale(stage, turned, STALE_YAW)


def stale(stage: Stage, move, bounds: dict[float, float]) -> Result:
    """dB of a frame in an old order against the frame in its own, at every angle of `bounds`."""
    scene, view = stage.scene(), stage.view()
    findings, images, kept, worst = [], [], 0, None
    for angle, least in bounds.items():
        there = move(view, angle)
        exact = stage.draw(scene, there)
        stage.draw(scene, view)  # every setting but KEPT makes its order anew
        stage.draw(scene, view, **KEPT)
        old = stage.draw(scene, there, **KEPT)
        kept += is_old(stage)
        db = decibels(old, exact)
        findings.append(at_least(f"order {angle:g} degrees old, dB", db, least, STALE_REASON))
        images.append(old)
        if worst is None or db < worst[0]:
            worst = (db, angle, old, exact)
    _, angle, old, exact = worst
    told = at_least("frames drawn in an old order", kept, len(bounds), WAS_OLD)
    panels = [
        stage.panel(f"order {angle:g} degrees old", old),
        stage.panel("its own order", exact),
        Panel("8 times the difference", difference(old, exact)),
    ]
    return Result([clean(*images), told, *findings], panels)


def is_old(stage: Stage) -> bool:
    """Whether the last frame was drawn in an order of an earlier one."""
    return stage.stats.sorts == 0 and stage.stats.order_age >= 1
