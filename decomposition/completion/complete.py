"""Completion, thing by thing: the background under everything that is taken out of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.decomposition.completion.anchor_looks import looks_of
from shapeshift.decomposition.completion.plane import Plane, support_plane
from shapeshift.decomposition.completion.stamp import Stamp, apply_stamp, find_stamp
from shapeshift.decomposition.completion.verify import Cells, PhotoView, Verdict, verify
from shapeshift.rasterizer.device import Device
from shapeshift.runtime_models.model import AnchorModel

BACKGROUND = 0  # its label
Progress = Callable[[str, int, int], None]  # what is being done, things done, things in all


@dataclass(frozen=True)
class Completion:
    """What was tried under one thing, and what came of it."""

    label: int
    plane: Plane | None  # that it stood on; None: none was found
    stamp: Stamp | None  # the one that stays
    verdict: Verdict | None
    why: str = ""  # why nothing was filled, a clause

    def sentence(self) -> str:
        """For people, without the thing's name."""
        if self.stamp is None:
            return f"the background behind it stays as it is: {self.why}"
        assert self.verdict is not None, "what stays was verified"
        patches = f"{self.stamp.patches} patch{'es' if self.stamp.patches > 1 else ''}"
        copies = f"{len(self.stamp.rows):,} anchors copied, {int(self.stamp.dropped.sum()):,} taken"
        return f"{patches}, {copies} out; {self.verdict.sentence()}"


def complete(
    device: Device,
    model: AnchorModel,
    views: Sequence[PhotoView],
    things: Sequence[int] | None = None,
    evidence: np.ndarray | None = None,
    *,
    shadows: bool = False,
    background: tuple[float, float, float] = (0.0, 0.0, 0.0),
    progress: Progress = lambda what, done, count: None,
) -> tuple[AnchorModel, list[Completion]]:
    """The model with the background completed under the things of these labels; all, if None.

    Copies are background and stand behind the other anchors.  A step that verify() refuses changes
    nothing and says why.  evidence (A,): pixels of background that each anchor shows; what photos
    show stays.  shadows: also where the thing's contact shadow lies, which no photo can confirm.
    Raises ValueError for a model without labels.
    """
    if model.labels is None:
        raise ValueError("the model has no labels of objects; partition it first.")
    if things is None:
        things = [int(each) for each in np.unique(model.labels) if each != BACKGROUND]
    told = []
    for done, label in enumerate(things):
        progress("completing the background", done, len(things))
        model, one = complete_one(device, model, views, label, evidence, shadows, background)
        if one.stamp is not None and evidence is not None:  # copies look as seen
            kept = evidence[~one.stamp.dropped]
            evidence = np.concatenate([kept, evidence[one.stamp.rows]])
        told.append(one)
    progress("completing the background", len(things), len(things))
    return model, told


def complete_one(
    device: Device,
    model: AnchorModel,
    views: Sequence[PhotoView],
    label: int,
    evidence: np.ndarray | None,
    shadows: bool,
    background: tuple[float, float, float],
) -> tuple[AnchorModel, Completion]:
    """The same for one thing: all of its footprint, else the part that no photo shows."""
    assert model.labels is not None, "complete() asks for them"
    if not (model.labels == label).any():
        return model, Completion(label, None, None, None, "no anchor is its")
    looks = looks_of(model)
    plane = support_plane(looks, model.labels, label)
    if isinstance(plane, str):
        return model, Completion(label, None, None, None, plane)
    first: Completion | None = None
    for core in (True, False) if evidence is not None and not shadows else (True,):
        stamp = find_stamp(looks, model.labels, label, plane, evidence, shadows, core)
        if isinstance(stamp, str):
            first = first or Completion(label, plane, None, None, stamp)
            continue
        after = with_background_copies(apply_stamp(model, stamp), len(stamp.rows))
        pair = only_background(model), only_background(after)
        cells = Cells(stamp.footprint, stamp.cell_m, plane.normal)
        verdict = verify(device, *pair, label, views, background, cells, shadows)
        if verdict.is_accepted:
            return after, Completion(label, plane, stamp, verdict)
        first = first or Completion(label, plane, None, verdict, verdict.sentence())
    assert first is not None, "one step at least was tried"
    return model, first


def with_background_copies(model: AnchorModel, copies: int) -> AnchorModel:
    """The model whose last rows belong to the background."""
    assert model.labels is not None, "of a labelled model"
    labels = model.labels.copy()
    labels[len(labels) - copies :] = BACKGROUND
    return replace(model, labels=labels)


def only_background(model: AnchorModel) -> AnchorModel:
    """What stays when every object is taken away."""
    assert model.labels is not None, "of a labelled model"
    return model.with_anchors(model.labels == BACKGROUND)
