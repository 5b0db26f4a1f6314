"""Splats that move in time, drawn: every moment is the picture of what stands there then."""

import numpy as np
import pytest

from shapeshift.runtime_models.bake import bake
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.layers.read_layers import join_layers
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.stop import Stop
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.splat_scenes import front_view
from tests.support.splats.ply_files import names_of, random_rows, write_rows

RENDERERS = EITHER_ON_GL
COLUMNS = [
    *names_of(1), "trbf_center", "trbf_scale", *(f"motion_{i}" for i in range(9)),
    *(f"omega_{i}" for i in range(4)),
]  # fmt: skip


@pytest.fixture(scope="module")
def moving(tmp_path_factory):
    rng = np.random.default_rng(5)
    rows = random_rows(150, COLUMNS)
    for row in rows:
        row.update(zip("xyz", (0.5 * rng.normal(size=3)).tolist(), strict=True))
        row.update({f"scale_{i}": -2.5 + 0.4 * float(rng.normal()) for i in range(3)})
        row.update({f"f_dc_{i}": float(rng.random()) for i in range(3)})
        row.update(trbf_center=float(rng.random()), trbf_scale=float(rng.uniform(-2, 0)))
        row.update(opacity=2.0)
    return read_model(write_rows(tmp_path_factory.mktemp("m") / "a.ply", rows), Reading())


def test_a_moment_is_the_picture_of_splats_that_stand_so(renderer, moving):
    """The oracle: the moment as plain splats without any motion; x forth and back."""
    view, pictures = front_view((96, 72)), {}
    for x in (0.0, 0.4, 1.0, 0.4):
        renderer.update(Scene((SceneObject("a", moving, x=x),)))
        renderer.draw([view])
        shown = renderer.image(0).copy()
        still = join_layers([bake(moving, x)], (Stop("a", 0.0, "layer"),), "", ["a"])
        renderer.update(Scene((SceneObject("b", still),)))
        renderer.draw([view])
        np.testing.assert_allclose(shown, renderer.image(0), atol=2e-3)
        pictures.setdefault(x, shown)
        assert np.array_equal(pictures[x], shown)
    assert np.abs(pictures[0.0] - pictures[0.4]).mean() > 0.01
    assert np.abs(pictures[1.0] - pictures[0.4]).mean() > 0.01
