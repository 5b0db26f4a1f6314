"""Counts what a frame or a training step asks of a graphics card, on any machine.

OpenGL: moderngl's methods, and the few functions that are called without it.  OpenCL: what
Device launches, makes and copies.  A read is a wait, unless what is read was only ever copied to,
and a fence behind the copy was seen to have passed.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from typing import Any
from unittest.mock import patch

import moderngl
import numpy as np
import pyopencl as cl

from shapeshift.rasterizer.device import Device, open_device
from shapeshift.renderer.gl import context
from shapeshift.renderer.gl.layered import GlFunctions
from shapeshift.renderer.tiles import arena as tiles_arena

# What a row has, of a frame or a step, in this order.
COUNTS = (
    "finishes",  # the queue was drained
    "reads",  # from a buffer or a texture while the card may still work on it
    "queries",  # whose result was asked for before it was there
    "launches",  # compute passes: dispatches of GL, kernels of OpenCL
    "draws",
    "uploads",
    "upload_bytes",
    "read_bytes",
    "made",  # buffers, textures and vertex arrays; OpenCL: arrays, from the pool too
)
SIGNALED = (0x911A, 0x911C)  # GL_ALREADY_SIGNALED, GL_CONDITION_SATISFIED


@dataclass
class Counted:
    """Of the frame under way; one that begins clears it."""

    counts: Counter[str] = field(default_factory=Counter)
    clock: int = 0  # commands that were given to the card
    passed: int = 0  # how many of them are known to be done
    fences: dict[int, int] = field(default_factory=dict)  # address -> clock
    copied: dict[int, int] = field(default_factory=dict)  # buffer -> clock of the last copy to it
    bound: set[int] = field(default_factory=set)  # buffers that a pass may write
    ended: dict[int, int] = field(default_factory=dict)  # query -> clock

    def command(self, what: str = "") -> None:
        self.clock += 1
        if what:
            self.counts[what] += 1

    def upload(self, data: Any) -> None:
        self.counts["uploads"] += 1
        self.counts["upload_bytes"] += memoryview(data).nbytes

    def read(self, buffer: moderngl.Buffer, size: int) -> None:
        copied = self.copied.get(buffer.glo)
        free = copied is not None and buffer.glo not in self.bound and copied <= self.passed
        if not free:
            self.counts["reads"] += 1
            self.counts["read_bytes"] += buffer.size if size < 0 else size


def _around(stack: ExitStack, owner: Any, name: str, note: Callable[..., None]) -> None:
    """note(result, *arguments) after each call of a method."""
    inner = getattr(owner, name)

    def method(*arguments, **named):
        result = inner(*arguments, **named)
        note(result, *arguments, **named)
        return result

    stack.enter_context(patch.object(owner, name, method))


@contextmanager
def counting_gl() -> Iterator[Counted]:
    """Counts in the body, in which this machine's GL is taken for a graphics card's."""
    told = Counted()
    counts = told.counts

    def buffer_made(made, ctx, data=None, reserve=0, dynamic=False):
        counts["made"] += 1
        told.bound.discard(made.glo)  # a number of before is given again
        told.copied.pop(made.glo, None)
        if data is not None:
            told.upload(data)

    def copied(_, ctx, to, source, *more, **places):
        told.command()
        told.copied[to.glo] = told.clock

    def function_called(result, gl, name, kind, kinds, *arguments):
        if name == "glFenceSync":
            told.fences[result] = told.clock
        elif name == "glClientWaitSync":
            counts["finishes"] += arguments[2] > 0
            if result in SIGNALED:
                told.passed = max(told.passed, told.fences[arguments[0]])

    def query_ended(_, query, *failure):
        told.command()
        told.ended[id(query)] = told.clock

    def elapsed(query):
        counts["queries"] += not told.ended[id(query)] <= told.passed
        return query.mglo.elapsed

    gl, buffer = moderngl.Context, moderngl.Buffer
    with ExitStack() as stack:
        stack.enter_context(patch.object(context, "SOFTWARE", ("no such driver",)))
        stack.enter_context(patch.object(moderngl.Query, "elapsed", property(elapsed)))
        _around(stack, gl, "finish", lambda *_: counts.update(finishes=1))
        _around(stack, gl, "buffer", buffer_made)
        _around(stack, gl, "copy_buffer", copied)
        for name in ("texture", "vertex_array"):
            _around(stack, gl, name, lambda *_, **__: counts.update(made=1))
        _around(stack, buffer, "write", lambda _, to, data, offset=0: told.upload(data))
        _around(stack, buffer, "read", lambda _, of, size=-1, offset=0: told.read(of, size))
        _around(stack, buffer, "read_into", lambda _, of, to, size=-1, *at: told.read(of, size))
        _around(stack, buffer, "clear", lambda *_, **__: counts.update(reads=1))  # it maps
        _around(stack, buffer, "bind_to_storage_buffer",
                lambda _, of, *slot: told.bound.add(of.glo))  # fmt: skip
        for kind in (moderngl.Texture, moderngl.Framebuffer):
            _around(stack, kind, "read", lambda pixels, *_, **__: counts.update(
                reads=1, read_bytes=len(pixels)))  # fmt: skip
        _around(stack, moderngl.Texture, "write", lambda _, to, data, *at, **__: told.upload(data))
        for name in ("run", "run_indirect"):
            _around(stack, moderngl.ComputeShader, name, lambda *_, **__: told.command("launches"))
        for name in ("render", "render_indirect"):
            _around(stack, moderngl.VertexArray, name, lambda *_, **__: told.command("draws"))
        _around(stack, moderngl.Query, "__exit__", query_ended)
        _around(stack, GlFunctions, "call", function_called)
        yield told


@contextmanager
def counting_cl() -> Iterator[tuple[Counted, Device]]:
    """The same of OpenCL, whose device is taken for a graphics card: its kernels run anywhere."""
    told = Counted()
    counts, device = told.counts, replace(open_device(), kind="gpu")

    def copied(_, queue, to, source, **how):
        if isinstance(to, np.ndarray):
            counts.update(reads=1, read_bytes=to.nbytes)
        elif isinstance(source, np.ndarray):
            told.upload(source)

    with ExitStack() as stack:
        stack.enter_context(patch.object(tiles_arena, "open_device", lambda *_: device))
        _around(stack, cl.CommandQueue, "finish", lambda *_: counts.update(finishes=1))
        _around(stack, cl, "enqueue_copy", copied)
        _around(stack, cl, "enqueue_map_buffer", lambda *_, **__: counts.update(reads=1))
        _around(stack, Device, "launch",
                lambda _, of, kernel, items, *more: counts.update(launches=items > 0))  # fmt: skip
        _around(stack, Device, "empty", lambda *_, **__: counts.update(made=1))
        for name in ("constants", "shared"):
            _around(stack, Device, name, lambda _, of, host: told.upload(host))
        yield told, device
