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
        check(vertices=(self.vertices, "V 3"))
        if self.faces.ndim != 2 or self.faces.shape[1] != 3 or self.faces.dtype != np.int32:
            raise ValueError(
                f"a mesh has faces {self.faces.shape} {self.faces.dtype}; (F, 3) int32 is wanted."
            )
        if self.faces.size and not 0 <= self.faces.min() <= self.faces.max() < len(self.vertices):
            raise ValueError(
                f"a mesh has faces of vertices {self.faces.min()} to {self.faces.max()}; there are "
                f"{len(self.vertices)} vertices, counted from 0."
            )
