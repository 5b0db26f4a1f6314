"""The self-test of the GPU sort: it passes here, and finds every harm that we think of."""

import numpy as np
import pytest

from renderer.renderer import Renderer
from renderer.sort import Sorter
from renderer.sort_check import KEYS, misplaced, working_sorter
from tests.splat_scenes import front_view, two_objects


def test_a_sort_that_works_is_kept(gpu, capsys):
    sorter, name = working_sorter(gpu, "gl")
    assert (sorter.backend, name) == ("gl", "gl")
    assert misplaced(gpu, sorter) == misplaced(gpu, Sorter(gpu, "numpy")) == 0
    assert working_sorter(gpu, "numpy")[1] == "numpy" and not capsys.readouterr().err


def swapped(order: np.ndarray) -> None:
    order[[5, 6]] = order[[6, 5]]


def unstable(order: np.ndarray) -> None:
    order[-40:] = order[-40:][::-1].copy()  # the culled ones, all with one key


def last_block_left(order: np.ndarray) -> None:
    order[-77:] = np.arange(KEYS - 77, KEYS)


@pytest.mark.parametrize("harm", [swapped, unstable, last_block_left])
def test_a_wrong_sort_is_found_and_numpy_sorts(ctx, gpu, monkeypatch, capsys, harm):
    right = Sorter._sort_on_gpu

    def wrong(self, arena, key_bits):
        right(self, arena, key_bits)
        order = np.frombuffer(arena.order.read(), np.uint32).copy()
        harm(order)
        arena.order.write(order)

    with Renderer(ctx, "quads", sort="numpy", target="rgba32f") as renderer:
        renderer.update(two_objects(500))
        renderer.draw([front_view((40, 30))])
        wanted = renderer.image().copy()
    monkeypatch.setattr(Sorter, "_sort_on_gpu", wrong)
    assert misplaced(gpu, Sorter(gpu, "gl")) >= 2
    with Renderer(ctx, "quads", sort="gl", target="rgba32f") as renderer:
        assert renderer.backends["sort"] == "numpy (gl sorts wrongly here)"
        renderer.update(two_objects(500))
        renderer.draw([front_view((40, 30))])
        np.testing.assert_array_equal(renderer.image(), wanted)
    said = capsys.readouterr().err
    assert "sort wrongly" in said and "numpy" in said and said.count("\n") == 1


def test_it_takes_no_time_worth_mentioning(gpu):
    import time

    sorter = Sorter(gpu, "gl")
    misplaced(gpu, sorter)
    start = time.process_time()
    misplaced(gpu, sorter)
    assert time.process_time() - start < 0.25  # on software GL; the whole start takes longer
