"""What touched what, how hard and where: the engine's events of a step, summed for each pair.

The engine merges the touching faces of a body's hulls into clusters, which halves its cost, and
then counts impulses of clusters up to four times.  So impulses are taken from the momentum that
bodies gained: a body that touched one object alone got all of it there, which leaves what its
neighbour got elsewhere, and so on.  Only in a ring of bodies, or of held ones, the engine's count
stays.
"""

import hashlib
import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from shapeshift.scene.pose import Pose

Triple = tuple[float, float, float]
HARDER = 1.1  # as hard as this a substep takes over the place of a contact


@dataclass(frozen=True)
class Contact:
    """Two objects that touched during a step; every pair comes once."""

    a: int  # id, less than b
    b: int
    impulse_n_s: float  # N s: pressure and friction together, summed over the substeps
    point: np.ndarray  # (3,) metres, world: the deepest point of the hardest substep


@dataclass(eq=False)
class Touch:
    """One pair in one substep, as the engine tells it."""

    ids: tuple[int, int]
    impulse: float  # N s
    event: Any


class ContactTally:
    """The contacts of one step, gathered substep by substep."""

    def __init__(self, world: Any, ids: dict[Any, int], gravity_m_s2: float) -> None:
        self._world, self._ids, self._gravity = world, ids, gravity_m_s2
        # pair: (sum of its impulses, the largest, where that one was)
        self._hardest: dict[tuple[int, int], tuple[float, float, np.ndarray | None]] = {}

    def gather(self, events: list, before: dict[int, Triple], free: dict[int, tuple]) -> None:
        """Adds one substep.

        `events`: its contact forces; `before`: velocities ahead of it, by id;
        `free`: id -> (mass, engine's body) of those that only contacts and gravity pushed.
        """
        seconds = self._world.integration_parameters.dt
        touches = [self._touch(event, seconds) for event in events]
        touched = {number for touch in touches for number in touch.ids if number in free}
        gained = {}
        for number in touched:
            mass, body = free[number]
            v, (x, y, z) = body.linvel, before[number]
            gained[number] = (
                mass * (v.x - x), mass * (v.y - y + self._gravity * seconds), mass * (v.z - z)
            )  # fmt: skip
        share_out(touches, gained)
        for touch in touches:
            a, b = touch.ids
            key = (a, b) if a < b else (b, a)
            total, largest, point = self._hardest.get(key, (0.0, -1.0, None))
            if touch.impulse > HARDER * largest:
                largest, point = touch.impulse, touch_point(self._world, touch.event, point)
            self._hardest[key] = total + touch.impulse, largest, point

    def contacts(self) -> list[Contact]:
        """Every pair once, by ids."""
        return [
            Contact(*pair, total, point)
            for pair, (total, _, point) in sorted(self._hardest.items(), key=lambda row: row[0])
            if point is not None
        ]

    def _touch(self, event: Any, seconds: float) -> Touch:
        ids = self._ids[event.collider1], self._ids[event.collider2]
        return Touch(ids, event.total_force_magnitude * seconds, event)


def share_out(touches: list[Touch], gained: dict[int, Triple]) -> None:
    """Sets the impulses of touches from what bodies gained (N s), from the ends of chains inward.

    The slow way is a system of linear equations; chains and trees of it are solved leaf by leaf.
    """
    of: dict[int, list[Touch]] = {}
    for touch in touches:
        for number in touch.ids:
            of.setdefault(number, []).append(touch)
    ends = [number for number in of if len(of[number]) == 1 and number in gained]
    while ends:
        number = ends.pop()
        if not of[number]:
            continue
        touch = of[number][0]
        x, y, z = gained[number]
        touch.impulse = math.sqrt(x * x + y * y + z * z)
        other = touch.ids[1] if touch.ids[0] == number else touch.ids[0]
        for side in touch.ids:
            of[side].remove(touch)
        if other in gained:
            p, q, r = gained[other]
            gained[other] = p + x, q + y, r + z  # what it got from elsewhere
            if len(of[other]) == 1:
                ends.append(other)


def touch_point(world: Any, event: Any, before: np.ndarray | None) -> np.ndarray:
    """(3,) metres, world: the deepest point that two colliders share."""
    position = world.colliders[event.collider1].position
    pair = world.narrow_phase.contact_pair(event.collider1, event.collider2)
    deepest = pair.find_deepest_contact() if pair else None
    if deepest is None and before is not None:
        return before
    at = position.transform_point(deepest.local_p1) if deepest else position.translation
    return np.array([at.x, at.y, at.z])


def any_near(world: Any, pairs: list[tuple[Any, Any]]) -> bool:
    """Whether one of these pairs of colliders touches or is about to: then faces are not merged.

    Merged contacts halve the cost, but let a hand push a cup 25 mm into a mesh.
    """
    found = (world.narrow_phase.contact_pair(*pair) for pair in pairs)
    return any(pair is not None and pair.find_deepest_contact() is not None for pair in found)


def velocities(bodies: dict[int, Any]) -> dict[int, tuple[float, float, float]]:
    """m/s of the engine's bodies, by id."""
    return {n: (v.x, v.y, v.z) for n, v in ((n, body.linvel) for n, body in bodies.items())}


# A snapshot of the physics as bytes: our own books as JSON, then the engine's, under one hash.

MARK = b"shapeshift physics 1\n"
HASH_BYTES = 32


def pack(books: dict, engine: bytes) -> bytes:
    """The mark, the SHA-256 of the rest, the length of the books (8 bytes), books, engine."""
    text = json.dumps(books, separators=(",", ":"), allow_nan=False).encode()
    rest = len(text).to_bytes(8, "little") + text + engine
    return MARK + hashlib.sha256(rest).digest() + rest


def unpack(data: bytes) -> tuple[dict, bytes]:
    """Books and engine of a snapshot whose every bit is as written.  Raises ValueError."""
    start = len(MARK) + HASH_BYTES
    rest = data[start:]
    digest = data[len(MARK) : start]
    if not data.startswith(MARK) or hashlib.sha256(rest).digest() != digest:
        raise ValueError(
            f"{len(data)} bytes are no whole snapshot of this program's physics; take a new one."
        )
    length = int.from_bytes(rest[:8], "little")
    return json.loads(rest[8 : 8 + length]), rest[8 + length :]


def hash_of(rows: Iterable[tuple[int, Pose, np.ndarray, np.ndarray]]) -> str:
    """SHA-256 of objects: id, pose, (3,) m/s and (3,) rad/s of each, to the bit."""
    digest = hashlib.sha256()
    for number, pose, linear, turning in rows:
        row = np.concatenate([[number], pose.position, pose.wxyz, linear, turning])
        digest.update(row.astype("<f8").tobytes())
    return digest.hexdigest()
