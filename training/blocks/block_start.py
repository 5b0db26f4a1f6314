"""What a block's run begins with: its part of the coarse run's state, its photos, its box.

One file a block, which is all that its run reads beside the capture.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shapeshift.rasterizer.device import with_small_pool
from shapeshift.rasterizer.raster import rasterize_backward
from shapeshift.runtime_models.blocks.read_blocks import BlockBox, Corner, turned
from shapeshift.runtime_models.files.json_fields import Fields
from shapeshift.runtime_models.model import AnchorModel, BadFile
from shapeshift.runtime_models.stop import ControlEncoding, Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.training.calibration.extrinsics import with_extrinsics
from shapeshift.training.checkpoint import read_checkpoint, write_checkpoint
from shapeshift.training.densify import NewAnchors
from shapeshift.training.heads.networks import HeadLayout
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.photo_store.open_photos import PhotoRoom
from shapeshift.training.photos import BLACK
from shapeshift.training.run import SETTLE
from shapeshift.training.settings import TrainSettings
from shapeshift.training.step import TrainingStep
from shapeshift.training.train import Trainer

# Which photos belong to which block, and which anchors outside of it they show.
#
# A photo's weight is what its picture of the coarse run is made of: alpha times transmittance of
# every anchor's splats, summed over the pixels. All pixels of a photo count in a block's run:
# where only those did that show the block, its splats grew into the others (docs/bench/ideas.md).

LEAST_SHARE = 0.05  # of a photo's weight that lies in a block that it belongs to
LEFT_OUT = 0.02  # of the weight of a block's photos: that of the anchors that its run does without
Progress = Callable[[int, int], None]  # photos done, of all


@dataclass(frozen=True)
class Cover:
    """What one block learns from."""

    photos: tuple[int, ...]  # rising
    context: np.ndarray  # (A,) bool: anchors outside that its run has


class CoarsePicture:
    """The state of a coarse run, drawn to be looked at."""

    def __init__(
        self, device, state: dict[str, np.ndarray], layout: HeadLayout, voxel: float,
        encoding: ControlEncoding, stops: Sequence[Stop],
    ) -> None:  # fmt: skip
        names = ("weights", *layout.per_anchor)
        values = {name: state[f"{name}.value"] for name in names}
        rates = dict.fromkeys(names, np.zeros(1, np.float32))
        self.device, self.splats = device, layout.splats
        self.control = {stop.name: encoding.encode(stop.x) for stop in stops}
        controls, adam = np.stack(list(self.control.values())), Adam(device, values, rates)
        self.step = TrainingStep(device, layout, voxel, adam, controls)

    def weights(self, photo: Photo, factor: int) -> np.ndarray:
        """(A,) pixels that each anchor gives to a photo, as large as it is trained."""
        view, device = photo.view.divided(factor), self.device
        drawn = self.step.draw(view, self.control[photo.modality], BLACK)
        nothing = device.zeros((3, *view.size[::-1]))
        record = rasterize_backward(
            device, drawn.projected, drawn.tiles, drawn.frame, nothing, absolute=False, weight=True
        )
        return device.download(record)[:, 11].reshape(-1, self.splats).sum(1, dtype=np.float64)


def cover_of(
    picture: CoarsePicture, photos: Sequence[Photo], factor: int, block: np.ndarray, count: int,
    report: Progress | None = None,
) -> tuple[Cover, ...]:  # fmt: skip
    """Of each of `count` blocks; block: (A,) of which block each anchor is, -1 of none."""
    inside = block >= 0
    sums = np.zeros((count, len(block)))
    mine: list[list[int]] = [[] for _ in range(count)]
    for i, photo in enumerate(photos):
        weights = picture.weights(photo, factor)
        of_blocks = np.bincount(block[inside], weights[inside], minlength=count)
        belongs = (of_blocks >= LEAST_SHARE * weights.sum()) & (of_blocks > 0)
        for number in np.flatnonzero(belongs).tolist():
            mine[number].append(i)
            sums[number] += weights
        if report is not None:
            report(i + 1, len(photos))
    shown = [context_of(sums[number], block == number) for number in range(count)]
    return tuple(Cover(tuple(each), rows) for each, rows in zip(mine, shown, strict=True))


def context_of(weights: np.ndarray, own: np.ndarray) -> np.ndarray:
    """(A,) bool: anchors outside, without those that together give LEFT_OUT of the weight (A,)."""
    outside = np.where(own, 0.0, weights)
    order = np.argsort(outside, kind="stable")
    left_out = np.cumsum(outside[order]) <= LEFT_OUT * weights.sum()
    shown = np.zeros(len(weights), bool)
    shown[order[~left_out]] = True
    return shown & ~own


OF_PHOTOS = ("exposure", "poses")  # groups of a state that are about all photos: begun anew
ADVICE = "train again with --blocks"


@dataclass(frozen=True)
class BlockPlace:
    """Where a block's anchors belong: a box in a turned frame, and the cube outside of which all is
    far and no block's."""

    box: BlockBox
    turn_degrees: float
    middle: Corner  # metres, world: of the cube
    half: float  # metres; infinite: nothing is far

    def __post_init__(self) -> None:
        """ValueError, one sentence."""
        if not self.half > 0:
            raise ValueError(f"half the side of what is near is {self.half}")

    def holds(self, places: np.ndarray, margin: float = 0.0) -> np.ndarray:
        """(N,) bool of places (N, 3) in the world; margin: metres the box is enlarged by."""
        near = (np.abs(np.asarray(places, np.float64) - self.middle) <= self.half).all(axis=1)
        return near & self.box.holds(turned(places, self.turn_degrees), margin)


