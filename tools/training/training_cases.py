"""The cases of training_stability.py: what is done to a capture or to a run, and what is good."""

import json
import os
import resource
import shutil
import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyopencl
from PIL import Image

from shapeshift.rasterizer.device import open_device
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.training.calibration.extrinsics import moved_by, offset_view
from shapeshift.training.train import Trainer

REFUSED, FAULT, INTERRUPTED = 2, 3, 130  # exit codes
POOR = 3.0  # dB below the untouched capture, of the modality that loses most
SMALL_FILE = 20_000  # bytes that fit on the disk that is full


@dataclass(frozen=True)
class Outcome:
    code: int
    said: list[str]
    db: dict[str, float] | None  # of each modality; None: there is no scene
    before: dict[str, float]  # of the untouched capture
    wrong: list[str]  # photos of which something is wrong
    out: Path

    @property
    def loss(self) -> float:
        """dB below the untouched capture, of the modality that loses most."""
        return max(self.before[name] - self.db[name] for name in self.db)


Change = Callable[[Capture, str], tuple[Path, list[str]]]  # (capture, case) -> its JSON, who


def by_loss(outcome: Outcome) -> str:
    """good, or how much is lost and whether it was said."""
    if outcome.code == FAULT or outcome.db is None:
        return "bad: no scene"
    if outcome.loss <= POOR:
        return "good"
    return f"poor: {outcome.loss:.1f} dB lost, " + ("said" if outcome.said else "not said")


def named(outcome: Outcome) -> str:
    """Whether the photos that are wrong were named, and only those."""
    lines = [line for line in outcome.said if " fits with " in line]
    found = [name for name in outcome.wrong if any(name in line for line in lines)]
    falsely = len(lines) - len(found)
    return f"{len(found)} of {len(outcome.wrong)} named, {falsely} falsely; {by_loss(outcome)}"


def refused(outcome: Outcome) -> str:
    one = outcome.code == REFUSED and len(outcome.said) == 1 and outcome.db is None
    return "good: one sentence" if one else f"bad: exit code {outcome.code}"


def kept(outcome: Outcome) -> str:
    """A sentence at the end, and the work until then on disk."""
    if outcome.code == FAULT or outcome.db is None:
        return "bad: the work is lost"
    steps = read_model(outcome.out).provenance["iterations"]
    return f"good: {steps} steps are kept" if outcome.said else "bad: nothing was said"


def elsewhere(outcome: Outcome) -> str:
    """Whether the work lies in the system's folder for temporary files; it is removed there."""
    for folder in Path(tempfile.gettempdir()).glob("shapeshift-*"):
        if (folder / outcome.out.name).is_file() and any(folder.name in s for s in outcome.said):
            read_model(folder / outcome.out.name)
            shutil.rmtree(folder)
            return "good: kept elsewhere"
    return "bad: the work is lost"


def untouched(whole: Capture, case: str) -> tuple[Path, list[str]]:
    return whole.folder, []


def no_fault(iterations: int) -> AbstractContextManager:
    return nullcontext()


@dataclass(frozen=True)
class Case:
    name: str
    capture: str  # balls | tankard | fern
    done: str
    change: Change = untouched
    judge: Callable[[Outcome], str] = by_loss
    options: tuple[str, ...] = ()
    settings: str = ""  # lines of the file of --settings
    share: float = 1.0  # of the steps of the others: what is kept needs no good picture
    fault: Callable[[int], AbstractContextManager] = no_fault
    resumed: bool = False  # whether a second command goes on
    out: str = "scene.shift"  # below a folder of the case's own

    @property
    def nothing_done(self) -> bool:
        """Whether the untouched capture itself is the case."""
        plain = self.change is untouched and self.fault is no_fault
        return plain and not (self.options or self.settings) and self.out == "scene.shift"


def written(changed: Capture, case: str) -> Path:
    """The JSON of a changed capture beside that of the untouched one."""
    plain = (changed.folder / "transforms.json").read_bytes()
    out = changed.folder / f"{case.replace(' ', '-')}.json"
    os.replace(write_capture(changed), out)
    (changed.folder / "transforms.json").write_bytes(plain)
    return out


def training(whole: Capture, modality: str | None = None) -> list[Photo]:
    """Its training photos, of one modality or of all."""
    names = [s.name for s in whole.stops if modality in (None, s.name)]
    return [photo for name in names for photo in whole.of(name, "train")]


def spread(photos: list[Photo], count: int) -> list[Photo]:
    return [photos[i] for i in np.linspace(0, len(photos) - 1, count).round().astype(int)]


