"""Captures like those that strangers bring: other places, other arrangements, other faults.

A kind is a place of random solids, a way to walk around it, and what went wrong on the day.  It is
written as nerfstudio writes: transforms.json with +Z up, photos and poses; some have masks, either
of the object or of people who walk by, and the file does not say which.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL import Image

from shapeshift.runtime_models.files.whole_file import make_folders, whole_file, write_whole
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.synthetic.placing import ball, bar, box, disc, mix, noise, ring, turned
from shapeshift.training.synthetic.solids import dot, unit
from shapeshift.training.synthetic.tracer import (
    Light,
    Material,
    Pattern,
    Place,
    Solid,
    look,
    photograph,
    shade,
)

Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # from +Y up
LIGHT = Light(sky=(0.45, 0.45, 0.45), ground=(0.3, 0.3, 0.3), in_shadow=0.4)
WHITE, BLACK, SKY = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), (0.62, 0.75, 0.9)
GOLDEN = (5**0.5 - 1) / 2
WRONG_METRES, WRONG_DEGREES = 0.3, 8.0  # of a wrong pose, where things are a metre away
EXPOSURE = 0.3  # by how much photos may be brighter or darker
PHONE_LENS = (-0.11, 0.02)  # k1 and k2 of nerfstudio's OPENCV: lines at the rim bow outwards
EXIF_ORIENTATION, ON_ITS_SIDE = 0x0112, 6  # the tag, and what it says of a phone held upright


@dataclass(frozen=True)
class Kind:
    """What is photographed, from where, and how well."""

    place: Callable[[np.random.Generator], list[Solid]]
    views: Callable[[int, tuple[int, int]], list[View]]
    behind: tuple[float, float, float] = BLACK  # display sRGB, where nothing is
    backdrop: bool = False  # a patterned wall behind, that stands still while the object turns
    exposure: float = 0.0  # share by which photos differ in brightness
    wrong: float = 0.0  # share of the photos whose pose is wrong
    lens: tuple[float, float] = (0.0, 0.0)  # k1 and k2
    missing: float = 0.0  # share of the photos that are named and not there
    phone: bool = False  # JPEGs that say in EXIF that they lie on their side, as poses know them
    views_usually: int = 48
    masks: str = ""  # "object": white where it is; "passers": black where somebody stands


def paint(rng: np.random.Generator, cells_per_m: float) -> Pattern:
    """Two colours in blots, and fine grain on them."""
    low, high = (tuple(c) for c in rng.uniform(0.05, 0.95, (2, 3)))
    aside = rng.uniform(-50, 50, 3)

    def pattern(p: np.ndarray) -> np.ndarray:
        blots = noise(p + aside, cells_per_m) * 2.2 - 0.6
        return mix(low, high, blots + 0.25 * (noise(p + aside, 5 * cells_per_m) - 0.5))

    return pattern


def checks(rng: np.random.Generator, cells_per_m: float) -> Pattern:
    """Squares in two colours."""
    low, high = (tuple(c) for c in rng.uniform(0.1, 0.9, (2, 3)))

    def pattern(p: np.ndarray) -> np.ndarray:
        odd = np.floor(p * cells_per_m + 1e-4).sum(axis=1) % 2
        return mix(low, high, odd)

    return pattern


def scattered(
    rng: np.random.Generator, count: int, across: tuple[float, float], tall: float
) -> list[Solid]:
    """Balls, boxes, bars and rings standing on y = 0, within +-across, of about `tall` metres."""
    out: list[Solid] = []
    for i in range(count):
        x, z = rng.uniform(-1, 1, 2) * across
        high = tall * rng.uniform(0.4, 1.2)
        cells = rng.uniform(1.5, 5) / tall
        make = paint(rng, cells) if i % 3 else checks(rng, cells)
        material = Material(make, gloss=float(rng.choice([0.0, 0.25])))
        turn = turned("y", float(rng.uniform(0, 180)))
        if i % 4 == 0:
            out.append(ball((x, high / 2, z), high / 2, material))
        elif i % 4 == 1:
            half = (high * rng.uniform(0.2, 0.5), high / 2, high * rng.uniform(0.2, 0.5))
            out.append(box((x, high / 2, z), half, material, rotation=turn))
        elif i % 4 == 2:
            lean = rng.uniform(-0.3, 0.3, 2) * high
            out.append(bar((x, 0, z), (x + lean[0], high, z + lean[1]), 0.18 * high, material))
        else:
            out.append(ring((x, 0.45 * high, z), "z", 0.33 * high, 0.1 * high, material))
    return out


def an_object(rng: np.random.Generator) -> list[Solid]:
    """Some things grown together, half a metre tall, without anything below."""
    return scattered(rng, 12, (0.22, 0.22), 0.4)


def a_table(rng: np.random.Generator) -> list[Solid]:
    return [
        disc((0, 0, 0), "y", 0.6, Material(paint(rng, 8))),
        *scattered(rng, 9, (0.35, 0.35), 0.22),
    ]


def walls(rng: np.random.Generator, half: tuple[float, float, float]) -> list[Solid]:
    """Floor, ceiling and four walls around (+-x, 0 to 2y, +-z), as slabs."""
    (x, y, z), thick = half, 0.1
    slabs = [
        ((0, -thick, 0), (x, thick, z)),
        ((0, 2 * y + thick, 0), (x, thick, z)),
        ((-x - thick, y, 0), (thick, y, z)),
        ((x + thick, y, 0), (thick, y, z)),
        ((0, y, -z - thick), (x, y, thick)),
        ((0, y, z + thick), (x, y, thick)),
    ]
    return [box(at, size, Material(paint(rng, 1.2))) for at, size in slabs]


def a_room(rng: np.random.Generator) -> list[Solid]:
    return walls(rng, (2.2, 1.25, 1.8)) + scattered(rng, 14, (1.8, 1.4), 0.8)


def a_corridor(rng: np.random.Generator) -> list[Solid]:
    return walls(rng, (1.1, 1.25, 8.0)) + scattered(rng, 16, (0.9, 7.5), 0.7)


def a_district(rng: np.random.Generator) -> list[Solid]:
    ground = Material(paint(rng, 0.03))
    return [box((0, -1, 0), (2000, 1, 2000), ground), *scattered(rng, 60, (180, 180), 22)]


def view_at(eye: np.ndarray, target: np.ndarray, size: tuple[int, int], degrees: float) -> View:
    return View(look_at(eye, target), perspective(np.deg2rad(degrees), size), 0.05, 20000.0, size)


def around(middle: tuple, away: float, low: float, high: float, degrees: float = 42):
    """All around at elevations from `low` to `high` degrees, in the order of a spiral."""

    def views(count: int, size: tuple[int, int]) -> list[View]:
        out = []
        for i in range(count):
            turn, up = 2 * np.pi * GOLDEN * i, np.deg2rad(low + (high - low) * (i + 0.5) / count)
            spoke = np.array([np.cos(up) * np.cos(turn), np.sin(up), np.cos(up) * np.sin(turn)])
            out.append(view_at(np.array(middle) + away * spoke, np.array(middle), size, degrees))
        return out

    return views


def from_inside(count: int, size: tuple[int, int]) -> list[View]:
    """An oval walk at eye height, looking across the room."""
    out = []
    for i in range(count):
        turn = 2 * np.pi * i / count
        eye = np.array([1.2 * np.cos(turn), 1.25 + 0.3 * np.sin(3 * turn), 0.9 * np.sin(turn)])
        aim = turn + np.pi + 0.5 * np.sin(5 * turn)
        target = np.array([2 * np.cos(aim), 0.8, 1.6 * np.sin(aim)])
        out.append(view_at(eye, target, size, 65))
    return out


def outward(count: int, size: tuple[int, int]) -> list[View]:
    """A turn on the spot: from a small ring in the middle of a room, looking away from it.

    Every third photo looks down, every third up; eyes are 0.35 m from the middle, so that
    neighbouring photos say how far the walls are.
    """
    out = []
    for i in range(count):
        turn, up = 2 * np.pi * i / count, (-0.35, 0.0, 0.3)[i % 3]
        ahead = np.array([np.cos(turn), up, np.sin(turn)])
        eye = np.array([0.35 * ahead[0], 1.5 + 0.1 * np.sin(5 * turn), 0.35 * ahead[2]])
        out.append(view_at(eye, eye + ahead, size, 65))
    return out


def along(count: int, size: tuple[int, int]) -> list[View]:
    """There and back along the corridor, looking ahead."""
    out = []
    for i in range(count):
        there = i < count / 2
        share = 2 * i / count if there else 2 - 2 * i / count
        eye = np.array([0.3 * np.sin(9 * share), 1.4, -7 + 13 * share])
        ahead = np.array([0.3 * np.cos(7 * share), -0.25, 1.0 if there else -1.0])
        out.append(view_at(eye, eye + ahead, size, 60))
    return out


def from_above(count: int, size: tuple[int, int]) -> list[View]:
    """A flight in stripes 70 m above the ground, every third photo with the horizon in it."""
    out, side = [], int(np.ceil(np.sqrt(count)))
    for i in range(count):
        row, column = divmod(i, side)
        column = column if row % 2 == 0 else side - 1 - column
        eye = np.array([-150 + 300 * column / (side - 1), 70, -150 + 300 * row / (side - 1)])
        down = -0.25 if i % 3 == 0 else -1.2
        turn = 1.7 * i
        out.append(view_at(eye, eye + np.array([np.cos(turn), down, np.sin(turn)]), size, 60))
    return out


KINDS = {
    "object_white": Kind(an_object, around((0, 0.22, 0), 1.3, -25, 65), WHITE),
    "object_black": Kind(an_object, around((0, 0.22, 0), 1.3, -25, 65), BLACK),
    "turntable": Kind(a_table, around((0, 0.1, 0), 1.5, 18, 50), backdrop=True),
    "room": Kind(a_room, from_inside),
    "corridor": Kind(a_corridor, along),
    "aerial": Kind(a_district, from_above, SKY),
    "exposure": Kind(a_room, from_inside, exposure=EXPOSURE),
    "twelve": Kind(a_table, around((0, 0.1, 0), 1.5, 15, 60), WHITE, views_usually=12),
    "wrong_poses": Kind(a_table, around((0, 0.1, 0), 1.5, 12, 60), SKY, wrong=0.02,
                        views_usually=100),
    "table_white": Kind(a_table, around((0, 0.1, 0), 1.5, 12, 60), WHITE, views_usually=42),
    "phone": Kind(a_room, from_inside, exposure=0.15, lens=PHONE_LENS, missing=0.15, phone=True,
                  views_usually=64),
    "cut_out": Kind(an_object, around((0, 0.22, 0), 1.3, -25, 65), backdrop=True, masks="object"),
    "passers": Kind(a_room, from_inside, masks="passers"),
    "outward": Kind(a_room, outward),
}  # fmt: skip


def radiance(kind: Kind, here: Place, wall: Pattern):
    """Of rays: what they meet, lit, and behind it one colour, or a wall."""

    def look_along(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hits = look(here, o, d)
        color, missed = shade(here, hits, d, LIGHT), hits.index < 0
        color[missed] = wall(d[missed]) if kind.backdrop else kind.behind
        return color, hits.index

    return look_along


def straightened(x: np.ndarray, y: np.ndarray, lens: tuple[float, float]) -> tuple:
    """Tangents of the rays whose pixels a lens k1, k2 puts at x, y (OpenCV's model)."""
    k1, k2 = lens
    straight_x, straight_y = x, y
    for _ in range(30):  # fixed point; from 20 on nothing changes any more
        square = straight_x**2 + straight_y**2
        factor = 1 + k1 * square + k2 * square**2
        straight_x, straight_y = x / factor, y / factor
    return straight_x, straight_y


def through_lens(view: View, lens: tuple[float, float], look_along):
    """The same radiance, of the rays that a view's pixels get through a lens."""
    world_from_eye = view.world_from_eye.matrix()[:3, :3]

    def bent(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y, z = (d @ world_from_eye).T
        x, y = straightened(x / -z, y / -z, lens)
        return look_along(o, unit(np.stack([x, y, -np.ones_like(x)], 1) @ world_from_eye.T))

    return bent


def passer(view: View, rng: np.random.Generator) -> list[Solid]:
    """Somebody who stands before the camera, to its left or right: as tall as it stands high."""
    eye, ahead = np.asarray(view.world_from_eye.position), -view.world_from_eye.matrix()[:3, 2]
    aside = rng.choice([-1, 1]) * rng.uniform(0.15, 0.5)  # radians
    turn = np.arctan2(ahead[0], ahead[2]) + aside
    away = rng.uniform(0.9, 1.3)
    x, z, tall = eye[0] + away * np.sin(turn), eye[2] + away * np.cos(turn), eye[1]
    clothes = Material(paint(rng, 6))
    return [
        bar((x, 0, z), (x, 0.8 * tall, z), 0.16, clothes),
        ball((x, 0.92 * tall, z), 0.13 * tall, Material((0.8, 0.6, 0.5))),
    ]


def mask_of(view: View, here: Place, first: int) -> np.ndarray:
    """(H, W) float32 the share of each pixel in which a solid from the `first` on is seen."""

    def after(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        index = look(here, o, d).index
        return np.zeros((len(o), 3)), np.where(index >= first, index, -1)

    return photograph(view, after)[1]


def still_wall(view: View, wall: Pattern) -> Pattern:
    """A wall as it is seen by a camera that stands still: by the view's own directions."""
    eye_from_world = view.world_from_eye.matrix()[:3, :3].T
    return lambda d: wall(unit(d @ eye_from_world.T))


def wrong_pose(view: View, rng: np.random.Generator, away: float) -> View:
    """The view from beside where it was taken."""
    pose = view.world_from_eye.matrix()
    pose[:3, :3] = turned("y", WRONG_DEGREES) @ pose[:3, :3]
    pose[:3, 3] += away * WRONG_METRES * unit(rng.normal(size=3))
    return replace(view, world_from_eye=type(view.world_from_eye).from_matrix(pose))


def frame_of(name: str, view: View, ours_from: np.ndarray) -> dict:
    _, fx, fy, cx, cy = view.pinhole()
    matrix = ours_from @ view.world_from_eye.matrix()
    lens = {"fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": view.size[0], "h": view.size[1]}
    return {"file_path": name, "transform_matrix": matrix.tolist()} | lens


def save_photo(path: Path, image: np.ndarray) -> None:
    photo = Image.fromarray(np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8))
    with whole_file(path) as file:
        if path.suffix == ".png":
            photo.save(file, "PNG")
            return
        exif = Image.Exif()
        exif[EXIF_ORIENTATION] = ON_ITS_SIDE
        photo.save(file, "JPEG", quality=92, exif=exif)


def save_mask(path: Path, white: np.ndarray) -> None:
    with whole_file(path) as file:
        Image.fromarray(np.uint8(255) * white.astype(np.uint8)).save(file, "PNG")


def make_stranger(
    folder: Path,
    name: str,
    seed: int = 0,
    size: tuple[int, int] = (160, 120),
    count: int | None = None,
) -> tuple[Place, list[View]]:
    """Writes images/ and transforms.json of a kind into `folder`; what was photographed, from
    where, +Y up.  The same seed gives the same capture.
    """  # fmt: skip
    kind, rng = KINDS[name], np.random.default_rng([seed, list(KINDS).index(name)])
    solids = kind.place(rng)
    here, wall = Place.of(solids), paint(rng, 8)
    views = kind.views(kind.views_usually if count is None else count, size)
    make_folders(folder, "images")
    if kind.masks:
        make_folders(folder, "masks")
    frames, wrong = [], set(rng.permutation(len(views))[: round(kind.wrong * len(views))].tolist())
    lost: set[int] = set()
    if kind.missing:  # else nothing is drawn, so that older kinds stay as they are
        lost = set(rng.permutation(len(views))[: round(kind.missing * len(views))].tolist())
    for i, view in enumerate(views):
        file = f"images/frame_{i:05}.{'jpg' if kind.phone else 'png'}"
        behind = still_wall(view, wall) if kind.backdrop else wall
        there = here if kind.masks != "passers" else Place.of(solids + passer(view, rng))
        seen = radiance(kind, there, behind)
        if any(kind.lens):
            seen = through_lens(view, kind.lens, seen)
        gain = 1 + kind.exposure * rng.uniform(-1, 1)
        if i not in lost:
            save_photo(folder / file, gain * photograph(view, seen)[0])
        stated = view
        if i in wrong:
            eye = np.asarray(view.world_from_eye.position)
            stated = wrong_pose(view, rng, float(np.sqrt(dot(eye[None], eye[None])[0])))
        frames.append(frame_of(file, stated, Z_UP))
        if kind.masks:
            mask = frames[-1]["mask_path"] = f"masks/frame_{i:05}.png"
            people = kind.masks == "passers"
            share = mask_of(view, there, len(solids) if people else 0)
            white = share == 0 if people else share >= 0.5  # of people no edge is left
            save_mask(folder / mask, white)
    bends = dict(zip(("k1", "k2"), kind.lens, strict=True)) if any(kind.lens) else {}
    data = {"camera_model": "OPENCV"} | bends | {"frames": frames}
    write_whole(folder / "transforms.json", json.dumps(data, indent=1).encode())
    return here, views
