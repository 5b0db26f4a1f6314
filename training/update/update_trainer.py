"""Trains the anchors of a region anew; all others are drawn with them, and stay to the bit.

The anchors outside come first in the optimiser's tables.  Their gradients are set to 0, so Adam
leaves them; at the end they are taken from the scene as it was, as are the networks.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shapeshift.runtime_models.eyes import EYES, LOOKS, spread_eyes
from shapeshift.runtime_models.files.memory import amount
from shapeshift.runtime_models.model import AnchorFrames, AnchorModel, BadFile, Stop
from shapeshift.runtime_models.package.feature_codes import EXACT
from shapeshift.runtime_models.rotation import normalize
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.densify import NewAnchors
from shapeshift.training.export import notes_of
from shapeshift.training.first_anchors.first_anchors import first_anchors
from shapeshift.training.first_anchors.initial import Report, initial_points
from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.heads.networks import KERNELS
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.photo_store.open_photos import open_photos
from shapeshift.training.photos import LoadedPhoto, choose_downscale, memory_for_photos
from shapeshift.training.run import SETTLE
from shapeshift.training.settings import TrainSettings, parameter_rates
from shapeshift.training.step import TrainingStep
from shapeshift.training.supervision.still_background import leave_out_still
from shapeshift.training.train import Trainer
from shapeshift.training.update.regions import UpdateRegion, cut_photos, refuse_unseen
from shapeshift.training.update.trainable import layout_of, packed_weights, rows_of, voxel_of

GROWTH = 2.0  # times the anchors that the region had, at most, where the points are not more
LEAST_ROOM = 500  # anchors that a region may have, however few it had


@dataclass(frozen=True)
class UpdateBase:
    """The scene that is updated, and where."""

    model: AnchorModel
    region: UpdateRegion
    digest: str  # of its file, so that a run resumes with the same one


class UpdateTrainer(Trainer):
    """One update.  Photos come cut to the region: see regions.cut_photos."""

    storage = EXACT  # halves that are read and written again may be others

    def __init__(
        self,
        device,
        base: UpdateBase,
        capture: Capture,
        settings: TrainSettings,
        loaded: dict[str, list[LoadedPhoto]],
        resume: tuple | None = None,
        report: Report | None = None,
    ) -> None:
        self.base = base
        inside = base.region.holds(base.model.anchors)
        self.outside = base.model.with_anchors(~inside)
        self.inside = base.model.with_anchors(inside)
        super().__init__(device, capture, settings, resume, loaded, report)
        self.exposures.light_stands = base.model.light is not None

    @property
    def fixed(self) -> int:
        """How many anchors stay: the first of the optimiser's."""
        return len(self.outside.anchors)

    def lay_out(self) -> None:
        model = self.base.model
        self.encoding, self.layout, self.voxel = model.encoding, layout_of(model), voxel_of(model)
        room = max(int(GROWTH * len(self.inside.anchors)), LEAST_ROOM)
        self.anchor_cap = self.fixed + min(room, self.settings.max_anchors)

    def new_step(self) -> TrainingStep:
        return UpdateStep(self)

    def initialise(self, photos: list[LoadedPhoto], report: Report | None) -> None:
        """The anchors that are there, and new ones where the later visit has points and no anchor
        is: with the features of the nearest anchor, which the networks know.
        """
        from scipy.spatial import cKDTree

        model, settings = self.base.model, self.settings
        values = {
            name: np.concatenate([rows, rows_of(self.inside, self.layout)[name]])
            for name, rows in rows_of(self.outside, self.layout).items()
        }
        rng = np.random.default_rng([settings.seed, 0])
        first = initial_points(self.capture, photos, rng, settings.points, report, settings.seconds)
        self.warnings += first.doubts
        self.origin = first.origin
        start = first_anchors(first, settings.max_anchors, photos, self.schedule.background)
        away, _ = cKDTree(values["anchors"]).query(start.anchors)
        fresh = self.base.region.holds(start.anchors) & (away > self.voxel)
        fresh[np.flatnonzero(fresh)[self.anchor_cap - len(values["anchors"]) :]] = False
        _, parents = cKDTree(model.anchors).query(start.anchors[fresh])
        added = rows_of(model.with_anchors(parents), self.layout)
        added["anchors"] = start.anchors[fresh]
        if "frames" in added:
            sizes = np.log(start.voxel / self.voxel)
            added["frames"] = start.frames[fresh] + np.array([sizes] * 3 + [0] * 4, np.float32)
        values = {name: np.concatenate([rows, added[name]]) for name, rows in values.items()}
        if len(values["anchors"]) == self.fixed:
            raise BadFile(
                "the region holds no anchor of the scene and no point of the capture; name a "
                "larger box, or points with --points."
            )
        values["weights"] = packed_weights(model, self.layout)
        self.iteration, self.elapsed, self.densified_at = 0, 0.0, -SETTLE
        self.rate_scale, self.run_length = 1.0, settings.iterations
        self.adam = Adam(self.device, values, self.all_rates())
        self.min_scale.look(self.adam["anchors"])
        self.stats, self.visibility = self.fresh_statistics(len(values["anchors"]))

    def all_rates(self) -> dict[str, np.ndarray]:
        rates = parameter_rates(self.layout, self.rates(), self.voxel)
        return rates | {"weights": np.zeros(1, np.float32)}

    def allowed(self, kept: np.ndarray, new: NewAnchors) -> tuple[np.ndarray, NewAnchors]:
        """Nobody outside goes, nobody new stands outside."""
        kept[: self.fixed] = True
        inside = self.base.region.holds(new.anchors)
        room = max(self.anchor_cap - int(kept.sum()), 0)
        return kept, NewAnchors(new.anchors[inside], new.parents[inside]).first(room)

    def checkpoint(self) -> tuple[dict[str, np.ndarray], dict]:
        state, notes = super().checkpoint()
        return state, notes | {"updates": self.base.digest}

    def psnr_before(self) -> dict[str, float]:
        """dB of the scene as it was, on the held-out photos where they see the region."""
        now = self.adam.state()
        model = self.base.model
        rows = rows_of(model, self.layout) | {"weights": packed_weights(model, self.layout)}
        was = {"steps": np.array(0)}
        for name, value in rows.items():
            was |= {f"{name}.value": value}
            was |= {f"{name}.{part}": np.zeros_like(value) for part in ("mean", "square")}
        self.adam.load(was)
        found = self.held_out_psnr(most=len(self.held_out))
        self.adam.load(now)
        return found

    def model(self) -> AnchorModel:
        """The scene with what was learned in the region; nothing else of it is another."""
        old, state, count = self.outside, self.adam.state(), self.fixed
        learned = {name: state[f"{name}.value"][count:] for name in self.layout.per_anchor}
        anchors = self.base.region.nearest(learned["anchors"]).astype(np.float32)
        features = halves(learned["features"][:, : old.features.shape[1]])
        frames = old.frames
        if frames is not None:
            sizes, turns = learned["frames"][:, :3], normalize(learned["frames"][:, 3:])
            frames = AnchorFrames(
                np.concatenate([frames.scales, np.exp(halves(sizes))]),
                np.concatenate([frames.wxyz, normalize(halves(turns))]),
            )
        light = old.light
        if light is not None:
            light = np.concatenate([light, halves(learned["light"])])
        return replace(
            old,
            anchors=np.concatenate([old.anchors, anchors]),
            features=np.concatenate([old.features, features]),
            frames=frames,
            light=light,
            labels=self.labels_of(anchors),
            provenance=self.provenance(),
        )

    def labels_of(self, anchors: np.ndarray) -> np.ndarray | None:
        """(A,) all labels; new anchors have that of the nearest old one."""
        from scipy.spatial import cKDTree

        model = self.base.model
        if model.labels is None or self.outside.labels is None:
            return None
        _, nearest = cKDTree(model.anchors).query(anchors)
        return np.concatenate([self.outside.labels, model.labels[nearest]])

    def provenance(self) -> dict:
        update = {
            "capture": self.capture.folder.name,
            "boxes": [
                {"centre": list(box.centre), "half": list(box.half), "wxyz": list(box.wxyz)}
                for box in self.base.region.boxes
            ],
            "iterations": self.iteration,
            "anchors_before": len(self.inside.anchors),
            "anchors": self.anchors_count - self.fixed,
        }
        before = self.base.model.provenance
        if EYES in before:  # else the old photos' are not known, and all directions count
            new = notes_of(self.capture)
            places, looks = ([*before.get(k, ()), *new.get(k, ())] for k in (EYES, LOOKS))
            kept = {k: v for k, v in before.items() if k != LOOKS}
            before = kept | spread_eyes(np.array(places), np.array(looks))
        return before | {"updates": [*before.get("updates", []), update]}


