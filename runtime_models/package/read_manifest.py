"""scene.json of a package: every entry is checked here, what is wrong becomes one sentence."""

import json
import reprlib
from dataclasses import dataclass
from itertools import pairwise

from shapeshift.runtime_models.files.plain_text import cut
from shapeshift.runtime_models.model import (
    BETWEEN_STOPS,
    HEADS,
    STOP_KINDS,
    BadFile,
    ControlEncoding,
    Stop,
)
from shapeshift.runtime_models.package.package_files import FORMAT, FRAMES_FORMAT
from shapeshift.runtime_models.stop_weights import Pace

LARGEST_COUNT = 4096  # splats an anchor, features, Gaussians of the encoding
LONGEST_PACE = 257  # weights of one pair of stops
LARGEST_NUMBER = 1e30  # beyond it float32 products overflow
PARTS = ("feature", "direction", "control")
LONGEST_VALUE = 80  # letters of a wrong value in a message
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
    has_frames: bool = False  # whether anchors.npz holds the anchors' own frames


def read_manifest(data: bytes, where: str) -> Manifest:
    """The checked manifest; `where` is for messages.  Raises BadFile."""
    try:
        entries = json.loads(data)
    except (ValueError, RecursionError):
        raise BadFile(f"{where} is not JSON; export it again.") from None
    found = entries.get("format") if isinstance(entries, dict) else None
    if found not in (FORMAT, FRAMES_FORMAT):
        raise BadFile(
            f"{where} has format {short(found)}, this program reads {FORMAT!r} and "
            f"{FRAMES_FORMAT!r}; a newer program may be needed."
        )
    top = Wanted(entries, where)
    if top.get("up") != "+Y":
        raise BadFile(f"{where} has up axis {short(top.get('up'))}, expected '+Y'; turn the scene.")
    provenance = Wanted(entries.get("provenance", {}), f"{where} 'provenance'")
    check_view(provenance)
    heads, stops = top.object("heads"), read_stops(top.get("stops"), where)
    between = entries.get("between_stops", "blend")
    if between not in BETWEEN_STOPS:
        raise BadFile(
            f"{where}: 'between_stops' is {short(between)}, expected one of {list(BETWEEN_STOPS)}."
        )
    return Manifest(
        top.count("splats_per_anchor"),
        top.count("feature_width"),
        read_encoding(top.object("encoding")),
        stops,
        {name: read_head(name, heads.object(name)) for name in HEADS},
        provenance.entries,
        read_pace(entries.get("pace", []), {stop.name for stop in stops}, where),
        between,
        found == FRAMES_FORMAT,
    )


class Wanted:
    """A JSON object whose missing or wrong entries become sentences."""

    def __init__(self, entries: object, where: str) -> None:
        if not isinstance(entries, dict):
            raise BadFile(f"{where} is {short(entries)}, expected an object.")
        self.entries, self.where = entries, where

    def get(self, key: str):
        if key not in self.entries:
            raise BadFile(f"{self.where} lacks '{key}'; docs/package.md lists what must be there.")
        return self.entries[key]

    def object(self, key: str) -> "Wanted":
        return Wanted(self.get(key), f"{self.where} '{key}'")

    def count(self, key: str) -> int:
        value = self.get(key)
        if type(value) is not int or not 1 <= value <= LARGEST_COUNT:
            raise BadFile(
                f"{self.where}: '{key}' is {short(value)}, "
                f"expected a whole number from 1 to {LARGEST_COUNT}."
            )
        return value

    def number(self, key: str) -> float:
        value = self.get(key)
        if not is_number(value):
            raise BadFile(f"{self.where}: '{key}' is {short(value)}, expected a finite number.")
        return float(value)

    def numbers(self, key: str, count: int) -> tuple[float, ...]:
        value = self.get(key)
        if not (isinstance(value, list) and len(value) == count and all(map(is_number, value))):
            raise BadFile(f"{self.where}: '{key}' is {short(value)}, expected {count} numbers.")
        return tuple(map(float, value))

    def text(self, key: str) -> str:
        value = self.get(key)
        if not (isinstance(value, str) and value.strip()):
            raise BadFile(f"{self.where}: '{key}' is {short(value)}, expected a text.")
        return value


def short(value: object) -> str:
    """A wrong value for a message, its middle left out where it is long."""
    return cut(reprlib.repr(value), LONGEST_VALUE)


def is_number(value: object) -> bool:
    """JSON's true is no number here; NaN and what float32 cannot hold are none, too."""
    return type(value) in (int, float) and abs(value) < LARGEST_NUMBER


