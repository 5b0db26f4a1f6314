"""The four views of a scene cut into objects (OWD 4.2): full, overlay, background, isolated.

A scene of one labelled model is shown by its labels; of a scene file each object is one.
"""

from dataclasses import replace

import numpy as np

from shapeshift.renderer.debug.debug import object_color
from shapeshift.runtime_models.model import AnchorModel, BadFile, SplatLayers
from shapeshift.runtime_models.parts import BACKGROUND, find_label, name_of, part_of
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene, SceneObject, Tint

SHOW_MODES = ("full", "overlay", "background", "isolated")
STRENGTH = 0.55  # of a tint: what is below stays to be seen


def read_show_mode(text: str) -> tuple[str, str]:
    """The mode and the object's name or label, "" where all are meant, of MODE or isolated:NAME.

    Raises ValueError, a sentence.
    """
    mode, colon, name = text.partition(":")
    if mode not in SHOW_MODES or (colon and (mode != "isolated" or not name)):
        modes = ", ".join(SHOW_MODES)
        raise ValueError(f"'{text[:60]}' is no view of objects; expected {modes} or isolated:NAME")
    return mode, name


def show_objects(scene: Scene, text: str) -> Scene:
    """What of the scene is drawn in a mode, as `read_show_mode` reads it.

    overlay: the objects tinted, the background as it is; background: without the objects; isolated:
    without the background, or one object alone, also a hidden one.  Raises ValueError.
    """
    mode, name = read_show_mode(text)
    if mode == "full":
        return scene
    alone = scene.objects[0] if len(scene.objects) == 1 else None
    if alone is not None and labels_of(alone) is not None:
        return show_labels(alone, mode, name)
    objects = [obj for obj in scene.objects if obj.label != BACKGROUND]
    if not objects:
        raise ValueError(
            "the scene has no labels of objects and is no scene file of several; "
            "`launch.py segment` makes both"
        )
    if mode == "overlay":
        tints = {obj.label: Tint(object_color(i), STRENGTH) for i, obj in enumerate(objects)}
        shown = [replace(obj, tint=tints.get(obj.label)) for obj in scene.objects]
    elif mode == "background":
        shown = [obj for obj in scene.objects if obj.label == BACKGROUND]
    elif name:
        found = [obj for obj in objects if name in (obj.name, str(obj.label))]
        if not found:
            there = ", ".join(f"{obj.label} {obj.name}" for obj in objects)
            raise ValueError(f"nothing of the scene is '{name[:60]}'; it has {there}")
        exact = [obj for obj in found if obj.name == name]
        shown = [replace((exact or found)[0], visible=True)]
    else:
        shown = objects
    if not shown:
        raise ValueError("the scene has no background; all of it is objects")
    return Scene(tuple(shown))


def labels_of(obj: SceneObject) -> np.ndarray | None:
    """(A,) of a model's anchors, (N,) of plain splats; None where it has none."""
    return obj.model.labels if isinstance(obj.model, AnchorModel | SplatLayers) else None


def show_labels(whole: SceneObject, mode: str, name: str) -> Scene:
    """The same of one model: the parts of its labels, each where it stands in the whole."""
    labels, model = labels_of(whole), whole.model
    assert labels is not None
    there = [int(label) for label in np.unique(labels) if label != BACKGROUND]
    if mode == "overlay":
        place = np.searchsorted(there, labels)
        table = np.array([object_color(i) for i in range(len(there) + 1)], np.float32)
        strength = np.where(labels == BACKGROUND, 0, STRENGTH).astype(np.float32)
        return Scene((replace(whole, tint=Tint(table[place], strength)),))
    if mode == "background":
        chosen = [BACKGROUND] if (labels == BACKGROUND).any() else []
    elif name:
        try:
            chosen = [find_label(model, name, "the scene")]
        except BadFile as error:
            raise ValueError(str(error).rstrip(".")) from None
    else:
        chosen = there
    if not chosen:
        missing = "background; all of it is objects" if mode == "background" else "objects"
        raise ValueError(f"the scene has no {missing}")
    return Scene(tuple(part_object(whole, label) for label in chosen))


def part_object(whole: SceneObject, label: int) -> SceneObject:
    """One part of a labelled object as an object of its own, where it stands in the whole."""
    part, place = part_of(whole.model, label)
    pose = whole.world_from_object
    put_back = np.eye(4)
    put_back[:3, 3] = place
    name = name_of(whole.model, label) or f"label {label}"
    return SceneObject(
        name, part, Pose.from_matrix(pose.matrix() @ put_back), whole.x, label, whole.visible
    )
