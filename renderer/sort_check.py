"""A self-test of the GPU sort at the start: a driver that gets it wrong is found out and told."""

import sys

import numpy as np

from renderer import layout
from renderer.buffers import Arena
from renderer.gpu import Gpu
from renderer.sort import Sorter, stable_order

# Several blocks of a group, several groups, and a last one that is not full.
KEYS = 3 * layout.WORKGROUP * layout.SORT_BLOCKS + layout.WORKGROUP + 77


def working_sorter(gpu: Gpu, backend: str) -> tuple[Sorter, str]:
    """(sorter, its name): the back end asked for, or numpy where GL's does not sort here.

    A fallback is told on stderr and by the name.
    """
    sorter = Sorter(gpu, backend)
    if backend != "gl":
        return sorter, backend
    wrong = misplaced(gpu, sorter)
    if not wrong:
        return sorter, backend
    sys.stderr.write(
        f"This driver's compute passes sort wrongly ({wrong:,} of {KEYS:,} keys in a test at the "
        "start); sorting with numpy instead, which costs a read-back a frame.\n"
    )
    return Sorter(gpu, "numpy"), "numpy (gl sorts wrongly here)"


def misplaced(gpu: Gpu, sorter: Sorter) -> int:
    """How many of some random keys, many of them equal, a sorter puts in another place than
    numpy's stable sort does.
    """
    rng = np.random.default_rng(20250101)
    keys = rng.integers(0, 2**32, KEYS, dtype=np.uint32)
    keys[rng.random(KEYS) < 0.3] &= np.uint32(0xFF00FF00)  # ties in two of the four digits
    keys[rng.random(KEYS) < 0.1] = layout.CULLED_KEY
    with Arena(gpu, [KEYS]) as arena:
        arena.keys.write(keys)
        sorter.sort(arena, 32)
        order = np.frombuffer(arena.order.read(), np.uint32)
    return int((order != stable_order(keys)).sum())