def halves(values: np.ndarray) -> np.ndarray:
    """float32 that a package holds in 16 bits, so that new anchors do not make old ones larger."""
    return values.astype(np.float16).astype(np.float32)


class UpdateStep(TrainingStep):
    """The training step in which the anchors outside and the networks rest."""

    def __init__(self, trainer: UpdateTrainer) -> None:
        device, layout = trainer.device, trainer.layout
        super().__init__(device, layout, trainer.voxel, trainer.adam)
        self.activation.unit = np.float32(trainer.base.model.networks["scale"].gain)
        self.fixed = trainer.fixed
        self.still = device.program(KERNELS / "update.cl")["still_rows"]
        self.nothing = device.upload(np.zeros(1, np.int32))

    def backward(self, grad: Gaussians) -> dict[str, object]:
        grads: dict[str, Any] = super().backward(grad)
        rows = self.nothing if self.rows is None else self.rows
        for name in self.layout.per_anchor:
            width = self.adam[name].shape[1]
            learned = self.layout.features if name == "features" else width
            count = grads[name].size
            self.device.launch(
                self.still, count, 64, count, width, learned, self.fixed,
                int(self.rows is not None), rows, grads[name],
            )  # fmt: skip
        return grads


# Everything that an update is begun with: scene, later capture and region, checked and cut.


