"""Prompts to objects without a network: a mask in each prompted photo, and a walk over anchors for
all that no mask has seen.

Masks of further photos made in the same way do not help: the demo's ten objects have an IoU of .71
with them and without (docs/bench/masks.csv).
"""

from dataclasses import replace

import numpy as np

from shapeshift.decomposition.label_photos import Progress, best_of
from shapeshift.decomposition.masks.anchor_walk import (
    AnchorGraph,
    make_graph,
    nodes_of,
    seeds_of_evidence,
)
from shapeshift.decomposition.masks.label_maps import SILENT
from shapeshift.decomposition.masks.pixel_walk import PixelWalk
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
    total = len(specs.objects) + 1
    progress("graph of anchors", 0, total)
    graph = make_graph(nodes_of(shown.model, eyes.mean(axis=0).astype(np.float32)), eyes)
    masks: Masks = {}
    inside: dict[int, np.ndarray] = {}
    seen: dict[int, np.ndarray] = {}
    for done, spec in enumerate(specs.objects, 1):
        progress(spec.name, done, total)
        masks[spec.label] = prompted_masks(shown, photos, specs, spec)
        inside[spec.label], seen[spec.label] = np.zeros(shown.count), np.zeros(shown.count)
        for view, mask in masks[spec.label].items():
            (within,), all_of_it = shown.masks(photos[view].view, photos[view].stop.x, [mask])
            inside[spec.label] += within
            seen[spec.label] += all_of_it
    labels = walk_labels(graph, inside, seen)
    for spec in specs.objects:
        if not (labels == spec.label).any():
            raise BadFile(
                f"object '{spec.name}' gets no anchor of the scene; its mask shows too little of "
                "it: give a tighter box, clicks inside, or a mask."
            )
    return labels, masks


def walk_labels(
    graph: AnchorGraph, inside: dict[int, np.ndarray], seen: dict[int, np.ndarray]
) -> np.ndarray:
    """(A,) int32 labels, from what each object's own photos show in its masks and at all.

    Each object walks against all the rest, since photos of one object say nothing of another; an
    anchor that several take goes to the one with the largest share.
    """
    seeds = {k: seeds_of_evidence(inside[k], seen[k] - inside[k]) for k in inside}
    nodes = graph.nodes
    best, labels = np.full(len(nodes.rows), 0.5), np.zeros(nodes.count, np.int32)
    for label, own in seeds.items():
        here = own.copy()
        for other, theirs in seeds.items():
            if other != label:
                here[(theirs == 1) & (here < 0)] = 0
        share = graph.shares(here)[:, 1]
        won = share > best
        labels[nodes.rows[won]], best[won] = label, share[won]
    return labels


def prompted_masks(
    shown: ShownAnchors, photos: list[WorkPhoto], specs: ObjectSpecs, spec: ObjectSpec
) -> dict[int, np.ndarray]:
    """The object's masks (H, W) bool in the photos that its prompts name.  Raises BadFile."""
    found: dict[int, np.ndarray] = {}
    for said in spec.prompts:
        view = find_photo(photos, said.photo, f"object '{spec.name}'")
        mask = given_mask(specs, said, photos[view])
        found[view] = walked_mask(shown, photos[view], spec, said) if mask is None else mask
    if not found:
        raise BadFile(
            f"object '{spec.name}' has no prompt; say in one photo where it is, by 'box', 'inside' "
            "or 'mask'."
        )
    return found


def walked_mask(
    shown: ShownAnchors, photo: WorkPhoto, spec: ObjectSpec, said: PhotoPrompt
) -> np.ndarray:
    """The mask of one photo, by its colours and by the heat that the model shows there."""
    image = np.concatenate([photo.pixels(), *heat_of(shown, photo)], axis=2)
    prompt = prompt_of(spec, said, photo)
    best = best_of(PixelWalk().candidates(image, prompt), prompt)
    if best is None:
        raise BadFile(
            f"object '{spec.name}': nothing is found at its prompt in {photo.name}; give a tighter "
            "box, clicks inside, or a mask."
        )
    return best.mask


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
        inside = seen = 0.0
        for view, mask in masks[spec.label].items():
            photo = photos[view]
            (within,), total = shown.masks(photo.view, photo.stop.x, [mask])
            inside, seen = inside + float(within[rows].sum()), seen + float(total[rows].sum())
            silent = np.full(mask.shape, SILENT, np.uint8)
            picture = pictures.setdefault(
                view, LabelledView(photo.view, photo.stop.x, silent, photo.photo.path)
            )
            picture.labels[mask] = spec.label
        share = inside / seen if seen else 0.0
        parts.append(SegmentedPart(spec, len(masks[spec.label]), int(rows.sum()), seen, share))
    objects = tuple(ObjectLabel(spec.label, spec.name) for spec in specs.objects)
    cut = with_labels(shown.model, labels, objects)
    return Segmented(cut, tuple(parts), tuple(pictures.values()), 0)


def with_labels(
    model: AnchorModel | SplatLayers, labels: np.ndarray, objects: tuple[ObjectLabel, ...]
) -> AnchorModel | SplatLayers:
    if isinstance(model, AnchorModel):
        return replace(model, labels=labels.astype(np.uint8), objects=objects)
    return replace(model, labels=labels)
