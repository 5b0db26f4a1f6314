"""Times the named passes of a frame: wall clock, and the GPU's own timer where there is a GPU."""

import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import c_uint, c_uint64, c_void_p
from typing import Generic, TypeVar

import moderngl

from shapeshift.renderer.gl.context import is_software
from shapeshift.renderer.gl.layered import GlFunctions, NoFunction

MOST_UNDER_WAY = 4  # frames that a driver may be behind; of those beyond nothing is asked

# glFenceSync and glClientWaitSync, OpenGL 3.2
GL_SYNC_GPU_COMMANDS_COMPLETE, GL_SYNC_FLUSH_COMMANDS_BIT = 0x9117, 1
GL_ALREADY_SIGNALED, GL_CONDITION_SATISFIED = 0x911A, 0x911C

Left = TypeVar("Left")


class UnderWay(Generic[Left]):
    """What frames leave for the processor, oldest first, until the GPU has done with the frame.

    A fence stands behind each and is asked, never waited for.  A driver whose functions cannot be
    found gives none: there a frame counts as done once MOST_UNDER_WAY others are behind it.
    """

    def __init__(self) -> None:
        self._gl: GlFunctions | None = None
        self._left: deque[tuple[int, int | None, Left]] = deque()
        self._frame = 0

    @property
    def full(self) -> bool:
        """Whether the driver is so far behind that this frame should leave nothing."""
        return len(self._left) >= MOST_UNDER_WAY

    def leave(self, what: Left | None) -> None:
        """A frame ends, with something or nothing."""
        self._frame += 1
        if what is not None:
            self._left.append((self._frame, self._fence(), what))

    def done(self) -> list[tuple[int, Left]]:
        """(frames ago, what was left) of the frames that are done now, each told once."""
        told = []
        while self._left and self._passed(*self._left[0][:2]):
            frame, fence, what = self._left.popleft()
            self._delete(fence)
            told.append((self._frame - frame, what))
        return told

    def all(self) -> list[tuple[int, Left]]:
        """The same of all frames, done or not: who reads what they left waits."""
        told = [(self._frame - frame, what) for frame, _, what in self._left]
        for _, fence, _ in self._left:
            self._delete(fence)
        self._left.clear()
        return told

    def _fence(self) -> int | None:
        try:
            gl = self._gl = self._gl or GlFunctions()
            made = (GL_SYNC_GPU_COMMANDS_COMPLETE, 0)
            return gl.call("glFenceSync", c_void_p, (c_uint, c_uint), *made)
        except NoFunction:
            return None

    def _passed(self, frame: int, fence: int | None) -> bool:
        if self._gl is None or fence is None:
            return self._frame - frame >= MOST_UNDER_WAY - 1
        kinds, wait = (c_void_p, c_uint, c_uint64), (fence, GL_SYNC_FLUSH_COMMANDS_BIT, 0)
        told = self._gl.call("glClientWaitSync", c_uint, kinds, *wait)
        return told in (GL_ALREADY_SIGNALED, GL_CONDITION_SATISFIED)

    def _delete(self, fence: int | None) -> None:
        if self._gl is not None and fence is not None:
            self._gl.call("glDeleteSync", None, (c_void_p,), fence)


class PassTimer:
    """Collects milliseconds by pass name; a name timed twice in a frame (two eyes) is summed.

    A GPU runs the commands of a pass after Python has issued them: the driver's timer queries
    count there, and nobody waits for them: what is collected is of the newest frame that is done.
    Software GL is finished after every pass, since its threads would do the work of one pass in the
    time of the next; else it is wall time as it is.
    """

    def __init__(self, ctx: moderngl.Context | None) -> None:
        self._software = ctx if ctx is not None and is_software(ctx) else None
        self._gpu = None if self._software else ctx
        self._unused: list[moderngl.Query] = []
        self._asked: list[tuple[str, moderngl.Query]] = []
        self._ms: dict[str, float] = {}
        self._under_way = UnderWay[tuple[dict[str, float], list[tuple[str, moderngl.Query]]]]()
        self._known: dict[str, float] = {}
        self.age = 0  # frames since the one that was collected last

    @contextmanager
    def time(self, name: str, on_gpu: bool = True) -> Iterator[None]:
        """Times the body as pass `name`; `on_gpu` is False for passes whose work is the CPU's."""
        if self._gpu is not None and on_gpu:
            if self._under_way.full:
                yield
                return
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

    def collect(self, wait: bool = False) -> dict[str, float]:
        """Milliseconds of every pass since the last call, in the order in which passes ran; on a
        GPU of the newest frame that is done, {} before the first.

        wait: of this frame on a GPU, too; then it is not one more frame where nothing was timed.
        """
        taken, self._ms = self._ms, {}
        if self._gpu is None:
            return taken
        asked, self._asked = self._asked, []
        if taken or not wait:
            self._under_way.leave(None if self._under_way.full else (taken, asked))
        self.age += 1 if taken or not wait else 0
        for age, (ms, queries) in self._under_way.all() if wait else self._under_way.done():
            for name, query in queries:
                ms[name] += query.elapsed * 1e-6
                self._unused.append(query)
            self._known, self.age = ms, age
        return dict(self._known)

    def _add(self, name: str, ms: float) -> None:
        self._ms[name] = self._ms.get(name, 0.0) + ms
