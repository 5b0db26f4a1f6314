"""What goes through the gate's pipe: lies about sizes, and memory that is let go."""

import gc
import io
import json
import threading
import time
import weakref

import numpy as np
import pytest

from shapeshift.runtime_models.gate import gate, wire

MOST = 100  # bytes
LIES = {  # of a process that its file has taken over: what stands for the value, bytes behind it
    "an array larger than its bytes": ({"@": 0, "of": "<f4", "shape": [1 << 40]}, 0),
    "an array of letters without a size": ({"@": 0, "of": "<U0", "shape": [1 << 40]}, 0),
    "an array smaller than its bytes": ({"@": 8, "of": "<f4", "shape": [1]}, 8),
    "an array of objects": ({"@": 8, "of": "|O", "shape": [1]}, 8),
    "an array of arrays": ({"@": 8, "of": "(2,)<f4", "shape": [1]}, 8),
    "sides that are negative": ({"@": 4, "of": "<f4", "shape": [-1, -1]}, 4),
    "sides that are no numbers": ({"@": 4, "of": "<f4", "shape": ["1"]}, 4),
    "more than was asked for": ({"@": MOST + 1}, MOST + 1),
    "more than it said": ({"@": 5}, 4),
    "less than it said": ({"@": 3}, 4),
    "the same twice": ([{"@": 4}, {"@": 4}], 4),
    "sizes that are negative": ([{"@": -1}, {"@": 5}], 4),
    "sizes that are no numbers": ({"@": "4"}, 4),
    "JSON without an end": ("[" * 100_000, 0),
}


@pytest.mark.parametrize("lie", LIES)
def test_who_lies_about_sizes_is_not_heard(lie):
    assert heard_of(*LIES[lie]) is None


def test_as_much_as_was_asked_for_is_heard():
    assert heard_of({"@": MOST}, MOST) == {"done": b"x" * MOST}


def heard_of(stands: object, size: int) -> dict | None:
    """What a listener makes of an answer with so many bytes behind it, who asked for MOST."""
    text = stands.encode() if isinstance(stands, str) else json.dumps({"done": stands}).encode()
    pipe = io.BufferedReader(io.BytesIO(wire.HEAD.pack(len(text), size) + text + b"x" * size))
    wanted, answers = gate.queue.SimpleQueue(), gate.queue.SimpleQueue()
    wanted.put(MOST)
    wanted.put(None)  # and no more
    gate.listen(pipe, wanted, answers)
    return answers.get_nowait()


def test_arrays_that_went_through_a_pipe_are_held_by_nobody():
    """Not until the collector of garbage runs: each file would be given memory of its own."""
    pipe = io.BytesIO()
    gc.disable()
    try:
        for _ in range(2):
            pipe.seek(0)
            wire.send(pipe, {"done": [array := np.ones(100)]})
            sent = weakref.ref(array)
            del array
            assert sent() is None
        pipe.seek(0)
        wanted, answers = gate.queue.SimpleQueue(), gate.queue.SimpleQueue()
        wanted.put(800)
        listener = threading.Thread(target=gate.listen, args=(pipe, wanted, answers), daemon=True)
        listener.start()
        heard = weakref.ref(answers.get(timeout=10)["done"][0])
        end = time.monotonic() + 10
        while heard() is not None and time.monotonic() < end:
            time.sleep(0.001)
        assert heard() is None
        wanted.put(None)
        listener.join()
    finally:
        gc.enable()
