"""What a frame of the window costs beside its splats, on software GL: CPU milliseconds.

    python3 tools/app/presenting.py > docs/bench/presenting.csv

Where there is no screen, after `xvfb-run -a -s "-screen 0 1920x1080x24"`.

The bundled demo with its panel; "kept" is the window's way on software GL, "each time" is the way
of a GPU, the overlay drawn over the picture in every frame; eight frames each in turns, all in one
run, medians.
nothing: a frame that somebody asked for and in which nothing changes; button: the mouse goes to
another button; picture: other pixels under the same overlay, as when somebody orbits, their splats
not counted; both; slider: x moves, and with it the picture, the knob and the legend.
presenting: the picture's bytes and their way to the window, the overlay's drawing, and the swap;
widgets: the panel's own code; frame: the whole function that the loop calls.  apart: the largest
difference of a pixel between the two ways, of 255.
"""

import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import replace
from itertools import cycle, repeat
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

import moderngl  # noqa: E402
import numpy as np  # noqa: E402

from shapeshift.app.editor.options import Options  # noqa: E402
from shapeshift.app.editor.panels.widgets.overlay_renderer import OverlayRenderer  # noqa: E402
from shapeshift.app.editor.state.editor_state import EditorState  # noqa: E402
from shapeshift.app.editor.window.overlay.presented import Presented  # noqa: E402
from shapeshift.app.editor.window.viewer import Viewer  # noqa: E402
from shapeshift.app.editor.window.window import Window  # noqa: E402
from shapeshift.app.paths import DEMO  # noqa: E402
from shapeshift.app.streaming.refine import Refiner  # noqa: E402
from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.renderer.settings import FrameStats  # noqa: E402

TURNS, FRAMES = 8, 8  # of each way
BUTTONS = ((60.0, 130.0), (170.0, 130.0))  # where two of the panel are
SIZES = ((1280, 720), (1920, 1080))


class Watch:
    """CPU milliseconds of named parts, all of GL's and OpenCL's work in them."""

    def __init__(self, window: Window) -> None:
        self._window = window
        self.ms: dict[str, list[float]] = defaultdict(list)

    def over(self, owner: object, name: str, part: str) -> None:
        """Counts every call of a method to a part."""
        method = getattr(owner, name)

        def timed(*arguments, **named):
            start = time.process_time()
            result = method(*arguments, **named)
            self._window.ctx.finish()
            self.ms[part].append(1e3 * (time.process_time() - start))
            return result

        setattr(owner, name, timed)


def way_of_a_gpu(kept: Presented) -> Presented:
    """The same window, its overlay drawn in every frame."""
    plain, other = object.__new__(OverlayRenderer), copy(kept)
    plain.__dict__.update(kept.renderer.__dict__)  # its program, buffers, and textures
    other.kept, other.renderer = None, plain
    return other


def changes(viewer: Viewer) -> dict[str, Callable[[int], None]]:
    """What happens before a frame, by name."""
    window, state = viewer.window, viewer.state
    path = cycle(np.linspace(0.3, 0.7, 41).tolist())

    def button(number: int) -> None:
        window.on_cursor(window.handle, *BUTTONS[number % 2])

    def picture(number: int) -> None:
        viewer.shown.forget()

    def both(number: int) -> None:
        button(number)
        picture(number)

    def slider(number: int) -> None:
        state.set_x(0, next(path))
        picture(number)

    return {
        "nothing": lambda number: None, "button": button, "picture": picture, "both": both,
        "slider": slider,
    }  # fmt: skip


def steps() -> Iterator[float]:
    return cycle(np.linspace(0.1, 0.3, 5).tolist())


class Alone:
    """Presents the splats that there are as another picture: a frame without drawing them."""

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        self.grays: Iterator[float] = steps()

    def draw(self, views: object, target: moderngl.Framebuffer) -> FrameStats:
        renderer = self._viewer.renderer
        renderer.settings = replace(renderer.settings, background=(next(self.grays),) * 3)
        renderer.present(target)
        return self._viewer.readings.stats


def measure(viewer: Viewer) -> list[str]:
    window = viewer.window
    if window.presented.kept is None:
        raise SystemExit("GL runs on a GPU here, which keeps no picture.")
    ways = {"each time": way_of_a_gpu(window.presented), "kept": window.presented}
    watch, rows = Watch(window), []
    watch.over(viewer, "frame", "frame")
    watch.over(viewer, "draw_overlay", "widgets")
    watch.over(viewer.shown, "draw", "presenting")
    setattr(viewer.renderer, "update", lambda scene: None)  # noqa: B010  methods
    alone = Alone(viewer)
    setattr(viewer.renderer, "draw", alone.draw)  # noqa: B010
    for each in ways.values():
        for name in ("keep_picture", "lay_over", "swap"):
            watch.over(each, name, "presenting")
    for name, change in changes(viewer).items():
        taken: dict[tuple[str, str], list[float]] = defaultdict(list)
        for _ in range(TURNS):
            for way, presented in ways.items():
                window.presented, viewer.renderer.taker = presented, presented.take_picture
                for number in range(FRAMES):
                    change(number)
                    window.wait(0.0)
                    watch.ms.clear()
                    viewer.frame(0.0)
                    if number:  # the first one finds what the other way has left in the caches
                        for part, ms in watch.ms.items():
                            taken[way, part].append(sum(ms))
        seen = []
        for presented in ways.values():
            window.presented, viewer.renderer.taker = presented, presented.take_picture
            alone.grays = repeat(0.2)
            viewer.shown.forget()
            viewer.frame(0.0)
            seen.append(window.picture().astype(int))
        alone.grays = steps()
        apart = int(np.abs(seen[0] - seen[1]).max())
        for way in ways:
            ms = [median(taken[way, part]) for part in ("presenting", "widgets", "frame")]
            numbers = ",".join(f"{each:.2f}" for each in ms)
            rows.append(f"{name},{way},{numbers},{apart}")
    return rows


def main() -> None:
    say = sys.stdout.write
    command = __doc__.splitlines()[2].strip()
    say(f"# {command}\nsize,change,way,presenting_ms,widgets_ms,frame_ms,apart\n")
    reader = Refiner(Options()).open
    for size in SIZES:
        state = EditorState(reader)
        state.open([DEMO])
        with Window("presenting", size, 1.0) as window, Renderer(window.ctx) as renderer:
            viewer = Viewer(window, renderer, state, Options())
            for _ in range(8):
                window.wait(0.0)
                viewer.frame(0.02)
            for row in measure(viewer):
                say(f"{size[0]}x{size[1]},{row}\n")


if __name__ == "__main__":
    main()
