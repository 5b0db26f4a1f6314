"""Growing and pruning of anchors: what is known of every splat, and what follows from it."""

from dataclasses import dataclass

import numpy as np

from shapeshift.training.density.density_strategy import STRATEGIES, Strategy
from shapeshift.training.heads.networks import KERNELS, HeadLayout

GRIDS = 2  # that newcomers fill: of a voxel, half a voxel at twice the threshold, a quarter ...
LEAST_VIEWS = 10  # steps in which a splat must have been on screen to count
LEAST_STEPS = 50  # before an anchor can be given up
AXIS_BITS = 21  # of a grid key


@dataclass(frozen=True)
class Watch:
    """What Evidence sums up."""

    strategy: Strategy = STRATEGIES["gradient"]
    stops: int = 1  # modalities, which take turns
    each: bool = False  # pulls apart for every stop: a newcomer stands where that stop needs it
    seen: bool = False  # what anchors give to pictures of every stop, too


class Evidence:
    """Sums over the steps since the last change.  `stop` says whose step is the next one."""

    def __init__(
        self, device, layout: HeadLayout, anchors_count: int, watch: Watch | None = None
    ) -> None:
        self.device, self.count, self.watch = device, anchors_count, watch or Watch()
        self.stop = 0
        defines = {"SPLATS": layout.splats, "PULL": self.watch.strategy.pull}
        defines |= {"SEEN": 1} if self.watch.seen else {}
        kernels = device.program(KERNELS / "density.cl", **defines)
        self.kernel, self.error_kernel = kernels["accumulate"], kernels["error_map"]
        groups, seen = self.groups, self.watch.stops if self.watch.seen else 0
        self.gradient = [device.zeros((anchors_count * layout.splats, 2)) for _ in range(groups)]
        self.opacity = device.zeros(anchors_count)
        self.seen = [device.zeros((anchors_count, 2)) for _ in range(seen)]
        self.steps, self.stop_steps = 0, [0] * self.watch.stops

    @property
    def groups(self) -> int:
        """How many pulls a splat has."""
        return self.watch.stops if self.watch.each else 1

    def asks(self, image, target) -> dict[str, object]:
        """What rasterize_backward has to sum up beside the gradients, its arguments.

        image: (3, H, W) drawn, target: a losses.Target; both on the device.
        """
        wanted = {"absolute": self.watch.strategy.pull == 1, "weight": self.watch.seen}
        if self.watch.strategy.pull == 2:
            width, height = target.size
            error, masked = self.device.empty((height, width)), int(target.weight is not None)
            self.device.launch(
                self.error_kernel, height, 1, width, height, target.planes.shape[2], masked,
                image, target.planes, target.weight if masked else error, error,
            )  # fmt: skip
            wanted["error"] = error
        return wanted

    def add(self, record, grad_record, opacity, size: tuple[int, int]) -> None:
        """A step: records (N, 12) and gradients by them, opacities (N,), pixels of the picture."""
        self.steps += 1
        self.stop_steps[self.stop] += 1
        width, height = size
        unit = 1 / (width * height) if self.watch.strategy.pull == 2 else width / 2
        self.device.launch(
            self.kernel, self.count, 16, self.count, unit, record, grad_record, opacity,
            self.gradient[self.stop if self.watch.each else 0], self.opacity,
            *(self.seen[self.stop : self.stop + 1]),
        )  # fmt: skip

    def state(self) -> dict[str, np.ndarray]:
        """gradient (groups * N, 2), opacity (A,), steps; seen (stops, A, 2) where it is watched."""
        out = {
            "evidence.gradient": np.concatenate([self.device.download(g) for g in self.gradient]),
            "evidence.opacity": self.device.download(self.opacity),
            "evidence.steps": np.array(self.steps),
        }
        if self.watch.seen:
            out["evidence.seen"] = np.stack([self.device.download(s) for s in self.seen])
            out["evidence.stop_steps"] = np.array(self.stop_steps)
        return out

    def load(self, state: dict[str, np.ndarray]) -> None:
        parts = np.split(state["evidence.gradient"], self.groups)
        self.gradient = [self.device.upload(np.ascontiguousarray(p)) for p in parts]
        self.opacity = self.device.upload(state["evidence.opacity"])
        self.steps = int(state["evidence.steps"])
        if self.watch.seen:
            self.seen = [self.device.upload(s) for s in state["evidence.seen"]]
            self.stop_steps = state["evidence.stop_steps"].tolist()


