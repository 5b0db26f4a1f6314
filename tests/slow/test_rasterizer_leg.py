"""The tiles on a real scene (136,605 splats) against float64, and where a frame's time goes."""

import time

import numpy as np
import pytest

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.project import Camera
from shapeshift.rasterizer.project_arena import project_arena
from shapeshift.rasterizer.raster import rasterize_rgba
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.read_scene import read_model
from tests.support.renderer.rasterizer_reference import project_reference, rasterize_reference
from tests.support.renderer.rasterizer_scenes import arena, as_double, device, psnr

pytestmark = pytest.mark.slow
SIZE = (640, 360)


@pytest.fixture(scope="module")
def leg(data) -> list:
    """All layers at once as means, scales, wxyz, opacity, color."""
    folder = data / "anatomy_leg_ml3dgs"
    if not folder.is_dir():
        pytest.skip("no anatomy_leg_ml3dgs beside the project")
    splats = evaluate(read_model(folder), 1.0, np.array([0.0, 0.0, 2.0]))
    parts = (splats.means, splats.scales, splats.wxyz, splats.opacity, splats.color)
    return [np.ascontiguousarray(a, np.float32) for a in parts]


def camera_before(splats: list) -> Camera:
    """Sees the whole model from the side, fovy 45 degrees."""
    means = splats[0].astype(np.float64)
    camera_from_world = np.diag([1.0, -1.0, -1.0, 1.0])
    extent = np.ptp(means, axis=0).max()
    camera_from_world[:3, 3] = -camera_from_world[:3, :3] @ (
        np.median(means, axis=0) + np.array([0, 0, 1.2 * extent])
    )
    focal = SIZE[1] / 2 / np.tan(np.radians(22.5))
    return Camera(camera_from_world, focal, focal, SIZE[0] / 2, SIZE[1] / 2, SIZE, 0.01)


def test_the_leg_matches_float64(leg):
    camera, d = camera_before(leg), device()
    projected = project_arena(d, *arena(leg), np.eye(4)[None], [camera])[0]
    rgba = rasterize_rgba(d, projected, bin_tiles(d, projected, SIZE), SIZE)
    image, through = rasterize_reference(*project_reference(*as_double(leg), camera), SIZE)
    assert (through < 0.5).mean() > 0.02  # it is in the picture
    assert psnr(rgba[..., :3].transpose(2, 0, 1), image) >= 60
    assert psnr(rgba[..., 3], 1 - through) >= 60


def test_projection_is_a_small_part_of_a_frame(leg):
    camera, d, inputs = camera_before(leg), device(), arena(leg)
    best = {"project": np.inf, "bin": np.inf, "raster": np.inf}  # CPU ms

    def timed(name: str, run):
        start = time.process_time()
        result = run()
        d.queue.finish()
        best[name] = min(best[name], (time.process_time() - start) * 1e3)
        return result

    def draw() -> None:
        projected = timed(
            "project", lambda: project_arena(d, *inputs, np.eye(4)[None], [camera])[0]
        )
        tiles = timed("bin", lambda: bin_tiles(d, projected, SIZE))
        timed("raster", lambda: rasterize_rgba(d, projected, tiles, SIZE))

    for _ in range(8):
        draw()
    print({name: round(value, 2) for name, value in best.items()})
    assert best["project"] <= 0.6 * (best["bin"] + best["raster"])
