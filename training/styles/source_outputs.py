"""What the networks of a model give at one stop before their activation."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.evaluate import directions, looked_along
from shapeshift.runtime_models.model import HEADS, AnchorModel
from shapeshift.runtime_models.network_sessions import FoldedNetwork
from shapeshift.runtime_models.session import BATCH
from shapeshift.training.heads.networks import HeadLayout


class SourceOutputs:
    """Their outputs in rows (A, RAW), laid out as the heads' on the device; colours of one eye."""

    def __init__(self, model: AnchorModel, stop: str, layout: HeadLayout) -> None:
        place = next(each.x for each in model.stops if each.name == stop)
        self.model, self.psi = model, model.psi(place)
        self.rows = np.zeros((len(model.anchors), layout.raw_at[-1]), np.float32)
        columns = zip(layout.raw_at, layout.outs, strict=False)
        self.at: dict[str, tuple] = dict(zip(HEADS, columns, strict=True))
        self.networks = {
            head: FoldedNetwork(
                head, replace(mlp, head="none", clip=None, gain=1.0), model, threads=1
            )
            for head, mlp in model.networks.items()
        }
        self.eye: tuple | None = None
        self.follows_eye = "direction" in model.networks["color"].inputs
        for head in HEADS:
            if head != "color" or not self.follows_eye:
                self.fill(head, {})

    def look_from(self, eye: np.ndarray) -> bool:
        """Colours as seen from `eye` (3,) metres; whether the rows have changed."""
        seen_from = tuple(np.asarray(eye, np.float32).tolist())
        if not self.follows_eye or seen_from == self.eye:
            return False
        self.eye = seen_from
        direction = directions(self.model.anchors, np.array(seen_from))
        self.fill("color", looked_along(self.model, direction))
        return True

    def fill(self, head: str, parts: dict[str, np.ndarray]) -> None:
        """The columns of one head."""
        start, width = self.at[head]
        network, features = self.networks[head], self.model.features
        base = network.feature_part(features)
        for at in range(0, len(features), BATCH):
            rows = slice(at, at + BATCH)
            mine = {"feature": features[rows], "control": self.psi}
            mine |= {part: values[rows] for part, values in parts.items()}
            self.rows[rows, start : start + width] = network.run(
                mine, None if base is None else base[rows]
            )
