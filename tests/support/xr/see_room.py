"""`launch.py vr` on a runtime that shows the room behind pictures; Monado's remote one does not.

see_room.py vr ...    arguments as of launch.py; beside the lines, blends.json has the blend mode
of each frame that was handed over.
"""

import json
import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]


def main(arguments: list[str]) -> int:
    sys.path.insert(0, str(ROOT))
    import xr

    import shapeshift  # noqa: F401  makes the folders its subpackages
    from shapeshift.app.cli import main as run

    modes = xr.EnvironmentBlendMode
    asked: list[int] = []
    end_frame, listed = xr.end_frame, xr.enumerate_environment_blend_modes

    def end(session, info):
        asked.append(int(info.environment_blend_mode))
        info.environment_blend_mode = modes.OPAQUE
        return end_frame(session, info)

    xr.enumerate_environment_blend_modes = lambda *given: [*listed(*given), modes.ALPHA_BLEND]
    xr.end_frame = end
    try:
        return run(arguments)
    finally:
        Path(os.environ["SHAPESHIFT_TEST_BLENDS"]).write_text(json.dumps(asked))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
