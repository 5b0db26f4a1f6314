"""`launch.py vr` whose runtime says that the session will be lost, or loses it in a call.

lose_session.py vr ...    arguments as of launch.py; SHAPESHIFT_TEST_LOSS names how
"""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
AFTER = 25  # frames with hands


def main(arguments: list[str]) -> int:
    sys.path.insert(0, str(ROOT))
    import xr

    import shapeshift  # noqa: F401  makes the folders its subpackages
    from shapeshift.app.cli import main as run
    from shapeshift.vr.openxr import session
    from shapeshift.vr.openxr.events import GoingAway, StateChanged

    how, ended, polled = os.environ["SHAPESHIFT_TEST_LOSS"], [], session.poll_events
    end_frame = xr.end_frame

    def end(*given):
        ended.append(given)
        if how == "SESSION_LOST" and len(ended) == AFTER:
            raise xr.exception.SessionLostError
        return end_frame(*given)

    def poll(*given):
        events = polled(*given)
        if len(ended) == AFTER and how != "SESSION_LOST":
            ended.append(None)
            events.append(StateChanged(how) if how == "LOSS_PENDING" else GoingAway())
        return events

    xr.end_frame, session.poll_events = end, poll
    return run(arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
