"""Times the named passes of a frame: wall clock, and the GPU's own timer where there is a GPU."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from shapeshift.renderer.gl.context import is_software


class PassTimer:
    """Collects milliseconds by pass name; a name timed twice in a frame (two eyes) is summed.

    A GPU runs the commands of a pass after Python has issued them: the driver's timer queries
    count there, and take() waits for them.  Software GL is finished after every pass, since its
    threads would do the work of one pass in the time of the next; else it is wall time as it is.
    """

    def __init__(self, ctx: moderngl.Context | None) -> None:
        self._software = ctx if ctx is not None and is_software(ctx) else None
        self._gpu = None if self._software else ctx
        self._unused: list[moderngl.Query] = []
        self._asked: list[tuple[str, moderngl.Query]] = []
        self._ms: dict[str, float] = {}

    @contextmanager
    def time(self, name: str, on_gpu: bool = True) -> Iterator[None]:
        """Times the body as pass `name`; `on_gpu` is False for passes whose work is the CPU's."""
        if self._gpu is not None and on_gpu:
            query = self._unused.pop() if self._unused else self._gpu.query(time=True)
            with query:
                yield
            self._asked.append((name, query))
            self._add(name, 0.0)  # keeps its place in the order of passes
            return
        start = time.perf_counter()
        yield
        if self._software is not None:
            self._software.finish()
        self._add(name, (time.perf_counter() - start) * 1e3)

    def collect(self) -> dict[str, float]:
        """Milliseconds of every pass since the last call, in the order in which passes ran."""
        for name, query in self._asked:
            self._add(name, query.elapsed * 1e-6)
            self._unused.append(query)
        self._asked.clear()
        taken, self._ms = self._ms, {}
        return taken

    def _add(self, name: str, ms: float) -> None:
        self._ms[name] = self._ms.get(name, 0.0) + ms