@dataclass(frozen=True)
class Newcomers:
    anchors: np.ndarray  # (M, 3) float32 metres
    parents: np.ndarray  # (M,) anchor whose feature each one copies
    pull: np.ndarray | None = None  # (M,) in thresholds

    def at_most(self, room: int, by_pull: bool) -> "Newcomers":
        """The first `room` of them, or as many with the largest pull, in the same order."""
        kept = np.arange(len(self.anchors))
        if by_pull:
            kept = np.argsort(-self.pull, kind="stable")
        kept = np.sort(kept[: max(room, 0)])
        return Newcomers(self.anchors[kept], self.parents[kept], self.pull[kept])


def grid_keys(points: np.ndarray, cell: float, origin: np.ndarray) -> np.ndarray:
    """(P,) int64, one number a grid cell; origin lies below all points."""
    cells = np.round((points - origin) / cell).astype(np.int64)
    if cells.size and not cells.max() < 1 << AXIS_BITS:
        raise ValueError(f"the scene is wider than {1 << AXIS_BITS} cells of {cell:.3g} m")
    return (cells[:, 0] << 2 * AXIS_BITS) | (cells[:, 1] << AXIS_BITS) | cells[:, 2]


def pulls(gradient: np.ndarray, relative: bool) -> tuple[np.ndarray, np.ndarray]:
    """(N,) mean pull of a splat over its steps on screen, and (N,) whether these were enough."""
    counts = gradient[:, 1] > LEAST_VIEWS
    pull = gradient[:, 0] / np.maximum(gradient[:, 1], 1)
    if relative:
        mean = pull[counts].mean(dtype=np.float64) if counts.any() else 0.0
        pull = pull / max(float(mean), 1e-30)
    return pull, counts


def newcomers(
    anchors: np.ndarray,  # (A, 3)
    means: list[np.ndarray],  # (A * k, 3) metres, for every stop
    gradients: list[np.ndarray],  # (A * k, 2) of Evidence, for every stop or one for all
    voxel: float,
    threshold: float,
    relative: bool = False,
    grids: int = GRIDS,
) -> Newcomers:
    """New anchors at free cells under splats with a large pull, largest first in each grid."""
    splats_per_anchor = len(gradients[0]) // max(len(anchors), 1)
    finite = np.logical_and.reduce([np.isfinite(m).all(1) for m in means])
    found, parents = np.zeros((0, 3), np.float32), np.zeros(0, np.int64)
    strength = np.zeros(0)
    for stop, mean in enumerate(means):
        pull, counts = pulls(gradients[stop if len(gradients) > 1 else 0], relative)
        eligible = counts & finite
        for times in (2.0**level for level in range(grids)):
            candidates = np.flatnonzero(eligible & (pull > threshold * times))
            if not len(candidates):
                continue
            cell = voxel / times
            taken = np.concatenate([anchors, found])
            # a multiple of the voxel, so that the nodes coincide with those of the first grid
            low = np.minimum(mean[candidates].min(0), taken.min(0))
            origin = (np.floor(low / voxel) - 1) * voxel
            keys, first = np.unique(grid_keys(mean[candidates], cell, origin), return_index=True)
            free = first[~np.isin(keys, grid_keys(taken, cell, origin))]
            free = free[np.argsort(-pull[candidates[free]], kind="stable")]
            chosen = candidates[free]
            nodes = origin + np.round((mean[chosen] - origin) / cell) * cell
            found = np.concatenate([found, nodes.astype(np.float32)])
            parents = np.concatenate([parents, chosen // splats_per_anchor])
            strength = np.concatenate([strength, pull[chosen] / (threshold * times)])
    return Newcomers(found, parents, strength)


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
