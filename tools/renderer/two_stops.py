"""Two stops beside a line against one frame: CPU milliseconds of the process, all in one run.

    python3 tools/renderer/two_stops.py > docs/bench/two_stops.csv

The demo at RGB and Thermal, 1280x720, OpenCL tiles, an orbit; "colours alone" is the demo whose
geometry does not see the control.  two frames: each stop in all of the window; two parts: each in
its half; one sort: both halves from one projection and one sort.  Medians.
"""

import sys
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.renderer.colors.decode_colors import same_shape  # noqa: E402
from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.cameras.framing import (  # noqa: E402
    frame_points,
    orbit_path,
    scene_points,
)
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402
from tests.support.models import without_control  # noqa: E402

SIZE, RUNS = (1280, 720), 21
HALF = SIZE[0] // 2


def medians_ms(jobs: dict[str, Callable[[int], None]]) -> dict[str, float]:
    """CPU milliseconds of each job, in turns: load meets all alike."""
    taken: dict[str, list[float]] = {name: [] for name in jobs}
    for turn in range(RUNS + 2):  # the first ones compile
        for name, job in jobs.items():
            start = time.process_time()
            job(turn)
            taken[name].append(1e3 * (time.process_time() - start))
    return {name: median(times[2:]) for name, times in taken.items()}


def costs_of(model) -> dict[str, float]:
    left, right = (Scene((SceneObject("demo", model, x=x),)) for x in (0.0, 0.5))
    views = orbit_path(90, *frame_points(*scene_points(left)), SIZE)
    halves = [(v.part(0, 0, (HALF, SIZE[1])), v.part(HALF, 0, (HALF, SIZE[1]))) for v in views]
    renderers = [Renderer(None) for _ in range(6)]
    number = count()

    def frames(scenes: tuple[Scene, ...], parts: bool) -> Callable[[int], None]:
        own = [renderers[next(number)] for _ in scenes]

        def draw(turn: int) -> None:
            for i, (renderer, scene) in enumerate(zip(own, scenes, strict=True)):
                renderer.update(scene)
                renderer.draw([halves[turn][i] if parts else views[turn]])

        return draw

    def together(turn: int) -> None:
        renderers[5].update(left)
        renderers[5].draw_two(halves[turn], right)

    jobs = {
        "one frame": frames((left,), False), "two frames": frames((left, right), False),
        "two parts": frames((left, right), True),
    }  # fmt: skip
    if same_shape(left, right):
        jobs["one sort"] = together
    try:
        return medians_ms(jobs)
    finally:
        for renderer in renderers:
            renderer.close()


def main() -> None:
    demo = read_model(ROOT / "assets" / "workshop.shift")
    assert isinstance(demo, AnchorModel)
    say = sys.stdout.write
    say("# python3 tools/renderer/two_stops.py > docs/bench/two_stops.csv\n")
    say("scene,way,cpu_ms,times_a_frame\n")
    names = ("offset", "scale", "rotation", "opacity")
    for scene, model in (("shape differs", demo), ("colours alone", without_control(demo, *names))):
        costs = costs_of(model)
        for way, ms in costs.items():
            say(f"{scene},{way},{ms:.1f},{ms / costs['one frame']:.2f}\n")


if __name__ == "__main__":
    main()
