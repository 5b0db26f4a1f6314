"""What a plane in a hand costs, with another stop beyond it.

    python3 tools/vr/sections.py SCENE --x full --beyond bone --out docs/bench/held_sections.csv

Processor time of frames of both eyes, 640 x 480 each, drawn in turn without a section, with one
that nobody moves (capped, and with the stop beyond it), and with both while the hand that holds the
plane goes 5 mm a frame; the hand's own work, edits and undo among it, is part of a frame.  Medians;
times_a_frame is the median over the rounds of the ratio to the frame without.  In each round the
head moves by 2 cm, so that all is shaded, projected and sorted anew, as in a headset.
"""

import argparse
import sys
import time
from pathlib import Path
from statistics import median

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import shapeshift  # noqa: F401  makes the folders its packages
from shapeshift.app.headset.headset import Options
from shapeshift.app.headset.panel_picture import PANEL
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.renderer.gl.context import open_context
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import Pose
from shapeshift.scene.sections.section import plane_through
from shapeshift.vr.panel import Carried
from shapeshift.vr.play_space import PlaySpace
from tests.support.vr.vr_hands import HEAD, a_frame, eyes, hand_at
from tests.support.vr.vr_panel import a_state

SIZE, ROUNDS = (640, 480), 16
MOVES_M, STEP_M = 0.02, 0.005  # of the head in a round, of the hand in a frame that carries
CASES = ("no section", "capped at rest", "capped in a hand", "beyond at rest", "beyond in a hand")
COLUMNS = "drawing,scene,case,cpu_ms,times_a_frame"


class Carrying:
    """A scene with a plane across its middle, a hand at it, and a head before it."""

    def __init__(self, options: argparse.Namespace) -> None:
        document, self.editor = open_xr(options.scene, Options(), options.x)
        self.state, self.tools = a_state(self.editor), a_state(self.editor).tools
        self.state.tools = self.tools
        look = document.view(SIZE).world_from_eye
        self.room = PlaySpace(Pose.from_matrix(look.matrix() @ np.linalg.inv(HEAD.matrix())))
        self.right = look.matrix()[:3, 0]
        self.beyond = next(s.x for s in self.editor.stops(0) if s.name == options.beyond)

    def views(self, number: int) -> list:
        at = np.array([MOVES_M * (number % 2), 0.0, 0.0])
        return [self.room.view(view) for view in eyes(SIZE, Pose(HEAD.position + at, HEAD.wxyz))]

    def hand(self, aside_m: float, squeeze: float) -> None:
        """The right hand, so far aside of the middle of the scene."""
        matrix = self.room.world_from_play.matrix()
        world = self.editor.centre + aside_m * self.right
        hand = hand_at(matrix[:3, :3].T @ (world - matrix[:3, 3]), squeeze=squeeze)
        self.tools.act(
            a_frame(right=hand), self.room, Carried(PANEL), self.editor.scene, 1 / 72
        )  # fmt: skip

    def prepare(self, case: str, number: int) -> None:
        """What is not counted: the section that the case wants, and who holds it."""
        tool = self.tools.sections
        self.hand(0.0, 0.0)
        if case == CASES[0]:
            while tool.sections:
                tool.remove(0)
            return
        if not tool.sections:
            tool.add(plane=True)
        tool.on = True
        tool.put_shape(plane_through(self.editor.centre, self.right))
        tool.change(0, "beyond", beyond=self.beyond if case.startswith("beyond") else None)
        self.hand(0.0, 1.0 if case.endswith("hand") else 0.0)

    def frame(self, case: str, number: int) -> None:
        """What a hand does in it."""
        holds = case.endswith("hand")
        self.hand(STEP_M * (1 + number % 4) if holds else 0.0, float(holds))


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("scene", type=Path)
    options.add_argument("--x", required=True)
    options.add_argument("--beyond", required=True)
    options.add_argument("--out", type=Path, required=True)
    chosen = options.parse_args()
    ctx = open_context()
    rows = []
    with Renderer(ctx, "tiles") as renderer:
        rows += rows_of(ctx, renderer, "tiles", chosen)
    name = f"{chosen.scene.name} --x {chosen.x} --beyond {chosen.beyond}"
    head = [f"# python3 tools/vr/sections.py {name} --out {chosen.out}"]
    head.append(f"# {ctx.info['GL_RENDERER']}")
    before = chosen.out.read_text().splitlines() if chosen.out.exists() else []
    before = [line for line in before if line != COLUMNS]
    out = [*(line for line in [*before, *head] if line.startswith("#")), COLUMNS]
    out += [line for line in [*before, *rows] if not line.startswith("#")]
    chosen.out.write_text("\n".join(dict.fromkeys(out)) + "\n")


def rows_of(ctx, renderer: Renderer, drawing: str, chosen: argparse.Namespace) -> list[str]:
    carrying = Carrying(chosen)
    renderer.settings = RenderSettings(background=(0.08, 0.08, 0.08), stereo_colors="shared")
    taken: dict[str, list[float]] = {case: [] for case in CASES}
    for number in range(ROUNDS):
        for case in CASES:
            carrying.prepare(case, number)
            renderer.update(carrying.editor.scene)
            renderer.draw(carrying.views(number + 1))
            ctx.finish()
            start = time.process_time()
            carrying.frame(case, number)
            renderer.update(carrying.editor.scene)
            renderer.draw(carrying.views(number))
            ctx.finish()
            taken[case].append((time.process_time() - start) * 1e3)
    whole = taken[CASES[0]][2:]
    out = []
    for case in CASES:
        times = taken[case][2:]
        ratio = median(one / other for one, other in zip(times, whole, strict=True))
        out.append(f"{drawing},{chosen.scene.stem},{case},{median(times):.1f},{ratio:.2f}")
    return out


if __name__ == "__main__":
    main()
