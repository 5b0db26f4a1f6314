"""Decoded parts within a bound: the one used longest ago goes, each is made once."""

import threading
from dataclasses import dataclass, field

import pytest

from shapeshift.runtime_models.files.part_cache import PartCache


@dataclass
class Bytes:
    size: int
    gone: list = field(default_factory=list)

    def release(self) -> None:
        self.gone.append(True)


@pytest.mark.parametrize("sizes", [(10,), (10, 10), (10, 10, 1), (20, 1), (21, 1), (1, 1, 20, 1)])
def test_no_more_than_the_bound_is_kept_and_what_goes_is_released_once(sizes):
    cache, parts = PartCache(20), [Bytes(size) for size in sizes]
    for number, part in enumerate(parts):
        assert cache.get(number, lambda part=part: part) is part
        kept = [p for n, p in enumerate(parts) if n in cache]
        assert cache.taken == sum(p.size for p in kept) <= 20
        assert all(len(p.gone) == (p not in kept) for p in parts[: number + 1])


def test_the_part_used_longest_ago_goes_first():
    cache = PartCache(2)
    for key in "ab":
        cache.get(key, lambda: Bytes(1))
    cache.get("a", lambda: pytest.fail("it is here"))
    cache.get("c", lambda: Bytes(1))
    assert "a" in cache and "b" not in cache and cache.decoded == 3


def test_many_threads_that_ask_make_one():
    cache, begun, made = PartCache(5), threading.Barrier(4), []

    def ask() -> None:
        begun.wait()
        cache.get("x", lambda: made.append(1) or Bytes(1))

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert made == [1]


def test_what_cannot_be_made_is_not_kept_and_may_be_asked_for_again():
    cache = PartCache(5)
    with pytest.raises(ValueError, match="broken"):
        cache.get("x", lambda: (_ for _ in ()).throw(ValueError("broken")))
    assert "x" not in cache and cache.taken == 0
    assert cache.get("x", lambda: Bytes(1)).size == 1
