"""What is done with what opened: described, decoded, and a part of it drawn at 16x16."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import AnchorModel, Finding, ScaffoldModel, SplatLayers
from shapeshift.runtime_models.read_scene import describe
from shapeshift.scene.cameras.camera_list import CameraList
from shapeshift.scene.cameras.framing import framing_view, model_points
from shapeshift.scene.scene import Scene, SceneObject

SIZE = (16, 16)


@dataclass
class Then:
    """Looks at every model, and draws those that it shall."""

    renderer: Renderer
    opened: int = 0
    drawn: int = 0

    def __call__(self, model: object, path: Path, draw: bool) -> None:
        self.opened += 1
        if isinstance(model, CameraList):
            assert model.views and len(model.views) == len(model.names)
        if not isinstance(model, AnchorModel | SplatLayers | ScaffoldModel):
            return
        describe(model, path)
        assert all(isinstance(finding, Finding) for finding in model.findings)
        assert model.splat_count > 0 and model.stops
        if isinstance(model, SplatLayers):
            check_layers(model)
        if draw:
            self.draw(model)

    def draw(self, model: AnchorModel | SplatLayers | ScaffoldModel) -> None:
        """Pixels are numbers and in range, whatever the file said."""
        x = model.stops[-1].x
        self.renderer.update(Scene((SceneObject("fuzzed", model, x=x),)))
        self.renderer.draw([framing_view(*model_points(model), SIZE)])
        picture = self.renderer.resolved(0)
        assert np.isfinite(picture).all(), "the picture holds NaN or Inf"
        self.drawn += 1


def check_layers(model: SplatLayers) -> None:
    """What every reader promises of plain splats."""
    assert np.isfinite(model.means).all()
    assert not np.isnan(model.scales).any() and (model.scales >= 0).all()
    assert (model.opacity >= 0).all() and (model.opacity <= 1).all()
    assert np.isfinite(model.sh).all()
    np.testing.assert_allclose(np.linalg.norm(model.wxyz, axis=1), 1, atol=1e-3)
    assert model.mode in ("cumulative", "exclusive")
    assert model.layer.min() >= 0 and model.layer.max() < len(model.stops)
    for column in (model.labels, *model.extra.values()):
        assert column is None or len(column) == len(model.means)
