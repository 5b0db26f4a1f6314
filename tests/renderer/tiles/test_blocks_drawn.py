"""A scene in blocks is drawn as one object: both drawings, beside its parts and one network."""

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.blocks.block_model import joined, one_network
from shapeshift.scene.cameras.framing import default_view
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.models import make_random_model

SIZE = (64, 48)


def blocks():
    """Two halves of 80 anchors, of two trainings."""
    models = [make_random_model(160, 3, seed, features=8) for seed in (0, 1)]
    sides = [model.anchors[:, 0] >= 0 for model in models]
    parts = [models[0].with_anchors(~sides[0]), models[1].with_anchors(sides[1])]
    return parts, joined(parts, ["0", "1"])


def picture(renderer, models, x):
    objects = tuple(SceneObject(str(n), model, x=x) for n, model in enumerate(models))
    renderer.update(Scene(objects))
    renderer.draw([default_view(blocks()[1], SIZE)])
    return renderer.resolved().copy()


@pytest.mark.parametrize(
    "options",
    [
        {"drawing": "tiles"}, {"drawing": "tiles", "mlps": "onnxruntime"},
        {"drawing": "quads", "mlps": "gl"}, {"drawing": "quads", "mlps": "onnxruntime"},
    ],
)  # fmt: skip
def test_both_drawings_show_the_blocks_in_one_sort(ctx, options):
    """The parts as two objects are sorted together, too: the very same splats in one order."""
    parts, whole = blocks()
    with Renderer(ctx, **options) as renderer:
        for x in (0.0, 0.4, 1.0):
            together = picture(renderer, [whole], x)
            assert together.std() > 0.05  # something is drawn
            for others in (parts, [one_network(whole)]):
                assert np.abs(together - picture(renderer, others, x)).max() <= 2 / 255
