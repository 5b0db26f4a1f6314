"""How far a picture moves on the way from one stop of a model to another, and the pace that makes
equal steps of the slider equal changes of the picture.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np

from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import AnchorModel, Model
from shapeshift.runtime_models.stop_weights import Control, Pace, StopWeights
from shapeshift.scene.cameras.framing import default_view, frame_points, orbit_path, scene_points
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene, SceneObject

SIZE = (96, 72)  # pixels of the pictures that are compared
VIEWS = 3  # the first look, and others from all around
BEHIND = (0.5, 0.5, 0.5)  # dark and light parts show alike
FIRST, MOST = 9, 33  # blends of a way that are looked at: evenly at first, then where it moves most
STEPS = 32  # of the curve that is kept
LEAST = 1 / 255  # mean change of a picture from end to end; of less nobody sees a pace
FLOOR = 0.05  # of an even change counts where nothing moves: a way stands still nowhere
MOST_STOPS = 6  # of more, only neighbours get a pace: 15 ways, or one a stop
DECIMALS = 4  # of a weight
EVEN_ENOUGH = 2.5  # largest step of x by 1/100 over an even one: more is a jump

Progress = Callable[[str, float], None]  # what is done, and how much of it, 0..1


def measure_pace(model: Model, progress: Progress | None = None) -> tuple[Pace, ...]:
    """The pace of every pair of stops (of many stops: of neighbours), where its way can be seen;
    that which the model has stays.

    About 1.5 seconds of a core a pair: MOST small pictures from VIEWS places.
    """
    if not isinstance(model, AnchorModel) or model.between_stops != "blend":
        return ()
    order = sorted(model.stops, key=lambda stop: stop.x)
    known = {frozenset((pace.start, pace.end)) for pace in model.pace}
    ways = combinations(order, 2) if len(order) <= MOST_STOPS else pairwise(order)
    pairs = [(a, b) for a, b in ways if {a.name, b.name} not in known]
    found = list(model.pace)
    plain = replace(model, pace=())
    with Renderer(None, sort="numpy") as renderer:
        views = views_of(plain)
        for number, (a, b) in enumerate(pairs):
            if progress is not None:
                progress(f"pace from {a.name} to {b.name}", number / len(pairs))

            def picture(share: float, a: str = a.name, b: str = b.name) -> np.ndarray:
                blend = StopWeights(((a, 1 - share), (b, share)))
                return pictures(renderer, plain, blend, views)

            shares, steps = follow_way(picture)
            if steps.sum() > LEAST:
                found.append(Pace(a.name, b.name, tuple(even_curve(shares, steps).tolist())))
    return tuple(found)


def follow_way(picture: Callable[[float], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Shares (MOST,) of a way, rising from 0 to 1, and how much its picture changes between them;
    nearer to each other where it changes more.
    """
    shares = np.linspace(0, 1, FIRST).tolist()
    seen = [picture(share) for share in shares]
    steps = [distance(a, b) for a, b in pairwise(seen)]
    while len(shares) < MOST:
        i = int(np.argmax(steps))
        shares.insert(i + 1, (shares[i] + shares[i + 1]) / 2)
        seen.insert(i + 1, picture(shares[i + 1]))
        steps[i : i + 1] = [distance(a, b) for a, b in pairwise(seen[i : i + 3])]
    return np.array(shares), np.array(steps)


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """Mean change of a value."""
    return float(np.abs(one - other).mean(dtype=np.float64))


def even_curve(shares: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """(STEPS + 1,) of shares (K,) of a way at which the picture has changed evenly, where it
    changes by `steps` (K - 1,) from one to the next.
    """
    even = max(float(steps.sum()), LEAST) * np.diff(shares)  # what even changes would be
    way = np.concatenate([[0], np.cumsum(steps + FLOOR * even)])
    evenly = np.linspace(0, 1, STEPS + 1)
    curve = np.interp(evenly, way / way[-1], shares)
    rounded = np.concatenate([[0], np.round(curve[1:-1], DECIMALS), [1]])
    if (np.diff(rounded) > 0).all():
        return rounded
    # The picture jumps somewhere, as between two palettes: what rounding made one is drawn apart.
    part = 2 * STEPS * 10.0**-DECIMALS
    curve = (1 - part) * curve + part * evenly
    return np.concatenate([[0], np.round(curve[1:-1], DECIMALS), [1]])


def largest_step(model: Model, count: int = 100) -> float:
    """Largest step of x by 1/count between the outermost stops, over an even one of its way between
    two stops; 0 where nothing is seen to change, or there are fewer than two stops.
    """
    xs = sorted({stop.x for stop in model.stops})
    worst = 0.0
    with Renderer(None, sort="numpy") as renderer:
        views = views_of(model)[:1]  # a jump is seen from anywhere
        for low, high in pairwise(xs):
            grid = np.arange(count + 1) / count
            places = np.array([low, *grid[(grid > low) & (grid < high)], high])
            steps = changes(renderer, model, places.tolist(), views)
            even = steps.sum() * np.diff(places) / (high - low)
            if steps.sum() > LEAST:
                worst = max(worst, float((steps / even).max()))
    return worst


def views_of(model: Model) -> list[View]:
    """From where a model is looked at: as it is first shown, then from all around."""
    points, opacity = scene_points(Scene((SceneObject("model", model, x=model.stops[0].x),)))
    centre, radius = frame_points(points, opacity)
    around = orbit_path(VIEWS, centre, radius, SIZE)
    return [default_view(model, SIZE), *around[1:]]


def changes(renderer: Renderer, model: Model, controls: list, views: list[View]) -> np.ndarray:
    """(n - 1,) mean change of the views' pictures from each control to the next."""
    seen = (pictures(renderer, model, control, views) for control in controls)
    return np.array([distance(a, b) for a, b in pairwise(seen)])


def pictures(renderer: Renderer, model: Model, control: Control, views: list[View]) -> np.ndarray:
    """(V, H, W, 3) display sRGB of a model from each view."""
    renderer.settings = RenderSettings(background=BEHIND)
    renderer.update(Scene((SceneObject("model", model, x=control),)))
    seen = []
    for view in views:
        renderer.draw([view])
        seen.append(renderer.resolved().copy())
    return np.stack(seen)
