"""Reads parts of scenes in a thread, those that are wanted most first."""

import ctypes
import sys
import threading
from collections.abc import Sequence

import numpy as np

from shapeshift.runtime_models.leaf_levels import LeafSource
from shapeshift.runtime_models.model import BadFile

MOST_WAITING = 16  # parts: those of later frames are asked for then
THREAD = "leaves"  # its name
PACE_S = 1.0  # longest wait for the next frame, between pictures of a part
PIXELS = 1 << 18  # of pictures that a frame of a moving eye bears: 3 to 5 ms of a core
RETURNED = 64  # parts, after which the heap is given back in motion, too: 7 to 20 ms of a core
PATIENCE_S = 5.0  # longest wait at the end for a part that is being read


class Fetcher:
    """One thread, which begins with the first request; `close` ends it."""

    def __init__(self) -> None:
        self._wanted: list[tuple[LeafSource, int]] = []
        self._wake = threading.Condition()
        self._thread: threading.Thread | None = None
        self._ended, self._moving = False, False
        self._left = 0  # pixels that this frame still bears
        self.busy = False  # a part is being read

    def want(self, parts: Sequence[tuple[LeafSource, int]]) -> None:
        """These instead of those before that are not begun."""
        with self._wake:
            self._wanted = list(parts[:MOST_WAITING])
            if self._wanted and self._thread is None:
                self._thread = threading.Thread(target=self._run, name=THREAD, daemon=True)
                self._thread.start()
            self._wake.notify()

    def tick(self, moving: bool, pixels: int) -> None:
        """A frame begins.  moving: of an eye that moves: then it bears so many pixels, since all
        pictures of a part at once would hold it up; a larger picture takes the next frames' share.
        """
        with self._wake:
            self._left, self._moving = min(self._left, 0) + pixels, moving
            self._wake.notify()

    def _pace(self, pixels: int) -> None:
        """After pictures of so many pixels."""
        with self._wake:
            self._left -= pixels
            if self._moving and not self._ended:
                self._wake.wait_for(lambda: self._left > 0 or self._ended, PACE_S)

    @property
    def waiting(self) -> bool:
        """Whether something is still to come."""
        return self.busy or bool(self._wanted)

    def _run(self) -> None:
        decoded = 0  # parts, since the heap was given back
        while True:
            with self._wake:
                self.busy = False
                while not self._wanted and not self._ended:
                    # Frames wake it; where none come for a while the eye rests.
                    if not self._wake.wait(PACE_S if decoded else None):
                        break
                if self._ended:
                    return
                asked = self._wanted.pop(0) if self._wanted else None
                self.busy = asked is not None
            if asked is not None:
                source, part = asked
                try:
                    source.load(part, self._pace)
                except (BadFile, MemoryError):
                    pass  # the source says so, and asks no more for it
                decoded += 1
            if asked is None or decoded >= RETURNED:
                return_heap()
                decoded = 0

    def close(self) -> None:
        with self._wake:
            self._ended, self._wanted = True, []
            self._wake.notify()
        if self._thread is not None:
            self._thread.join(PATIENCE_S)


def return_heap() -> None:
    """Gives pages that decoding has freed back to the system.  glibc keeps them, for each thread,
    75 MB beside a scene of 13 million splats; other C libraries have no such call.
    """
    if sys.platform == "linux" and (trim := getattr(ctypes.CDLL(None), "malloc_trim", None)):
        trim(0)


# What leaves come from: of copies of one object it is asked once, whatever their number.


class Sources:
    """The sources of some objects, each once, and whose leaves they are."""

    def __init__(self, each: Sequence[LeafSource]) -> None:
        """each: of every object, which has leaves of its own."""
        numbers = {id(source): n for n, source in enumerate({id(s): s for s in each}.values())}
        self.once = list({id(source): source for source in each}.values())
        sizes = [len(source.part) for source in each]
        self.first = np.concatenate([[0], np.cumsum(sizes, dtype=int)])  # leaf of each object
        self.object = np.repeat(np.arange(len(each)), sizes)  # of each leaf
        self._which = np.array([numbers[id(source)] for source in each])  # of each object

    @property
    def problem(self) -> str:
        return next((source.problem for source in self.once if source.problem), "")

    def share_memory(self, taken: int) -> None:
        for source in self.once:
            source.share_memory(taken)

    def at_hand(self) -> list[np.ndarray]:
        """Of each source once: what is decoded."""
        return [source.at_hand() for source in self.once]

    def whole(self) -> list[np.ndarray]:
        """Of each source once: what can be read, as far as is known."""
        return [~source.broken() for source in self.once]

    def finest_of(
        self, level: np.ndarray, parts: Sequence[np.ndarray], coarsest: np.ndarray
    ) -> np.ndarray:
        """(L,) the finest level from the wanted one on that lies in one of these parts (a mask of
        each source once), or is the coarsest, which is in memory.
        """
        kinds = max(source.levels.counts.shape[1] for source in self.once)
        there = np.zeros((len(level), kinds), bool)
        for number, (source, mask) in enumerate(zip(self.once, parts, strict=True)):
            own = source.levels.counts
            copies = self.first[:-1][self._which == number]
            rows = copies[:, None] + np.arange(len(own))
            there[rows, : own.shape[1]] = mask[source.part] & (own > 0)
        there |= np.arange(kinds) == coarsest[:, None]
        there &= np.arange(kinds) >= level[:, None]
        return np.where(level >= 0, np.argmax(there, axis=1), level)

    def missing(
        self, leaves: np.ndarray, levels: np.ndarray, worth: np.ndarray,
        at_hand: Sequence[np.ndarray],
    ) -> list[tuple[LeafSource, int]]:  # fmt: skip
        """Parts that leaves (n,) at levels (n,) lie in and that are not at hand, what is worth
        (n,) most first.
        """
        found: list[tuple[float, int, LeafSource]] = []
        owner = self.object[leaves]
        for number, (source, there) in enumerate(zip(self.once, at_hand, strict=True)):
            mine = self._which[owner] == number
            parts = source.part[leaves[mine] - self.first[owner[mine]], levels[mine]]
            most = np.zeros(len(there))
            np.maximum.at(most, parts, worth[mine])
            wanted = np.flatnonzero((most > 0) & ~there & ~source.broken())
            found += [(float(most[part]), int(part), source) for part in wanted]
        found.sort(key=lambda each: (-each[0], each[1]))
        return [(source, part) for _, part, source in found]
