"""What leaves come from: of copies of one object it is asked once, whatever their number."""

from collections.abc import Sequence

import numpy as np

from shapeshift.runtime_models.leaf_levels import LeafSource


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