def changed_photos(
    whole: Capture, case: str, new: dict[Path, Photo | None]
) -> tuple[Path, list[str]]:
    """With other photos instead of some, by their files; None: without it."""
    photos = [new.get(p.path, p) if p.split == "train" else p for p in whole.photos]
    out = written(replace(whole, photos=tuple(p for p in photos if p is not None)), case)
    return out, [p.path.relative_to(whole.folder).as_posix() for p in new.values() if p]


def few(count: int, modality: str | None, whole: Capture, case: str) -> tuple[Path, list[str]]:
    gone = {}
    for stop in whole.stops:
        mine = training(whole, stop.name)
        kept = spread(mine, count) if modality in (None, stop.name) else mine
        gone |= {photo.path: None for photo in mine if not any(photo is k for k in kept)}
    return changed_photos(whole, case, gone)


def tenth(whole: Capture) -> list[Photo]:
    """Every tenth training photo of each modality, from the fourth."""
    return [p for stop in whole.stops for p in training(whole, stop.name)[3::10]]


def wrong_poses(degrees: float, whole: Capture, case: str) -> tuple[Path, list[str]]:
    random, new = np.random.default_rng(0), {}
    for photo in tenth(whole):
        axis = random.normal(size=3)
        turn = np.deg2rad(degrees) * axis / np.linalg.norm(axis)
        motion = moved_by(np.concatenate([turn, np.zeros(3)]))
        new[photo.path] = replace(photo, view=offset_view(photo.view, motion))
    return changed_photos(whole, case, new)


def brighter(photo: Photo, gain: float, folder: Path) -> Photo:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{photo.modality}-{photo.path.name}"
    pixels = np.clip(np.rint(gain * load_photo(photo).rgb), 0, 255)
    Image.fromarray(pixels.astype(np.uint8)).save(path)
    return replace(photo, path=path)


def dark_tenth(whole: Capture, case: str) -> tuple[Path, list[str]]:
    folder = whole.folder / "dark"
    new: dict[Path, Photo | None]
    new = {p.path: brighter(p, 0.45, folder) for p in tenth(whole)}
    return changed_photos(whole, case, new)


def uneven_exposure(whole: Capture, case: str) -> tuple[Path, list[str]]:
    random, new = np.random.default_rng(0), {}
    for photo in training(whole):
        new[photo.path] = brighter(photo, random.uniform(0.7, 1.3), whole.folder / "uneven")
    return changed_photos(whole, case, new)[0], []


def without_masks(share: float, whole: Capture, case: str) -> tuple[Path, list[str]]:
    mine = training(whole)
    some = spread(mine, round(share * len(mine)))
    return changed_photos(whole, case, {p.path: replace(p, mask=None) for p in some})


def mask_file_gone(whole: Capture, case: str) -> tuple[Path, list[str]]:
    out = written(whole, case)
    data = json.loads(out.read_text(encoding="utf-8"))
    data["frames"][5]["mask_path"] = "masks/gone.png"
    out.write_text(json.dumps(data), encoding="utf-8")
    return out, []


def nan_in_points(whole: Capture, case: str) -> tuple[Path, list[str]]:
    points = np.array(whole.points, np.float32)
    points[::7] = np.nan
    np.savez(whole.folder / "broken.npz", xyz=points)
    out = written(whole, case)
    data = json.loads(out.read_text(encoding="utf-8")) | {"points": "broken.npz"}
    out.write_text(json.dumps(data), encoding="utf-8")
    return out, []


def nan_in_photos(whole: Capture, case: str) -> tuple[Path, list[str]]:
    """Thermal photos as floating-point TIFF in which every hundredth pixel is NaN."""
    (whole.folder / "floats").mkdir(exist_ok=True)
    new = {}
    for photo in (photo for photo in whole.photos if photo.modality == "Thermal"):
        pixels = load_photo(photo).rgb[..., 0].astype(np.float32) / 255
        pixels.ravel()[::100] = np.nan
        path = whole.folder / "floats" / f"{photo.path.stem}.tiff"
        Image.fromarray(pixels).save(path)
        new[photo.path] = replace(photo, path=path, counts=(0.0, 1.0))
    photos = tuple(new.get(p.path, p) for p in whole.photos)
    return written(replace(whole, photos=photos), case), []


@contextmanager
def at_step(share: float, do: Callable[[Trainer], None], iterations: int) -> Iterator[None]:
    """`do` happens to the run before the step after that share of it."""
    plain, at = Trainer.one_step, round(share * iterations)

    def one_step(trainer: Trainer):
        if trainer.iteration == at:
            do(trainer)
        return plain(trainer)

    cast(Any, Trainer).one_step = one_step
    try:
        yield
    finally:
        Trainer.one_step = plain


def nan_into(group: str, trainer: Trainer) -> None:
    state = trainer.adam.state()
    state[f"{group}.value"].ravel()[::7] = np.nan
    trainer.adam.load(state)


