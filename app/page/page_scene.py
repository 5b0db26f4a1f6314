"""A document as the bytes that a web page reads."""

import base64
import io
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, NotRequired, TypedDict

import numpy as np

from shapeshift.app.document import Document
from shapeshift.renderer.colors.palette import PALETTES, palette_colors
from shapeshift.renderer.gl.target import brightest
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.evaluate import follows_eye
from shapeshift.runtime_models.model import AnchorModel, BadFile, Model
from shapeshift.runtime_models.web.web_model import (
    COLOR_BITS,
    FORMAT,
    MOST_SPLATS,
    Container,
    ControlEntry,
    ModelEntry,
    TableEntry,
    control_entry,
    describe_model,
)
from shapeshift.scene.appearance import plain_color
from shapeshift.scene.cameras.framing import model_points
from shapeshift.scene.document.scene_file import SceneItem, named_stops
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.selectors.selector import Box, HalfSpace, Lens, Painted, Selector

FRAMED = (1280, 720)  # the page stands back where it is narrower
PICTURE = (160, 90)  # pixels of a stop's picture
QUALITY = 60  # of its WebP: about 2 kB
MOST_PICTURES = 9  # of the stops that keys reach
COARSE = 8  # a coarse scene has every so many-th anchor
BOX = (1.0, 99.0)  # percentiles of an object's points that its bounding box holds
Progress = Callable[[str, float], None]  # what is done, and how much of it, 0..1

Profile = Literal["any", "quest"]  # what may be left out in a headset: sharpness.js
Vec3 = tuple[float, float, float]
Wxyz = tuple[float, float, float, float]


@dataclass(frozen=True)
class PageSettings:
    """How a scene is stored for a page."""

    title: str
    exact: bool = False  # float32 instead of codes
    pictures: bool = True  # of the stops
    profile: Profile = "any"


class ViewEntry(TypedDict):
    """The first look: world metres; fovY in radians."""

    eye: list[float]
    target: list[float]
    fovY: float


class StateEntry(TypedDict):
    """A button of the slider; picture: a data address."""

    name: str
    x: float
    picture: NotRequired[str]


class PartEntry(TypedDict):
    """A part of an object with an x of its own; space: whose places are meant."""

    x: ControlEntry
    space: str


class PaintedEntry(PartEntry):
    """How much of each anchor is in it, 0 to 1."""

    kind: Literal["painted"]
    weight: TableEntry


class ShapeEntry(PartEntry):
    """What has a surface, and fades out over `border` metres outside it."""

    border: float


class HalfSpaceEntry(ShapeEntry):
    """All behind a plane through a point; the normal has any length."""

    kind: Literal["half"]
    point: Vec3
    normal: Vec3


class BoxEntry(ShapeEntry):
    """Half its sides, and how it is turned."""

    kind: Literal["box"]
    centre: Vec3
    half: Vec3
    wxyz: Wxyz


class SphereEntry(ShapeEntry):
    """A ball; metres."""

    kind: Literal["sphere"]
    centre: Vec3
    radius: float


RegionEntry = PaintedEntry | HalfSpaceEntry | BoxEntry | SphereEntry


class ObjectEntry(TypedDict):
    """model: its number; pose in the world; bounding box and sphere in the object; metres."""

    name: str
    model: int
    position: list[float]
    wxyz: list[float]
    x: ControlEntry
    visible: bool
    centre: list[float]
    half: list[float]
    radius: float
    movable: bool
    solid: bool
    restitution: float
    states: list[StateEntry]
    regions: list[RegionEntry]


class SceneEntry(TypedDict):
    """The table of contents; metres, m/s^2, display sRGB.  null: nobody knows."""

    format: Literal["shapeshift web 1"]
    title: str
    profile: Profile
    background: list[float]
    brightest: float | None
    radius: float
    view: ViewEntry
    gravity: float
    floorY: float | None
    models: list[ModelEntry]
    objects: list[ObjectEntry]
    palettes: dict[str, TableEntry]


def page_scene(document: Document, settings: PageSettings, progress: Progress) -> bytes:
    """The whole scene.  Raises BadFile for what a page cannot show."""
    refuse(document)
    out = Container(settings.exact)
    pictures = stop_pictures(document, progress) if settings.pictures else {}
    return out.pack(described(out, document, settings, pictures, every=1))


