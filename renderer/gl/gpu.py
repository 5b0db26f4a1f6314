"""One GL context with what the passes share: its limits, its programs, a count of allocations."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import moderngl
import numpy as np

from shapeshift.renderer.gl import shader
from shapeshift.renderer.limits import TooLarge

LARGEST_INT = 2**31 - 1  # a driver that says more, or less than nothing, has no such limit


class Gpu:
    """Makes buffers and programs.  `allocations` counts every buffer and texture ever made."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx = ctx
        self.allocations = 0
        stated = ctx.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"]
        self.max_block = stated if 0 < stated <= LARGEST_INT else LARGEST_INT  # bytes
        self.max_groups = ctx.info["GL_MAX_COMPUTE_WORK_GROUP_COUNT"][0]
        self.max_uniforms = ctx.info["GL_MAX_UNIFORM_BLOCK_SIZE"]  # bytes
        self.max_side = min(ctx.info["GL_MAX_TEXTURE_SIZE"], *ctx.info["GL_MAX_VIEWPORT_DIMS"])
        self.targets: dict[str, bool] = {}  # formats that were tried: see target.py
        self._programs: dict[tuple, moderngl.ComputeShader | moderngl.Program] = {}

    def reserve(self, size: int, what: str = "buffer") -> moderngl.Buffer:
        """A buffer of `size` bytes (at least one uint), zeroed; TooLarge names `what`."""
        if size > self.max_block:
            raise TooLarge(
                f"{what} needs {size:,} bytes; this driver's storage blocks hold "
                f"{self.max_block:,} (GL_MAX_SHADER_STORAGE_BLOCK_SIZE); give --max-splats, or "
                "draw with --drawing tiles."
            )
        self.allocations += 1
        # Not clear(): it maps the buffer, and of what is written into it afterwards NVIDIA's driver
        # 580 keeps the first write alone.  Zeros that nobody touched take no memory here.
        return self.ctx.buffer(bytes(max(size, 4)))

    def upload(self, array: np.ndarray, what: str = "buffer") -> moderngl.Buffer:
        """A buffer with the bytes of an array."""
        array = np.ascontiguousarray(array)
        buffer = self.reserve(array.nbytes, what)
        if array.nbytes:
            buffer.write(array)
        return buffer

    def target(self, size: tuple[int, int], dtype: str, images: int = 1) -> moderngl.Framebuffer:
        """A framebuffer with so many RGBA textures; dtype one of target.DTYPES."""
        if not max(size) <= self.max_side:
            raise TooLarge(
                f"a view of {size[0]} x {size[1]} pixels was asked for and this driver draws "
                f"{self.max_side} a side at most (GL_MAX_TEXTURE_SIZE); ask for a smaller one."
            )
        self.allocations += images
        textures = [self.ctx.texture(size, 4, dtype=dtype) for _ in range(images)]
        return self.ctx.framebuffer(textures)

    def compute(self, name: str, **defines: Any) -> moderngl.ComputeShader:
        """The program of a .comp file, compiled once for the same defines."""
        key = (name, *sorted(defines.items()))
        if key not in self._programs:
            self._programs[key] = shader.compile_compute(self.ctx, name, **defines)
        return self._programs[key]

    def program(self, vertex: str, fragment: str, **defines: Any) -> moderngl.Program:
        """The program of two stages, compiled once for the same defines."""
        key = (vertex, fragment, *sorted(defines.items()))
        if key not in self._programs:
            self._programs[key] = shader.compile_program(self.ctx, vertex, fragment, **defines)
        return self._programs[key]

    def run(self, program: moderngl.ComputeShader, groups: int, **uniforms: Any) -> None:
        """Sets uniforms and runs the groups; what they write is seen by all that follows."""
        for name, value in uniforms.items():
            program[name].value = value
        program.run(groups)
        self.ctx.memory_barrier()

    def run_indirect(
        self, program: moderngl.ComputeShader, groups: moderngl.Buffer, at: int = 0, **uniforms: Any
    ) -> None:
        """The same with as many groups as three numbers of a buffer say, from byte `at` on."""
        for name, value in uniforms.items():
            program[name].value = value
        program.run_indirect(groups, at)
        self.ctx.memory_barrier()

    @contextmanager
    def drawing_into(self, framebuffer: moderngl.Framebuffer) -> Iterator[None]:
        """Binds a framebuffer for the body; then again what was bound, so that a window stays the
        target, and one of ours can be deleted without being it.
        """
        before = self.ctx.fbo or self.ctx.detect_framebuffer(0)
        framebuffer.use()
        try:
            yield
        finally:
            before.use()

    def release(self) -> None:
        for program in self._programs.values():
            program.release()
        self._programs.clear()

    def __enter__(self) -> "Gpu":
        return self

    def __exit__(self, *failure) -> None:
        self.release()


def overwrite(buffer: moderngl.Buffer, data: Any, offset: int = 0) -> None:
    """Other bytes from `offset` on in a buffer that a pass has read or written before.

    GL promises that such a pass is done before; with NVIDIA's driver 580 writes overtake compute
    passes that still run.  So what is written as a whole gets new memory, and a part comes by a
    copy on the GPU, which has its turn among the passes: nobody waits.
    """
    size = memoryview(data).nbytes
    if offset == 0 and size == buffer.size:
        buffer.orphan()
        buffer.write(data)
    elif size:
        part = buffer.ctx.buffer(data)
        buffer.ctx.copy_buffer(buffer, part, size, write_offset=offset)
        part.release()  # its memory lasts until the copy is made


def release_framebuffer(framebuffer: moderngl.Framebuffer) -> None:
    """Gives back a framebuffer with all that was drawn into."""
    for image in framebuffer.color_attachments:
        image.release()
    framebuffer.release()


def groups_for(count: int, size: int) -> int:
    """Work groups of `size` invocations that cover `count`."""
    return -(-count // size)
