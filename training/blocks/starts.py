"""A coarse run cut into blocks: a folder with what each block's run begins with."""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shapeshift.runtime_models.blocks.read_blocks import BlockBox
from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.files.plain_text import json_text
from shapeshift.runtime_models.files.whole_file import whole_folder, write_whole
from shapeshift.runtime_models.model import AnchorModel, BadFile
from shapeshift.runtime_models.package.feature_codes import EXACT
from shapeshift.runtime_models.package.refit_encoding import encoding_for
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.blocks.block_start import (
    ADVICE,
    BlockPlace,
    BlockStart,
    CoarsePicture,
    Cover,
    Progress,
    begun_anew,
    cover_of,
    endless,
    finite,
    part_of_state,
    photos_of,
)
from shapeshift.training.blocks.cut import FAR, Wanted, cut_whole, far_away
from shapeshift.training.first_anchors.hull import (
    median_neighbour,
    voxel_centres,
)
from shapeshift.training.settings import TrainSettings

LIST = "cut.json"
FORMAT = "shapeshift-cut 1"
LARGEST_LIST = 4 << 20  # bytes


@dataclass(frozen=True)
class Coarse:
    """A coarse run that has ended."""

    model: AnchorModel
    state: dict[str, np.ndarray]
    notes: dict[str, Any]  # of its checkpoint


@dataclass(frozen=True)
class CutRules:
    """How a coarse run is cut."""

    wanted: Wanted
    least_photos: int = 50  # for training, of all modalities together
    most: int = 12000  # anchors that a block may have


@dataclass(frozen=True)
class CutBlock:
    """A row of cut.json: either `start` or `coarse` names a file beside it."""

    box: BlockBox
    anchors: int
    photos: int  # for training
    start: str  # of its run; "": it stays as the coarse run left it
    coarse: str  # a package; "": it is trained
    why: str  # it is not


@dataclass(frozen=True)
class CutList:
    """What cut.json says."""

    turn_degrees: float
    blocks: tuple[CutBlock, ...]
    far: str  # a package; "": nothing is far


def expected_anchors(capture: Capture) -> np.ndarray:
    """(P, 3) metres: places as far apart as the capture's points, where anchors are expected.

    Raises BadFile where the capture has none.
    """
    if capture.points is None or not len(capture.points):
        raise BadFile(
            f"{capture.folder} has no points that would say how many anchors it needs; give a "
            "number of blocks, --blocks N, or a grid, --blocks 4x2."
        )
    points = np.unique(np.asarray(capture.points, np.float64), axis=0)
    spacing = max(median_neighbour(points, np.random.default_rng(0)), 1e-9)
    return voxel_centres(points, spacing).astype(np.float64)


def make_starts(
    device, capture: Capture, coarse: Coarse, rules: CutRules, folder: Path,
    report: Progress | None = None,
) -> CutList:  # fmt: skip
    """Writes `folder` and returns what its list says.  Raises BadFile."""
    anchors = coarse.state["anchors.value"]
    eyes = np.array([photo.view.world_from_eye.position for photo in capture.photos])
    far = far_away(anchors, eyes)
    if far.all():
        raise BadFile(
            "all anchors stand far from the cameras, so nothing can be cut; train without --blocks."
        )
    wanted, expected = rules.wanted, anchors[~far]
    if wanted.count is None and wanted.grid is None:
        expected = expected_anchors(capture)
        expected = expected[~far_away(expected, eyes)]
    cut = cut_whole(anchors[~far], wanted, expected, rules.most)
    places = [place_of(box, cut.turn_degrees, eyes) for box in cut.boxes]
    block = np.full(len(anchors), -1, np.int32)
    for number, place in enumerate(places):
        block[place.holds(anchors)] = number
    covers = look_at_photos(device, capture, coarse, block, len(places), report)
    with whole_folder(folder) as part:
        rows: list[CutBlock] = []
        for number, place in enumerate(places):
            if (block == number).any():
                name, own = str(len(rows)), block == number
                rows.append(
                    write_one(part, name, own, place, covers[number], (capture, coarse, rules))
                )
        found = CutList(cut.turn_degrees, tuple(rows), "far.shift" if (block < 0).any() else "")
        if found.far:
            write_package(coarse.model.with_anchors(np.flatnonzero(block < 0)), part / found.far)
        write_whole(part / LIST, (json_text(describe(found)) + "\n").encode())
    return found


