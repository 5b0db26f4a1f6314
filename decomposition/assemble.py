"""Cut objects to things that can be grabbed: their proxies, the ground under them, the background
completed where they stood (OWD, sections 3.4 to 3.6).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.decomposition.completion.complete import (
    Completion,
    complete,
    only_background,
)
from shapeshift.decomposition.completion.plane import (
    Plane,
    looks_of,
    support_plane,
)
from shapeshift.decomposition.completion.verify import PhotoView
from shapeshift.decomposition.partition import LabelledView
from shapeshift.decomposition.proxies.ground import (
    ground_mesh,
    seen_depths,
    seen_planes,
)
from shapeshift.decomposition.proxies.silhouettes import SilhouetteScore, score_silhouettes
from shapeshift.rasterizer.device import Device
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import AnchorModel, BadFile
from shapeshift.runtime_models.parts import part_of
from shapeshift.scene.colliders.carve import PhotoSight
from shapeshift.scene.colliders.collider import Collider, Making, collider_of_mesh, mesh_of_splats
from shapeshift.scene.colliders.convex_parts import cut_into_parts, hull_volume
from shapeshift.scene.colliders.cut_apart import apart
from shapeshift.scene.colliders.primitives import SHAPES, collider_of_shape
from shapeshift.scene.colliders.standing import pressed
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh

# Candidates for an object's proxy, and which of them its silhouettes prefer (OWD, section 3.5).

PIECES = "hulls"  # CoACD's: the name of that candidate
LIMIT_S = 120.0  # for CoACD, on a machine that is busy with photos
AS_GOOD = 0.02  # of IoU below the best, at which a candidate of fewer corners is taken
LEAST_RECALL = 0.85  # below, a proxy does not cover its object


@dataclass(frozen=True)
class Proxy:
    name: str
    collider: Collider
    score: SilhouetteScore

    @property
    def corners(self) -> int:
        """Of all pieces: what the physics pays for."""
        return sum(len(part) for part in self.collider.parts)


def candidates_of(
    mesh: TriangleMesh,
    plane: Plane | None,
    making: Making,
    given: Path | None = None,
    cut: bool = True,
) -> dict[str, Collider]:
    """Colliders by name: CoACD's pieces, one hull, the primitives, and a mesh file of the user's.

    mesh: the object's, as standing_mesh() makes it; plane: on which it stands, in the same frame.
    cut: False leaves out the pieces, which take seconds.  Raises BadFile for a mesh file that
    cannot be used.
    """
    found: dict[str, Collider] = {}
    if cut:
        parts, _ = cut_into_parts(mesh, making.most_parts, making.report, LIMIT_S)
        if plane is not None:
            parts = tuple(part for part in pressed(parts, plane) if hull_volume(part) > 0)
        found[PIECES] = Collider(parts, mesh)
    up = (0.0, 1.0, 0.0) if plane is None else plane.normal
    for shape in SHAPES:  # round ones, too, stand on a base: else they roll
        whole = collider_of_shape(mesh, shape, up)
        parts = whole.parts if plane is None else tuple(pressed(whole.parts, plane))
        found[shape] = replace(whole, parts=parts)
    if given is not None:
        found[given.name] = collider_of_mesh(given, making)
    return found


def choose_proxy(
    candidates: dict[str, Collider],
    world_from_part: np.ndarray,
    label: int,
    views: Sequence[LabelledView],
) -> tuple[Proxy, list[Proxy]]:
    """The candidate with the fewest corners of those as good as the best; all, best first.

    A proxy has to cover the object, LEAST_RECALL of it.  The first one where no view shows it.
    """
    scored = [
        Proxy(name, collider, score_silhouettes(collider, world_from_part, label, views))
        for name, collider in candidates.items()
    ]
    if not any(proxy.score.views for proxy in scored):
        return scored[0], scored
    covering = [p for p in scored if p.score.recall >= LEAST_RECALL] or scored
    iou = max(proxy.score.iou for proxy in covering)
    as_good = [p for p in covering if p.score.iou >= iou - AS_GOOD]
    best = min(as_good, key=lambda proxy: proxy.corners)
    return best, sorted(scored, key=lambda proxy: -proxy.score.iou)


BACKGROUND_FACES = 10_000  # of the skin around it
FINEST_PICTURES = 16  # that verify and score: the ones with most of the object
Progress = Callable[[str, float], None]  # what is being done, part done 0..1


@dataclass(frozen=True)
class RowEvidence:
    """Evidence of each anchor, in pixels of all label maps."""

    own: np.ndarray  # (A,) that show it as its own object
    background: np.ndarray  # (A,) that show it as background


@dataclass(frozen=True)
class Assembled:
    model: AnchorModel  # completed
    proxies: dict[int, Proxy]  # by label, in the part's own frame
    ground: TriangleMesh  # of the background, in the model's frame
    completions: tuple[Completion, ...]
    failed: dict[int, str]  # label: why it has no proxy, a sentence
    planes: dict[int, Plane]  # label: what it stands on


def assemble(
    device: Device,
    model: AnchorModel,
    views: Sequence[PhotoView],
    evidence: RowEvidence,
    objects: Mapping[int, Path | None],
    *,
    completed: bool = True,
    shadows: bool = False,
    background: tuple[float, float, float] = (0.0, 0.0, 0.0),
    making: Making | None = None,
    sights: Sequence[PhotoSight] = (),
) -> Assembled:
    """Proxies, ground and completed background of a labelled model.

    objects: the labels that get a proxy, with a mesh file of the user's where there is one, which
    is a candidate, too.  completed: whether the background is filled.  sights: where photos were
    taken from, small; what is solid is carved by what they see.  Raises BadFile, ValueError.
    """
    if model.labels is None:
        raise ValueError("the model has no labels of objects; partition it first.")
    making = making or Making()
    looks, x = looks_of(model), model.stops[0].x
    found = {label: support_plane(looks, model.labels, label) for label in objects}
    seen = seen_depths(device, model, sights, x, making)
    planes = {label: plane for label, plane in found.items() if isinstance(plane, Plane)}
    planes = seen_planes(planes, seen, looks.spacing_m)
    proxies, failed = {}, {}

    def make(label: int, only: str | None = None) -> Proxy:
        plane, given = planes.get(label), objects[label]
        return proxy_of(model, label, plane, evidence.own, views, given, making, only)

    for done, label in enumerate(objects):
        making.report("making what is touched of objects", done / max(len(objects), 1))
        try:
            proxies[label] = make(label)
        except BadFile as why:
            failed[label] = str(why)
    proxies = proxies_apart(proxies, model, make)
    told: list[Completion] = []
    whole = model
    if completed:
        there = [int(label) for label in np.unique(model.labels) if label]
        whole, told = complete(
            device, model, views, there, evidence.background, shadows=shadows,
            background=background,
            progress=lambda what, done, count: making.report(what, done / max(count, 1)),
        )  # fmt: skip
    standing = [
        (planes[label], corners_of(proxy, model, label))
        for label, proxy in proxies.items()
        if label in planes
    ]
    hollow = replace(making, hollow=True, faces=BACKGROUND_FACES)
    ground = ground_mesh(
        only_background(whole), looks, model.labels, list(planes.values()), x, hollow, standing,
        seen,
    )  # fmt: skip
    return Assembled(whole, proxies, ground, tuple(told), failed, planes)


def proxies_apart(
    proxies: dict[int, Proxy], model: AnchorModel, make: Callable[[int, str], Proxy]
) -> dict[int, Proxy]:
    """The proxies of things of a model, by label, cut so that none is inside another.

    make(label, name) makes another candidate of a thing.
    """
    places = {label: np.array(part_of(model, label)[1]) for label in proxies}
    cut, inside = apart({label: proxy.collider for label, proxy in proxies.items()}, places)
    again = {label for pair in inside for label in pair if proxies[label].name in SHAPES}
    if again:
        # One hull reaches over the hollow in which its neighbour lies; pieces follow the thing.
        proxies = proxies | {label: make(label, PIECES) for label in sorted(again)}
        cut, _ = apart({label: proxy.collider for label, proxy in proxies.items()}, places)
    return {label: replace(proxy, collider=cut[label]) for label, proxy in proxies.items()}


def proxy_of(
    model: AnchorModel,
    label: int,
    plane: Plane | None,
    own: np.ndarray,
    views: Sequence[PhotoView],
    given: Path | None,
    making: Making,
    only: str | None = None,
) -> Proxy:
    """What is touched of one object, in its own frame; only: the candidate of that name.

    Raises BadFile.
    """
    assert model.labels is not None, "assemble() asks for them"
    part, at = part_of(model, label)
    assert isinstance(part, AnchorModel), "a part of one"
    here = plane and Plane(plane.normal, plane.offset - float(plane.normal @ np.array(at)))
    mesh = standing_mesh(part, model.stops[0].x, own[model.labels == label], here, making)
    world_from_part = np.eye(4)
    world_from_part[:3, 3] = at
    pictures = most_of([view.labelled for view in views], label)
    if only is not None:
        candidates = candidates_of(mesh, here, making, given)
        return choose_proxy({only: candidates[only]}, world_from_part, label, pictures)[0]
    simple = candidates_of(mesh, here, making, given, cut=False)
    best = choose_proxy(simple, world_from_part, label, pictures)[0]
    # Pieces follow the mesh: where that is hardly better, they would not be chosen.
    whole = Collider((), mesh)
    bound = score_silhouettes(whole, world_from_part, label, pictures, as_mesh=True)
    score = best.score
    if score.views and score.recall >= LEAST_RECALL and score.iou >= bound.iou - AS_GOOD:
        return best
    candidates = candidates_of(mesh, here, making, given)
    return choose_proxy(candidates, world_from_part, label, pictures)[0]


def most_of(pictures: Sequence[LabelledView], label: int) -> list[LabelledView]:
    """FINEST_PICTURES of them, with most pixels of a label."""
    counts = [int((picture.labels == label).sum()) for picture in pictures]
    order = np.argsort(-np.array(counts), kind="stable")[:FINEST_PICTURES]
    return [pictures[i] for i in order if counts[i]]


def corners_of(proxy: Proxy, model: AnchorModel, label: int) -> np.ndarray:
    """(V, 3) metres, the model's frame: of all pieces of what is touched of an object."""
    _, at = part_of(model, label)
    return np.concatenate([np.asarray(each, np.float64) for each in proxy.collider.parts]) + at


# The mesh around what photos show of an object, cut where it stood.
#
# Splats reach 5 to 25 mm below the plane that carried the object: needles, and what no photo
# shows. A body made of them begins inside the table and is thrown out of it.

LEAST_EVIDENCE = 0.5  # pixels of an anchor's own object, summed over the views, to be touched
LEAST_OPACITY = 0.05
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
