"""The renderer of the tests of OpenGL: either drawing, each in the context of all tests."""

from collections.abc import Iterator

import pytest

from shapeshift.rasterizer.device import NoDevice
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.renderer import Renderer


@pytest.fixture(scope="module", params=["quads", "tiles"])
def renderer(request, session_gpu: Gpu) -> Iterator[Renderer]:
    """One of either drawing with a target of floats; a module may have its own instead."""
    with session_gpu.ctx:
        try:
            with Renderer(session_gpu.ctx, request.param, target="rgba32f") as made:
                yield made
        except NoDevice as reason:
            pytest.skip(str(reason))
