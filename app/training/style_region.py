"""Which anchors a style is for: selectors, labels of objects, regions painted in a scene file."""

from pathlib import Path

import numpy as np

from shapeshift.app.errors import UsageError
from shapeshift.app.paths import plain
from shapeshift.runtime_models.model import AnchorModel, BadFile
from shapeshift.runtime_models.parts import find_label

HALF = 0.5  # of a weight: from there on an anchor is inside


def anchors_inside(
    model: AnchorModel, region: tuple[str, ...], keep: tuple[str, ...]
) -> np.ndarray | None:
    """(A,) bool: what lies in a region and in nothing that is kept; None: all.  Raises UsageError.

    Each text is a selector without X, label:NAME or painted:FILE.scene.json.
    """
    if not region and not keep:
        return None
    inside = np.ones(len(model.anchors), bool)
    if region:
        inside = np.any([chosen(model, text, "--region") for text in region], axis=0)
    for text in keep:
        inside &= ~chosen(model, text, "--keep")
    if not inside.any():
        raise UsageError("--region and --keep leave no anchor of the scene; choose another place.")
    return inside


def chosen(model: AnchorModel, text: str, option: str) -> np.ndarray:
    """(A,) bool: the anchors that one text names.  Raises UsageError where there are none."""
    kind, _, rest = text.partition(":")
    if kind == "label":
        found = labelled(model, rest, option)
    elif kind == "painted":
        found = painted(model, plain(rest), option)
    else:
        found = selected(model, text, option)
    if not found.any():
        raise UsageError(f"{option} '{text}' holds no anchor of the scene; choose another place.")
    return found


def selected(model: AnchorModel, text: str, option: str) -> np.ndarray:
    """(A,) bool: the anchors in a selector."""
    from shapeshift.app.commands.export import with_x
    from shapeshift.scene.cameras.framing import default_view
    from shapeshift.scene.selectors.read_selector import read_selector

    try:
        eye = default_view(model, (640, 360)).world_from_eye
        return read_selector(with_x(text), (), eye).weights(model.anchors) >= HALF
    except ValueError as error:
        raise UsageError(f"{option} {error}") from None


def labelled(model: AnchorModel, name: str, option: str) -> np.ndarray:
    """(A,) bool: the anchors of an object, by its name or label."""
    try:
        label = find_label(model, name, "the scene")
    except BadFile as error:
        raise UsageError(f"{option} label:{name}: {error}") from None
    return np.asarray(model.labels == label)


def painted(model: AnchorModel, path: Path, option: str) -> np.ndarray:
    """(A,) bool: the anchors in any region that a scene file has painted on such a model."""
    from shapeshift.scene.document.read_scene_file import read_scene_file
    from shapeshift.scene.selectors.selector import Painted

    weights = [
        selector.weight
        for item in read_scene_file(path).all_items
        for selector in item.selectors
        if isinstance(selector, Painted) and len(selector.weight) == len(model.anchors)
    ]
    if not weights:
        raise UsageError(
            f"{option} painted:{path}: no region is painted there on {len(model.anchors):,} "
            "anchors, as many as the scene has."
        )
    return np.any([weight >= HALF for weight in weights], axis=0)
