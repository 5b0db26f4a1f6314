"""A script of hands and rays as JSON lines (docs/scene.md): drives a scene without a person."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import MOST_BYTES, Fields, parse_json
from shapeshift.runtime_models.files.memory import read_text_file
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.document.scene_file import FAR_M, SceneItem
from shapeshift.scene.pose import UNIT_SLACK, Pose
from shapeshift.scene.selectors.selector import UPRIGHT

DEEDS = ("hand", "grab", "release", "lose", "ray", "control")
HAND = "right"  # where a line names none
REACH_M = 0.05  # from a hand to what it grabs
LONGEST_S = 24 * 3600.0
MOST_LINES = 100_000


@dataclass(frozen=True, kw_only=True)
class Act:
    """One line: what is done when."""

    line: int  # of the file, counted from 1
    t: float  # seconds
    do: str  # one of DEEDS
    hand: str = HAND
    pose: Pose | None = None  # of a hand
    reach_m: float = REACH_M  # of a grab
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of a ray, metres
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    item: str = ""  # of a control
    balance: float | None = None  # of a control: these two, or x
    power: float | None = None
    x: Control | None = None


def read_script(path: Path, items: Sequence[SceneItem] = ()) -> tuple[Act, ...]:
    """The acts in their order; `items` are the objects that there are.

    Empty lines and such that begin with # are passed over.  Raises BadFile that names the line.
    """
    if not path.is_file():  # reading a pipe would wait for ever
        raise BadFile(f"{path} is no file; a script of JSON lines is wanted.")
    if (size := path.stat().st_size) > MOST_BYTES:
        raise BadFile(f"{path} has {size:,} bytes; at most {MOST_BYTES:,} are read.")
    lines = read_text_file(path).split(b"\n")
    if len(lines) > MOST_LINES:
        raise BadFile(f"{path.name} has {len(lines):,} lines; at most {MOST_LINES:,} are read.")
    acts: list[Act] = []
    hands: set[str] = set()  # that have a place by now
    for number, line in enumerate(lines, 1):
        if line.strip() and not line.lstrip().startswith(b"#"):
            where = f"{path.name}, line {number}"
            row = Fields(parse_json(line, where, unique=True), where)
            acts.append(read_act(row, number, acts[-1].t if acts else 0.0, items))
            check_hand(acts[-1], hands, row.where)
    return tuple(acts)


def read_act(row: Fields, number: int, before_s: float, items: Sequence[SceneItem]) -> Act:
    t = row.number("t", wanted="seconds, 0 to a day,", low=0, high=LONGEST_S)
    if t < before_s:
        raise BadFile(f"{row.where}: 't' is {t:g} after {before_s:g}; lines go on in time.")
    do = row.line("do", known=DEEDS)
    values = READ[do](row, items)
    row.refuse_unknown_keys()
    return Act(line=number, t=t, do=do, **values)


def check_hand(act: Act, hands: set[str], where: str) -> None:
    """A hand must be somewhere before it does anything."""
    if act.do == "hand":
        hands.add(act.hand)
    elif act.do in ("grab", "release", "lose") and act.hand not in hands:
        raise BadFile(
            f"{where}: hand '{act.hand}' is nowhere yet; a line with 'do': 'hand' must come first."
        )


def read_hand(row: Fields, items: Sequence[SceneItem]) -> dict:
    position = row.numbers("position", 3, most=FAR_M)
    wxyz = row.numbers("wxyz", 4, UPRIGHT)
    length = math.hypot(*wxyz)
    if not abs(length - 1) <= UNIT_SLACK:
        raise row.error("wxyz", "a quaternion of length 1")
    return read_which(row, items) | {"pose": Pose(np.array(position), np.array(wxyz) / length)}


def read_which(row: Fields, items: Sequence[SceneItem]) -> dict:
    return {"hand": row.line("hand", HAND)}


def read_grab(row: Fields, items: Sequence[SceneItem]) -> dict:
    return read_which(row, items) | {"reach_m": row.number("reach_m", REACH_M, "metres", 0, 100)}


def read_ray(row: Fields, items: Sequence[SceneItem]) -> dict:
    origin, direction = row.numbers("origin", 3, most=FAR_M), row.numbers("direction", 3)
    if not 1e-6 < math.hypot(*direction) < 1e6:
        raise row.error("direction", "a direction, not zero,")
    return {"origin": origin, "direction": direction}


def read_control(row: Fields, items: Sequence[SceneItem]) -> dict:
    if not items:
        raise BadFile(f"{row.where}: the scene has no object to control.")
    values = {
        "item": row.line("object", known=tuple(item.name for item in items)),
        "balance": row.number("balance", None, "-1 to 1", -1, 1),
        "power": row.number("power", None, "0 to 1", 0, 1),
        "x": row.control("x", None),
    }
    given = tuple(values[name] is not None for name in ("x", "balance", "power"))
    if given not in ((True, False, False), (False, True, True)):
        raise BadFile(f"{row.where}: a control wants either 'x' or 'balance' and 'power'.")
    item = next(item for item in items if item.name == values["item"])
    if values["x"] is None and item.two_axes is None:
        raise BadFile(f"{row.where}: object '{item.name}' has no 'two_axes'; give it 'x'.")
    return values


READ = {
    "hand": read_hand,
    "grab": read_grab,
    "release": read_which,
    "lose": read_which,
    "ray": read_ray,
    "control": read_control,
}


class HandPath:
    """Where a hand is when: straight and evenly from each line of the script to the next."""

    def __init__(self, acts: Sequence[Act], hand: str) -> None:
        lines = [act for act in acts if act.do == "hand" and act.hand == hand]
        self.poses = [act.pose for act in lines if act.pose is not None]
        self.times = [act.t for act in lines]

    def at(self, time_s: float) -> Pose:
        """Before the first line where that says, after the last one where that says."""
        row = bisect_right(self.times, time_s)
        if row in (0, len(self.poses)):
            return self.poses[max(row - 1, 0)]
        before_s, after_s = self.times[row - 1], self.times[row]
        part = (time_s - before_s) / (after_s - before_s)
        return between(self.poses[row - 1], self.poses[row], part)


def between(first: Pose, last: Pose, part: float) -> Pose:
    """The pose at a part 0..1 of the way; turns on the great arc, the shorter way round."""
    position = first.position + (last.position - first.position) * part
    cos = float(first.wxyz @ last.wxyz)
    goal = last.wxyz if cos >= 0 else -last.wxyz
    angle = math.acos(min(abs(cos), 1.0))
    if angle < 1e-6:
        wxyz = first.wxyz + (goal - first.wxyz) * part
    else:
        wxyz = math.sin((1 - part) * angle) * first.wxyz + math.sin(part * angle) * goal
    return Pose(position, wxyz / np.linalg.norm(wxyz))
