"""Growing and pruning of anchors, simple form: where splats pull at the picture, a new anchor."""

from dataclasses import dataclass

import numpy as np

from training.networks import KERNELS, HeadLayout

LEVELS = ((1.0, 1.0), (0.5, 2.0))  # (voxels of the grid, times the threshold)
LEAST_VIEWS = 10  # steps in which a splat must have been on screen to count
LEAST_STEPS = 50  # before an anchor can be given up
AXIS_BITS = 21  # of a grid key


class Evidence:
    """Sums over the steps since the last change: screen gradients and opacities."""

    def __init__(self, device, layout: HeadLayout, anchors_count: int) -> None:
        self.device, self.count = device, anchors_count
        kernels = device.program(KERNELS / "density.cl", SPLATS=layout.splats)
        self.kernel = kernels["accumulate"]
        self.gradient = device.zeros((anchors_count * layout.splats, 2))
        self.opacity = device.zeros(anchors_count)
        self.steps = 0

    def add(self, record, grad_record, opacity, width: int) -> None:
        self.steps += 1
        self.device.launch(
            self.kernel, self.count, 16, self.count, width / 2,
            record, grad_record, opacity, self.gradient, self.opacity,
        )  # fmt: skip

    def state(self) -> dict[str, np.ndarray]:
        return {
            "evidence.gradient": self.device.download(self.gradient),
            "evidence.opacity": self.device.download(self.opacity),
            "evidence.steps": np.array(self.steps),
        }

    def load(self, state: dict[str, np.ndarray]) -> None:
        self.gradient = self.device.upload(state["evidence.gradient"])
        self.opacity = self.device.upload(state["evidence.opacity"])
        self.steps = int(state["evidence.steps"])


@dataclass(frozen=True)
class Newcomers:
    anchors: np.ndarray  # (M, 3) float32 metres
    parents: np.ndarray  # (M,) anchor whose feature each one copies


def grid_keys(points: np.ndarray, cell: float, origin: np.ndarray) -> np.ndarray:
    """(P,) int64, one number a grid cell; origin lies below all points."""
    cells = np.round((points - origin) / cell).astype(np.int64)
    if cells.size and not cells.max() < 1 << AXIS_BITS:
        raise ValueError(f"the scene is wider than {1 << AXIS_BITS} cells of {cell:.3g} m")
    return (cells[:, 0] << 2 * AXIS_BITS) | (cells[:, 1] << AXIS_BITS) | cells[:, 2]


def newcomers(
    anchors: np.ndarray,  # (A, 3)
    means: list[np.ndarray],  # (A * k, 3) metres, for every stop
    gradient: np.ndarray,  # (A * k, 2) of Evidence
    voxel: float,
    threshold: float,
    room: int,
) -> Newcomers:
    """New anchors at free grid cells under splats with a large screen gradient, largest first."""
    pull = gradient[:, 0] / np.maximum(gradient[:, 1], 1)
    splats_per_anchor = len(gradient) // max(len(anchors), 1)
    finite = np.logical_and.reduce([np.isfinite(m).all(1) for m in means])
    eligible = (gradient[:, 1] > LEAST_VIEWS) & finite
    found, parents = np.zeros((0, 3), np.float32), np.zeros(0, np.int64)
    for mean in means:
        for level, times in LEVELS:
            candidates = np.flatnonzero(eligible & (pull > threshold * times))
            if not len(candidates) or room <= len(found):
                continue
            cell = voxel * level
            taken = np.concatenate([anchors, found])
            # a multiple of the voxel, so that the nodes coincide with those of the first grid
            low = np.minimum(mean[candidates].min(0), taken.min(0))
            origin = (np.floor(low / voxel) - 1) * voxel
            keys, first = np.unique(grid_keys(mean[candidates], cell, origin), return_index=True)
            free = first[~np.isin(keys, grid_keys(taken, cell, origin))]
            free = free[np.argsort(-pull[candidates[free]], kind="stable")][: room - len(found)]
            chosen = candidates[free]
            nodes = origin + np.round((mean[chosen] - origin) / cell) * cell
            found = np.concatenate([found, nodes.astype(np.float32)])
            parents = np.concatenate([parents, chosen // splats_per_anchor])
    return Newcomers(found, parents)


def given_up(opacity_sum: np.ndarray, steps: int, splats_per_anchor: int, least: float):
    """(A,) bool: anchors whose splats stayed below a mean opacity of `least` in every modality."""
    if steps < LEAST_STEPS:
        return np.zeros(len(opacity_sum), bool)
    return opacity_sum < least * steps * splats_per_anchor


def changed_state(
    state: dict[str, np.ndarray], keep: np.ndarray, new: Newcomers
) -> dict[str, np.ndarray]:
    """An optimiser's state with some anchors gone and others added at the end, at rest."""
    out = dict(state)
    added = {"anchors": new.anchors, "features": state["features.value"][new.parents]}
    for name, rows in added.items():
        for part in ("value", "mean", "square"):
            old = state[f"{name}.{part}"][keep]
            fresh = rows if part == "value" else np.zeros_like(rows)
            out[f"{name}.{part}"] = np.concatenate([old, fresh]).astype(np.float32)
    return out
