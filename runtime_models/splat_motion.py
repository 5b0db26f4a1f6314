"""How splats move, turn and fade with time: SpacetimeGaussians (Li et al. 2024, section 4.1)."""

from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.shapes import check


@dataclass(frozen=True)
class SplatMotion:
    """With dt = time - centre a splat stands at its place + path[0] dt + path[1] dt^2 +
    path[2] dt^3, is turned by its quaternion + turning dt, and is as opaque as
    exp(-(dt / width)^2) of its opacity.
    """

    path: np.ndarray  # (N, 3, 3) float32 metres by power of dt, then axis
    turning: np.ndarray  # (N, 4) float32, wxyz of a unit of time, of a unit quaternion
    centre: np.ndarray  # (N,) float32; a recording lasts from 0 to 1
    width: np.ndarray  # (N,) float32 above 0

    def __post_init__(self) -> None:
        check(
            path=(self.path, "N 3 3"), turning=(self.turning, "N 4"),
            centre=(self.centre, "N"), width=(self.width, "N"),
        )  # fmt: skip

    def at(
        self, means: np.ndarray, wxyz: np.ndarray, opacity: np.ndarray, time: float | np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Means (N, 3), quaternions (N, 4) of any length above 0, opacities (N,) at a time, one for
        all or (N,) each its own.
        """
        since = np.asarray(time, np.float32) - self.centre
        column = since[:, None]
        path = self.path
        # Horner: one product a power, and no power of a small number on its own.
        moved = means + column * (path[:, 0] + column * (path[:, 1] + column * path[:, 2]))
        turned = wxyz + column * self.turning
        turned[~(np.abs(turned).max(axis=1, initial=0) > 0)] = (1, 0, 0, 0)
        with np.errstate(over="ignore", under="ignore"):
            seen = np.exp(-np.square(since / self.width))
        return moved, turned, opacity * seen

    def with_rows(self, rows: np.ndarray | slice) -> "SplatMotion":
        """Of these splats alone, in their order."""
        return SplatMotion(
            np.ascontiguousarray(self.path[rows]), np.ascontiguousarray(self.turning[rows]),
            np.ascontiguousarray(self.centre[rows]), np.ascontiguousarray(self.width[rows]),
        )  # fmt: skip
