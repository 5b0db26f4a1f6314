"""The columns of splats that move in time, SpacetimeGaussians' (Li et al. 2024): time as x.

Its PLY has, besides 3DGS's columns, motion_0..8 (powers of time, x y z each), trbf_center,
trbf_scale (a logarithm) and omega_0..3, and f_dc are colours from 0 to 1.  What is decoded of them
at a time is in runtime_models/splat_motion.py.
"""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.lint.lint_rows import DROPPED, drop, row_findings
from shapeshift.runtime_models.model import BadFile, Finding, Stop
from shapeshift.runtime_models.splat_motion import SplatMotion
from shapeshift.runtime_models.splats.operations.rotate_splats import rotate_quaternions
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, RawSplats

MOTION = tuple(f"motion_{i}" for i in range(9))
TIMES = ("trbf_center", "trbf_scale")
TURNING = tuple(f"omega_{i}" for i in range(4))
MARKS = ("motion_", "trbf_")  # how columns of splats that move begin
OF_NETWORK = ("f_t_", "f_dc_")  # with f_dc_3 and more: features for a network of colours
FARTHEST = 1e9  # metres from its place, within the recording
WIDTHS = (-69.0, 88.0)  # logarithms that float32 has: seen at its centre alone, and always
BYTES = 60  # a splat, of SplatMotion
TIME_STOPS = (Stop("Start", 0.0, "layer"), Stop("End", 1.0, "layer"))


def with_motion_columns(raw: RawSplats) -> RawSplats:
    """The splats of a file, where they move made ready for `motion_of`; else as they are.

    Raises BadFile for colours that only a network knows, and where no motion is finite.
    """
    moving = [name for name in raw.extra if name.startswith(MARKS)]
    if not moving:
        return raw
    if not {*MOTION, *TIMES} <= raw.extra.keys():
        what = f"columns of splats that move ({', '.join(moving[:3])}, ...), but not all of them"
        done = "shown as they are filed, all times at once"
        found = Finding(what, len(raw.means), done, file=raw.file, repaired=False)
        return replace(raw, findings=(*raw.findings, found))
    if features := [name for name in raw.extra if name.startswith(OF_NETWORK)]:
        raise BadFile(
            f"{raw.file} has features ({features[0]}, ...) of which a network makes the colours, "
            "and a PLY does not hold it; train SpacetimeGaussians' lite model, which has colours."
        )
    raw.memory.charge(2 * BYTES * len(raw.means), f"{len(raw.means):,} splats that move")
    if raw.sh.shape[1] == 1:
        with np.errstate(over="ignore", invalid="ignore"):  # such rows are dropped later
            raw.sh[:] = (raw.sh - 0.5) / np.float32(C0)
    with np.errstate(invalid="ignore"):
        length = np.linalg.norm(raw.wxyz.astype(np.float64), axis=1)
    scale = np.divide(1, length, out=np.zeros_like(length), where=length > 0)
    for name in TURNING:  # of the quaternion that is read, which is made one of length 1
        turning = raw.extra.pop(name, np.zeros(len(scale)))
        with np.errstate(over="ignore", invalid="ignore"):
            raw.extra[name] = (turning * scale).astype(np.float32)
    broken = np.flatnonzero(~sound(raw.extra))
    found_rows = row_findings("a motion that is not finite", broken, DROPPED, raw)
    if len(broken):
        drop(raw, broken)
    if not len(raw.means):
        what = found_rows[0].what
        raise BadFile(f"{raw.file}: not one of {len(broken):,} splats can be drawn, as {what}.")
    return replace(raw, findings=(*raw.findings, *found_rows))


def sound(extra: dict[str, np.ndarray]) -> np.ndarray:
    """(N,) bool: whose motion is finite and ends within FARTHEST, all through the recording."""
    with np.errstate(over="ignore", invalid="ignore"):
        centre = extra["trbf_center"].astype(np.float64)
        longest = np.maximum(np.abs(centre), np.abs(1 - centre))
        away = np.zeros_like(centre)
        for i, name in enumerate(MOTION):
            away += np.abs(extra[name].astype(np.float64)) * longest ** (i // 3 + 1)
        turning = sum(np.abs(extra[name].astype(np.float64)) for name in TURNING)
        known = ~np.isnan(extra["trbf_scale"].astype(np.float64))
    return known & (away <= FARTHEST) & (turning * longest <= FARTHEST)


def motion_of(extra: dict[str, np.ndarray], rotation: np.ndarray) -> SplatMotion | None:
    """Takes the columns out of `extra`; None: there are none.  rotation (3, 3): into our axes."""
    if not {*MOTION, *TIMES, *TURNING} <= extra.keys():
        return None
    table = np.stack([extra.pop(name) for name in MOTION], axis=1).reshape(-1, 3, 3)
    turning = np.stack([extra.pop(name) for name in TURNING], axis=1)
    centre, logs = (extra.pop(name) for name in TIMES)
    width = np.exp(np.clip(logs.astype(np.float32), *WIDTHS))
    return SplatMotion(
        (table @ rotation.T).astype(np.float32), rotate_quaternions(turning, rotation),
        centre.astype(np.float32), width,
    )  # fmt: skip


def held_still(splats: PlainSplats, time: float) -> PlainSplats:
    """The splats at a time from 0 to 1, where they move; else as they are."""
    if splats.motion is None:
        return splats
    means, wxyz, opacity = splats.motion.at(splats.means, splats.wxyz, splats.opacity, time)
    wxyz /= np.linalg.norm(wxyz, axis=1, keepdims=True)
    found = Finding(
        f"{len(means):,} splats that move in time", len(means),
        f"shown still, at time {time:g} of 0 to 1, as one of several files", repaired=False,
    )  # fmt: skip
    return replace(
        splats, means=means, wxyz=wxyz, opacity=opacity, motion=None,
        findings=(*splats.findings, found),
    )  # fmt: skip
