"""A plain triangle mesh: what colliders are made of and what a debug view draws of them."""

from dataclasses import dataclass

import numpy as np

from runtime_models.shapes import check


@dataclass(frozen=True)
class TriangleMesh:
    vertices: np.ndarray  # (V, 3) float32 metres, object frame
    faces: np.ndarray  # (F, 3) int32 rows of vertices, anticlockwise seen from outside

    def __post_init__(self) -> None:
        """Refuses what is no mesh: ValueError with a sentence."""
        check(vertices=(self.vertices, "V 3"), faces=(self.faces, "F 3"))
        if not np.isfinite(self.vertices).all():
            raise ValueError("a mesh has vertices that are NaN or Inf; finite metres are wanted.")
        if self.faces.size and not 0 <= self.faces.min() <= self.faces.max() < len(self.vertices):
            raise ValueError(
                f"a mesh has faces of vertices {self.faces.min()} to {self.faces.max()}; there are "
                f"{len(self.vertices)} vertices, counted from 0."
            )
