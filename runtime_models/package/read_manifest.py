"""scene.json of a package: every entry is checked here, what is wrong becomes one sentence."""

import math
from dataclasses import dataclass
from itertools import pairwise

from shapeshift.runtime_models.eyes import EYES, LOOK, LOOKS, MOST_EYES
from shapeshift.runtime_models.files.json_fields import Fields, is_number, parse_json, shown
from shapeshift.runtime_models.model import (
    BETWEEN_STOPS,
    HEADS,
    MOST_LABEL,
    STOP_KINDS,
    BadFile,
    ControlEncoding,
    ObjectLabel,
    Stop,
)
from shapeshift.runtime_models.package.package_files import (
    FORMATS,
    FRAMES_FORMAT,
    LIGHT,
    LIT,
)
from shapeshift.runtime_models.stop_dates import check_dates
from shapeshift.runtime_models.stop_weights import Pace
from shapeshift.runtime_models.stops.stop_formula import check_formulas

LARGEST_COUNT = 4096  # splats an anchor, features, Gaussians of the encoding
LONGEST_PACE = 257  # weights of one pair of stops
MOST_ROWS = 1 << 16  # stops, or pairs of stops with a pace
LARGEST_NUMBER = 1e30  # beyond it float32 products overflow
LARGEST_TANGENT = 1e4  # of a photo's edge: 179.99 degrees
UNIT_SLACK = 0.01  # that a quaternion of four decimals may be off one
PARTS = ("feature", "direction", LIGHT, "control")
ADVICE = "docs/package.md lists what must be there"
ACTIVATIONS = ("none", "tanh", "sigmoid", "softplus", "exp")


@dataclass(frozen=True)
class Head:
    """What the manifest says of one network."""

    file: str
    inputs: tuple[str, ...]  # out of PARTS, in the order of concatenation
    activation: str


@dataclass(frozen=True)
class Manifest:
    splats_per_anchor: int
    feature_width: int
    encoding: ControlEncoding
    stops: tuple[Stop, ...]
    heads: dict[str, Head]
    provenance: dict
    pace: tuple[Pace, ...] = ()
    between_stops: str = "blend"
    has_frames: bool | None = False  # whether anchors.npz holds anchors' frames; None: maybe
    objects: tuple[ObjectLabel, ...] | None = None  # None: anchors.npz holds no labels
    light_channels: int = 0  # of their light by direction; 0: it holds none


def read_manifest(data: bytes, where: str) -> Manifest:
    """The checked manifest; `where` is for messages.  Raises BadFile."""
    top = Fields(parse_json(data, where), where, ADVICE)
    found = top.data.get("format")
    if found not in FORMATS:
        raise BadFile(
            f"{where} has format {shown(found)}, this program reads "
            f"{', '.join(map(repr, FORMATS[:-1]))} and '{FORMATS[-1]}'; a newer program may be "
            "needed."
        )
    if (up := top.value("up")) != "+Y":
        raise BadFile(f"{where} has up axis {shown(up)}, expected '+Y'; turn the scene.")
    provenance = Fields(top.value("provenance", {}), f"{where}: 'provenance'", ADVICE)
    check_view(provenance)
    check_eyes(provenance)
    heads, stops = top.object("heads"), read_stops(top)
    return Manifest(
        top.count("splats_per_anchor", 1, LARGEST_COUNT),
        top.count("feature_width", 1, LARGEST_COUNT),
        read_encoding(top.object("encoding")),
        stops,
        {name: read_head(name, heads.object(name), found) for name in HEADS},
        dict(provenance.data),
        read_pace(top, {stop.name for stop in stops}),
        top.line("between_stops", "blend", known=BETWEEN_STOPS),
        None if found in LIT else found == FRAMES_FORMAT,
        read_objects(top),
        LIT.get(found, 0),
    )


def finite(entry: Fields, key: str) -> float:
    return entry.number(key, low=-LARGEST_NUMBER, high=LARGEST_NUMBER)


def read_encoding(entry: Fields) -> ControlEncoding:
    encoding = ControlEncoding(
        entry.count("d", 1, LARGEST_COUNT), finite(entry, "spacing"), finite(entry, "sigma")
    )
    if not (encoding.sigma > 0 and encoding.spacing > 0):
        raise BadFile(f"{entry.where}: sigma and spacing must be above 0.")
    return encoding


def read_head(name: str, entry: Fields, version: str) -> Head:
    file, inputs = entry.text("file"), entry.value("inputs")
    if "/" in file or "\\" in file or not file.endswith(".onnx"):
        raise entry.error("file", "the name of a .onnx in the package")
    known = PARTS if name == "color" else ("feature", "control")  # only colour sees the eye
    parts = tuple(part for part in known if version in LIT or part != LIGHT)
    if not (
        isinstance(inputs, list)
        and inputs
        and all(inputs.count(part) == 1 and part in parts for part in inputs)
    ):
        raise entry.error("inputs", f"a list of some of {', '.join(parts)}, each once,")
    if version in LIT and name == "color" and not {"direction", LIGHT} <= set(inputs):
        raise entry.error("inputs", f"a list with 'direction' and '{LIGHT}' in '{version}'")
    return Head(file, tuple(inputs), entry.line("activation", known=ACTIVATIONS))