def coarse_scene(document: Document, settings: PageSettings) -> bytes:
    """A sample of every COARSE-th anchor with larger splats: what a page shows while it loads."""
    out = Container(settings.exact)
    return out.pack(described(out, document, settings, {}, COARSE))


def refuse(document: Document) -> None:
    """BadFile, one sentence, for what no page can show."""
    objects = document.scene.objects
    splats = sum(obj.model.splat_count for obj in objects)
    if splats > MOST_SPLATS:
        raise BadFile(
            f"the scene has {splats:,} splats in all objects; a page shows at most {MOST_SPLATS:,}."
        )
    for obj in objects:
        if any(isinstance(selector, Lens) for selector in obj.selectors):
            raise BadFile(
                f"object '{obj.name}' has a lens, which a page cannot show; remove it, or export "
                "the scene baked (--out scene.ply)."
            )
        if obj.selectors and obj.model.blend.direct:
            raise BadFile(
                f"object '{obj.name}' has regions, and its model encodes x between its stops as it "
                "is, which a page cannot show together; `export --encoding stops` writes it anew."
            )
        if follows_eye(obj.model):
            describe_model(Container(), obj.model)  # says why


def described(
    out: Container, document: Document, settings: PageSettings, pictures: dict[float, str],
    every: int,
) -> SceneEntry:  # fmt: skip
    """The table of contents."""
    models = list(document.models)
    number = {id(model): i for i, model in enumerate(models)}
    view = document.view(FRAMED)
    eye, axes = view.world_from_eye.position, view.world_from_eye.matrix()
    centre, radius = document.bounds()
    ahead = max(float((centre - eye) @ -axes[:3, 2]), 0.1 * radius)
    items = {item.name: item for item in document.file.all_items} if document.file else {}
    entries = [
        describe_model(out, sample(model, every), every**0.5 if every > 1 else 1.0)
        for model in models
    ]
    objects = [
        object_entry(
            obj, items.get(obj.name), number[id(obj.model)], pictures,
            [region_entry(out, obj, selector, every) for selector in obj.selectors],
        )
        for obj in document.scene.objects
    ]  # fmt: skip
    for obj, place in zip(document.scene.objects, objects, strict=True):
        if obj.label == 0 and place["solid"]:
            cut_to_ground(place, [entry for entry in objects if entry["movable"]])
    return {
        "format": FORMAT,
        "title": settings.title,
        "profile": settings.profile,
        "background": [float(c) for c in plain_color(document.background)],
        "brightest": brightest_of(models),
        "radius": float(radius),
        "view": {"eye": eye.tolist(), "target": (eye - ahead * axes[:3, 2]).tolist(),
                 "fovY": 2 * float(np.arctan(view.tangents[3]))},
        "gravity": document.file.gravity_m_s2 if document.file else 9.81,
        "floorY": document.floor_y,
        "models": entries,
        "objects": objects,
        "palettes": palettes_of(out, models),
    }  # fmt: skip


def brightest_of(models: list[Model]) -> float | None:
    """The largest display value of any colour; None: nothing bounds it."""
    most = brightest(models)
    return most if math.isfinite(most) else None


def sample(model: Model, every: int) -> Model:
    """Every so many-th anchor or splat."""
    if every == 1:
        return model
    if isinstance(model, AnchorModel):
        return model.with_anchors(np.arange(0, len(model.anchors), every))
    rows = np.arange(0, model.splat_count, every)
    return model.with_rows(rows)  # type: ignore[union-attr]  # refuse() lets no other kind pass


def palettes_of(out: Container, models: list[Model]) -> dict[str, TableEntry]:
    """All of them, where a stop has one: a page can choose."""
    if not any(stop.has_false_colors for m in models for stop in m.stops):
        return {}
    for model in models:
        for stop in model.stops:
            if stop.palette:
                palette_colors(stop.palette)  # an unknown one is refused
    return {name: out.add_table("a palette", palette_colors(name)) for name in PALETTES}


