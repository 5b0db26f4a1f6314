"""What a frame costs beside its drawing, at 400,000 splats with a moving camera.

python -m pytest --slow tests/slow/test_frame_cost.py -s      prints the table
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from shapeshift.rasterizer.device import NoDevice
from shapeshift.renderer.gl.context import NoContext, open_context
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.timing import PassTimer
from shapeshift.scene.pose import View, look_at, perspective
from tests.support.splat_scenes import alone, shell

SPLATS, SIZE, FRAMES = 400_000, (1280, 720), 6
# What stands for "the draw pass": a driver finds the pixels of its quads inside it, tiles before.
DRAW = {"quads": ("splat",), "tiles": ("project", "bin", "splat")}


class CpuTimer(PassTimer):
    """Process CPU time of all threads in place of wall time: other load does not count."""

    @contextmanager
    def time(self, name: str, on_gpu: bool = True) -> Iterator[None]:
        start = time.process_time()
        with super().time(name, on_gpu):
            yield
        self.cpu_ms = getattr(self, "cpu_ms", {})
        self.cpu_ms[name] = self.cpu_ms.get(name, 0.0) + (time.process_time() - start) * 1e3


def cpu_ms(drawing: str, coefficients: int) -> dict[str, float]:
    """Median CPU milliseconds a pass and of the whole "frame"."""
    try:
        ctx = open_context()
        renderer = Renderer(ctx, drawing)
    except (NoContext, NoDevice) as reason:
        pytest.skip(str(reason))
    scene = alone(shell(SPLATS, coefficients))
    rows = []
    with ctx, renderer:
        for turn in np.arange(FRAMES) * 0.02:
            eye = (3.2 * np.sin(turn), 0.8, 3.2 * np.cos(turn))
            view = View(look_at(eye, (0, 0, 0)), perspective(0.87, SIZE), 0.05, 50, SIZE)
            renderer._timer = CpuTimer(ctx)  # another clock in place of the wall's
            start = time.process_time()
            renderer.update(scene)
            renderer.draw([view])
            whole = (time.process_time() - start) * 1e3
            rows.append({**renderer._timer.cpu_ms, "frame": whole})
    ctx.release()
    return {name: float(np.median([row[name] for row in rows[2:]])) for name in rows[-1]}


@pytest.mark.slow
@pytest.mark.parametrize("drawing", DRAW)
def test_a_frame_costs_little_more_than_its_drawing(drawing):
    for coefficients in (1, 16):
        ms = cpu_ms(drawing, coefficients)
        ratio = ms["frame"] / sum(ms[name] for name in DRAW[drawing])
        passes = ", ".join(f"{name} {value:.1f}" for name, value in ms.items())
        print(f"\n{drawing}, {coefficients} coefficients: {passes} CPU ms; frame/draw {ratio:.3f}")
        # Colours towards a moving eye are read from 48 numbers a splat; plain ones cost nothing.
        assert ratio < (1.1 if coefficients == 1 else 1.25)
