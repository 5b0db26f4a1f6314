"""The self-test of the GL sort: right drivers pass, each way to be wrong is found and named."""

import numpy as np
import pytest

from shapeshift.renderer.gl import shader, sort_check
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.sort_check import FAILED, Sorter, checked_sorter, first_wrong
from shapeshift.renderer.renderer import Renderer
from tests.support.renderer.gl_models import make_layers, make_view
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.splat_scenes import alone

RENDERERS = EITHER_ON_GL

BREAKAGES = {  # what a driver could do to a shader: (file, text, wrong text)
    "a key is lost at the end": ("count", "i < end ?", "i + 1u < end ?"),
    "a block is lost": ("count", "block < SORT_BLOCKS", "block + 1u < SORT_BLOCKS"),
    "an add is not atomic": ("count", "atomicAdd(occurrences[(key - base >> shift) & 255u], 1u)",
                             "occurrences[(key - base >> shift) & 255u] = 1u"),
    "culled ones are counted": ("count", "if (key != culled)", "if (i < end)"),
    "a group is lost": ("scan", "carry + before", "carry + (group > 1u ? 0u : before)"),
    "a prefix is short": ("scatter", "reach < WORKGROUP", "reach < 128u"),
    "keys have another base": ("scatter", "(key - base >> shift)", "(key >> shift)"),
    "a pass too many": ("scatter", "& 1u) == 0u;", "& 1u) != 0u;"),
    "ranks are reversed": ("scatter", "to + rank]", "to + total - 1u - rank]"),
    "ranks are one off": ("scatter", "bits & (own_bit - 1u)", "bits & own_bit"),
    "blocks overwrite": ("scatter", "next[digit] = to + total", "next[digit] = to"),
    "a word is not seen": ("scatter", "word < own_word ? bits :", "word + 1u < own_word ? bits :"),
    "nothing is written": ("scatter", "order[to + rank] =", "uint unused ="),
    "culled ones come first": ("quantize", "? 65535u", "? 0u"),
    "steps wrap": ("quantize", "uint(steps)", "uint(steps) * 2u & 65535u"),
    "steps are too coarse": ("quantize", "uint(steps)", "uint(steps) & 65520u"),
}  # fmt: skip


@pytest.fixture
def broken(request, ctx, monkeypatch):
    """A Gpu on which one shader of the sort is another."""
    file, text, wrong = BREAKAGES[request.param]
    read_shader, replaced = shader.read_shader, []

    def read(name: str, *args, **defines):
        lines = read_shader(name, *args, **defines)
        if name != f"sort/sort_{file}.comp":
            return lines
        replaced.append(name)
        assert any(text in line for _, _, line in lines), "the shader does not say this any more"
        return [(path, number, line.replace(text, wrong)) for path, number, line in lines]

    monkeypatch.setattr(shader, "read_shader", read)
    sort_check.warn_once.cache_clear()
    with Gpu(ctx) as gpu:
        yield gpu
    sort_check.warn_once.cache_clear()
    assert replaced


def test_this_driver_sorts_right_and_says_nothing(gpu, caplog):
    sorter, name = checked_sorter(gpu, "gl")
    assert (sorter.backend, name) == ("gl", "gl") and not caplog.records
    sorter, name = checked_sorter(gpu, "numpy")
    assert (sorter.backend, name) == ("numpy", "numpy")
    with pytest.raises(ValueError, match="choose gl or numpy"):
        checked_sorter(gpu, "bitonic")


@pytest.mark.parametrize("broken", BREAKAGES, indirect=True)
def test_every_breakage_is_found_and_numpy_sorts_by_name(broken, caplog):
    assert "keys of" in first_wrong(broken, Sorter(broken, "gl"))
    for _ in range(2):
        sorter, name = checked_sorter(broken, "gl")
        assert (sorter.backend, name) == ("numpy", FAILED)
    assert len(caplog.records) == 1  # once, whatever many renderers are opened
    assert caplog.records[0].levelname == "WARNING" and "numpy sorts instead" in caplog.text


@pytest.mark.parametrize("broken", ["ranks are one off"], indirect=True)
def test_a_renderer_draws_right_on_a_broken_driver_and_says_what_sorts(broken, caplog):
    scene, view = alone(make_layers(3000)), make_view()
    images = []
    for sort in ("gl", "numpy"):
        with Renderer(broken.ctx, "quads", sort=sort) as renderer:
            assert renderer.backends["sort"] == (FAILED if sort == "gl" else "numpy")
            renderer.update(scene)
            renderer.draw([view])
            images.append(renderer.image().copy())
    np.testing.assert_array_equal(*images)
    assert images[0].any()
