"""rasterizer/device.py and program.py: which device, what is said without one, kernel files."""

import gc
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyopencl.tools import ImmediateAllocator, MemoryPool

from shapeshift.rasterizer.device import INSTALL, NoDevice, open_device, with_small_pool
from shapeshift.rasterizer.program import BuildError, read_source
from tests.support.renderer.rasterizer_scenes import device

ROOT = Path(__file__).resolve().parents[2]


def python(code: str, **environment) -> subprocess.CompletedProcess:
    env = {k: v for k, v in os.environ.items() if k != "POCL_CACHE_DIR"}
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={**env, "PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        text=True,
    )


def test_it_says_which_device_and_driver():
    d = device()
    assert d.kind in ("cpu", "gpu") and d.name and d.units >= 1
    if "PoCL" in d.platform:
        assert "system" in d.platform or "wheel" in d.platform


def test_without_a_driver_one_sentence_says_what_to_install(tmp_path):
    code = """
from shapeshift.rasterizer.device import NoDevice, open_device
try:
    open_device()
except NoDevice as error:
    print(error)
"""
    # Loaders look into this folder alone; some need the trailing separator to take it as one.
    run = python(code, OCL_ICD_VENDORS=f"{tmp_path}{os.sep}")
    assert run.returncode == 0, run.stderr
    message = run.stdout.strip()
    assert message.count("\n") == 0 and INSTALL in message
    assert "apt-get install pocl-opencl-icd" in message
    assert "pip install pocl-binary-distribution" in message


@pytest.mark.skipif(sys.platform != "linux", reason="limits of address space are Linux's here")
def test_little_address_space_is_a_sentence_before_the_driver_ends_the_process():
    """With 40 MB left PoCL aborts in its first thread (exit -6, its own words)."""
    code = """
import resource
from shapeshift.rasterizer.device import NoDevice, NoMemory, open_device
taken = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (taken + (40 << 20), resource.RLIM_INFINITY))
try:
    open_device()
except NoMemory as error:
    print(error)
resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
"""
    run = python(code)
    assert run.returncode == 0, run.stderr
    assert run.stdout.count("\n") == 1 and run.stderr == ""
    assert "OpenCL wants 450 MB of address space" in run.stdout and "ulimit -v" in run.stdout


def test_a_kind_that_is_not_there_is_named():
    kind = "gpu" if device().kind == "cpu" else "cpu"
    try:
        assert open_device(kind).kind == kind
    except NoDevice as error:
        assert kind in str(error)


def test_nothing_happens_at_import():
    run = python(
        "import sys, os; before = dict(os.environ)\n"
        "import shapeshift.rasterizer.raster, shapeshift.rasterizer.reference\n"
        "assert 'pyopencl' not in sys.modules; assert dict(os.environ) == before"
    )
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("shape", [(0,), (1,), (5, 0, 3), (17, 3)])
def test_arrays_come_back_as_they_went(shape):
    d = device()
    host = np.random.default_rng(0).normal(size=shape).astype(np.float32)
    array = d.upload(host)
    np.testing.assert_array_equal(d.download(array), host)
    np.testing.assert_array_equal(d.view(array), host)
    assert not d.download(d.zeros(shape, np.int32)).any()


def test_arrays_that_are_not_contiguous_are_uploaded_in_c_order():
    host = np.arange(24, dtype=np.float32).reshape(4, 6)
    np.testing.assert_array_equal(device().download(device().upload(host.T)), host.T)
    np.testing.assert_array_equal(device().download(device().upload(host[:, ::2])), host[:, ::2])


def test_a_view_keeps_its_memory_when_the_array_goes():
    d = device()
    view = d.view(d.upload(np.full(1000, 7, np.float32)))
    gc.collect()
    for _ in range(20):
        d.upload(np.zeros(1000, np.float32))
    assert np.all(view == 7)
    with pytest.raises(ValueError, match="read-only"):
        view[0] = 1


def test_freed_arrays_are_used_again():
    d = device()
    d.zeros((1000, 1000))
    held = d.pool.managed_bytes
    for _ in range(20):
        d.zeros((1000, 1000))
    assert d.pool.managed_bytes == held


