"""What a file of splats keeps of the splats written into it."""

from dataclasses import replace

import numpy as np

from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.scene.cameras.framing import frame_points, orbit_path
from shapeshift.scene.metrics import psnr
from shapeshift.scene.scene import Scene, SceneObject

SIZE = (240, 160)


def rows(splats: PlainSplats, part: slice) -> PlainSplats:
    names = ("means", "scales", "wxyz", "opacity", "sh")
    return replace(splats, **{name: getattr(splats, name)[part].copy() for name in names}, extra={})


def drawn(renderer: Renderer, splats: PlainSplats, views: list) -> list[np.ndarray]:
    means = (splats.means + np.array(splats.origin)).astype(np.float32)
    arrays = (means, splats.scales, splats.wxyz, splats.opacity, splats.sh)
    model = SplatLayers(*arrays, np.zeros(len(means), np.int32), (Stop("only", 0.0),))
    renderer.update(Scene((SceneObject("splats", model),)))
    pictures = []
    for view in views:
        renderer.draw([view])
        pictures.append(renderer.resolved(0).copy())
    return pictures


def compare(renderer: Renderer, one: PlainSplats, other: PlainSplats) -> float:
    """The worst of three pictures from all around, dB."""
    views = orbit_path(3, *frame_points(one.means, one.opacity), SIZE)
    pairs = zip(drawn(renderer, one, views), drawn(renderer, other, views), strict=True)
    return min(psnr(a, b) for a, b in pairs)
