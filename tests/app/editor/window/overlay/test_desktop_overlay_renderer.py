"""Our drawing of ImGui against ImGui's own, and the letters that it uploads as they are needed."""

import numpy as np
import pytest
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.overlay_renderer import OverlayRenderer, pixels_of
from tests.support.desktop.desktop_stand import run_frames


@pytest.fixture
def renderer(viewer):
    """The one of the window, drawing as it does on a GPU."""
    kept = viewer.window.presented.renderer
    plain = object.__new__(OverlayRenderer)
    plain.__dict__.update(kept.__dict__)  # its program, buffers, and textures
    return plain


def drawn(viewer, draw) -> np.ndarray:
    screen = viewer.window.screen()
    screen.clear(0.1, 0.5, 0.3)
    screen.use()
    draw(imgui.get_draw_data())
    return viewer.window.presented.read().astype(int)


def test_it_draws_what_the_backend_of_imgui_bundle_draws(viewer, renderer):
    """A third party's program: the OpenGL backend that comes with the bindings."""
    pytest.importorskip("OpenGL.GL")
    from imgui_bundle.python_backends.opengl_backend_programmable import (
        ProgrammablePipelineRenderer,
    )

    run_frames(viewer, 2)
    theirs = drawn(viewer, ProgrammablePipelineRenderer().render)
    ours = drawn(viewer, renderer.render)
    assert (theirs != theirs[0, 0]).any(axis=2).mean() > 0.1, "there is an overlay"
    # Their scissor is rounded as ours where a logical pixel is one pixel, as here.
    np.testing.assert_array_equal(ours, theirs)


def same_letters(renderer) -> int:
    """Texels that are not empty; every texture of ImGui's is on the GPU as ImGui has it."""
    filled = 0
    for own in imgui.get_platform_io().textures:
        if own.status == imgui.ImTextureStatus.ok:
            texture, pixels = renderer.textures[own.tex_id], pixels_of(own)
            assert texture.size == (own.width, own.height)
            there = np.frombuffer(texture.read(alignment=1), np.uint8).reshape(pixels.shape)
            np.testing.assert_array_equal(there, pixels)
            filled += int((pixels[..., 3] > 0).sum())
    return filled


def test_letters_are_on_the_gpu_as_soon_as_they_are_drawn(viewer, renderer):
    """A few at a time, then so many that ImGui takes a larger texture."""
    run_frames(viewer, 2)
    before = same_letters(renderer)
    sizes = [max(t.height for t in imgui.get_platform_io().textures)]
    for first, last in ((0x100, 0x110), (0x110, 0x180), (0x391, 0x3C0), (0x410, 0x450)):
        for _ in range(2):  # said, and then seen
            viewer.state.say(" ".join(map(chr, range(first, last))))
            run_frames(viewer, 1)
        after = same_letters(renderer)
        assert after > before
        before = after
    for size in (1.5, 2.0, 3.0):
        viewer.window.text_size = size
        run_frames(viewer, 2)
        assert same_letters(renderer) > 0
        sizes.append(max(t.height for t in imgui.get_platform_io().textures))
    assert max(sizes) > sizes[0]
    viewer.window.text_size = None
    run_frames(viewer, 2)


def test_textures_that_imgui_has_done_with_are_released(viewer, renderer):
    """Many sizes of type, one after another: only the textures of the last are left."""
    for size in np.linspace(1, 3, 12).tolist():
        viewer.window.text_size = size
        run_frames(viewer, 3)
    own = [t.tex_id for t in imgui.get_platform_io().textures if t.tex_id]
    assert len(own) <= 2 and set(own) <= renderer.textures.keys()
    assert len(renderer.textures) <= len(own) + len(viewer.window.textures)
    viewer.window.text_size = None
    run_frames(viewer, 2)