@dataclass(frozen=True)
class BlockPhoto:
    """A photo of a block, by its path in the capture."""

    path: str
    modality: str
    split: str


@dataclass(frozen=True)
class BlockStart:
    place: BlockPlace
    photos: tuple[BlockPhoto, ...]
    state: dict[str, np.ndarray]  # as of Trainer.checkpoint
    notes: dict[str, Any]  # likewise
    provenance: dict[str, Any]  # of the coarse run's package

    def write(self, path: Path) -> None:
        photos = [[p.path, p.modality, p.split] for p in self.photos]
        box, place = self.place.box, self.place
        mine = {
            "low": finite(box.low), "high": finite(box.high), "turn_degrees": place.turn_degrees,
            "middle": list(place.middle), "half": finite([place.half])[0], "photos": photos,
            "provenance": self.provenance,
        }  # fmt: skip
        write_checkpoint(path, self.state, self.notes | {"block": mine})

    @staticmethod
    def read(path: Path) -> "BlockStart":
        """Raises BadFile."""
        if not path.is_file():
            raise BadFile(f"{path}: no start of a block is there; {ADVICE} makes one.")
        state, notes = read_checkpoint(path)
        try:
            mine = Fields(notes.pop("block"), str(path), ADVICE)
            low, high = (endless(mine.value(key), side) for key, side in (("low", -1), ("high", 1)))
            half = endless([mine.value("half")] * 3, 1)[0]
            place = BlockPlace(
                BlockBox(low, high), mine.number("turn_degrees"),
                mine.numbers("middle", 3), half,  # type: ignore[arg-type]  # three of them
            )  # fmt: skip
            photos = []
            for name, modality, split in mine.value("photos"):
                photos.append(BlockPhoto(str(name), str(modality), str(split)))
            provenance = mine.typed("provenance", dict, {})
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            if isinstance(error, BadFile):
                raise
            raise BadFile(f"{path}: not the start of a block ({error}); {ADVICE}.") from None
        return BlockStart(place, tuple(photos), state, notes, provenance)

    def capture_of(self, capture: Capture) -> Capture:
        """The capture with the photos of the block alone.  Raises BadFile."""
        known = {(path_in(capture, p), p.modality): p for p in capture.photos}
        found = []
        for mine in self.photos:
            photo = known.get((mine.path, mine.modality))
            if photo is None:
                raise BadFile(
                    f"{capture.folder} has no photo '{mine.path:.200}' of '{mine.modality:.60}' "
                    f"any more; {ADVICE}, anew."
                )
            found.append(photo)
        return replace(capture, photos=tuple(found))


def finite(values: Sequence[float]) -> list[float | None]:
    """JSON has no infinity: null."""
    return [v if math.isfinite(v) else None for v in values]


def endless(values: Sequence[float | None], side: int) -> Corner:
    x, y, z = (side * math.inf if v is None else float(v) for v in values)
    return x, y, z


def path_in(capture: Capture, photo: Photo) -> str:
    """A photo's path as seen from its capture, with forward slashes."""
    path = Path(photo.path)
    inside = path.is_absolute() and path.is_relative_to(capture.folder.absolute())
    if inside:
        return path.relative_to(capture.folder.absolute()).as_posix()
    return path.as_posix().removeprefix(capture.folder.as_posix() + "/")


def photos_of(cover: Cover, capture: Capture, photos: Sequence[Photo]) -> tuple[BlockPhoto, ...]:
    """The photos of a block as its run finds them again."""
    return tuple(
        BlockPhoto(path_in(capture, photos[i]), photos[i].modality, photos[i].split)
        for i in cover.photos
    )