def place_of(box: BlockBox, degrees: float, eyes: np.ndarray) -> BlockPlace:
    """The same cube as far_away's."""
    low, high = eyes.min(axis=0), eyes.max(axis=0)
    x, y, z = ((low + high) / 2).tolist()
    half = FAR / 2 * float((high - low).max())
    return BlockPlace(box, degrees, (x, y, z), half if half > 0 else math.inf)


def look_at_photos(
    device, capture: Capture, coarse: Coarse, block: np.ndarray, count: int,
    report: Progress | None,
) -> tuple[Cover, ...]:  # fmt: skip
    settings = TrainSettings(**coarse.notes["settings"])
    encoding = encoding_for([stop.x for stop in capture.stops])
    layout = settings.layout(encoding.d, len(capture.stops))
    picture = CoarsePicture(
        device, coarse.state, layout, coarse.notes["voxel"], encoding, capture.stops
    )
    factor = coarse.model.provenance["downscale"]
    return cover_of(picture, capture.photos, factor, block, count, report)


def write_one(
    folder: Path, name: str, own: np.ndarray, place: BlockPlace, cover: Cover,
    known: tuple[Capture, Coarse, CutRules],
) -> CutBlock:  # fmt: skip
    """The start of a block, or its package where it stays as it is."""
    capture, coarse, rules = known
    mine = photos_of(cover, capture, capture.photos)
    training = [photo for photo in mine if photo.split == "train"]
    why = why_coarse([photo.modality for photo in training], capture, rules)
    row = CutBlock(place.box, int(own.sum()), len(training), "", "", why)
    if why:
        model = coarse.model.with_anchors(np.flatnonzero(own))
        write_package(model, folder / f"{name}.shift", EXACT)
        return replace(row, coarse=f"{name}.shift")
    settings = TrainSettings(**coarse.notes["settings"])
    units = encoding_for([stop.x for stop in capture.stops]).d
    layout = settings.layout(units, len(capture.stops))
    state = part_of_state(coarse.state, np.flatnonzero(own | cover.context), layout)
    known_before = coarse.model.provenance
    kept = [key for key in ("view", "background", "downscale") if key in known_before]
    provenance = {key: known_before[key] for key in kept}
    start = BlockStart(place, mine, state, begun_anew(coarse.notes), provenance)
    start.notes["of_block"] = digest_of(start)
    start.write(folder / f"{name}.start.npz")
    return replace(row, start=f"{name}.start.npz")


def why_coarse(modalities: Sequence[str], capture: Capture, rules: CutRules) -> str:
    """Why a block with training photos of these modalities is not trained; "": it is."""
    if len(modalities) < rules.least_photos:
        return f"{len(modalities)} photos show it, {rules.least_photos} are wanted"
    lacking = [stop.name for stop in capture.stops if stop.name not in modalities]
    return f"no photo of '{lacking[0]}' shows it" if lacking else ""


def digest_of(start: BlockStart) -> str:
    """What a checkpoint of the block is known by."""
    digest = hashlib.sha256(repr((start.place, start.notes)).encode())
    for name, array in sorted(start.state.items()):
        digest.update(name.encode() + np.ascontiguousarray(array).tobytes())
    for photo in start.photos:
        digest.update(f"{photo.path}\n{photo.modality}\n".encode())
    return digest.hexdigest()


def describe(found: CutList) -> dict:
    rows = [
        {
            "low": finite(row.box.low), "high": finite(row.box.high), "anchors": row.anchors,
            "photos": row.photos, "start": row.start, "coarse": row.coarse, "why": row.why,
        }
        for row in found.blocks
    ]  # fmt: skip
    return {
        "format": FORMAT, "turn_degrees": found.turn_degrees, "blocks": rows, "far": found.far
    }  # fmt: skip


def read_cut(folder: Path) -> CutList:
    """Raises BadFile."""
    path = folder / LIST
    top = Fields(read_json(path, most_bytes=LARGEST_LIST), str(path), ADVICE)
    if top.value("format") != FORMAT:
        raise top.error("format", f"'{FORMAT}'")
    rows = []
    for row in top.rows("blocks", 1 << 12, "block", first=0):
        try:
            low, high = (endless(row.value(key), s) for key, s in (("low", -1), ("high", 1)))
            box = BlockBox(low, high)
        except (TypeError, ValueError):
            raise row.error("low", "the corner of a box") from None
        counts = row.count("anchors", 0, 1 << 40), row.count("photos", 0, 1 << 40)
        rows.append(CutBlock(box, *counts, row.text("start", ""), row.text("coarse", ""),
                             row.text("why", "")))  # fmt: skip
    return CutList(top.number("turn_degrees"), tuple(rows), top.text("far", ""))
