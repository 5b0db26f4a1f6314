"""What sections leave of splats: their opacity, and where one is capped their place and shape.

One function for all drawings: both read the splats that it writes, so both show the same cut.

A capped edge truncates each Gaussian at the plane and takes the Gaussian with the truncated one's
mass, mean and covariance for it.  With s the deviation along the normal n, a = (d - n.mu) / s the
sigmas inside, and lambda = phi(a) / Phi(a) of the standard normal distribution, the truncated one
lies lambda sigmas further inside and has the variance s^2 (1 - a lambda - lambda^2) along n
(Johnson, Kotz and Balakrishnan 1994, section 13.10).  Along all that is independent of n, in the
Gaussian's own metric, it keeps its shape.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.scene.sections.section import CAPPED, SOFT, SceneSection

CAP_SIGMAS = 4.0  # farther from a plane than this a splat is left to the bit, or gone
LEAST_KEPT = 1e-3  # of a splat's mass: below it nothing of it is drawn (the rule ends at 1/255)


@dataclass(frozen=True)
class ObjectCut:
    """A section in an object's frame: what a cut depends on, to be compared."""

    planes: tuple[tuple[float, ...], ...]  # (F, 4)
    edge: str
    width_m: float

    @property
    def half_spaces(self) -> np.ndarray:
        return np.array(self.planes)


def cuts_of(sections: Iterable[SceneSection], world_from_object: Pose) -> tuple[ObjectCut, ...]:
    """Of an object that stands so: the enabled sections beyond which nothing is."""
    return tuple(
        ObjectCut(tuple(map(tuple, one.half_spaces_of(world_from_object))), one.edge, one.width_m)
        for one in sections
        if one.enabled and one.beyond is None
    )


def inside_of(half_spaces: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(N,) metres of places (N, 3) inside all of (F, 4), negative outside: to the nearest plane."""
    inside = np.full(len(places), np.inf, np.float32)
    for *normal, offset in half_spaces:
        along = places @ np.asarray(normal, np.float32)
        np.minimum(inside, np.float32(offset) - along, out=inside)  # NaN stays
    return inside


def kept_by(half_spaces: np.ndarray, edge: str, width_m: float, places: np.ndarray) -> np.ndarray:
    """(N,) float32 0..1: how much is left at places (N, 3), by the place alone.

    1 inside and 0 outside; of a soft edge smoothly 0 at the shape and 1 from width_m inside on.
    """
    inside = inside_of(half_spaces, places)
    if edge != SOFT:
        return (inside >= 0).astype(np.float32)
    part = np.clip(inside / np.float32(width_m), 0, 1)
    return np.where(inside > 0, part * part * (3 - 2 * part), 0).astype(np.float32)


def moves_splats(cuts: Iterable[ObjectCut]) -> bool:
    """Whether more than opacities changes."""
    return any(cut.edge == CAPPED for cut in cuts)


def cut_splats(
    mean_opacity: np.ndarray, covariance: np.ndarray, cuts: Iterable[ObjectCut]
) -> tuple[np.ndarray, np.ndarray]:
    """Splats (N, 4) and (N, 8: xx xy xz yy yz zz 0 0) of an object, cut; what no section meets is
    the same to the bit.  An opacity of 0 is an absent splat.
    """
    cuts = list(cuts)
    mean_opacity = mean_opacity.copy()
    opacity = mean_opacity[:, 3]
    for cut in cuts:
        if cut.edge != CAPPED:
            kept = kept_by(cut.half_spaces, cut.edge, cut.width_m, mean_opacity[:, :3])
            opacity[:] = np.where(kept > 0, opacity * kept, np.minimum(opacity, 0))
    if moves_splats(cuts):
        covariance = covariance.copy()
        for cut in cuts:
            for plane in cut.half_spaces if cut.edge == CAPPED else ():
                _cap(mean_opacity, covariance, plane)
    return mean_opacity, covariance


def _cap(mean_opacity: np.ndarray, covariance: np.ndarray, plane: np.ndarray) -> None:
    """Cuts splats at one plane (4,), in place."""
    normal, offset = plane[:3].astype(np.float32), np.float32(plane[3])
    inside = offset - mean_opacity[:, :3] @ normal  # (N,) metres
    there = mean_opacity[:, 3] > 0
    # The trace is at least the variance along any direction: most splats are far from the plane.
    trace = covariance[:, 0] + covariance[:, 3] + covariance[:, 5]
    reach = np.float32(CAP_SIGMAS) * np.sqrt(trace)
    whole = inside >= reach
    gone = there & ~whole & ~(inside > -reach)  # NaN too
    mean_opacity[gone, 3] = 0
    rows = np.flatnonzero(there & ~whole & ~gone)
    if not len(rows):
        return
    # Sigma n and s, in float64: thin splats lie in the plane with s near 0.
    c = covariance[rows, :6].astype(np.float64)
    n = plane[:3] / np.linalg.norm(plane[:3])
    shift = np.column_stack([
        c[:, 0] * n[0] + c[:, 1] * n[1] + c[:, 2] * n[2],
        c[:, 1] * n[0] + c[:, 3] * n[1] + c[:, 4] * n[2],
        c[:, 2] * n[0] + c[:, 4] * n[1] + c[:, 5] * n[2],
    ])  # fmt: skip
    deviation = np.sqrt(np.maximum(shift @ n, 1e-24))
    sigmas = inside[rows] / deviation
    near = np.abs(sigmas) < CAP_SIGMAS
    mean_opacity[rows[~near & ~(sigmas > 0)], 3] = 0
    rows, shift, deviation, sigmas = rows[near], shift[near], deviation[near], sigmas[near]
    mass, hazard = _mass_and_hazard(sigmas)
    narrower = np.clip(sigmas * hazard + hazard * hazard, 0, 1)  # of the variance along n
    unit = shift / deviation[:, None]  # (R, 3): a sigma of the splat towards the plane
    mean_opacity[rows, :3] -= (hazard[:, None] * unit).astype(np.float32)
    pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    less = np.stack([unit[:, i] * unit[:, j] for i, j in pairs], axis=1) * narrower[:, None]
    covariance[rows, :6] = covariance[rows, :6] - less
    mean_opacity[rows, 3] *= np.where(mass >= LEAST_KEPT, mass, 0).astype(np.float32)


def _mass_and_hazard(sigmas: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Phi and phi / Phi of the standard normal distribution."""
    from scipy.special import ndtr  # 0.1 s to load, which a scene without sections is spared

    mass = ndtr(sigmas)
    return mass, np.exp(-0.5 * sigmas * sigmas) / (np.sqrt(2 * np.pi) * mass)
