"""Prompts to objects without a network: a mask in each prompted photo, and a walk over anchors for
all that no mask has seen.

Masks of further photos made in the same way do not help: the demo's ten objects have an IoU of .71
with them and without (docs/bench/masks.csv).
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from shapeshift.decomposition.completion.plane import fit_plane
from shapeshift.decomposition.label_photos import Progress
from shapeshift.decomposition.masks.anchor_walk import (
    UNKNOWN,
    AnchorGraph,
    Nodes,
    make_graph,
    nodes_of,
    seeds_of_evidence,
)
from shapeshift.decomposition.masks.label_maps import SILENT
from shapeshift.decomposition.masks.pixel_grid import box_in
from shapeshift.decomposition.masks.pixel_walk import region_of, walk_together
from shapeshift.decomposition.masks.segmenter import Prompt
from shapeshift.decomposition.masks.specs import ObjectSpec, ObjectSpecs, PhotoPrompt
from shapeshift.decomposition.masks.work_photos import (
    WorkPhoto,
    find_photo,
    given_mask,
    prompt_of,
)
from shapeshift.decomposition.partition import LabelledView
from shapeshift.decomposition.segment_scene import Segmented, SegmentedPart
from shapeshift.decomposition.shown import ShownAnchors
from shapeshift.runtime_models.model import AnchorModel, BadFile, ObjectLabel, SplatLayers
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.pose import View

Masks = dict[int, dict[int, np.ndarray]]  # (H, W) bool by label and photo


def walk_objects(
    shown: ShownAnchors,
    photos: list[WorkPhoto],
    specs: ObjectSpecs,
    progress: Progress = lambda what, done, of: None,
) -> tuple[np.ndarray, Masks]:
    """Labels (A,) int32 of a model's anchors, 0 the background, and the masks that they are from.

    Raises BadFile, also for an object that gets no anchor.
    """
    eyes = np.array([photo.view.world_from_eye.position for photo in photos])
    progress("graph of anchors", 0, len(specs.objects))
    graph = make_graph(nodes_of(shown.model, eyes.mean(axis=0).astype(np.float32)), eyes)
    masks = prompted_masks(shown, photos, specs, graph.nodes, progress)
    labels = labels_of_masks(shown, photos, graph, masks)
    for spec in specs.objects:
        if not (labels == spec.label).any():
            raise BadFile(
                f"object '{spec.name}' gets no anchor of the scene; its mask shows too little of "
                "it: give a tighter box, clicks inside, or a mask."
            )
    return labels, masks


def labels_of_masks(
    shown: ShownAnchors, photos: list[WorkPhoto], graph: AnchorGraph, masks: Masks
) -> np.ndarray:
    """(A,) int32 labels: what the masks show of anchors, and a walk to all others."""
    inside: dict[int, np.ndarray] = {}
    seen: dict[int, np.ndarray] = {}
    for label, by_photo in masks.items():
        inside[label], seen[label] = np.zeros(shown.count), np.zeros(shown.count)
        for view, mask in by_photo.items():
            (within,), all_of_it = shown.masks(photos[view].view, photos[view].stop.x, [mask])
            inside[label] += within
            seen[label] += all_of_it
    return walk_labels(graph, inside, seen)


def walk_labels(
    graph: AnchorGraph, inside: dict[int, np.ndarray], seen: dict[int, np.ndarray]
) -> np.ndarray:
    """(A,) int32 labels, from what each object's own photos show in its masks and at all.

    Each object walks against all the rest, since photos of one object say nothing of another; an
    anchor that several take goes to the one with the largest share.
    """
    seeds = {k: seeds_of_evidence(inside[k], seen[k] - inside[k]) for k in sorted(inside)}
    nodes = graph.nodes
    best, labels = np.full(len(nodes.rows), 0.5), np.zeros(nodes.count, np.int32)
    for label, own in seeds.items():
        here = own.copy()
        for other, theirs in seeds.items():
            if other != label:
                here[(theirs == 1) & (here < 0)] = 0
                # Seen in masks of both, in other photos: what lies around it tells whose it is.
                here[(theirs == 1) & (own == 1)] = UNKNOWN
        share = graph.shares(here)[:, 1]
        won = share > best
        labels[nodes.rows[won]], best[won] = label, share[won]
    return labels


def prompted_masks(
    shown: ShownAnchors,
    photos: list[WorkPhoto],
    specs: ObjectSpecs,
    nodes: Nodes,
    progress: Progress = lambda what, done, of: None,
) -> Masks:
    """The objects' masks in the photos that their prompts name.  Raises BadFile."""
    masks: Masks = {}
    said_in: dict[int, dict[int, tuple[ObjectSpec, PhotoPrompt]]] = {}  # by photo and label
    for spec in specs.objects:
        masks[spec.label] = {}
        for said in spec.prompts:
            view = find_photo(photos, said.photo, f"object '{spec.name}'")
            said_in.setdefault(view, {})[spec.label] = spec, said
        if not spec.prompts:
            raise BadFile(
                f"object '{spec.name}' has no prompt; say in one photo where it is, by 'box', "
                "'inside' or 'mask'."
            )
    for done, (view, said_here) in enumerate(said_in.items()):
        progress(photos[view].name, done, len(said_in))
        for label, mask in masks_of_photo(shown, photos[view], specs, said_here, nodes).items():
            masks[label][view] = mask
    return masks


