"""Sources of copies, asked once each: beside loops over every object."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from shapeshift.renderer.streaming.fetch import Sources
from shapeshift.runtime_models.leaf_levels import LeafLevels


@dataclass
class Made:
    """A source of random leaves in random parts."""

    seed: int
    leaves: int
    kinds: int
    asked: list[int] = field(default_factory=list)
    problem: str = ""

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        counts = self.rng.integers(0, 4, (self.leaves, self.kinds)) * 10
        counts[:, -1] = 5
        box = np.zeros((self.leaves, 3))
        self.levels = LeafLevels(box, box, counts, np.zeros(counts.shape))
        self.part = self.rng.integers(0, 6, counts.shape).astype(np.int32)
        self.there, self.bad = self.rng.random(6) < 0.5, self.rng.random(6) < 0.2

    def at_hand(self) -> np.ndarray:
        return self.there

    def broken(self) -> np.ndarray:
        return self.bad

    def share_memory(self, taken: int) -> None:
        self.asked.append(taken)


def slow_finest(each, level, coarsest, masks) -> list[int]:
    out, leaf = [], 0
    for source in each:
        for own in range(source.leaves):
            wanted = level[leaf]
            fits = [k for k in range(max(wanted, 0), source.kinds)
                    if (source.levels.counts[own, k] and masks[id(source)][source.part[own, k]])
                    or k == coarsest[leaf]]  # fmt: skip
            out.append(min(fits) if wanted >= 0 else wanted)
            leaf += 1
    return out


@pytest.mark.parametrize("order", [(0,), (0, 0, 0), (0, 1, 0, 2, 1), (2, 1, 0)])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_finest_and_missing(order, seed):
    kinds = [Made(seed, 7, 3), Made(seed + 10, 4, 5), Made(seed + 20, 1, 1)]
    each = [kinds[n] for n in order]
    sources = Sources(each)
    assert len(sources.once) == len(set(order))
    coarsest = np.concatenate([source.levels.coarsest for source in each])
    rng = np.random.default_rng(seed)
    level = np.array([rng.integers(-1, top + 1) for top in coarsest])
    masks = {id(source): source.there for source in each}
    found = sources.finest_of(level, sources.at_hand(), coarsest)
    assert found.tolist() == slow_finest(each, level, coarsest, masks)
    masks = {id(source): ~source.bad for source in each}
    found = sources.finest_of(level, sources.whole(), coarsest)
    assert found.tolist() == slow_finest(each, level, coarsest, masks)
    worth = rng.random(len(level))
    leaves = np.flatnonzero((level >= 0) & (level != coarsest))
    best: dict = {}
    for leaf in leaves:
        source = each[sources.object[leaf]]
        part = source.part[leaf - sources.first[sources.object[leaf]], level[leaf]]
        if not source.there[part] and not source.bad[part]:
            key = (id(source), int(part))
            best[key] = max(best.get(key, 0.0), worth[leaf])
    missing = sources.missing(leaves, level[leaves], worth[leaves], sources.at_hand())
    keys = [(id(source), part) for source, part in missing]
    assert set(keys) == set(best) and len(keys) == len(best)
    assert [best[key] for key in keys] == sorted(best.values(), reverse=True)


def test_each_source_is_told_and_asked_once():
    one, other = Made(0, 2, 2), Made(1, 2, 2, problem="x cannot be read")
    sources = Sources([one, other, one, one])
    sources.share_memory(7)
    assert one.asked == other.asked == [7]
    assert sources.problem == "x cannot be read" and Sources([one]).problem == ""
