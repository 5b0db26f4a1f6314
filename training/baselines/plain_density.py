"""Growing and pruning of plain splats by the rules of 3DGS (Kerbl et al., 2023, section 5.2).

Where the screen gradient is large, a small splat is cloned and a large one is split in two; what
has become transparent goes.  Unlike there nothing goes for being large, on the screen or in the
world: at the cap, walls of a room went and did not come back (docs/bench/ideas.md).
"""

from dataclasses import dataclass

import numpy as np

from shapeshift.rasterizer.reference import rotations
from shapeshift.scene.pose import View
from shapeshift.training.baselines.plain_settings import PlainSettings
from shapeshift.training.baselines.plain_step import GROUPS

LARGE = 0.01  # of the extent: larger ones are split, not cloned
SMALLER = 1.6  # times: each of two halves
AFTER_RESET = 0.01  # opacity that all are cut to


@dataclass(frozen=True)
class Densification:
    """What a look at the stats decided, of N splats."""

    gone: np.ndarray  # (N,) bool, transparent
    cloned: np.ndarray  # (C,) indices
    split: np.ndarray  # (S,) indices; each becomes two


def extent_of(views: list[View]) -> float:
    """Metres: 1.1 times the farthest camera from the middle of all, as 3DGS measures a scene."""
    eyes = np.array([view.world_from_eye.position for view in views])
    return max(1.1 * float(np.linalg.norm(eyes - eyes.mean(0), axis=1).max()), 1e-6)


def choose_densification(
    state: dict[str, np.ndarray],
    stats: np.ndarray,  # (N, 2) of PlainDensificationStats
    settings: PlainSettings,
    extent: float,
) -> Densification:
    """Which splats go, are cloned or are split; where room is short, the strongest first."""
    largest = np.exp(state["scales.value"].astype(np.float64)).max(axis=1)
    opacity = 1 / (1 + np.exp(-state["opacity.value"].astype(np.float64)))
    gone = ~(opacity >= settings.prune_opacity)  # NaN goes, too
    if gone.all():
        gone[:] = False
    grad2d = stats[:, 0] / np.maximum(stats[:, 1], 1)
    chosen = np.flatnonzero((grad2d >= settings.grow_threshold) & ~gone)
    room = max(settings.max_splats - int((~gone).sum()), 0)
    chosen = chosen[np.argsort(-grad2d[chosen], kind="stable")][:room]
    small = largest[chosen] <= LARGE * extent
    return Densification(gone, np.sort(chosen[small]), np.sort(chosen[~small]))


def split_splats(values: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Two splats for each one: drawn from it as from a distribution, SMALLER times smaller."""
    two = {name: np.repeat(rows, 2, axis=0) for name, rows in values.items()}
    sigma = np.exp(two["scales"].astype(np.float64))
    away = rotations(two["wxyz"].astype(np.float64)) @ rng.normal(0, sigma)[..., None]
    two["means"] = two["means"] + away[..., 0]
    two["scales"] = two["scales"] - np.log(SMALLER)
    return two


def apply_densification(
    state: dict[str, np.ndarray], change: Densification, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """An optimiser's state afterwards: splats that stay keep their moments, new ones have none."""
    values = {name: state[f"{name}.value"] for name in GROUPS}
    keep = ~change.gone
    keep[change.split] = False
    clones = {name: rows[change.cloned] for name, rows in values.items()}
    split = split_splats({name: rows[change.split] for name, rows in values.items()}, rng)
    out = dict(state)
    for name in GROUPS:
        fresh = np.concatenate([clones[name], split[name]]).astype(np.float32)
        out[f"{name}.value"] = np.concatenate([values[name][keep], fresh])
        for part in ("mean", "square"):
            old = state[f"{name}.{part}"][keep]
            out[f"{name}.{part}"] = np.concatenate([old, np.zeros_like(fresh)])
    return out


def reset_opacity(state: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The state with no opacity above AFTER_RESET, and the optimiser's memory of them gone."""
    most = np.float32(np.log(AFTER_RESET / (1 - AFTER_RESET)))
    cut = np.minimum(state["opacity.value"], most)
    nothing = {f"opacity.{part}": np.zeros_like(cut) for part in ("mean", "square")}
    return state | {"opacity.value": cut} | nothing