def masks_of_photo(
    shown: ShownAnchors,
    photo: WorkPhoto,
    specs: ObjectSpecs,
    said_here: dict[int, tuple[ObjectSpec, PhotoPrompt]],
    nodes: Nodes,
) -> dict[int, np.ndarray]:
    """(H, W) bool by label: of all objects that have a prompt in a photo, by its colours, by the
    heat that the model shows there, and by what stands above what; no two have a pixel of it, but
    where masks are given that overlap.
    """
    found: dict[int, np.ndarray] = {}
    asked: dict[int, Prompt] = {}
    for label, (spec, said) in said_here.items():
        mask = given_mask(specs, said, photo)
        if mask is None:
            asked[label] = prompt_of(spec, said, photo)
        else:
            found[label] = mask
    if not asked:
        return found
    given = np.any([*found.values(), np.zeros(photo.view.size[::-1], bool)], axis=0)
    image = np.concatenate([photo.pixels(), *heat_of(shown, photo)], axis=2)
    prompts = list(asked.values())
    places = places_of(shown, photo.view, photo.stop.x, nodes)
    heights = heights_of(places, photo.view, prompts, nodes)
    answers = walk_together(image, prompts, heights, ways_of(places, photo.view))
    for label, answer in zip(asked, answers, strict=True):
        mask = None if answer is None else answer.mask & ~given
        if mask is None or not mask.any() or mask.all():
            spec, _ = said_here[label]
            raise BadFile(
                f"object '{spec.name}': nothing is found at its prompt in {photo.name}; give a "
                "tighter box, clicks inside, or a mask."
            )
        found[label] = mask
    return found


LEAST_ON = 0.2  # of what lies around a prompt, that has to lie on one plane
WITHIN = 0.7  # spacings of anchors: as near to the plane is on it while it is looked for
MOST_PLACES = 2000  # by which a plane is looked for
FINE, LOW, HIGH = 1.5, -2.0, 6.5  # medians of what lies beside the plane; of asinh of heights
ON_PLANE = (60, 30)  # of 255: heights about 0, and by how much they scatter


def places_of(shown: ShownAnchors, view: View, x: Control, nodes: Nodes) -> np.ndarray:
    """(H, W, 3) float32 metres: where what a pixel shows is; NaN: not known."""
    means = np.zeros((nodes.count, 3))
    means[nodes.rows] = nodes.means
    return shown.places(view, x, means)


def ways_of(places: np.ndarray, view: View) -> np.ndarray:
    """(H, W) how far away places (H, W, 3) are, in pixels that wide there: the focal length times
    the logarithm of the depth, so that differences are ways along the view.
    """
    camera_from_world, fx, _, _, _ = view.pinhole()
    depth = places @ camera_from_world[2, :3].astype(np.float32) + camera_from_world[2, 3]
    with np.errstate(invalid="ignore", divide="ignore"):
        return fx * np.log(np.where(depth > 0, depth, np.nan))


