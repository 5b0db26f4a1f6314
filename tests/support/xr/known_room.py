"""`launch.py vr` in a room whose edges are known; Monado's remote headset knows none.

known_room.py vr ...    arguments as of launch.py
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
SIZE_M = (2.4, 2.0)  # about the origin of the room


def main(arguments: list[str]) -> int:
    sys.path.insert(0, str(ROOT))
    import shapeshift  # noqa: F401  makes the folders its subpackages
    from shapeshift.app.cli import main as run
    from shapeshift.scene.scene import IDENTITY
    from shapeshift.vr.frame import Area
    from shapeshift.vr.openxr.room import Bounds

    Bounds.area = lambda self, play, time_ns: Area(IDENTITY, SIZE_M)
    return run(arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