def capture_for(model: AnchorModel, capture: Capture) -> tuple[Capture, tuple[str, ...]]:
    """The capture with the scene's stops, and what a person should know.

    Its modalities and those stops have the same names, whatever their letters' case; values are
    read over the scene's range.  Raises BadFile.
    """
    names = {stop.name.casefold(): stop for stop in model.stops}
    said, photos = [], []
    known = {stop.name: stop for stop in capture.stops}
    for modality in known:
        if modality.casefold() not in names:
            said.append(f"photos of '{modality}' are left out: the scene has no such stop.")
    for photo in capture.photos:
        stop = names.get(photo.modality.casefold())
        if stop is not None:
            counts = counts_of(photo.counts, known[photo.modality], stop, capture)
            photos.append(replace(photo, modality=stop.name, counts=counts))
    for stop in model.stops:
        if not any(photo.modality == stop.name for photo in photos):
            raise BadFile(
                f"{capture.folder} has no photos of the stop '{stop.name}', which would stay as it "
                "was where the others change; add some, or take the stop out with style --remove."
            )
    return replace(capture, stops=model.stops, photos=tuple(photos)), tuple(said)


def counts_of(
    counts: tuple[float, float] | None, of_photo: Stop, of_scene: Stop, capture: Capture
) -> tuple[float, float] | None:
    """Numbers of a grey photo that stand for the ends of the scene's range.  Raises BadFile."""
    was, now = of_photo.value_range, of_scene.value_range
    if was is None or now is None or was == now:
        return counts
    if of_photo.unit != of_scene.unit:
        raise BadFile(
            f"{capture.folder}: '{of_photo.name}' is in '{of_photo.unit}', in the scene in "
            f"'{of_scene.unit}'; one unit is wanted."
        )
    if counts is None:
        raise BadFile(
            f"{capture.folder}: black and white of '{of_photo.name}' stand for {was[0]:g} and "
            f"{was[1]:g}, in the scene for {now[0]:g} and {now[1]:g}; write the photos in the "
            "scene's range."
        )
    a_value = (counts[1] - counts[0]) / (was[1] - was[0])
    return (counts[0] + a_value * (now[0] - was[0]), counts[0] + a_value * (now[1] - was[0]))


def refuse_large(photos: dict[str, list[LoadedPhoto]], factor: int) -> None:
    """BadFile where what photos show of the region does not fit into memory."""
    needed, may = sum(p.bytes for each in photos.values() for p in each), memory_for_photos()
    if not needed <= may:
        raise BadFile(
            f"what the photos show of the region takes {amount(needed)} of memory, photos may take "
            f"{amount(may)}; name a smaller box, or give --downscale {factor + 1} or more --memory."
        )


def begin_update(
    device, base: UpdateBase, capture: Capture, settings: TrainSettings,
    resume: tuple | None = None, report: Report | None = None,
) -> UpdateTrainer:  # fmt: skip
    """The trainer, before its first step.  Raises BadFile."""
    layout_of(base.model)  # refused before photos are read
    if resume is not None and resume[1].get("updates") != base.digest:
        raise BadFile(
            "the checkpoint is of another scene, capture or region; train anew without resuming."
        )
    fitting, said = capture_for(base.model, capture)
    factor = settings.downscale or choose_downscale(fitting.photos)
    settings = replace(settings, downscale=factor)
    photos, _ = leave_out_still(
        open_photos(fitting, factor, settings.masks), settings.background, fitting.background
    )
    cut = cut_photos({"train": photos.train, "test": photos.test}, base.region)
    photos.close()
    refuse_large(cut, factor)
    refuse_unseen(cut, tuple(stop.name for stop in base.model.stops), str(capture.folder))
    trainer = UpdateTrainer(device, base, fitting, settings, cut, resume, report)
    trainer.warnings = [*said, *trainer.warnings]
    return trainer