def object_entry(
    obj: SceneObject, item: SceneItem | None, model: int, pictures: dict[float, str],
    regions: list[RegionEntry],
) -> ObjectEntry:  # fmt: skip
    """One object: where it stands, its x, the stops of its slider, its body."""
    middle, half = bounding_box(obj.model)
    stops = named_stops(item, obj.model) if item else obj.model.stops
    states: list[StateEntry] = [{"name": stop.name, "x": float(stop.x)} for stop in stops]
    for state in states:
        if not item and state["x"] in pictures:
            state["picture"] = pictures[state["x"]]
    touched = item is not None and item.collider is not None
    room = item is not None and obj.label == 0
    return {
        "name": obj.name, "model": model,
        "position": [float(v) for v in obj.world_from_object.position],
        "wxyz": [float(v) for v in obj.world_from_object.wxyz],
        "x": control_entry(obj.model, obj.x), "visible": obj.visible,
        "centre": middle.tolist(), "half": half.tolist(), "radius": float(np.linalg.norm(half)),
        "movable": item is not None and touched and not room and not item.static, "solid": touched,
        "restitution": item.restitution if item else 0.0, "states": states,
        "regions": regions,
    }  # fmt: skip


def cut_to_ground(place: ObjectEntry, things: list[ObjectEntry]) -> None:
    """Leaves of the box of an upright bench or room what lies under the things that begin in it.

    The page has boxes alone: things would rest on its top, or fall through.
    """
    if abs(place["wxyz"][0]) < 1 - 1e-6:
        return
    position, centre, half = (np.array(place[key]) for key in ("position", "centre", "half"))
    bottoms = []
    for thing in things:
        world_from_thing = Pose(np.array(thing["position"]), np.array(thing["wxyz"])).matrix()
        middle = world_from_thing[:3, :3] @ thing["centre"] + world_from_thing[:3, 3]
        if (np.abs(middle - position - centre) < half).all():
            sides = np.abs(world_from_thing[:3, :3]) @ thing["half"]
            bottoms.append(float(middle[1] - sides[1] - position[1]))
    low = centre[1] - half[1]
    if bottoms and low < min(bottoms):
        top = min(bottoms)
        place["centre"], place["half"] = list(place["centre"]), list(place["half"])
        place["centre"][1], place["half"][1] = (low + top) / 2, (top - low) / 2
        place["radius"] += float(centre[1] - place["centre"][1])  # still around all of it


def region_entry(out: Container, obj: SceneObject, selector: Selector, every: int) -> RegionEntry:
    """A part of an object with an x of its own; every: of which sample of its anchors."""
    entry: PartEntry = {"x": control_entry(obj.model, selector.x), "space": selector.space}
    if isinstance(selector, Painted):
        weight = out.add_table("painted weights", selector.weight[::every, None], COLOR_BITS)
        return {**entry, "kind": "painted", "weight": weight}
    assert not isinstance(selector, Lens), "refuse() lets none pass"
    shape: ShapeEntry = {**entry, "border": selector.border}
    if isinstance(selector, HalfSpace):
        return {**shape, "kind": "half", "point": selector.point, "normal": selector.normal}
    if isinstance(selector, Box):
        return {
            **shape, "kind": "box", "centre": selector.centre, "half": selector.half,
            "wxyz": selector.wxyz,
        }  # fmt: skip
    return {**shape, "kind": "sphere", "centre": selector.centre, "radius": selector.radius}


def bounding_box(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Middle (3,) and half sides (3,) in the object's frame, metres, of what can be seen."""
    points, opacity = model_points(model)
    finite = np.isfinite(points).all(axis=1)
    seen = finite & (opacity > 0.1)
    points = points[seen if seen.any() else finite].astype(np.float64)
    low, high = np.percentile(points, BOX, axis=0) if len(points) else (np.zeros(3), np.zeros(3))
    return (low + high) / 2, (high - low) / 2


def stop_pictures(document: Document, progress: Progress) -> dict[float, str]:
    """x -> data address of a small WebP of every stop, of one model alone."""
    if document.file or len(document.scene.objects) != 1:
        return {}
    from PIL import Image

    stops = [stop.x for stop in document.scene.objects[0].model.stops][:MOST_PICTURES]
    found = {}
    with Renderer(None, sort="numpy") as renderer:
        renderer.settings = replace(renderer.settings, background=plain_color(document.background))
        for number, x in enumerate(stops):
            progress("drawing pictures of the stops", number / (len(stops) + 1))
            objects = tuple(replace(obj, x=x) for obj in document.scene.objects)
            renderer.update(Scene(objects))
            renderer.draw([document.view(PICTURE)])
            picture = renderer.resolved(0)
            bytes_ = (np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8)
            file = io.BytesIO()
            Image.fromarray(bytes_).save(file, "WEBP", quality=QUALITY)
            address = base64.b64encode(file.getvalue()).decode()
            found[x] = f"data:image/webp;base64,{address}"
    return found
