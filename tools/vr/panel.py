"""What a frame of the headset's panel costs: python3 tools/vr/panel.py --out docs/bench/panel.csv

Processor time, medians of frames in which the panel is drawn anew: the widgets (ImGui, Python and
the state under them), then the whole with its picture on this GL, software GL's threads included;
and a frame in which nothing has changed and no hand is on it, which draws nothing.
"""

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any, cast

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import shapeshift  # noqa: F401  makes the folders its packages
from shapeshift.app.headset.headset import Options
from shapeshift.app.headset.panel_picture import PanelPicture
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.app.paths import TOUCH
from shapeshift.renderer.gl.context import open_context
from tests.support.vr.vr_hands import a_frame, hand_at
from tests.support.vr.vr_panel import FROM, LEFT, Wearer, a_state

FRAMES = 200
COLUMNS = "case,widgets_ms,whole_ms"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", type=Path, required=True)
    out = options.parse_args().out
    ctx = open_context()
    wearer = Wearer(PanelPicture(ctx), a_state(open_xr(TOUCH, Options())[1]))
    hand = hand_at(FROM, wearer.room((400.0, 600.0)))
    away = replace(hand, aim=None, grip=None, active=False)
    rows = [row(ctx, wearer, "a ray on it", hand), row(ctx, wearer, "at rest", away)]
    head = [f"# python3 tools/vr/panel.py --out {out}", f"# {ctx.info['GL_RENDERER']}"]
    out.write_text("\n".join([*head, COLUMNS, *rows]) + "\n")


def row(ctx, wearer: Wearer, case: str, hand) -> str:
    picture, inner = wearer.menu.picture, []
    whole, begun = [], picture.draw

    def timed(fill, *given) -> None:
        def measured() -> None:
            start = time.process_time()
            fill()
            inner.append(time.process_time() - start)

        begun(measured, *given)

    cast(Any, picture).draw = timed
    for _ in range(FRAMES):
        ctx.finish()
        start = time.process_time()
        wearer.menu.act(a_frame(LEFT, hand), 1 / 90)
        ctx.finish()
        whole.append(time.process_time() - start)
    picture.draw = begun
    widgets = median(inner[-FRAMES // 2 :]) * 1e3 if len(inner) > FRAMES // 2 else 0.0
    return f"{case},{widgets:.2f},{median(whole) * 1e3:.2f}"


if __name__ == "__main__":
    main()
