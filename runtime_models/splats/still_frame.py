"""Splats that move (SpacetimeGaussians, Li et al. 2024), held still at one time.

Its PLY has, besides 3DGS's columns, motion_0..8, trbf_center, trbf_scale and omega_0..3.  With
dt = t - trbf_center (its section 4.1) a splat is at place + motion_0..2 dt + motion_3..5 dt^2 +
motion_6..8 dt^3, its quaternion + omega dt, its opacity times exp(-(dt / exp(trbf_scale))^2).
f_dc are colours from 0 to 1.
"""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.model import Finding
from shapeshift.runtime_models.splats.plain_splats import RawSplats

MOTION = tuple(f"motion_{i}" for i in range(9))
TIMES = ("trbf_center", "trbf_scale")
TURNING = tuple(f"omega_{i}" for i in range(4))
MARKS = ("motion_", "trbf_")  # how columns of splats that move begin


def still(raw: RawSplats, time: float) -> RawSplats:
    """The splats at a time from 0 to 1, where they move; else as they are.

    The columns of their motion go: what is exported does not move.
    """
    moving = [name for name in raw.extra if name.startswith(MARKS)]
    if not moving:
        return raw
    if not {*MOTION, *TIMES} <= raw.extra.keys():
        what = f"columns of splats that move ({', '.join(moving[:3])}, ...), but not all of them"
        done = "shown as they are filed, all times at once"
        found = Finding(what, len(raw.means), done, file=raw.file, repaired=False)
        return replace(raw, findings=(*raw.findings, found))
    raw.memory.charge(64 * len(raw.means), f"{len(raw.means):,} splats at one time")
    columns = {name: raw.extra.pop(name) for name in (*MOTION, *TIMES)}
    turning = {name: raw.extra.pop(name) for name in TURNING if name in raw.extra}
    others = [n for n in raw.extra if n.startswith(("f_t_", "f_dc_"))]  # of its network of colours
    for name in others:
        del raw.extra[name]
    with np.errstate(all="ignore"):  # what is not finite is for the judge
        since = np.float32(time) - columns["trbf_center"].astype(np.float32)  # (N,)
        for power in (1, 2, 3):
            for axis in range(3):
                raw.means[:, axis] += columns[MOTION[3 * (power - 1) + axis]] * since**power
        for i, name in enumerate(TURNING):
            if name in turning:
                raw.wxyz[:, i] += turning[name] * since
        shown = np.exp(-np.square(since / np.exp(columns["trbf_scale"].astype(np.float32))))
        opacity = shown / (1 + np.exp(-raw.opacity))
        if raw.sh.shape[1] == 1:
            raw.sh[:] = (raw.sh - 0.5) / np.float32(C0)
    what = f"{len(raw.means):,} splats that move in time"
    more = ", without its network of colours" if others else ""
    done = f"shown still, at time {time:g} of 0 to 1{more}"
    found = Finding(what, len(raw.means), done, file=raw.file, repaired=False)
    return replace(raw, opacity=opacity, logits=False, findings=(*raw.findings, found))