def read_stops(entry: Fields) -> tuple[Stop, ...]:
    """The list "stops" of an object, in the order of their x.  Raises BadFile."""
    rows = entry.rows("stops", MOST_ROWS, "stop", first=0)
    if not rows:
        raise BadFile(f"{entry.where}: 'stops' must be a list of at least one stop.")
    stops = tuple(map(read_stop, rows))
    if any(a.x >= b.x for a, b in pairwise(stops)):
        raise BadFile(
            f"{entry.where}: the stops' x must rise, they are {shown([s.x for s in stops])}."
        )
    names = [stop.name for stop in stops]
    if len(set(names)) < len(names):
        raise BadFile(f"{entry.where}: two stops have one name in {shown(names)}.")
    try:
        check_dates(stops)
        check_formulas(stops)
    except ValueError as error:
        raise BadFile(f"{entry.where}: {error}") from None
    return stops


def read_stop(entry: Fields) -> Stop:
    name, x = entry.text("name"), entry.number("x", wanted="0 to 1", low=0, high=1)
    kind, palette = entry.line("kind", known=STOP_KINDS), entry.text("palette", "")
    date = entry.line("date") if entry.has("date") else ""
    ends, unit = None, ""
    if entry.has("value_range"):
        ends, unit = entry.pair("value_range", most=LARGEST_NUMBER), entry.text("unit", "")
    formula = entry.text("formula", "") if kind == "values" else ""
    try:
        return Stop(name, x, kind, palette, ends, unit, date, formula)
    except ValueError as error:
        raise BadFile(f"{entry.where}: {error}") from None


def read_pace(top: Fields, stops: set[str]) -> tuple[Pace, ...]:
    """The paces of some pairs of stops."""
    paces: dict[frozenset[str], Pace] = {}
    for row in top.rows("pace", MOST_ROWS, "pace", first=0):
        first, last, blend = row.text("from"), row.text("to"), row.value("blend")
        ends = frozenset((first, last))
        if not (ends <= stops and first != last and ends not in paces):
            raise BadFile(
                f"{row.where} is from {shown(first)} to {shown(last)}, expected two stops of "
                "the scene, each pair once."
            )
        listed = isinstance(blend, list) and 2 <= len(blend) <= LONGEST_PACE
        if not (listed and all(is_number(b) and abs(b) <= LARGEST_NUMBER for b in blend)):
            raise row.error("blend", f"a list of 2 to {LONGEST_PACE} numbers")
        try:
            paces[ends] = Pace(first, last, tuple(map(float, blend)))
        except ValueError as error:
            raise BadFile(f"{row.where}: {error}") from None
    return tuple(paces.values())


def read_objects(top: Fields) -> tuple[ObjectLabel, ...] | None:
    """What the labels of anchors mean; None where the manifest has no "objects"."""
    if not top.has("objects"):
        return None
    found: dict[int, ObjectLabel] = {}
    for row in top.rows("objects", MOST_LABEL, "object", first=0):
        label, name = row.count("label", 1, MOST_LABEL), row.line("name")
        if label in found or name in (other.name for other in found.values()):
            word = f"label {label}" if label in found else f"name {shown(name)}"
            raise BadFile(f"{row.where}: the {word} is taken by another object; each has its own.")
        found[label] = ObjectLabel(label, name)
    return tuple(found.values())


def check_view(provenance: Fields) -> None:
    """The first look, where there is one: it steers a camera, so it must be sound."""
    if "view" not in provenance.data:
        return
    view = provenance.object("view")
    if view.numbers("eye", 3, most=LARGEST_NUMBER) == view.numbers(
        "target", 3, most=LARGEST_NUMBER
    ):
        raise BadFile(f"{view.where}: eye and target are one point, expected two.")
    if not 0.01 < view.number("fov_y", 1.0) < 3.1:
        raise view.error("fov_y", "an angle above 0.01 and below 3.1 radians")


def check_eyes(provenance: Fields) -> None:
    """Where photos were taken, if it says so: exports fit colours as they are seen from there."""
    eyes = provenance.value(EYES, [])
    if not isinstance(eyes, list) or len(eyes) > MOST_EYES or not all(map(is_place, eyes)):
        wanted = f"a list of at most {MOST_EYES} places of three finite numbers up to"
        raise provenance.error(EYES, f"{wanted} {LARGEST_NUMBER:g}")
    looks = provenance.value(LOOKS, [])
    if not isinstance(looks, list) or len(looks) > MOST_EYES or not all(map(is_look, looks)):
        wanted = "a list with, beside each eye, a unit quaternion w x y z and the tangents left <"
        raise provenance.error(LOOKS, f"{wanted} right, down < up")


def is_look(value: object) -> bool:
    if not (isinstance(value, list) and len(value) == LOOK and all(map(is_number, value))):
        return False
    if not all(abs(number) <= LARGEST_TANGENT for number in value):
        return False
    w, x, y, z, left, right, down, up = value
    return abs(math.hypot(w, x, y, z) - 1) < UNIT_SLACK and left < right and down < up


def is_place(value: object) -> bool:
    if not (isinstance(value, list) and len(value) == 3 and all(map(is_number, value))):
        return False
    return all(abs(number) <= LARGEST_NUMBER for number in value)
