"""What a run in the headset leaves behind for tests and benchmarks: a report, lines, pictures."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import moderngl
import numpy as np

from shapeshift.app.drawing import save_png
from shapeshift.app.headset.xr_user import XrState
from shapeshift.app.paths import full
from shapeshift.app.terminal import say
from shapeshift.runtime_models.files.json_fields import control_row
from shapeshift.runtime_models.files.whole_file import open_lines, write_whole
from shapeshift.scene.pose import Pose
from shapeshift.scene.world.record import Record
from shapeshift.vr.frame import SIDES, Area, Frame, Hand, view_names
from shapeshift.vr.glove import fingertip
from shapeshift.vr.openxr.events import Life
from shapeshift.vr.openxr.graphics import read_color
from shapeshift.vr.pace import FramePace

DECIMALS = 6


@dataclass(frozen=True)
class DoneFrame:
    """A frame that has been handed over, and what there is to tell of it."""

    frame: Frame
    state: XrState
    panel: Callable[[], dict]  # what a line says of it
    pulses: Sequence[tuple[str, float, float]]  # side, strength, seconds
    records: Sequence[Record]
    life: Life
    pace: FramePace
    layers: Sequence[str] = ()  # that were handed to the compositor


class Report:
    """Writes a line a frame as it happens, pictures of every n-th, and the report at the end."""

    def __init__(
        self,
        path: Path | None = None,
        lines: Path | None = None,
        pictures: Path | None = None,
        every: int = 1,
    ) -> None:
        self.ended = "by the runtime"
        self._path, self._pictures, self._every = path, pictures, every
        self._lines: IO[str] | None = None
        self._lines_path = lines
        if lines is not None:
            self._lines = open_lines(lines)

    def note(self, done: DoneFrame, eyes: Sequence[moderngl.Framebuffer]) -> None:
        """A frame that has been handed over, and the pictures of its views."""
        frame, number = done.frame, done.pace.frames
        if self._lines is not None:
            row = frame_row(done)
            self._lines.write(json.dumps(row, allow_nan=False, separators=(",", ":")) + "\n")
            self._lines.flush()
        if self._pictures is not None and frame.drawn and number % self._every == 0:
            for name, framebuffer in zip(view_names(len(eyes)), eyes, strict=True):
                save_png(read_color(framebuffer), self._pictures / f"{name}-{number:05d}.png")

    def write(self, facts: dict) -> None:
        """The report itself; and a word on what has been written."""
        if self._path is not None:
            text = json.dumps({**facts, "ended": self.ended}, indent=1) + "\n"
            write_whole(self._path, text.encode())
        written = [self._path, self._lines and self._lines_path, self._pictures]
        if names := [full(path) for path in written if path]:
            say(f"written to {', '.join(names)}")

    def close(self) -> None:
        if self._lines is not None:
            self._lines.close()

    def __enter__(self) -> "Report":
        return self

    def __exit__(self, *failure) -> None:
        self.close()


def frame_row(done: DoneFrame) -> dict:
    """What a line tells."""
    frame, world, play_space = done.frame, done.state.world, done.state.play_space
    times = done.pace.own_ms
    return {
        "frame": done.pace.frames,
        "seen_s": rounded(frame.seen_s),
        "time_s": rounded(world.time_s),  # of the physics
        "state": done.life.state,
        "scene": done.state.editor.edited.name,
        "drawn": frame.drawn,
        "focused": frame.focused,
        "recentred": frame.recentred,
        "head": pose_row(frame.head),
        "views": [
            {**pose_row(view.world_from_eye), "tangents": numbers(view.tangents)}
            for view in frame.views
        ],
        "hands": {side: hand_row(side, hand) for side, hand in frame.hands.items()},
        "standing": {**pose_row(play_space.world_from_play), "scale": rounded(play_space.scale)},
        "lift_m": rounded(done.state.fit.lift_m),
        "held": {side: world.held(side) for side in SIDES},
        "offers": [
            {"hand": offer.side, "object": offer.object, "by": offer.by}
            for offer in done.state.user.touched.offers
        ],
        "objects": {
            obj.name: {**pose_row(obj.world_from_object), "x": control_row(obj.x, DECIMALS)}
            for obj in world.drawn().objects
        },
        "dark": rounded(done.state.user.comfort.blink),
        "area": area_row(frame.area) if frame.area is not None else None,
        "panel": done.panel(),
        "glass": done.state.glass.row(),
        "tools": done.state.tools.row(),
        "shadows": done.state.shadows,
        "layers": done.layers,
        "events": [event for record in done.records for event in record.events],
        "pulses": [[side, rounded(strength), rounded(s)] for side, strength, s in done.pulses],
        "own_ms": rounded(times[-1]) if times else None,
        "dropped": done.pace.dropped,
    }


def hand_row(side: str, hand: Hand) -> dict:
    return {
        "active": hand.active,
        "grip": pose_row(hand.grip) if hand.grip is not None else None,
        "aim": pose_row(hand.aim) if hand.aim is not None else None,
        "squeeze": rounded(hand.squeeze),
        "trigger": rounded(hand.trigger),
        "stick": numbers(hand.stick),
        "finger": numbers(fingertip(side, hand)) if hand.grip is not None else None,
        "bare": hand.joints is not None,
    }


def area_row(area: Area) -> dict:
    return {**pose_row(area.play_from_area), "size_m": numbers(area.size_m)}


def pose_row(pose: Pose) -> dict:
    return {"position": numbers(pose.position), "wxyz": numbers(pose.wxyz)}


def numbers(many: np.ndarray | tuple) -> list[float]:
    return [rounded(number) for number in many]


def rounded(number: float) -> float:
    return round(float(number), DECIMALS) + 0.0
