"""What a Scene's methods do with its parts: stops, placing, regions, splats as a model."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shapeshift.app.document import Document, placed
from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.model import Model, SplatLayers, Stop
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.scene.appearance import NEUTRAL, Appearance
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import named_stops
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene as DrawnScene
from shapeshift.scene.scene import SceneObject
from shapeshift.scene.sections.section import SceneSection
from shapeshift.scene.selectors.selector import Selector

if TYPE_CHECKING:
    from shapeshift.api.arguments import X


def stops_of(subject: Document) -> tuple[Stop, ...]:
    """The stops of all objects by x, as a scene file names them; one of each name."""
    found: dict[str, Stop] = {}
    items = {item.name: item for item in subject.file.all_items} if subject.file else {}
    for obj in subject.scene.objects:
        item = items.get(obj.name)
        for stop in named_stops(item, obj.model) if item else obj.model.stops:
            found.setdefault(stop.name, stop)
    return tuple(sorted(found.values(), key=lambda stop: stop.x))


def describe(subject: Document, path: Path | None) -> dict[str, Any]:
    """What Scene.info gives."""
    from shapeshift.app.scene_files import describe_scene
    from shapeshift.runtime_models.read_scene import describe as describe_model

    objects = subject.scene.objects
    if subject.file is not None and path is not None:
        return describe_scene(subject.file, {obj.name: obj.model for obj in objects}, path)
    if len(subject.models) != 1:
        raise UsageError("this scene has several models; take scene.object(NAME).model.")
    if path is not None:
        return describe_model(subject.models[0], path)
    facts = describe_model(subject.models[0], Path("."))
    facts.pop("bytes")
    return facts


def changed(
    subject: Document,
    obj: SceneObject,
    position: Sequence[float] | None,
    wxyz: Sequence[float] | None,
    x: "X | None",
    visible: bool | None,
    appearance: Appearance | None,
) -> Document:
    """With one object elsewhere, at another x or appearing otherwise: in what is drawn and in its
    scene file.
    """
    before, file = obj.world_from_object, subject.file
    pose = Pose(
        np.array(before.position if position is None else position, np.float64),
        np.array(before.wxyz if wxyz is None else wxyz, np.float64),
    )
    shown = obj.visible if visible is None else visible
    moved = replace(obj, world_from_object=pose, visible=shown)
    if isinstance(x, str):
        states = {item.name: item.states for item in file.all_items} if file else {}
        (moved,) = placed([moved], x, "x", states)
    elif x is not None:
        moved = replace(moved, x=x if isinstance(x, StopWeights) else float(x))
    own = {} if appearance is None else {"appearance": appearance}
    if appearance is not None:
        of_scene = file.appearance if file else NEUTRAL
        moved = replace(moved, appearance=appearance.under(of_scene))
    objects = tuple(moved if each is obj else each for each in subject.scene.objects)
    if file is not None:  # as a simulation takes it
        place = {"position": tuple(map(float, pose.position)), "wxyz": tuple(map(float, pose.wxyz))}
        file = edits.change(file, obj.name, x=moved.x, visible=shown, **place, **own)
    return Document(DrawnScene(objects), file)


UNIT = 0.01  # how far from 1 the square of a quaternion's length may be


def in_our_coding(splats: PlainSplats) -> PlainSplats:
    """Float32 arrays of whatever holds the numbers.  ValueError for those that are coded still.

    Logarithms of scales, logits and quaternions of any length are what training keeps; taken for
    metres, opacities and turns they would draw something that nobody meant.
    """
    arrays = {
        name: np.ascontiguousarray(getattr(splats, name), np.float32)
        for name in ("means", "scales", "wxyz", "opacity", "sh")
    }
    scales, opacity, wxyz = arrays["scales"], arrays["opacity"], arrays["wxyz"]
    judged = {
        "scales": (~(scales >= 0), scales, "metres of one sigma, 0 or more, are wanted"),
        "opacity": (~((opacity >= 0) & (opacity <= 1)), opacity, "0 to 1 is wanted"),
    }
    if wxyz.ndim == 2:
        with np.errstate(over="ignore"):
            squares = np.einsum("nc,nc->n", wxyz, wxyz)
        length = np.sqrt(squares)
        judged["wxyz"] = (~(np.abs(squares - 1) <= UNIT), length, "length 1 is wanted")
    for name, (odd, numbers, wanted) in judged.items():
        if np.any(odd & np.isfinite(numbers)):  # NaN and Inf are named by whoever takes the arrays
            row = np.argwhere(odd & np.isfinite(numbers))[0].tolist()
            of = "has length" if name == "wxyz" else "is"
            raise ValueError(
                f"{name} {of} {numbers[tuple(row)]:g} at {row}; {wanted}. Parameters as training "
                "keeps them (log scales, logits, quaternions of any length) become splats by "
                "PlainSplats.from_raw(means, scales, wxyz, opacity, sh)."
            )
    return replace(splats, **arrays)


def layers_of(layers: Sequence[PlainSplats], names: Sequence[str]) -> SplatLayers:
    """Each set of splats as a stop of its own.  Raises UsageError, ValueError."""
    from shapeshift.runtime_models.splats.layers.read_layers import join_layers

    if not layers or (names and len(names) != len(layers)):
        raise UsageError(f"{len(layers)} sets of splats and {len(names)} names were given.")
    last = max(len(layers) - 1, 1)
    names = names or [f"layer {i}" for i in range(1, len(layers) + 1)]
    kind = "layer" if len(layers) > 1 else "rgb"
    stops = tuple(Stop(name, i / last, kind) for i, name in enumerate(names))
    layers = [in_our_coding(splats) for splats in layers]
    for splats in layers:  # before they are joined, where sizes would no longer be told apart
        SplatLayers(
            splats.means, splats.scales, splats.wxyz, splats.opacity, splats.sh,
            np.zeros(len(splats.means), np.int32), stops[:1],
        )  # fmt: skip
    return join_layers(list(layers), stops, "exclusive", [])


def sections_from(
    sections: Sequence["str | SceneSection"], subject: Document
) -> tuple[SceneSection, ...]:
    """Sections of texts and of themselves.  Raises UsageError."""
    from shapeshift.scene.sections.section_texts import read_section

    stops = stops_of(subject)
    try:
        return tuple(read_section(s, stops) if isinstance(s, str) else s for s in sections)
    except ValueError as error:
        raise UsageError(f"section {error}") from None


def regions_of(
    regions: Sequence["str | Selector"], model: Model, view: View
) -> tuple[Selector, ...]:
    """Selectors of texts and of themselves; a text's lens looks along the view.  UsageError."""
    from shapeshift.scene.selectors.selector_texts import read_selector

    try:
        return tuple(
            read_selector(region, model.stops, view.world_from_eye)
            if isinstance(region, str)
            else region
            for region in regions
        )
    except ValueError as error:
        raise UsageError(f"region {error}") from None
