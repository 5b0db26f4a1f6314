"""Makes the pictures of docs/viewer.md: marks and lengths on the demo, laid by a mouse and keys.

python3 tools/pictures/viewer_pictures.py [docs]

Needs an X display with XTEST, such as Xvfb's: `xvfb-run -s "-screen 0 1280x720x24" python3 ...`.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.drawing import save_png  # noqa: E402
from shapeshift.app.editor.window.viewer import Viewer  # noqa: E402
from shapeshift.app.editor.window.window import Window  # noqa: E402
from shapeshift.app.paths import DEMO  # noqa: E402
from shapeshift.renderer.renderer import Renderer  # noqa: E402
from tests.support.desktop.desktop_stand import run_frames  # noqa: E402
from tests.support.desktop.real_hands import RealHands  # noqa: E402
from tests.support.desktop.scene_stand import hands_on, read, viewer_on  # noqa: E402

SIZE = (1280, 720)
PATIENCE_S = 8.0  # for what is measured at rest
ABOVE_C = 75.0


def settle(viewer: Viewer) -> None:
    """Until the view is measured and the picture at rest is drawn."""
    end = time.monotonic() + PATIENCE_S
    run_frames(viewer, 4)
    while time.monotonic() < end and not (
        viewer.inspecting.is_current and not viewer.readings.error_is_old
    ):
        time.sleep(0.05)
        run_frames(viewer, 1)
    run_frames(viewer, 4)


def lay_marks(viewer: Viewer, hands: RealHands) -> None:
    """Three spots, a box and a line, in logical pixels of the window."""
    hands.key("y")
    for place in ((734, 262), (700, 385), (911, 300)):
        hands.click(*place)
    hands.drag((624, 260), (710, 338))
    hands.hold_key("Shift_L", True)
    hands.drag((624, 423), (968, 423))
    hands.hold_key("Shift_L", False)
    settle(viewer)
    viewer.inspecting.bound("above", ABOVE_C)
    hands.move(1050, 440)


def lay_lengths(viewer: Viewer, hands: RealHands) -> None:
    """A distance, an area, an angle, and a distance that is chosen."""
    hands.key("y", "Shift_L")
    ruler = viewer.ruler
    for kind, places in (
        ("distance", ((483, 238), (608, 236))),
        ("area", ((381, 465), (489, 405), (731, 405), (671, 470), (381, 465))),
        ("angle", ((815, 330), (815, 393), (878, 386))),
        ("distance", ((829, 185), (915, 434))),
    ):
        ruler.choose_kind(kind)
        run_frames(viewer, 1)
        for place in places:
            hands.click(*place)
    hands.move(1200, 60)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", default=ROOT / "docs")
    folder = parser.parse_args().folder
    with (
        Window("Shapeshift", SIZE, 1.0) as window,
        Renderer(window.ctx) as renderer,
        tempfile.TemporaryDirectory() as pictures,
    ):
        for name, stop, sections, act in (
            ("inspect.png", "Thermal", ("Look",), lay_marks),
            ("measure.png", "RGB", (), lay_lengths),
        ):
            viewer = viewer_on(window, renderer, read(DEMO), Path(pictures), stop)
            viewer.shell.actions.sections.update(dict.fromkeys(sections, False))
            settle(viewer)
            with hands_on(viewer, os.environ["DISPLAY"]) as hands:
                act(viewer, hands)
                viewer.shell.actions.sections.update(dict.fromkeys(sections, False))
                settle(viewer)
                save_png(window.picture() / 255.0, folder / name)
            viewer.parts.finder.close()


if __name__ == "__main__":
    main()
