"""A cut scene with +Y up: by what its things stand on, its photos and its capture's own word."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from shapeshift.decomposition.completion.plane import AnchorLooks, Plane, looks_of, support_plane
from shapeshift.decomposition.segment_scene import Segmented, SegmentedPart
from shapeshift.runtime_models.model import AnchorModel, SplatLayers
from shapeshift.runtime_models.parts import find_label, part_of
from shapeshift.runtime_models.shapes import four, three
from shapeshift.scene.cameras.upright import (
    ASSUMED,
    LEVEL,
    PLANES,
    UNIT_M,
    Up,
    Upright,
    believed,
    up_of_planes,
    ways_sentence,
)
from shapeshift.scene.document.scene_file import FirstView, SceneFile, SceneItem
from shapeshift.scene.pose import Pose

MOST_PLACES = 50_000  # of plain splats, among which planes are looked for
EXTENT = (2, 98)  # percent of a thing's anchors, between which it is so long
LEAST_OPACITY = 0.1  # of a splat, to be there at all


def planes_under(
    model: AnchorModel | SplatLayers, parts: Sequence[SegmentedPart]
) -> dict[int, Plane]:
    """What each object stands on, by label, in the model's frame."""
    assert model.labels is not None, "it is labelled"
    looks, labels = (
        (looks_of(model), model.labels) if isinstance(model, AnchorModel) else splat_places(model)
    )
    planes = {p.spec.label: support_plane(looks, labels, p.spec.label) for p in parts if p.rows}
    return {label: plane for label, plane in planes.items() if isinstance(plane, Plane)}


def splat_places(model: SplatLayers) -> tuple[AnchorLooks, np.ndarray]:
    """Where some of its splats are, without colours, and their labels (N,)."""
    from scipy.spatial import cKDTree

    assert model.labels is not None, "it is labelled"
    rows = np.flatnonzero(np.asarray(model.opacity) > LEAST_OPACITY)
    if len(rows) > MOST_PLACES:
        rows = np.sort(np.random.default_rng(0).choice(rows, MOST_PLACES, replace=False))
    places = np.asarray(model.means[rows], np.float64)
    away = cKDTree(places).query(places, 2)[0][:, 1] if len(rows) > 1 else np.zeros(1)
    there, colors = np.ones(len(rows), bool), np.zeros((len(rows), 3))
    return AnchorLooks(places, there, colors, float(np.median(away))), model.labels[rows]


def upright_scene(
    file: SceneFile, found: Segmented, ups: Sequence[Up], planes: Mapping[int, Plane]
) -> tuple[SceneFile, list[str]]:
    """The scene turned such that what is believed to be up is +Y, with all that says it; sentences.

    ups: of the capture, what was taken to be up first.  planes: by label, in the model's frame.
    """
    ways = list(ups) or [Up(ASSUMED, (0.0, 1.0, 0.0))]
    names = {part.spec.label: part.spec.name for part in found.parts}
    normals = {names[label]: plane.normal for label, plane in planes.items() if label in names}
    level, others = up_of_planes(normals, ways)
    if level is not None:  # nearer to the things than the plane of the capture's points
        ways = [*(way for way in ways if way.source != PLANES), level]
    used = believed(ways)
    told = [said] if (said := ways_sentence(ways, used)) else []
    if used.source != PLANES and level is None:
        told.append("Nothing flat is under the objects, so no plane says what is up.")
    if others:
        told.append(f"Not on those planes, but on others, stand: {', '.join(others)}.")
    upright = Upright(tuple(ways), used)
    file = replace(file, upright=upright)
    return (turned(file, found.model, upright.turn) if used.off() > LEVEL else file), told


def scale_sentence(found: Segmented, metres: str) -> str:
    """Who says how long a metre is, or how large its things would be if nobody does."""
    if metres:
        return f"Scale: metres are those of {metres}."
    model, sizes = found.model, []
    assert model.labels is not None, "it is labelled"
    places = np.asarray(model.anchors if isinstance(model, AnchorModel) else model.means)
    for part in found.parts:
        if part.rows:
            low, high = np.percentile(places[model.labels == part.spec.label], EXTENT, axis=0)
            sizes.append((float((high - low).max()), part.spec.name))
    few = ", ".join(f"{name} {size:.2g} m" for size, name in sorted(sizes)[-3:])
    return (
        f"Scale: nobody says how long a metre is; as it stands the largest would be {few} long. "
        f"Give a length: '{UNIT_M}' in the capture's file, metres of one unit, and train again."
    )


def turned(file: SceneFile, model: AnchorModel | SplatLayers, turn: np.ndarray) -> SceneFile:
    """The scene turned by (3, 3) about its origin, each object where it stands then."""
    whole = np.eye(4)
    whole[:3, :3] = turn
    wxyz = four(Pose.from_matrix(whole).wxyz)

    def placed(item: SceneItem) -> SceneItem:
        assert item.part is not None, "made of parts"
        label = find_label(model, item.part, item.model)
        position = three(turn @ np.array(part_of(model, label)[1]))
        return replace(item, position=position, wxyz=wxyz, placed=True)

    return replace(
        file,
        items=tuple(map(placed, file.items)),
        background=file.background and placed(file.background),
        view=file.view and turned_view(file.view, turn),
    )


def turned_view(view: FirstView, turn: np.ndarray) -> FirstView:
    """A first look at the same thing; one that would look straight up or down looks a little
    aside, as no view that is kept does."""
    eye, target = turn @ np.array(view.eye), turn @ np.array(view.target)
    away = target - eye
    if not np.hypot(away[0], away[2]) > 1e-3 * np.linalg.norm(away):
        eye = eye + np.array([0.0, 0.0, 1e-2 * np.linalg.norm(away)])
    return replace(view, eye=three(eye), target=three(target))
