"""Splats where the nodes of a scene graph put them, and several sets of them as one."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.runtime_models.rotation import normalize, quaternions_of, rotation_matrices
from shapeshift.runtime_models.splats.operations.rotate_splats import (
    quaternion_of,
    rotate_harmonics,
)
from shapeshift.runtime_models.splats.plain_splats import RawSplats

EVEN = 1e-5  # how much the scales of a node may differ and still be one
BLOCK = 1 << 16  # splats at a time whose shapes are decomposed
MOVING = 96  # bytes a splat without its harmonics while a matrix moves it


def moved(raw: RawSplats, world_from_mesh: np.ndarray) -> RawSplats:
    """The splats (in metres, not logarithms) after a node's matrix (4, 4), whatever it is.

    Places become float64 where the node lies elsewhere: a far one keeps its millimetres.  Raises
    BadFile for a matrix that flattens them.
    """
    if np.array_equal(world_from_mesh, np.eye(4)):
        return raw
    moving = len(raw.means) * (MOVING + 12 * raw.sh.shape[1])
    with raw.memory.lend(moving, f"moving {len(raw.means):,} splats"):
        return after(raw, world_from_mesh)


def instances(raw: RawSplats, worlds: np.ndarray) -> list[RawSplats]:
    """The splats once for each matrix of worlds (K, 4, 4), K at least 1; what was found once.

    Of several, those that flatten them are left out, and said: scenes hide instances so.  Raises
    BadFile where none is left.
    """
    if len(worlds) == 1:
        return [moved(raw, worlds[0])]
    flat = [not is_solid(np.linalg.svd(world[:3, :3], compute_uv=False)) for world in worlds]
    if all(flat):
        raise BadFile(f"{raw.file}: all {len(worlds):,} instances of its splats have no size.")
    count = (len(worlds) - sum(flat)) * len(raw.means)
    raw.memory.charge(count * (MOVING + 12 * raw.sh.shape[1]), f"{count:,} splats in instances")
    if any(flat):
        what = f"{sum(flat):,} of {len(worlds):,} instances have no size"
        found = Finding(what, sum(flat), "left out", file=raw.file, repaired=False)
        raw = replace(raw, findings=(*raw.findings, found))
    rest = replace(raw, findings=())
    solid = [world for world, gone in zip(worlds, flat, strict=True) if not gone]
    return [moved(raw, solid[0]), *(moved(rest, world) for world in solid[1:])]


def is_solid(sizes: np.ndarray) -> bool:
    """Whether a matrix of such singular values, from large to small, leaves a body a body."""
    return bool(sizes[2] > 1e-12 * sizes[0] > 0)


@np.errstate(over="ignore", invalid="ignore")  # numbers that are none are for the judge to find
def after(raw: RawSplats, world_from_mesh: np.ndarray) -> RawSplats:
    linear, offset = world_from_mesh[:3, :3], world_from_mesh[:3, 3]
    left, sizes, right = np.linalg.svd(linear)
    if not is_solid(sizes):
        raise BadFile(f"{raw.file}: a node squeezes its splats to a plane or to nothing.")
    turn = left @ right  # the nearest rotation; a reflection where the matrix mirrors
    raw = replace(raw, means=raw.means @ linear.T + offset)
    if not np.allclose(turn, np.eye(3), atol=1e-7):
        harmonics = rotate_harmonics(turn, raw.sh.shape[1])
        sh = np.einsum("ij,njc->nic", harmonics, raw.sh, optimize=True)
        raw = replace(raw, sh=sh)
    if sizes[0] - sizes[2] <= EVEN * sizes[0] and np.linalg.det(turn) > 0:
        w, x, y, z = quaternion_of(turn)
        times = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
        wxyz = (raw.wxyz @ times.T).astype(np.float32)
        return replace(raw, scales=raw.scales * np.float32(sizes.mean()), wxyz=wxyz)
    scales, wxyz = stretched(raw.scales, raw.wxyz, linear)
    return replace(raw, scales=scales, wxyz=wxyz)


def stretched(
    scales: np.ndarray, wxyz: np.ndarray, linear: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Scales (N, 3) and quaternions (N, 4) of ellipsoids after any linear map (3, 3).

    Sigma' = M C C^T M^T: the singular values and left vectors of M C.
    """
    new_scales, new_wxyz = np.empty_like(scales, np.float32), np.empty_like(wxyz, np.float32)
    for start in range(0, len(scales), BLOCK):
        part = slice(start, start + BLOCK)
        axes = rotation_matrices(normalize(wxyz[part].astype(np.float64)))
        shape = np.nan_to_num(linear @ (axes * scales[part, None, :]), posinf=0, neginf=0)
        left, sizes, _ = np.linalg.svd(shape)
        left[np.linalg.det(left) < 0, :, 2] *= -1  # any sign of an axis is the same ellipsoid
        good = np.isfinite(scales[part]).all(1) & np.isfinite(wxyz[part]).all(1)
        good &= (wxyz[part] != 0).any(1)
        new_scales[part] = np.where(good[:, None], sizes, np.nan)
        new_wxyz[part] = quaternions_of(left)
    return new_scales, new_wxyz


def joined(parts: list[RawSplats], file: str) -> RawSplats:
    """One set of splats of equal codings; those of fewer harmonics get zeros.  Raises BadFile."""
    if len(parts) == 1:
        return parts[0]
    first, count = parts[0], sum(len(part.means) for part in parts)
    width = max(part.sh.shape[1] for part in parts)
    first.memory.charge(count * (56 + 24 * width), f"{count:,} splats in one")
    sh = [np.pad(p.sh, ((0, 0), (0, width - p.sh.shape[1]), (0, 0))) for p in parts]
    return replace(
        first,
        means=np.concatenate([part.means for part in parts]),
        scales=np.concatenate([part.scales for part in parts]),
        wxyz=np.concatenate([part.wxyz for part in parts]),
        opacity=np.concatenate([part.opacity for part in parts]),
        sh=np.concatenate(sh),
        file=file,
        format=" + ".join(sorted({part.format for part in parts})),
        axes=" / ".join(dict.fromkeys(part.axes for part in parts if part.axes)),
        antialiased=any(part.antialiased for part in parts),
        findings=tuple(finding for part in parts for finding in part.findings),
    )