def part_of_state(
    state: dict[str, np.ndarray], rows: np.ndarray, layout: HeadLayout
) -> dict[str, np.ndarray]:
    """The state of the anchors `rows` (R,): Adam's moments stay, statistics begin anew."""
    out = {}
    for name, array in state.items():
        group = name.partition(".")[0]
        if group in OF_PHOTOS:
            continue
        if group in layout.per_anchor or name == "min_scale.pixels":
            array = array[rows]
        elif name == "visibility.reach":
            array = array[:, rows]
        out[name] = array
    count, stops = len(rows), len(state["densify.contribution"])
    out["densify.grad2d"] = np.zeros((stops, count * layout.splats, 2), np.float32)
    out["densify.opacity"] = np.zeros((count, 2), np.float32)
    out["densify.contribution"] = np.zeros((stops, count, 2), np.float32)
    out["densify.steps"] = np.array(0)
    return out


def begun_anew(notes: dict[str, Any]) -> dict[str, Any]:
    """The notes of a run whose clock begins here: rates and growing follow it."""
    fresh = {"iteration": 0, "elapsed": 0.0, "densified_at": -SETTLE, "run_length": None}
    return notes | fresh | {"lr_warmup_start": None}


# Trains one block: goes on from its part of the coarse run, with heads of its own.

MARGIN = 4.0  # voxels that the box is enlarged by for new anchors: a splat reaches two


class BlockTrainer(Trainer):
    """Anchors outside of the block are there because its photos show them; they learn, too, and do
    not leave the run."""

    def __init__(
        self, device, start: BlockStart, capture: Capture, settings: TrainSettings,
        resume: tuple | None = None, room: PhotoRoom | None = None,
    ) -> None:  # fmt: skip
        """settings: with the downscale and the background of the coarse run; resume: of a
        checkpoint of this very block."""
        self.start = start
        if resume is None:
            length = {"run_length": settings.iterations}
            resume = start.state, start.notes | length
        super().__init__(device, start.capture_of(capture), settings, resume, room=room)
        self.targets.most = 0  # made at each use, 2 % of a step: a block sees half of all photos

    def lay_out(self) -> None:
        super().lay_out()
        self.most_inside = self.anchor_cap  # of anchors within the enlarged box

    def inside(self, places: np.ndarray, margin: float = 0.0) -> np.ndarray:
        """(N,) bool: which places (N, 3) are the block's, enlarged by so many voxels."""
        return self.start.place.holds(places, margin * self.voxel)

    def densify(self) -> None:
        """As ever for the anchors inside; those outside neither go nor ask for others."""
        outside = ~self.inside(self.device.download(self.adam["anchors"]), MARGIN)
        self.anchor_cap = self.most_inside + int(outside.sum())
        state = self.stats.state()
        grad2d = state["densify.grad2d"]
        grad2d.reshape(len(grad2d), len(outside), -1)[:, outside] = 0
        state["densify.opacity"][outside] = 0
        state["densify.contribution"][:, outside] = 0
        self.stats.load(state)
        super().densify()

    def allowed(self, kept: np.ndarray, new: NewAnchors) -> tuple[np.ndarray, NewAnchors]:
        inside = self.inside(new.anchors, MARGIN)
        return kept, NewAnchors(new.anchors[inside], new.parents[inside])

    def checkpoint(self) -> tuple[dict[str, np.ndarray], dict]:
        state, notes = super().checkpoint()
        return state, notes | {"of_block": self.start.notes["of_block"]}

    def model(self) -> AnchorModel:
        """The anchors that stand in the block.  Raises BadFile where none does."""
        whole = super().model()
        rows = np.flatnonzero(self.inside(whole.anchors))
        if not len(rows):
            raise BadFile(
                "no anchor of this block is left in its box; train with fewer blocks, or with more "
                "photos of that place."
            )
        return replace(whole.with_anchors(rows), provenance=self.provenance(whole.provenance))

    def provenance(self, own: dict[str, Any]) -> dict[str, Any]:
        """Of the block; the first look is that at the whole."""
        whole = {name: v for name, v in self.start.provenance.items() if name == "view"}
        photos = sum(len(found) for found in self.schedule.photos.values())
        rest = {name: v for name, v in own.items() if name != "view"}
        return rest | whole | {"block_photos": photos}


def begin_block(
    device, start: BlockStart, capture: Capture, settings: TrainSettings,
    resume: tuple | None = None, room: PhotoRoom | None = None,
) -> BlockTrainer:  # fmt: skip
    """The trainer, before its first step.  Raises BadFile."""
    if resume is not None and resume[1].get("of_block") != start.notes["of_block"]:
        raise BadFile(
            f"the checkpoint is of another block, or of one that was cut otherwise; {ADVICE}, or "
            "leave out --resume."
        )
    color, factor = start.provenance.get("background"), start.provenance.get("downscale")
    settings = replace(settings, downscale=factor)
    if settings.background == "auto":  # a part of the photos could look otherwise than all do
        if color is None and not start.provenance.get("still_background"):
            settings = replace(settings, background="random")
        elif color is not None:
            capture = replace(capture, background=tuple(color))
    given = with_extrinsics(capture, settings.rig)
    device = with_small_pool(device)
    return BlockTrainer(device, start, given, settings, resume, room)