def heights_of(
    places: np.ndarray, view: View, prompts: list[Prompt], nodes: Nodes
) -> list[np.ndarray | None]:
    """(H, W) uint8 a prompt: how high what the photo shows stands above the plane of what lies
    around the prompt, finely near it; None where nothing flat is around.  places: of places_of().
    """
    eye = view.world_from_eye.position
    apart = spacing_of(nodes.means)
    found: list[np.ndarray | None] = []
    for prompt in prompts:
        left, top, right, bottom = region_of(prompt, places.shape)
        around = np.zeros(places.shape[:2], bool)
        around[top:bottom, left:right] = True
        if prompt.box is not None:
            around &= ~box_in(prompt.box, around.shape)
        points = places[around & np.isfinite(places[..., 0])]
        points = points[:: len(points) // MOST_PLACES + 1]
        fitted = fit_plane(points, WITHIN * apart)
        if fitted is None or fitted[1].sum() < LEAST_ON * len(points):
            found.append(None)
            continue
        plane, on = fitted
        height = plane.height(places) * (1 if plane.height(eye[None])[0] > 0 else -1)
        fine = max(FINE * float(np.median(np.abs(plane.height(points)[on]))), 1e-9)
        share = (np.arcsinh(height / fine) - LOW) / (HIGH - LOW)
        # What is not covered stands above all: whatever is behind it is no table.
        found.append(np.rint(255 * np.clip(np.nan_to_num(share, nan=1.0), 0, 1)).astype(np.uint8))
    return found


def spacing_of(means: np.ndarray) -> float:
    """Metres from an anchor to the next one, median of some; 0 of fewer than two."""
    if len(means) < 2:
        return 0.0
    some = means[:: len(means) // MOST_PLACES + 1]
    return float(np.median(cKDTree(means).query(some, 2)[0][:, 1]))


def heat_of(shown: ShownAnchors, photo: WorkPhoto) -> list[np.ndarray]:
    """(H, W, 1) uint8 of each value stop of the model other than the photo's own."""
    return [
        np.rint(255 * np.clip(shown.look(photo.view, stop.x)[..., :1], 0, 1)).astype(np.uint8)
        for stop in shown.model.stops
        if stop.is_measured and stop.name != photo.stop.name
    ]


def segment_by_walk(
    shown: ShownAnchors,
    photos: list[WorkPhoto],
    specs: ObjectSpecs,
    progress: Progress = lambda what, done, of: None,
) -> Segmented:
    """The model with the labels of walk_objects; its pictures say nothing beside the masks."""
    labels, masks = walk_objects(shown, photos, specs, progress)
    pictures: dict[int, LabelledView] = {}
    parts: list[SegmentedPart] = []
    for spec in specs.objects:
        rows = labels == spec.label
        seen = 0.0
        for view, mask in masks[spec.label].items():
            photo = photos[view]
            _, total = shown.masks(photo.view, photo.stop.x, [])
            seen += float(total[rows].sum())
            silent = np.full(mask.shape, SILENT, np.uint8)
            picture = pictures.setdefault(
                view, LabelledView(photo.view, photo.stop.x, silent, photo.photo.path)
            )
            picture.labels[mask] = spec.label
        parts.append(SegmentedPart(spec, len(masks[spec.label]), int(rows.sum()), seen))
    objects = tuple(ObjectLabel(spec.label, spec.name) for spec in specs.objects)
    cut = with_labels(shown.model, labels, objects)
    return Segmented(cut, tuple(parts), tuple(pictures.values()), 0)


def with_labels(
    model: AnchorModel | SplatLayers, labels: np.ndarray, objects: tuple[ObjectLabel, ...]
) -> AnchorModel | SplatLayers:
    if isinstance(model, AnchorModel):
        return replace(model, labels=labels.astype(np.uint8), objects=objects)
    return replace(model, labels=labels)
