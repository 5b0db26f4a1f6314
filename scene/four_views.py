"""Four ways to look at a scene of objects (OWD, figure 4.2): pure, a scene gives another scene.

full: as it is; overlay: every object in a colour of its own; background: without the objects;
isolated: objects alone, one or all.  Objects are those of a label above 0, the background has 0; of
a package that was opened as a whole the labels of its anchors say so.
"""

import colorsys
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.model import AnchorModel, Model, SplatLayers
from shapeshift.runtime_models.parts import BACKGROUND, find_label
from shapeshift.scene.scene import Scene, SceneObject, Tint
from shapeshift.scene.selectors.selector import Painted

FOUR_VIEWS = ("full", "overlay", "background", "isolated")
FULL, OVERLAY, WITHOUT, ALONE = FOUR_VIEWS
STRENGTH = 0.55  # of the colour of an object over its own
GOLDEN = 0.381966  # of a turn: hues of labels in a row are far apart
# Display sRGB; any two are 30 apart in CIE Lab with normal vision and without one kind of cones.
DISTINCT = (
    (0.00, 1.00, 0.00), (0.95, 0.04, 0.08), (0.00, 0.00, 0.96), (1.00, 0.71, 0.70),
    (0.54, 0.20, 0.75), (1.00, 1.00, 0.59), (0.76, 0.26, 0.39), (0.50, 0.60, 0.80),
)  # fmt: skip
RowsOf = Callable[[Model, np.ndarray], Model]


def shown_as(scene: Scene, show: str, name: str = "", rows_of: RowsOf | None = None) -> Scene:
    """The scene in one of FOUR_VIEWS; the very same where nothing is different.

    name: of the one object that is isolated, "" = all.  rows_of(model, rows) gives some anchors
    (A,) bool of a model; who asks again and again hands over one that remembers what it gave, since
    a renderer decodes every new model anew.
    """
    if show not in FOUR_VIEWS:
        raise ValueError(f"there is no view {show!r}; choose {', '.join(FOUR_VIEWS)}.")
    if show == FULL:
        return scene
    objects = tuple(one_shown_as(obj, show, name, rows_of or with_rows) for obj in scene.objects)
    alike = all(a is b for a, b in zip(objects, scene.objects, strict=True))
    return scene if alike else Scene(objects)


def has_objects(scene: Scene) -> bool:
    """Whether the four views differ at all."""
    return any(obj.label != BACKGROUND or parts_of(obj) is not None for obj in scene.objects)


def parts_of(obj: SceneObject) -> np.ndarray | None:
    """(A,) labels of a model that was opened as a whole, with objects in it; None of others."""
    model = obj.model
    labels = model.labels if isinstance(model, AnchorModel | SplatLayers) else None
    if labels is None or not len(labels) or (labels == labels[0]).all():
        return None
    return labels


def one_shown_as(obj: SceneObject, show: str, name: str, rows_of: RowsOf) -> SceneObject:
    """One object of the scene in a view that is not the full one."""
    labels = parts_of(obj)
    if labels is None:
        of_object = obj.label != BACKGROUND
        if show == OVERLAY:
            tint = Tint(color_of(obj.label), STRENGTH)
            return replace(obj, tint=tint) if of_object and obj.tint is None else obj
        wanted = not of_object if show == WITHOUT else of_object and name in ("", obj.name)
        return obj if wanted or not obj.visible else replace(obj, visible=False)
    if show == OVERLAY:
        if obj.tint is not None:
            return obj
        colors = np.array([color_of(label) for label in range(int(labels.max()) + 1)])
        return replace(obj, tint=Tint(colors[labels], STRENGTH * (labels != BACKGROUND)))
    if show == WITHOUT:
        rows = labels == BACKGROUND
    elif name in ("", obj.name):
        rows = labels != BACKGROUND
    else:
        rows = labels == find_label(obj.model, name, obj.name)
    selectors = tuple(
        replace(one, weight=one.weight[rows]) if isinstance(one, Painted) else one
        for one in obj.selectors
    )
    return replace(obj, model=rows_of(obj.model, rows), selectors=selectors, tint=None)


def with_rows(model: Model, rows: np.ndarray) -> Model:
    """Some anchors (A,) bool of a labelled model, where they are."""
    if isinstance(model, SplatLayers):
        return model.with_rows(rows)
    assert isinstance(model, AnchorModel), "no other kind has labels"
    return model.with_anchors(rows)


def color_of(label: int) -> tuple[float, float, float]:
    """Display sRGB of an object in the overlay, none dark: the first ones are told apart with any
    colour vision, more of them have hues a golden angle apart.
    """
    if 0 < label <= len(DISTINCT):
        return DISTINCT[label - 1]
    value = 1.0 if label % 2 else 0.8
    return colorsys.hsv_to_rgb((GOLDEN * label) % 1.0, 0.85, value)
