"""The OpenCL device that everything here runs on: GPU before CPU, a plain word where is none."""

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike

from shapeshift.rasterizer.program import build

if TYPE_CHECKING:
    import pyopencl as cl
    from pyopencl.array import Array

# Called each time a device has been opened: the compiler in its driver takes signals over.
opened: list[Callable[[], None]] = []
GPU = "SHAPESHIFT_GPU"  # in the environment: which GPU, where several processes share them
# Bytes of address space: where PoCL's threads and compiler find less, it ends the process or waits
# for ever.  Opening takes 210 to 440 MB.
ROOM = 450 << 20
INSTALL = (
    "on Debian or Ubuntu run `apt-get install pocl-opencl-icd` (fastest on a CPU), elsewhere "
    f"`{sys.executable} -m pip install pocl-binary-distribution`, or install the driver of your GPU"
)


class NoDevice(RuntimeError):
    """No OpenCL device can be used.  The message says what to install."""


class NoMemory(NoDevice):
    """The device's memory is full.  The message says what was asked for."""


@dataclass(frozen=True)
class Device:
    """One OpenCL device with its queue.  Arrays come from a pool: freed ones are reused."""

    context: "cl.Context"
    queue: "cl.CommandQueue"
    name: str
    platform: str  # name and version, e.g. "Portable Computing Language 3.1 (system)"
    kind: str  # cpu | gpu
    units: int  # compute units: how many work-groups run at once
    pool: Any = field(repr=False)  # pyopencl.tools.MemoryPool or what stands in
    programs: dict = field(default_factory=dict, repr=False)
    lanes: int = 8  # floats of the widest vectors that it computes with
    most_bytes: int = 0  # of one array, as the driver says; 0: it says nothing

    def empty(self, shape, dtype: DTypeLike = np.float32) -> "Array":
        """A device array with undefined contents."""
        import pyopencl as cl
        from pyopencl.array import Array

        try:
            return Array(self.queue, shape, dtype, allocator=self.pool)
        except cl.MemoryError as error:
            size = int(np.prod(shape, dtype=np.int64)) * np.dtype(dtype).itemsize
            raise NoMemory(
                f"{self.name} has no room for {size:,} bytes more; open the scene with "
                "--max-splats, or draw it with --drawing quads."
            ) from error

    def zeros(self, shape, dtype: DTypeLike = np.float32) -> "Array":
        """A device array of zeros."""
        array = self.empty(shape, dtype)
        self.clear(array)
        return array

    def clear(self, array: "Array") -> None:
        """Enqueue zeros into an array; its own fill() is a kernel that a first use compiles."""
        import pyopencl as cl

        if array.size:
            data: Any = array.base_data  # a buffer: the pool has no other memory
            where = (array.offset, array.nbytes)
            cl.enqueue_fill_buffer(self.queue, data, np.zeros(1, np.uint8), *where)

    def upload(self, host: np.ndarray) -> "Array":
        """A copy of a numpy array on the device, C order."""
        host = np.ascontiguousarray(host)
        array = self.empty(host.shape, host.dtype)
        if host.size:
            array.set(host)
        return array

    def constants(self, host: np.ndarray) -> "cl.Buffer":
        """A copy of a small array for kernels to read, not from the pool; upload() takes 90 us."""
        import pyopencl as cl

        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self.context, flags, hostbuf=np.ascontiguousarray(host))

    def shared(self, host: np.ndarray) -> "cl.Buffer":
        """The memory of a numpy array for kernels to read; on a CPU without a copy."""
        import pyopencl as cl

        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.USE_HOST_PTR
        return cl.Buffer(self.context, flags, hostbuf=host)

    def download(self, array: "Array") -> np.ndarray:
        """A copy of a device array in numpy."""
        return array.get() if array.size else np.empty(array.shape, array.dtype)

    def copy_rows(self, rows: "Array", into: "Array", start: int) -> None:
        """Enqueue a copy of an array into rows `start` and on of another one of the same width."""
        import pyopencl as cl

        if rows.size:
            at: Any = (rows.base_data, into.base_data)  # buffers: the pool has no other memory
            offset = into.offset + start * into.strides[0]
            cl.enqueue_copy(
                self.queue, at[1], at[0], byte_count=rows.nbytes, src_offset=rows.offset,
                dst_offset=offset,
            )  # fmt: skip

    def view(self, array: "Array") -> np.ndarray:
        """The contents of a device array, read only; on a CPU without a copy.

        The view keeps the array's memory alive.  Kernels that write to `array` later show
        through it on a CPU: download() where that matters.
        """
        if self.kind != "cpu" or not array.size:
            return self.download(array)
        import pyopencl as cl

        flags = cl.map_flags.READ
        data: Any = array.base_data  # a buffer: the pool has no other memory
        host, _ = cl.enqueue_map_buffer(
            self.queue, data, flags, array.offset, array.shape, array.dtype
        )
        view = np.asarray(_Mapped(host, array))
        view.flags.writeable = False
        return view

    def program(self, path: Path, **defines) -> dict:
        """Kernels by name of an OpenCL C file, built once for each set of defines."""
        key = (str(path), tuple(sorted(defines.items())))
        if key not in self.programs:
            options = ["-cl-std=CL1.2", "-cl-mad-enable", "-cl-no-signed-zeros"]
            options += [f"-D{name}={_literal(value)}" for name, value in defines.items()]
            self.programs[key] = build(self.context, Path(path), options)
        return self.programs[key]

    def launch(self, kernel, items, group, *arguments) -> None:
        """Enqueue a kernel.  Numbers become what it takes, device arrays their buffers.

        items: global size, rounded up to a multiple of `group` (the local size); each an int.
        """
        if items > 0:
            size = -(-items // group) * group
            kernel(self.queue, (size,), (group,), *[_argument(a) for a in arguments])


class _Mapped:
    """Owner of a mapped view: gives the memory back to the pool when numpy lets go of it."""

    def __init__(self, host: np.ndarray, array: "Array") -> None:
        self.__array_interface__ = host.__array_interface__
        self.host, self.array = host, array


def _argument(value):
    return value.data if hasattr(value, "base_data") else value


def _literal(value) -> str:
    return f"{value!r}f" if isinstance(value, float) else str(int(value))


def refuse_little_room() -> None:
    """Raises NoMemory where a limit leaves this process too little to open a device in."""
    if sys.platform != "linux":
        return
    import resource

    most, _ = resource.getrlimit(resource.RLIMIT_AS)
    if most == resource.RLIM_INFINITY:
        return
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    if most - taken < ROOM:
        raise NoMemory(
            f"OpenCL wants {ROOM >> 20} MB of address space, and of the {most >> 20} MB that this "
            f"process may have {max(most - taken, 0) >> 20} are left; raise the limit (ulimit -v)."
        )


def open_device(kind: str | None = None) -> Device:
    """The best OpenCL device: a GPU, else a CPU, the system's PoCL before the wheel's.

    kind: "gpu" or "cpu" to insist on one.  Raises NoDevice, of which NoMemory is one kind.
    """
    if not _opened.cache_info().currsize:
        refuse_little_room()
    import pyopencl as cl

    try:
        found = [d for platform in cl.get_platforms() for d in platform.get_devices()]
    except cl.LogicError:  # PLATFORM_NOT_FOUND_KHR: there is no driver at all
        found = []
    usable = [d for d in found if d.available and kind in (None, _kind(d))]
    if not usable:
        wanted = f" of kind {kind!r}" if kind and found else ""
        raise NoDevice(f"There is no OpenCL device{wanted} on this machine: {INSTALL}.")
    usable.sort(key=_preference, reverse=True)
    alike = [d for d in usable if _kind(d) == _kind(usable[0])]
    number = os.environ.get(GPU, "")
    if _kind(usable[0]) == "gpu" and number.isascii() and number.isdigit():
        return _opened(alike[int(number) % len(alike)])
    return _opened(usable[0])


@cache  # PoCL keeps 8 MB of every set of programs that is built anew, even when all is released
def _opened(device: "cl.Device") -> Device:
    """One context, queue and set of programs a process for each device."""
    import pyopencl as cl
    from pyopencl.tools import ImmediateAllocator, MemoryPool

    context = cl.Context([device])
    queue = cl.CommandQueue(context)
    for each in opened:
        each()
    return Device(
        context,
        queue,
        device.name.strip(),
        _platform(device),
        _kind(device),
        device.max_compute_units,
        MemoryPool(ImmediateAllocator(queue)),
        lanes=device.native_vector_width_float,
        most_bytes=device.max_mem_alloc_size,
    )


def with_small_pool(device: Device) -> Device:
    """The device with a pool of its own that keeps less for arrays whose sizes change all the time.

    Sizes are rounded up to 1 or 1.5 times a power of two, not to sixteenths of it, so that fewer
    sizes are kept unused; arrays take a fifth more in the mean.  Contents are the same to the bit.
    """
    from pyopencl.tools import ImmediateAllocator, MemoryPool

    pool = MemoryPool(ImmediateAllocator(device.queue), leading_bits_in_bin_id=1)
    return replace(device, pool=pool)


def _kind(device: "cl.Device") -> str:
    import pyopencl as cl

    return "cpu" if device.type & cl.device_type.CPU else "gpu"


def _is_wheel(device: "cl.Device") -> bool:
    """True for the PoCL of PyPI: it says 3.0 and knows neither AVX-512 nor its distribution."""
    version = device.platform.version
    return "PoCL" in version and "DISTRO" not in version and "debian" not in version.lower()


def _preference(device: "cl.Device") -> tuple:
    # Debian's PoCL 3.1 is about twice as fast as the wheel's 3.0 on the same CPU.
    return (_kind(device) == "gpu", not _is_wheel(device), device.max_compute_units)


def _platform(device: "cl.Device") -> str:
    platform = device.platform
    if "PoCL" not in platform.version:
        return f"{platform.name.strip()}, {platform.version.strip()}"
    version = platform.version.split("PoCL", 1)[1].split()[0]
    source = "wheel, slower than the system's" if _is_wheel(device) else "system"
    return f"PoCL {version} ({source})"
