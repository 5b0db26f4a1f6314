"""A PLY of over 2 GB and over 8 million splats opens, is drawn in tiles, and limits are named.

Needs 3 GB of disk and 9 GB of memory; half a minute.
"""

import shutil
from pathlib import Path

import numpy as np
import pytest

from shapeshift.rasterizer.device import NoDevice, open_device
from shapeshift.renderer.gl.buffers import fitting_splats
from shapeshift.renderer.gl.context import NoContext, open_context
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.limits import TooLarge
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.operations.decimate import prune_by_importance
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.scene.cameras.framing import default_view
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.splats.ply_files import names_of

COUNT = 8_660_000
DISK, MEMORY = 3 << 30, 9 << 30  # bytes
BLOCK = 100_000
NAMED = (0, 1, 2047, 2048, COUNT // 2, COUNT - 2, COUNT - 1)  # rows that are looked at


def available_memory() -> int:
    """Bytes that can be taken without swapping; 0 where the system does not tell."""
    told = Path("/proc/meminfo")
    lines = told.read_text().splitlines() if told.exists() else []
    return sum(int(line.split()[1]) << 10 for line in lines if line.startswith("MemAvailable"))


def rows_of(first: int, count: int, width: int) -> np.ndarray:
    """(count, width) float32 of some rows of the file; a row is the same in any call."""
    at = np.arange(first, first + count)[:, None] * 0.61803398875 + np.arange(width) * 0.7548776662
    rows = (at % 1 - 0.5).astype(np.float32)
    rows[:, 3:6] = 0  # normals
    rows[:, -8] *= 8  # opacity: logits
    rows[:, -7:-4] -= 5  # scales: logarithms
    return rows


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> SplatLayers:
    folder = tmp_path_factory.mktemp("big")
    if shutil.disk_usage(folder).free < DISK:
        pytest.skip("less than 3 GB of disk are free")
    if available_memory() < MEMORY:
        pytest.skip("less than 9 GB of memory are free")
    path, names = folder / "big.ply", names_of(16)
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {COUNT}"]
    head += [f"property float {name}" for name in names] + ["end_header", ""]
    try:
        with path.open("wb") as file:
            file.write("\n".join(head).encode())
            for first in range(0, COUNT, BLOCK):
                file.write(rows_of(first, min(BLOCK, COUNT - first), len(names)))
        assert path.stat().st_size > 1 << 31
        told = []
        model = read_model(path, Reading(progress=lambda _, part: told.append(part)))
        assert told == sorted(told) and len(told) > 100
        return model
    finally:
        path.unlink(missing_ok=True)


@pytest.mark.slow
def test_every_row_is_where_it_belongs(model):
    assert model.splat_count == COUNT
    for i in NAMED:
        row = rows_of(i, 1, 62)[0]
        np.testing.assert_array_equal(model.means[i], row[:3] * [1, -1, -1])
        assert model.sh[i, 0].tolist() == row[6:9].tolist()
        assert model.sh[i, 15].tolist() == (row[[23, 38, 53]] * 1).tolist()
        np.testing.assert_allclose(model.scales[i], np.exp(row[-7:-4]), rtol=1e-6)


@pytest.mark.slow
def test_it_is_drawn_in_tiles_and_half_of_it_looks_alike(model):
    try:
        open_device()
    except NoDevice as reason:
        pytest.skip(str(reason))
    pictures = []
    for scene in (model, prune_by_importance(model, COUNT // 2)):
        with Renderer(None, "tiles") as renderer:
            renderer.update(Scene((SceneObject("big", scene),)))
            renderer.draw([default_view(model, (320, 180))])
            pictures.append(renderer.resolved(0)[..., :3])
    whole, half = pictures
    assert np.isfinite(whole).all() and whole.std() > 0.01
    assert np.abs(whole - half).mean() < 0.1


@pytest.mark.slow
def test_quads_draw_it_or_say_which_limit_stops_them(model):
    try:
        ctx = open_context()
    except NoContext as reason:
        pytest.skip(str(reason))
    with ctx, Gpu(ctx) as gpu:
        most = fitting_splats(gpu)
        with Renderer(ctx, "quads") as renderer:
            if most >= COUNT:
                renderer.update(Scene((SceneObject("big", model),)))
                return
            with pytest.raises(TooLarge, match=f"draws {most:,} at most.*--max-splats {most} "):
                renderer.update(Scene((SceneObject("big", model),)))