def test_a_small_pool_keeps_less_of_sizes_that_change():
    """Sizes of three octaves at random, a dozen at a time, as lists of a step: a pool keeps what
    was in use at once in each of its classes of size, of which the small one has a quarter.
    """
    d, rng = device(), np.random.default_rng(1)
    kept = []
    usual = replace(d, pool=MemoryPool(ImmediateAllocator(d.queue)))
    for mine in (with_small_pool(d), usual):
        for _ in range(200):
            arrays = [mine.empty(int(n), np.uint8) for n in 1e5 * 8 ** rng.random(12)]
        assert mine.pool.active_bytes >= sum(array.nbytes for array in arrays)
        kept.append(mine.pool.managed_bytes)
    assert kept[0] < 0.7 * kept[1], kept
    small = with_small_pool(d)
    np.testing.assert_array_equal(small.download(small.upload(np.arange(1537))), np.arange(1537))
    for size, taken in ((1025, 1536), (1500, 1536), (1537, 2048), (2049, 3072)):
        before = small.pool.managed_bytes
        array = small.empty(size, np.uint8)
        assert taken - 1 <= small.pool.managed_bytes - before <= taken
        del array
        small.pool.free_held()


def test_programs_are_built_once_for_each_set_of_defines(tmp_path):
    path = tmp_path / "twice.cl"
    path.write_text("__kernel void f(__global float* x) { x[get_global_id(0)] = VALUE; }\n")
    d = device()
    one, same, other = (d.program(path, VALUE=v) for v in (1.5, 1.5, 2))
    assert one is same and one is not other
    array = d.empty(3)
    d.launch(one["f"], 3, 1, array)
    assert d.download(array).tolist() == [1.5] * 3
    d.launch(other["f"], 3, 1, array)
    assert d.download(array).tolist() == [2] * 3


def test_kernels_take_plain_numbers_of_their_own_types(tmp_path):
    """Whole numbers as floats, too; of uint the largest, of int the least; and no array."""
    path = tmp_path / "numbers.cl"
    path.write_text(
        "__kernel void f(int a, uint b, float c, __global const int* no, __global float* x) {\n"
        "  x[0] = a; x[1] = b; x[2] = c; x[3] = no ? 1 : 0;\n}\n"
    )
    d = device()
    found, kernel = d.empty(4), d.program(path)["f"]
    for a, b, c in ((3, 5, 2), (-(2**31), 2**32 - 1, 0.5), (True, np.uint32(7), np.float64(1e-3))):
        d.launch(kernel, 1, 1, a, b, c, None, found)
        wanted = np.array([a, b, c, 0], np.float32)
        np.testing.assert_array_equal(d.download(found), wanted)


def test_includes_are_taken_once_from_beside_the_file_and_from_the_kernels(tmp_path):
    (tmp_path / "near.cl").write_text('#include "common/record.cl"\n#define NEAR 1\n')
    (tmp_path / "main.cl").write_text('#include "near.cl"\n#include "common/record.cl"\nint x;\n')
    text, origins = read_source(tmp_path / "main.cl")
    assert text.count("#define RECORD 12") == 1 and text.count("#define NEAR 1") == 1
    assert origins[text.splitlines().index("int x;")] == "main.cl:3"


def test_a_broken_kernel_names_file_and_line(tmp_path):
    (tmp_path / "part.cl").write_text("\n\nfloat wrong( { }\n")
    (tmp_path / "whole.cl").write_text('\n#include "part.cl"\n')
    with pytest.raises(BuildError, match=r"part\.cl:3:"):
        device().program(tmp_path / "whole.cl")


def test_a_condition_needs_names_that_are_defined(tmp_path):
    """A compiler takes others for 0, and a slip of the pen leaves out what it should switch on."""
    part, path = tmp_path / "part.cl", tmp_path / "whole.cl"
    part.write_text(
        "#define FEW 3\n#if FEW > 0x2u && GIVEN  /* no NAME */ // nor THIS\n#endif\n"
        "#ifdef MAYBE\n#elif defined(OTHER) && OTHER > 1 || !defined ELSE\n#endif\n"
        "#if __has_builtin(__builtin_prefetch)\n#endif\n"
    )
    path.write_text('#include "part.cl"\n\n#if FEW == 4\n#elif GIVEM\n#endif\n')
    with pytest.raises(BuildError, match=r"^whole\.cl:4: #if GIVEM, which nobody has defined$"):
        read_source(path, ["GIVEN"])
    assert read_source(path, ["GIVEN", "GIVEM"]) == read_source(path)
    with pytest.raises(BuildError, match=r"^part\.cl:2: #if GIVEN, which nobody has defined$"):
        device().program(path, GIVEM=1)


def test_a_missing_include_is_named(tmp_path):
    (tmp_path / "whole.cl").write_text('#include "nowhere.cl"\n')
    with pytest.raises(BuildError, match=r"whole\.cl:1: no file for"):
        device().program(tmp_path / "whole.cl")
