"""The thread that reads: it gives memory back where nobody waits for the processor."""

import time

import pytest

from shapeshift.renderer.streaming import fetch
from shapeshift.renderer.streaming.fetch import RETURNED, Fetcher


class Parts:
    """A source that notes what is read."""

    def __init__(self) -> None:
        self.read: list[int] = []

    def load(self, part: int, pace) -> None:
        self.read.append(part)
        pace(1)


@pytest.fixture
def returned(monkeypatch):
    """How many parts were read each time the heap was given back."""
    source, at = Parts(), []
    monkeypatch.setattr(fetch, "return_heap", lambda: at.append(len(source.read)))
    fetcher = Fetcher()
    yield fetcher, source, at
    fetcher.close()


def wait_until(done, seconds: float = 10.0) -> None:
    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_in_motion_the_heap_goes_back_after_many_parts(returned):
    """A frame 5 ms after the other; parts are read in the order of their worth."""
    fetcher, source, at = returned
    for part in range(RETURNED + 3):
        fetcher.want([(source, part)])
        while part not in source.read:
            fetcher.tick(True, 1 << 18)
            time.sleep(0.005)
    assert source.read == list(range(RETURNED + 3))
    assert at == [RETURNED]
    wait_until(lambda: len(at) == 2)  # no frame comes: at rest the others follow
    assert at == [RETURNED, RETURNED + 3]
    time.sleep(1.5)
    assert len(at) == 2 and not fetcher.waiting  # once


def test_nothing_read_gives_nothing_back(returned):
    fetcher, source, at = returned
    fetcher.want([])
    fetcher.tick(False, 1)
    time.sleep(1.2)
    assert source.read == [] and at == []
