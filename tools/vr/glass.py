"""What a glass in the hand costs: python3 tools/vr/glass.py --out docs/bench/glass.csv

Processor time of frames of both eyes of the demo, 640 x 480 each, drawn in turn without and with a
glass half a metre away, and with both eyes drawn a second time at the other stop instead; medians.
Between two rounds the head moves by 2 cm, so that all is shaded, projected and sorted anew.
"""

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import shapeshift  # noqa: F401  makes the folders its packages
from shapeshift.app.headset.headset import Options
from shapeshift.app.headset.over.hand_glass import HandGlass
from shapeshift.app.headset.panel_picture import PANEL
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.renderer.gl.context import open_context
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene
from shapeshift.vr.panel import Carried
from tests.support.vr.vr_glass import BEFORE, upright
from tests.support.vr.vr_hands import HEAD, a_frame, eyes
from tests.support.vr.vr_panel import a_state

SCENE = Path(__file__).resolve().parents[2] / "assets" / "workshop.shift"
SIZE, ROUNDS = (640, 480), 24
MOVES_M = 0.02
COLUMNS = "drawing,what differs,pixels,without_ms,with_ms,ratio,twice_ms"


class Brighter(HandGlass):
    """One whose other stop differs in its colours alone: the same, brighter."""

    def _scenes(self, state):
        bright = (replace(o, appearance=Appearance(exposure=0.5)) for o in state.shown.objects)
        scene = Scene(tuple(bright))
        return scene, scene


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", type=Path, required=True)
    out = options.parse_args().out
    ctx, rows = open_context(), []
    for drawing in ("tiles", "quads"):
        for what, kind in (("colours", Brighter), ("shape", HandGlass)):
            with Renderer(ctx, drawing) as renderer:
                rows.append(row(ctx, renderer, drawing, what, kind(ctx, renderer)))
    head = [f"# python3 tools/vr/glass.py --out {out}", f"# {ctx.info['GL_RENDERER']}"]
    out.write_text("\n".join([*head, COLUMNS, *rows]) + "\n")


def row(ctx, renderer: Renderer, drawing: str, what: str, glass: HandGlass) -> str:
    document, editor = open_xr(SCENE, Options())
    state = a_state(editor)
    state.glass.stop, state.shown = "Thermal", editor.scene
    look = document.view(SIZE).world_from_eye
    renderer.settings = RenderSettings(background=(0.08, 0.08, 0.08))
    target = ctx.framebuffer([ctx.texture(SIZE, 4)])
    taken: dict[str, list[float]] = {"without": [], "with": [], "twice": []}
    other, share = Scene(tuple(replace(o, x=0.5) for o in editor.scene.objects)), 0.0
    with Renderer(ctx, drawing) as second:
        second.settings = renderer.settings
        for number in range(3 * ROUNDS):
            case = ("without", "with", "twice")[number % 3]
            at = np.array([MOVES_M * (number // 3 % 2), 0.0, 0.0])
            play = list(eyes(SIZE, Pose(HEAD.position + at, HEAD.wxyz)))
            views = [world(view, look) for view in play]
            glass.hold(a_frame(upright(np.add(BEFORE, at))), state, Carried(PANEL))
            if case != "with":
                state.glass.held = None
            ctx.finish()
            start = time.process_time()
            looking = glass.look(state, views, play)
            renderer.update(editor.scene)
            renderer.draw(views)
            looking = glass.draw(looking, state)
            if case == "twice":
                second.update(other)
                second.draw(views)
            for i, view in enumerate(play):
                renderer.present(target, i)
                if looking is not None:
                    glass.lay(looking, i, target, view, None, shown)
                    share = np.prod(looking.boxes[0][2:]) / np.prod(SIZE)
                if case == "twice":
                    second.present(target, i)
            ctx.finish()
            taken[case].append((time.process_time() - start) * 1e3)
    glass.close()
    without, with_it, twice = (median(times[2:]) for times in taken.values())
    ratio = with_it / without
    return f"{drawing},{what},{share:.3f},{without:.1f},{with_it:.1f},{ratio:.2f},{twice:.1f}"


def world(view, look: Pose):
    """An eye of the room in the world, as if the room stood where the scene is looked at first."""
    matrix = look.matrix() @ np.linalg.inv(HEAD.matrix()) @ view.world_from_eye.matrix()
    return replace(view, world_from_eye=Pose.from_matrix(matrix))


def shown(renderer, i, framebuffer, play_view, floor, see_through) -> None:
    renderer.present(framebuffer, i)


if __name__ == "__main__":
    main()
