"""The arena: what it refuses, what an upload leaves in it; a running scene allocates nothing."""

import numpy as np
import pytest

from shapeshift.renderer import layout
from shapeshift.renderer.gl import buffers
from shapeshift.renderer.gl.buffers import Arena, fitting_splats
from shapeshift.renderer.gl.decode import Decoder
from shapeshift.renderer.gl.gpu import Gpu, groups_for
from shapeshift.renderer.gl.project import Projector
from shapeshift.renderer.gl.sort_check import Sorter
from shapeshift.renderer.gl.splat import Splatter
from shapeshift.renderer.limits import TooLarge
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.rotation import covariance
from tests.support.renderer.gl_models import f32, make_layers, make_model, make_view, read

BLOCK = layout.WORKGROUP


def parts(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """means, scales, wxyz of any length (the first one zero), opacity."""
    rng = np.random.default_rng(seed)
    wxyz = rng.normal(size=(n, 4)) * 10 ** rng.uniform(-6, 6, (n, 1))
    wxyz[:1] = 0
    scales = np.exp(rng.normal(size=(n, 3)))
    return tuple(f32(a) for a in (rng.normal(size=(n, 3)), scales, wxyz, rng.normal(size=n)))


@pytest.mark.parametrize("n", [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 1000])
def test_an_upload_becomes_rows_of_the_arena(gpu, n):
    means, scales, wxyz, opacity = parts(n)
    with Arena(gpu, [3, n, 2]) as arena:
        arena.write_geometry(1, means, scales, wxyz, opacity)
        arena.write_color(1, f32(means * 2))
        rows = slice(3, 3 + n)
        mean_opacity = read(arena.mean_opacity, np.float32, 4)
        color = read(arena.color, np.float32, 4)
        sigma = read(arena.covariance, np.float32, 8)
    np.testing.assert_array_equal(mean_opacity[rows, :3], means)
    np.testing.assert_array_equal(mean_opacity[rows, 3], opacity)
    np.testing.assert_array_equal(color[rows, :3], means * 2)
    expected = covariance(scales, wxyz)
    if n:
        error = np.abs(sigma[rows, :6] - expected).max(axis=1)
        assert np.all(error <= 2e-6 * np.square(scales).max(axis=1))
        np.testing.assert_allclose(sigma[3, [0, 3, 5]], np.square(scales[0]), rtol=1e-6)
    assert not mean_opacity[[0, 1, 2, -1, -2]].any()  # the neighbours' rows are untouched
    assert not sigma[[0, 1, 2, -1, -2]].any() and not color[[0, 1, 2, -1, -2]].any()


def test_an_upload_larger_than_the_staging_buffer_comes_in_parts(gpu, monkeypatch):
    means, scales, wxyz, opacity = parts(1001)
    whole, in_parts = [], []
    for staged, out in ((2000, whole), (100, in_parts)):
        monkeypatch.setattr(buffers, "STAGED_SPLATS", staged)
        with Arena(gpu, [1001]) as arena:
            arena.write_geometry(0, means, scales, wxyz, opacity)
            out += [arena.mean_opacity.read(), arena.covariance.read()]
    assert whole == in_parts


def test_the_wrong_number_of_rows_is_refused(gpu):
    with Arena(gpu, [5]) as arena:
        with pytest.raises(ValueError, match="object 0 has 5 splats, but 4 means came"):
            arena.write_geometry(0, *parts(4))
        with pytest.raises(ValueError, match="object 0 has 5 splats, but 6 colours came"):
            arena.write_color(0, np.zeros((6, 3), np.float32))


def test_a_scene_over_the_driver_s_limit_is_refused_with_what_fits(ctx):
    with Gpu(ctx) as small:
        small.max_block = 3200
        assert fitting_splats(small) == 100
        made = small.allocations
        with pytest.raises(TooLarge) as refusal:
            Arena(small, [60, 41])
        assert small.allocations == made  # nothing is left behind
        Arena(small, [60, 40]).release()
    said = str(refusal.value)
    assert "101 splats" in said and "100 at most" in said
    assert "GL_MAX_SHADER_STORAGE_BLOCK_SIZE is 3,200 bytes" in said and "\n" not in said
    assert "--max-splats 100 " in said


def test_the_driver_s_own_limits_are_known(gpu):
    assert gpu.max_block >= 2**24 and gpu.max_uniforms >= 2**14  # GL 4.3 promises these
    assert fitting_splats(gpu) >= 500_000
    with pytest.raises(TooLarge, match=r"the test needs [\d,]+ bytes"):
        gpu.reserve(gpu.max_block + 4, "the test")


def test_groups_cover():
    assert [groups_for(n, 64) for n in (0, 1, 63, 64, 65)] == [0, 1, 1, 1, 2]


def test_an_empty_scene_is_a_scene(gpu):
    with Arena(gpu, []) as arena, Splatter(gpu) as splatter:
        arena.set_poses([])
        Projector(gpu).project(arena, [make_view()], RenderSettings())
        Sorter(gpu, "gl").sort(arena)
        splatter.draw(arena, 0, (8, 4), 1 / 255)
        assert not splatter.image(0).any() and splatter.image(0).shape == (4, 8, 4)
        assert Projector(gpu).counts(arena)["drawn"] == 0


@pytest.mark.parametrize("mlps", ["gl", "onnxruntime"])
@pytest.mark.parametrize("sort", ["gl", "numpy"])
def test_a_sweep_of_200_steps_allocates_nothing(gpu, mlps, sort):
    models = [make_model(40, k=3), make_layers(100)]
    projector, sorter, view = Projector(gpu), Sorter(gpu, sort), make_view(size=(16, 12))
    with (
        Arena(gpu, [m.splat_count for m in models]) as arena,
        Decoder(gpu, arena, models, mlps) as decoder,
        Splatter(gpu) as splatter,
    ):

        def frame(x: float) -> None:
            for i in range(2):
                decoder.geometry(i, x)
                decoder.color(i, x, np.array([0.0, x, 3.0]))
            projector.project(arena, [view], RenderSettings())
            sorter.sort(arena, 32)
            splatter.draw(arena, 0, view.size, 1 / 255)
            splatter.draw(arena, 1, view.size, 1 / 255)

        frame(0.0)
        before = gpu.allocations
        for x in np.linspace(0, 1, 200):
            frame(float(x))
        assert gpu.allocations == before
        assert sum(projector.counts(arena).values()) == 220


@pytest.mark.parametrize("n", [1, 3, 255, 256, 1000])
def test_a_new_buffer_is_zero_and_keeps_every_part_that_is_written(gpu, n):
    """After a map NVIDIA's driver 580 kept the first of these writes alone."""
    buffer = gpu.reserve(16 * n)
    assert buffer.read() == bytes(16 * n)
    parts = np.random.default_rng(n).integers(1, 1 << 30, (4, n), np.uint32)
    for k, part in enumerate(parts):
        buffer.write(part, offset=4 * n * k)
    copy = gpu.reserve(16 * n)
    gpu.ctx.copy_buffer(copy, buffer)
    for each in (buffer, copy):
        np.testing.assert_array_equal(np.frombuffer(each.read(), np.uint32), parts.reshape(-1))
        each.release()
