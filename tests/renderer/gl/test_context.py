"""Every way to a context works or says in one sentence why not."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import moderngl
import numpy as np
import pytest

from shapeshift.renderer.gl import context
from shapeshift.renderer.gl.context import (
    KINDS,
    VERSIONS,
    NoContext,
    create_newest,
    describe,
    is_software,
    open_context,
)
from shapeshift.renderer.gl.layered import GlFunctions
from shapeshift.renderer.timing import MOST_UNDER_WAY, PassTimer

ROOT = Path(__file__).resolve().parents[3]
TRIPLE = """#version 430
layout(local_size_x = 64) in;
layout(std430, binding = 0) buffer Numbers { uint numbers[]; };
void main() { numbers[gl_GlobalInvocationID.x] = gl_GlobalInvocationID.x * 3u; }
"""


def open_or_skip(kind: str) -> moderngl.Context:
    try:
        return open_context(kind)
    except NoContext as reason:
        pytest.skip(str(reason))


@pytest.mark.parametrize("kind", [*KINDS, "auto"])
def test_a_context_computes_draws_and_is_released(kind):
    ctx = open_or_skip(kind)
    numbers = ctx.buffer(reserve=4 * 256)
    numbers.bind_to_storage_buffer(0)
    ctx.compute_shader(TRIPLE).run(4)
    ctx.memory_barrier()
    np.testing.assert_array_equal(
        np.frombuffer(numbers.read(), np.uint32), np.arange(256, dtype=np.uint32) * 3
    )
    target = ctx.framebuffer([ctx.texture((4, 4), 4)])
    target.clear(1.0, 0.0, 0.0, 1.0)
    assert target.read(components=4) == b"\xff\x00\x00\xff" * 16
    assert ctx.error == "GL_NO_ERROR"
    assert set(describe(ctx)) == {"gl_renderer", "gl_version", "vendor"}
    ctx.release()


def test_two_contexts_live_side_by_side():
    first, second = open_or_skip("egl"), open_or_skip("egl")
    with first:
        kept = first.buffer(b"first")
    with second:
        other = second.buffer(b"other")
        assert other.read() == b"other"
    with first:
        assert kept.read() == b"first"
    second.release()
    first.release()


@pytest.mark.parametrize(
    ("name", "software"),
    [
        ("llvmpipe (LLVM 15.0.6, 256 bits)", True),
        ("softpipe", True),
        ("SWR (LLVM 12.0)", True),
        ("Software Rasterizer", True),
        ("GDI Generic", True),
        ("D3D12 (Microsoft Basic Render Driver)", True),
        ("NVIDIA GeForce RTX 4090/PCIe/SSE2", False),
        ("AMD Radeon RX 7900 XTX (radeonsi, navi31)", False),
        ("Mesa Intel(R) Arc(tm) A770 Graphics", False),
    ],
)
def test_software_is_known_by_its_name(name, software):
    assert is_software(SimpleNamespace(info={"GL_RENDERER": name})) is software


def test_an_unknown_kind_is_refused_with_the_list():
    with pytest.raises(NoContext, match="'vulkan'; choose one of auto, egl, surfaceless, osmesa"):
        open_context("vulkan")


def run_with(environment: dict[str, str], kind: str) -> str:
    code = (
        "from shapeshift.renderer.gl.context import NoContext, open_context\n"
        f"try: open_context({kind!r})\n"
        "except NoContext as reason: print(reason)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={"PATH": "/usr/bin:/bin", **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


@pytest.mark.parametrize("kind", [*KINDS, "auto"])
def test_an_old_driver_is_named_in_one_sentence(kind):
    with open_or_skip(kind) as ctx:
        if "Mesa" not in ctx.info["GL_VERSION"]:
            pytest.skip("only Mesa can be told to be old")
    ctx.release()
    said = run_with({"MESA_GL_VERSION_OVERRIDE": "4.1"}, kind)
    assert "GL 4.3 needed, this driver offers 4.1" in said
    assert said.endswith(".") and "\n" not in said and said.count("this driver offers") == 1


def test_no_egl_device_is_said_in_one_sentence(tmp_path):
    open_or_skip("egl").release()
    said = run_with({"__EGL_VENDOR_LIBRARY_DIRS": str(tmp_path)}, "egl")
    assert said.endswith(".") and "\n" not in said
    assert "EGL" in said


def test_the_timer_sums_a_pass_and_keeps_the_order_of_passes():
    timer = PassTimer(None)
    for name in ("project", "sort", "project"):
        with timer.time(name):
            pass
    took = timer.collect()
    assert list(took) == ["project", "sort"] and all(ms >= 0 for ms in took.values())
    assert timer.collect() == {}


def test_a_failing_pass_does_not_break_the_timer():
    timer = PassTimer(None)
    with pytest.raises(ValueError, match="in the pass"), timer.time("splat"):
        raise ValueError("in the pass")
    assert timer.collect() == {}


@pytest.fixture
def queries(monkeypatch) -> list[moderngl.Query]:
    """All that are made from now on, by timers that take this machine's GL for a GPU's."""
    made, query = [], moderngl.Context.query

    def noted(*arguments, **kinds):
        made.append(query(*arguments, **kinds))
        return made[-1]

    monkeypatch.setattr(moderngl.Context, "query", noted)
    monkeypatch.setattr(context, "SOFTWARE", ("none such",))
    return made


def test_the_drivers_timer_counts_what_the_driver_does(ctx, queries):
    timer = PassTimer(ctx)
    target = ctx.framebuffer([ctx.texture((512, 512), 4, dtype="f4")])
    for _ in range(2):  # queries are used again
        for name, on_gpu in (("decode", False), ("splat", True), ("splat", True)):
            with timer.time(name, on_gpu):
                target.clear(0.5, 0.5, 0.5, 1.0)
        took = timer.collect(wait=True)
        assert list(took) == ["decode", "splat"] and all(ms >= 0 for ms in took.values())
        assert timer.age == 0
    assert len(queries) == 2


def test_times_of_a_gpu_that_is_behind_are_of_a_frame_before(ctx, queries, monkeypatch):
    """Ten frames of which none gets done: nobody waits, and no more is asked for than may be under
    way; then all are done, and the newest is told with its age."""
    behind, call = [True], GlFunctions.call

    def slow(self, name, *arguments):
        return 0x911B if behind and "Wait" in name else call(self, name, *arguments)

    monkeypatch.setattr(GlFunctions, "call", slow)  # GL_TIMEOUT_EXPIRED
    timer = PassTimer(ctx)
    target, frames = ctx.framebuffer([ctx.texture((8, 8), 4)]), 10
    for number in range(frames):
        with timer.time(f"pass {number}"):
            target.clear()
        assert (timer.collect(), timer.age) == ({}, number + 1)
    behind.clear()
    ctx.finish()
    assert list(timer.collect()) == [f"pass {MOST_UNDER_WAY - 1}"]
    assert timer.age == frames + 1 - MOST_UNDER_WAY and len(queries) == MOST_UNDER_WAY


@pytest.mark.parametrize("newest", VERSIONS)
def test_a_driver_that_gives_just_what_is_asked_for_is_asked_for_its_newest(newest):
    """NVIDIA's gives 3.3 to who asks for 3.3, though it could 4.6; Mesa its newest, always."""
    asked = []

    def create(*version):
        asked.append(version)
        return 77 if version <= newest else None

    assert create_newest(create) == 77
    assert asked[-1] == newest and asked == sorted(asked, reverse=True)
    assert create_newest(lambda *version: None) is None
