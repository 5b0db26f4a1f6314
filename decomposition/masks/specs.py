"""objects.json: which objects a capture shows, and the hints by which their masks are found.

The paper's object specifications (OWD section 3.1), docs/objects.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from shapeshift.decomposition.masks.label_maps import MOST_LABEL
from shapeshift.runtime_models.files.json_fields import Fields, is_number, read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.document.scene_file import BACKGROUND, HULLS
from shapeshift.scene.pose import MOST_SIDE

FORMAT = "shapeshift-objects 1"
MOST_PROMPTS = 1000  # of an object
MOST_POINTS = 1000  # of a prompt
LONGEST_NAME = 100  # letters
MOST_MASS = 1e6  # kg
Point = tuple[float, float]


@dataclass(frozen=True)
class PhotoPrompt:
    """What a person says of an object in one photo; pixels of the file, x right, y down."""

    photo: str  # below the capture's folder, forward slashes
    box: tuple[float, float, float, float] | None = None  # left, top, right, bottom
    inside: tuple[Point, ...] = ()  # on the object
    outside: tuple[Point, ...] = ()  # beside it
    mask: str | None = None  # an 8-bit grey PNG, beside objects.json
    mask_label: int | None = None  # the value in it that stands for the object


@dataclass(frozen=True)
class ObjectSpec:
    label: int  # 1 to 254
    name: str
    prompts: tuple[PhotoPrompt, ...] = ()
    text: str = ""  # "a red mug": for a segmenter that reads
    mass_kg: float = 1.0
    static: bool = False
    collider: str | None = HULLS  # as in a scene file; None: nothing touches it


@dataclass(frozen=True)
class ObjectSpecs:
    """The objects of one capture; labels and names are unique."""

    folder: Path  # where the paths of masks begin
    objects: tuple[ObjectSpec, ...] = field(default=())

    def path(self, prompt: PhotoPrompt) -> Path:
        """Of the prompt's mask."""
        assert prompt.mask is not None
        return self.folder / prompt.mask


def read_specs(path: str | Path) -> ObjectSpecs:
    """Raises BadFile, one sentence that names the object and the key."""
    path = Path(path)
    return specs_of(read_json(path, path.name, unique=True), path.name, path.parent)


def checked(objects: Sequence[ObjectSpec], folder: Path) -> ObjectSpecs:
    """Objects that were made by a program, under the rules of the file.  Raises BadFile."""
    rows = [object_row(spec) for spec in objects]
    return specs_of({"format": FORMAT, "objects": rows}, "objects", folder)


def specs_of(data: object, where: str, folder: Path) -> ObjectSpecs:
    """What the JSON says; `where` is for messages.  Raises BadFile."""
    file = Fields(data, where, "docs/objects.md describes the file")
    if file.value("format") != FORMAT:
        raise file.error("format", f"'{FORMAT}', which this program reads,")
    rows = file.rows("objects", MOST_LABEL, "object")
    file.refuse_unknown_keys()
    if not rows:
        raise file.error("objects", "a list of one object or more")
    objects = tuple(read_object(row, where) for row in rows)
    for key in ("label", "name"):
        values = [getattr(spec, key) for spec in objects]
        if twice := next((v for v in values if values.count(v) > 1), None):
            raise BadFile(f"{where}: two objects have the {key} {twice!r}; choose another.")
    return ObjectSpecs(folder, objects)


def read_object(row: Fields, file: str) -> ObjectSpec:
    name = row.line("name")
    if len(name) > LONGEST_NAME or not name.strip():
        raise row.error("name", f"a name of at most {LONGEST_NAME} letters")
    if name == BACKGROUND:
        raise row.error("name", "another name, for label 0 is called that,")
    row.where = f"{file}: object '{name}'"
    collider: str | None = HULLS
    if "collider" in row.data:
        collider = row.path("collider") if row.value("collider") is not None else None
    row.value("collider", None)
    prompts = row.rows("prompts", MOST_PROMPTS, "prompt")
    spec = ObjectSpec(
        label=row.count("label", 1, MOST_LABEL),
        name=name,
        prompts=tuple(map(read_prompt, prompts)),
        text=row.line("text", "") if row.value("text", "") != "" else "",
        mass_kg=row.number("mass_kg", 1.0, "kilograms above 0", 1e-9, MOST_MASS),
        static=row.flag("static"),
        collider=collider,
    )
    row.refuse_unknown_keys()
    photos = [prompt.photo for prompt in spec.prompts]
    if twice := next((p for p in photos if photos.count(p) > 1), None):
        raise BadFile(f"{row.where}: two prompts are of the photo '{twice}'; make them one.")
    return spec


def read_prompt(row: Fields) -> PhotoPrompt:
    prompt = PhotoPrompt(
        photo=row.path("photo"),
        box=read_box(row),
        inside=read_points(row, "inside"),
        outside=read_points(row, "outside"),
        mask=row.path("mask") if row.value("mask", None) is not None else None,
        mask_label=(
            row.count("mask_label", 1, 255) if row.value("mask_label", None) is not None else None
        ),
    )
    row.refuse_unknown_keys()
    if prompt.mask is None and prompt.mask_label is not None:
        raise row.error("mask_label", "it together with 'mask', or left out,")
    if prompt.mask is not None and (prompt.box or prompt.inside or prompt.outside):
        raise row.error("mask", "a mask alone, or a box and points,")
    if prompt.mask is None and prompt.box is None and not prompt.inside:
        raise BadFile(f"{row.where} shows nothing; give it 'box', 'inside' or 'mask'.")
    return prompt


def read_box(row: Fields) -> tuple[float, float, float, float] | None:
    if row.value("box", None) is None:
        return None
    left, top, right, bottom = row.numbers("box", 4, most=MOST_SIDE)
    if not (left < right and top < bottom):
        raise row.error("box", "[left, top, right, bottom] in pixels")
    return left, top, right, bottom


def read_points(row: Fields, key: str) -> tuple[Point, ...]:
    value = row.value(key, [])
    good = isinstance(value, list) and len(value) <= MOST_POINTS
    if not (good and all(map(is_point, value))):
        raise row.error(key, f"a list of at most {MOST_POINTS:,} [x, y] in pixels of the photo")
    return tuple((float(x), float(y)) for x, y in value)


def is_point(value: object) -> bool:
    return (
        isinstance(value, list)
        and len(value) == 2
        and all(is_number(n) and 0 <= n <= MOST_SIDE for n in value)
    )


def object_row(spec: ObjectSpec) -> dict:
    row: dict = {"label": spec.label, "name": spec.name}
    if spec.prompts:
        row["prompts"] = [prompt_row(prompt) for prompt in spec.prompts]
    plain = ObjectSpec(spec.label, spec.name)
    for key in ("text", "mass_kg", "static", "collider"):
        if getattr(spec, key) != getattr(plain, key):
            row[key] = getattr(spec, key)
    return row


def prompt_row(prompt: PhotoPrompt) -> dict:
    row: dict = {"photo": prompt.photo}
    if prompt.box:
        row["box"] = list(map(whole, prompt.box))
    for key in ("inside", "outside"):
        if points := getattr(prompt, key):
            row[key] = [list(map(whole, point)) for point in points]
    for key in ("mask", "mask_label"):
        if getattr(prompt, key) is not None:
            row[key] = getattr(prompt, key)
    return row


def whole(number: float) -> float:
    """The same number, without a fraction of zero."""
    return int(number) if number == int(number) else number
