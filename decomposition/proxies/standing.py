"""The mesh around what photos show of an object, cut where it stood.

Splats reach 5 to 25 mm below the plane that carried the object: needles, and what no photo shows.
A body made of them begins inside the table and is thrown out of it.
"""

from collections.abc import Sequence

import numpy as np

from shapeshift.decomposition.completion.plane import Plane
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import AnchorModel, BadFile
from shapeshift.scene.colliders.collider import Making, mesh_of_splats
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh

LEAST_EVIDENCE = 0.5  # pixels of an anchor's own object, summed over the views, to be touched
LEAST_OPACITY = 0.05
# Of the longest side: corners so little above the lowest lie on the plane.  A spanner of 15 pieces
# whose bases differ by .9 mm creeps 4 mm a second; on one plane it sleeps.
SNAP = 0.0125
FEWEST = 30  # splats: with fewer the rules above leave too little


def standing_mesh(
    part: AnchorModel,
    x: float,
    evidence: np.ndarray | None = None,
    plane: Plane | None = None,
    making: Making | None = None,
) -> TriangleMesh:
    """The watertight mesh of an object, in the part's own frame.  Raises BadFile.

    evidence (A,): pixels that show each of its anchors as this object, None: not known.  plane: on
    which it stood, in the same frame; nothing lies below, and what is near above lies on it.
    """
    columns = [np.asarray(each) for each in Evaluator(part).geometry(x)]
    use = columns[3] > LEAST_OPACITY
    if evidence is not None:
        use &= np.repeat(evidence > LEAST_EVIDENCE, part.splats_per_anchor)
    if plane is not None:
        use &= plane.height(columns[0].astype(np.float64)) > 0
    if use.sum() < FEWEST:
        raise BadFile(
            f"photos show {int(use.sum())} splats of it above the plane that it stood on, of "
            f"{len(use)}; {FEWEST} are wanted: mark it in more photos, or name a mesh file."
        )
    means, scales, wxyz, opacity = (column[use] for column in columns)
    mesh = mesh_of_splats(means, scales, wxyz, opacity, making or Making(kept=False))
    if plane is None:
        return mesh
    return TriangleMesh(pressed([mesh.vertices], plane)[0], mesh.faces)


def pressed(pieces: Sequence[np.ndarray], plane: Plane) -> list[np.ndarray]:
    """Corners (V, 3) float32 of pieces of one object that stands on the plane.

    What lies below, and what hardly lies above the lowest, is moved onto the plane: the object
    touches it with all of its base, and does not fall the last millimetres.
    """
    corners = np.concatenate(pieces)
    longest = float(np.ptp(corners, axis=0).max())
    heights = [plane.height(piece.astype(np.float64)) for piece in pieces]
    base = max(float(np.concatenate(heights).min()), 0.0) + SNAP * longest
    out = []
    for piece, height in zip(pieces, heights, strict=True):
        down = np.where(height < base, height, 0.0)[:, None] * plane.normal
        out.append((piece - down).astype(np.float32))
    return out