def read_encoding(want: Wanted) -> ControlEncoding:
    encoding = ControlEncoding(want.count("d"), want.number("spacing"), want.number("sigma"))
    if not (encoding.sigma > 0 and encoding.spacing > 0):
        raise BadFile(f"{want.where}: sigma and spacing must be above 0.")
    return encoding


def read_head(name: str, want: Wanted) -> Head:
    file, inputs, activation = want.text("file"), want.get("inputs"), want.text("activation")
    if "/" in file or "\\" in file or not file.endswith(".onnx"):
        raise BadFile(f"{want.where}: file is {short(file)}, expected a .onnx in the package.")
    parts = PARTS if name == "color" else ("feature", "control")  # only colour sees the eye
    if not (
        isinstance(inputs, list)
        and inputs
        and all(inputs.count(part) == 1 and part in parts for part in inputs)
    ):
        raise BadFile(
            f"{want.where}: inputs are {short(inputs)}, expected some of {list(parts)}, each once."
        )
    if activation not in ACTIVATIONS:
        raise BadFile(
            f"{want.where}: activation is {short(activation)}, expected one of {list(ACTIVATIONS)}."
        )
    return Head(file, tuple(inputs), activation)


def read_stops(rows: object, where: str) -> tuple[Stop, ...]:
    if not (isinstance(rows, list) and rows):
        raise BadFile(f"{where}: 'stops' must be a list of at least one stop.")
    stops = tuple(read_stop(Wanted(row, f"{where} stop {i}")) for i, row in enumerate(rows))
    if any(a.x >= b.x for a, b in pairwise(stops)):
        raise BadFile(f"{where}: the stops' x must rise, they are {short([s.x for s in stops])}.")
    if len({stop.name for stop in stops}) < len(stops):
        raise BadFile(f"{where}: two stops have one name in {short([s.name for s in stops])}.")
    return stops


def read_stop(want: Wanted) -> Stop:
    name, x, kind = want.text("name"), want.number("x"), want.get("kind")
    if not 0 <= x <= 1:
        raise BadFile(f"{want.where}: x is {x}, expected 0 to 1.")
    if kind not in STOP_KINDS:
        raise BadFile(f"{want.where}: kind is {short(kind)}, expected one of {list(STOP_KINDS)}.")
    palette, unit = (want.text(key) if want.entries.get(key) else "" for key in ("palette", "unit"))
    if want.entries.get("value_range") is None:
        return Stop(name, x, kind, palette)
    low, high = want.numbers("value_range", 2)
    if not low < high:
        raise BadFile(f"{want.where}: value_range is {low} to {high}, expected the lower first.")
    return Stop(name, x, kind, palette, (low, high), unit)


def read_pace(rows: object, stops: set[str], where: str) -> tuple[Pace, ...]:
    """The paces of some pairs of stops."""
    if not isinstance(rows, list):
        raise BadFile(f"{where}: 'pace' is {short(rows)}, expected a list of pairs of stops.")
    paces: dict[frozenset[str], Pace] = {}
    for i, row in enumerate(rows):
        want = Wanted(row, f"{where} pace {i}")
        ends, blend = (want.text("from"), want.text("to")), want.get("blend")
        if not (set(ends) <= stops and ends[0] != ends[1] and frozenset(ends) not in paces):
            raise BadFile(
                f"{want.where} is from {short(ends[0])} to {short(ends[1])}, expected two stops of "
                "the scene, each pair once."
            )
        listed = isinstance(blend, list) and 2 <= len(blend) <= LONGEST_PACE
        if not (listed and all(map(is_number, blend))):
            raise BadFile(f"{want.where}: blend is {short(blend)}, expected 2 to {LONGEST_PACE} "
                          "numbers.")  # fmt: skip
        try:
            paces[frozenset(ends)] = Pace(*ends, tuple(map(float, blend)))
        except ValueError as error:
            raise BadFile(f"{want.where}: {error}") from None
    return tuple(paces.values())


def check_view(provenance: Wanted) -> None:
    """The first look, where there is one: it steers a camera, so it must be sound."""
    if "view" not in provenance.entries:
        return
    view = provenance.object("view")
    if view.numbers("eye", 3) == view.numbers("target", 3):
        raise BadFile(f"{view.where}: eye and target are one point, expected two.")
    if "fov_y" in view.entries and not 0.01 < view.number("fov_y") < 3.1:
        raise BadFile(f"{view.where}: fov_y is {view.number('fov_y')}, expected radians below pi.")