def times_rates(factor: float, trainer: Trainer) -> None:
    trainer.rate_scale *= factor


@contextmanager
def full_memory(share: float | None, iterations: int) -> Iterator[None]:
    """From that share of the run on the device has no memory left; None: from the beginning."""
    device = open_device()
    pool = device.pool

    def none_left(size: int):
        raise pyopencl.MemoryError("allocate", pyopencl.status_code.MEM_OBJECT_ALLOCATION_FAILURE)

    def fill(trainer: Trainer | None) -> None:
        object.__setattr__(device, "pool", none_left)

    try:
        if share is None:
            fill(None)
            yield
        else:
            with at_step(share, fill, iterations):
                yield
    finally:
        object.__setattr__(device, "pool", pool)


def gone(trainer: Trainer) -> None:
    """No folder named `gone` is one any longer, below where the captures lie."""
    for folder in trainer.capture.folder.parent.glob("out/*/gone"):
        shutil.rmtree(folder)
        folder.write_bytes(b"")


@contextmanager
def full_disk(iterations: int) -> Iterator[None]:
    """From the middle of the run on no file can have more than SMALL_FILE bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)

    def fill(trainer: Trainer) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (SMALL_FILE, hard))

    try:
        with at_step(0.5, fill, iterations):
            yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def interrupted(trainer: Trainer) -> None:
    signal.raise_signal(signal.SIGINT)


SHARED = 'fixed = "offset,scale,rotation,opacity"'
CASES = (
    *(
        Case(f"{n} views", "balls", f"{n} of 40 training photos of each modality",
             partial(few, n, None))
        for n in (3, 6, 12)
    ),
    Case("five images", "balls", "5 of 40 training photos of Thermal", partial(few, 5, "Thermal")),
    Case("five images, one shape", "balls", f"the same, with `{SHARED}`",
         partial(few, 5, "Thermal"), settings=SHARED),
    Case("wrong poses", "balls", "every 10th pose turned by 8 degrees",
         partial(wrong_poses, 8.0), named),
    Case("slightly wrong poses", "balls", "every 10th pose turned by 2 degrees",
         partial(wrong_poses, 2.0), named),
    Case("dark photos", "balls", "every 10th photo at 0.45 of its brightness", dark_tenth, named),
    Case("uneven exposure", "balls", "every photo at 0.7 to 1.3 of its brightness",
         uneven_exposure),
    Case("turntable", "tankard", "the background does not turn with the object; with masks"),
    Case("turntable, no masks", "tankard", "the same without a mask", partial(without_masks, 1.0)),
    Case("masks missing", "tankard", "no mask for a third of the photos",
         partial(without_masks, 1 / 3)),
    Case("mask file missing", "tankard", "one mask is named, and not there", mask_file_gone,
         refused),
    Case("forward-facing", "fern", "all cameras look one way"),
    Case("forward-facing, no points", "fern", "the same from `--points random`",
         options=("--points", "random")),
    Case("divergence", "balls", "400 times the learning rates",
         fault=partial(at_step, 0.0, partial(times_rates, 400.0))),
    Case("NaN in weights", "balls", "every 7th weight of the networks, in the middle of the run",
         fault=partial(at_step, 0.5, partial(nan_into, "weights"))),
    Case("NaN in anchors", "balls", "every 7th coordinate, in the middle of the run",
         fault=partial(at_step, 0.5, partial(nan_into, "anchors"))),
    Case("NaN in points", "balls", "every 7th point of the capture", nan_in_points, refused),
    Case("NaN in photos", "balls", "1 % of the pixels of floating-point photos", nan_in_photos),
    Case("memory full at the start", "balls", "the device gives no memory", judge=refused,
         share=0.3, fault=partial(full_memory, None)),
    Case("memory full", "balls", "the device gives no more after 60 % of the run", judge=kept,
         share=0.3, fault=partial(full_memory, 0.6)),
    Case("NaN at the end", "balls", "in the weights, before the last step", judge=kept, share=0.3,
         fault=partial(at_step, 0.996, partial(nan_into, "weights"))),
    Case("disk gone", "balls", "a file takes the place of `--out`'s folder after half of the run",
         judge=elsewhere, share=0.3, fault=partial(at_step, 0.5, gone), out="gone/scene.shift"),
    Case("disk full", "balls", "no file can be written after half of the run", judge=refused,
         share=0.3, fault=full_disk),
    Case("nowhere to write", "balls", "`--out` below a file that is no folder", judge=refused,
         share=0.3, out="points.npz/scene.shift"),
    Case("Ctrl-C", "balls", "after half of the run, then `--resume`", judge=kept, share=0.3,
         fault=partial(at_step, 0.5, interrupted), resumed=True),
)  # fmt: skip
