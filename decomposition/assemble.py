"""Cut objects to things that can be grabbed: their proxies, the ground under them, the background
completed where they stood (OWD, sections 3.4 to 3.6).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.decomposition.completion.anchor_looks import looks_of
from shapeshift.decomposition.completion.complete import (
    Completion,
    complete,
    only_background,
)
from shapeshift.decomposition.completion.plane import Plane, support_plane
from shapeshift.decomposition.completion.verify import PhotoView
from shapeshift.decomposition.partition import LabelledView
from shapeshift.decomposition.proxies.choose import Proxy, candidates_of, choose_proxy
from shapeshift.decomposition.proxies.ground import ground_mesh
from shapeshift.decomposition.proxies.standing import standing_mesh
from shapeshift.rasterizer.device import Device
from shapeshift.runtime_models.model import AnchorModel, BadFile
from shapeshift.runtime_models.parts import part_of
from shapeshift.scene.colliders.collider import Making
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh

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
) -> Assembled:
    """Proxies, ground and completed background of a labelled model.

    objects: the labels that get a proxy, with a mesh file of the user's where there is one, which
    is a candidate, too.  completed: whether the background is filled.  Raises BadFile, ValueError.
    """
    if model.labels is None:
        raise ValueError("the model has no labels of objects; partition it first.")
    making = making or Making()
    looks, x = looks_of(model), model.stops[0].x
    found = {label: support_plane(looks, model.labels, label) for label in objects}
    planes = {label: plane for label, plane in found.items() if isinstance(plane, Plane)}
    proxies, failed = {}, {}
    for done, (label, given) in enumerate(objects.items()):
        making.report("making what is touched of objects", done / max(len(objects), 1))
        try:
            proxies[label] = proxy_of(
                model, label, planes.get(label), evidence.own, views, given, making
            )
        except BadFile as why:
            failed[label] = str(why)
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
        only_background(whole), looks, model.labels, list(planes.values()), x, hollow, standing
    )
    return Assembled(whole, proxies, ground, tuple(told), failed)


def proxy_of(
    model: AnchorModel,
    label: int,
    plane: Plane | None,
    own: np.ndarray,
    views: Sequence[PhotoView],
    given: Path | None,
    making: Making,
) -> Proxy:
    """What is touched of one object, in its own frame.  Raises BadFile."""
    assert model.labels is not None, "assemble() asks for them"
    part, at = part_of(model, label)
    assert isinstance(part, AnchorModel), "a part of one"
    here = plane and Plane(plane.normal, plane.offset - float(plane.normal @ np.array(at)))
    mesh = standing_mesh(part, model.stops[0].x, own[model.labels == label], here, making)
    world_from_part = np.eye(4)
    world_from_part[:3, 3] = at
    candidates = candidates_of(mesh, here, making, given)
    pictures = most_of([view.labelled for view in views], label)
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
