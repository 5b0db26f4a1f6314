"""`launch.py vr` on a headset that sees where its eyes look; Monado's remote one does not.

gazing_eyes.py vr ...    arguments as of launch.py
"""

import math
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
ASIDE, DOWN = math.radians(-12.0), math.radians(8.0)  # of straight on, in the room


def main(arguments: list[str]) -> int:
    sys.path.insert(0, str(ROOT))
    import numpy as np

    import shapeshift  # noqa: F401  makes the folders its subpackages
    from shapeshift.app.cli import main as run
    from shapeshift.vr.openxr.tracked import Gaze

    way = np.array([math.sin(ASIDE), -math.tan(DOWN), -math.cos(ASIDE)])

    def direction(self, play_space, time_ns):
        return way / np.linalg.norm(way) if self.wanted else None

    Gaze.direction = direction
    return run(arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
