"""Tells where the head is in play space of a kind, as if the runtime had no better one.

tell_room.py KIND       one line of JSON: the kind in use, and the head's place, frame by frame
"""

import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
FRAMES = 10


def main(kind: str) -> None:
    sys.path.insert(0, str(ROOT))
    from shapeshift.renderer.gl.context import open_context
    from shapeshift.vr.openxr import room
    from shapeshift.vr.openxr.instance import Instance
    from shapeshift.vr.openxr.session import Session

    room.KINDS = room.KINDS[room.KINDS.index(kind) :]
    with (
        open_context("egl") as ctx,
        Instance() as instance,
        Session(instance, ctx, part=0.1) as session,
    ):
        heads = []
        for frame in session.frames():
            if frame.focused:
                heads.append([float(number) for number in frame.head.position])
            if len(heads) == FRAMES:
                session.leave()
        print(json.dumps({"kind": session.play.kind, "heads": heads}))


if __name__ == "__main__":
    main(sys.argv[1])
