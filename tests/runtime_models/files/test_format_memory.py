"""How much memory formats other than PLY take: bounds, by numpy's and Python's own counts."""

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from shapeshift.runtime_models.files.blocks import each_block
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply import write_compressed_ply as compressed_ply
from shapeshift.runtime_models.splats.ply.write_compressed_ply import write_compressed_ply
from shapeshift.runtime_models.splats.spz import write_spz as spz
from shapeshift.runtime_models.splats.spz.write_spz import write_spz

COUNT = 300_000


def some_splats(count: int, degree: int = 3) -> PlainSplats:
    """A scene like a real one: small splats, more transparent ones than solid ones."""
    rng, wide = np.random.default_rng(degree), (degree + 1) ** 2
    wxyz = rng.standard_normal((count, 4), np.float32)
    return PlainSplats(
        rng.standard_normal((count, 3), np.float32) * 2,
        np.exp(rng.standard_normal((count, 3), np.float32) * 0.7 - 6),
        wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True),
        rng.random(count, np.float32),
        rng.standard_normal((count, wide, 3), np.float32) * np.float32(0.2),
    )


def peak_of(work: Callable[[], object]) -> tuple[int, object]:
    """Most bytes that were there at once, and what came."""
    tracemalloc.start()
    try:
        came = work()
        return tracemalloc.get_traced_memory()[1], came
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("name", "write", "most"),
    [
        ("a.compressed.ply", write_compressed_ply, 1.0),
        ("a.spz", write_spz, 0.5),
        # what is compressed already, one stream as it was and zstd's buffer for it
        ("a.spz", partial(write_spz, version=4), 2.3),
    ],
)
def test_writing_takes_little_beside_the_file(tmp_path, name, write, most):
    splats, path = some_splats(COUNT), tmp_path / name
    write(some_splats(10), path)  # imports
    peak, _ = peak_of(lambda: write(splats, path))
    assert peak <= most * path.stat().st_size


def arrays_of(model: SplatLayers) -> int:
    names = ("means", "scales", "wxyz", "opacity", "sh", "layer")
    return sum(getattr(model, name).nbytes for name in names)


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.compressed.ply", write_compressed_ply),
        ("a.spz", partial(write_spz, version=2)),
        ("a.spz", write_spz),
        ("a.spz", partial(write_spz, version=4)),
    ],
)
def test_opening_takes_little_beside_the_arrays_and_the_file(tmp_path, name, write):
    """The whole way, from the path to a checked scene."""
    path = tmp_path / name
    write(some_splats(10), path)
    read_model(path)  # imports
    write(some_splats(COUNT), path)
    peak, model = peak_of(lambda: read_model(path))
    assert peak <= 1.15 * arrays_of(model) + path.stat().st_size


@pytest.mark.parametrize("count", [1, 255, 256, 257, 3000])
@pytest.mark.parametrize("degree", [0, 2, 3])
def test_what_is_written_does_not_depend_on_the_blocks(tmp_path, monkeypatch, count, degree):
    splats = replace(some_splats(count, degree), origin=(5.0, -3.0, 700.0))
    splats.scales[0] = 0
    writers = [write_compressed_ply] + [partial(write_spz, version=v) for v in (2, 3, 4)]

    def written() -> list[bytes]:
        for number, write in enumerate(writers):
            write(splats, tmp_path / str(number))
        return [(tmp_path / str(number)).read_bytes() for number in range(len(writers))]

    whole = written()
    monkeypatch.setattr(spz, "BLOCK", 100)
    monkeypatch.setattr(compressed_ply, "BLOCK", 100)
    monkeypatch.setattr(compressed_ply, "each_block", partial(each_block, block=256))
    assert written() == whole
