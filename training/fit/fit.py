"""The search for the smallest model that shows a capture as well as the largest one asked for."""

import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np

from shapeshift.rasterizer.raster import rasterize_backward
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.files.json_fields import LONGEST_TEXT, Fields, read_json
from shapeshift.runtime_models.model import AnchorModel, BadFile, Model
from shapeshift.runtime_models.package.drop_unused import drop_unused
from shapeshift.runtime_models.package.feature_codes import FEATURES
from shapeshift.runtime_models.package.read_package import read_files
from shapeshift.runtime_models.package.write_package import package_files, zip_files
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.evaluation.evaluate import ModelRenderer, stop_for
from shapeshift.training.evaluation.metrics import psnr
from shapeshift.training.first_anchors.initial import SOURCES
from shapeshift.training.fit.ablation import COMPONENTS, DROPPED, Ablation, Component, Trial, decide
from shapeshift.training.photo_store.open_photos import open_photos
from shapeshift.training.photos import BLACK, LoadedPhoto, choose_downscale
from shapeshift.training.settings import TrainSettings
from shapeshift.training.supervision.backgrounds import choose_background
from shapeshift.training.supervision.still_background import leave_out_still
from shapeshift.training.train import Trainer

ReportProgress = Callable[[str, float], None]  # what is tried now, and how far it is, 0..1
PIXELS = (0.02, 0.1, 0.5, 2.0)  # anchors that make up less in every photo are tried without
DECODES = 6  # the fastest counts


@dataclass(frozen=True)
class TrainedSeed:
    """What one training of a trial left: its model as a package of it gives it back."""

    model: AnchorModel
    bytes: int  # of that package, features as FEATURES[0]
    seconds: float  # as Trainer.elapsed


# Trains settings by name, which of a trial differ in their seed; gives what each left, in order.
TrainSeeds = Callable[[dict[str, TrainSettings]], list[TrainedSeed]]


@dataclass(frozen=True)
class FitReport:
    """What a capture needs, and how that was found."""

    settings: TrainSettings  # that train it
    full: Trial  # the largest
    fitted: Trial
    decisions: tuple[Ablation, ...]
    outlines: dict[tuple[str, str], float]  # of every two stops of the largest, see fit.py
    photos: dict[str, int]  # held out, by modality
    seeds: int
    tolerance_db: float

    def as_dict(self) -> dict:
        return {
            "tolerance_db": self.tolerance_db, "seeds": self.seeds, "held_out": self.photos,
            "outlines": [{"stops": list(pair), "iou": round(v, 4)} for pair, v in
                         self.outlines.items()],
            "full": self.full.as_dict(), "fitted": self.fitted.as_dict(),
            "parts": [verdict.as_dict() for verdict in self.decisions],
            "settings": self.settings.as_dict(),
        }  # fmt: skip


class Fit:
    """One search.  Every trial is a training of its own, from the same seeds."""

    def __init__(
        self,
        device,
        capture: Capture,
        settings: TrainSettings,
        tolerance_db: float,
        seeds: int,
        report: ReportProgress,
        components: tuple[Component, ...] = COMPONENTS,
        last: TrainSettings | None = None,
        *,
        train_seeds: TrainSeeds | None = None,
    ) -> None:
        """last: settings whose iterations and seconds the chosen model is trained for once more;
        train_seeds: who does the trainings, None: this process.

        Raises BadFile where the held-out photos could not report how sure a difference is.
        """
        self.device, self.capture, self.report = device, capture, report
        self.tolerance_db, self.seeds = tolerance_db, seeds
        self.decisions: list[Ablation] = []
        self.stops, factor = capture.stops, settings.downscale or choose_downscale(capture.photos)
        opened = open_photos(capture, factor, settings.masks)
        self.loaded, _ = leave_out_still(opened, settings.background, capture.background)
        self.held_out, self.photos = self.loaded.test, self.loaded.train
        behind = choose_background(settings.background, capture.background, self.photos)
        self.background = behind or BLACK
        self.counts = {s.name: sum(p.modality == s.name for p in self.held_out) for s in self.stops}
        for name, count in self.counts.items():
            if not count or count * seeds < 2:
                raise BadFile(
                    f"{capture.folder}: {count} photos of '{name}' are held out, and a difference "
                    "needs two to report how sure it is; mark more with split 'test'"
                    + (" or give --seeds 2." if count else ".")
                )
        self.settings, self.components, self.last = settings, components, last
        self.train_seeds = train_seeds or self.train_here

    def run(self) -> FitReport:
        full = self.full = self.current = self.trained(self.settings, "the largest")
        outlines = outline_ious(self.device, full.models[0], self.held_out, self.stops)
        for part in self.components:
            while (fewer := part.without(self.settings, self.stops)) is not None:
                if not self.consider(part.name, self.trained(fewer, f"without {part.name}")):
                    break
                self.settings = fewer
                if not part.again:
                    break
        if self.last is not None:  # what is cleaned is held to the one that was trained last
            iterations, seconds = self.last.iterations, self.last.seconds
            self.settings = replace(self.settings, iterations=iterations, seconds=seconds)
            self.full = self.current = self.trained(self.settings, "the chosen model")
        self.prune_models()
        return FitReport(
            self.settings, full, self.current, tuple(self.decisions), outlines, self.counts,
            self.seeds, self.tolerance_db,
        )  # fmt: skip

    def consider(self, part: str, tried: Trial) -> bool:
        """Notes what the trial did; goes on from it, and says so, where the part may go."""
        verdict = decide(part, self.full, self.current, tried, self.tolerance_db)
        self.decisions.append(verdict)
        if verdict.verdict == DROPPED:
            self.current = tried
        return verdict.verdict == DROPPED

    def trained(self, settings: TrainSettings, name: str) -> Trial:
        """A trial: settings trained once a seed.  Raises BadFile where a run ends unsettled."""
        asked = {}
        for seed in range(self.seeds):
            what = name if self.seeds == 1 else f"{name}, seed {seed + 1} of {self.seeds}"
            asked[what] = replace(settings, seed=settings.seed + seed)
        runs = self.train_seeds(asked)
        seconds = float(np.mean([run.seconds for run in runs]))
        models = [run.model for run in runs]
        return self.compared(models, FEATURES[0], runs[0].bytes, seconds)

    def train_here(self, asked: dict[str, TrainSettings]) -> list[TrainedSeed]:
        """TrainSeeds of this process."""
        runs = []
        for what, settings in asked.items():
            trainer = Trainer(self.device, self.capture, settings, loaded=self.loaded)
            for now in trainer.steps():
                self.report(what, min(now.fraction, 1.0))
            refuse_unsettled(trainer)
            runs.append(TrainedSeed(*packed(trainer.model(), FEATURES[0]), trainer.elapsed))
        return runs

    def measured(self, models: list[AnchorModel], storage: str, train_s: float) -> Trial:
        """How alike the held-out photos are to what packages of the models show."""
        back = [packed(model, storage) for model in models]
        return self.compared([model for model, _ in back], storage, back[0][1], train_s)

    def compared(self, back: list[AnchorModel], storage: str, size: int, train_s: float) -> Trial:
        """The same of models as their packages give them back; size: bytes of the first."""
        found = [
            view_psnr(self.device, model, self.held_out, self.stops, self.background)
            for model in back
        ]
        psnr = {s.name: np.stack([f[s.name] for f in found]) for s in self.stops}
        return Trial(psnr, tuple(back), storage, size, shift_ms(back[0]), train_s)

    def prune_models(self) -> None:
        """What goes without another training: what nothing shows, and digits of the features."""
        now = self.current
        smaller = [drop_unused(model)[0] for model in now.models]
        self.consider_models("what no stop shows", smaller)
        for pixels in PIXELS:
            smaller = [self.without_faint(model, pixels) for model in self.current.models]
            if not self.consider_models(
                f"anchors of under {pixels:g} pixels in every photo", smaller
            ):
                break
        for more, storage in pairwise(FEATURES):
            now = self.current
            tried = self.measured(list(now.models), storage, now.train_s)
            if not self.consider(f"features as {more} instead of {storage}", tried):
                break

    def consider_models(self, part: str, models: list[AnchorModel]) -> bool:
        """A trial of models made smaller; True, too, where there was nothing to take away."""
        now = self.current
        self.report(f"without {part}", 1.0)
        same = all(weights_of(a) == weights_of(b) for a, b in zip(models, now.models, strict=True))
        return same or self.consider(part, self.measured(models, now.storage, now.train_s))

    def without_faint(self, model: AnchorModel, pixels: float) -> AnchorModel:
        """The model without anchors that make up fewer pixels in every photo."""
        most = largest_contribution(self.device, model, [*self.photos, *self.held_out], self.stops)
        return drop_unused(model, np.repeat(most[:, None] >= pixels, model.splats_per_anchor, 1))[0]


def packed(model: AnchorModel, storage: str) -> tuple[AnchorModel, int]:
    """The model as its package gives it back, and the bytes of that."""
    files = package_files(model, storage)
    return read_files(files.__getitem__, "the fitted scene"), len(zip_files(files))


def refuse_unsettled(trainer: Trainer) -> None:
    """Raises BadFile where a trial's run has ended with anchors that nobody can judge yet."""
    if not trainer.settled:
        raise BadFile(
            f"A trial of {trainer.iteration} steps ends while new anchors still settle; "
            "give more --iterations."
        )


def weights_of(model: AnchorModel) -> int:
    """How many numbers a model is made of."""
    weights = sum(a.size for m in model.networks.values() for a in (*m.weights, *m.biases))
    return model.anchors.size + model.features.size + weights


def shift_ms(model: AnchorModel) -> float:
    """Milliseconds of one thread for the splats at another x, seen from another place."""
    evaluator, times = Evaluator(model, keep=True), []
    for i in range(DECODES):
        start = time.perf_counter()
        evaluator.geometry(i % 2)
        evaluator.color(i % 2, np.array([i, 1.0, 2.0]))
        times.append(1e3 * (time.perf_counter() - start))
    return min(times[1:])


# The settings of one training from a JSON file, as TrainSettings.as_dict gives them.

MOST_BYTES = 1 << 16
ADVICE = "take it as `fit --cluster` wrote it"
# Whole numbers up to this, so that nothing asks for more memory than there could be.
MOST = {
    "iterations": 1 << 31, "max_anchors": 1 << 31, "seed": 1 << 62, "downscale": 1 << 16,
    "splats_per_anchor": 1 << 10, "features": 1 << 12, "hidden": 1 << 12, "grow_every": 1 << 31,
}  # fmt: skip


def read_settings(path: Path) -> TrainSettings:
    """Every field has to be there, and none besides.  Raises BadFile."""
    row = Fields(read_json(path, most_bytes=MOST_BYTES, unique=True), str(path), ADVICE)
    kinds = get_type_hints(TrainSettings)
    values = {each.name: read_value(row, each.name, kinds[each.name])
              for each in fields(TrainSettings)}  # fmt: skip
    row.refuse_unknown_keys()
    try:
        return TrainSettings(**values)
    except ValueError as error:
        raise BadFile(f"{path}: {str(error).rstrip('.')}; {ADVICE}.") from None


def read_value(row: Fields, name: str, kind: Any) -> Any:
    """One field of the type that TrainSettings has.  Raises BadFile."""
    if row.value(name) is None and type(None) in get_args(kind):
        return None
    kinds = {kind, *get_args(kind)}
    if name == "points":  # files of points are not among what a trial reads
        return row.line(name, known=SOURCES)
    if get_origin(kind) is Literal:
        return row.line(name, known=get_args(kind))
    if bool in kinds:
        return row.typed(name, bool)
    if int in kinds:
        return row.count(name, 0, MOST[name])
    if float in kinds:
        return row.number(name, wanted="a number from 0", low=0)
    text = row.typed(name, str)
    if not (text.isprintable() and (name == "rig" or len(text) <= LONGEST_TEXT)):
        raise row.error(name, "one line of text")
    return text


# What photos say of a model: how alike each is, what every anchor gives them, and outlines.

Color = tuple[float, float, float]
COVERED = 0.5  # of a pixel, from where on it lies inside of an outline


def view_psnr(
    device, model: Model, photos: list[LoadedPhoto], stops: tuple, background: Color
) -> dict[str, np.ndarray]:
    """PSNR in dB of every photo, in their order, by modality."""
    renderer, found = ModelRenderer(device, model), {}
    for stop in stops:
        mine = [p for p in photos if p.modality == stop.name]
        renderer.set_control(stop_for(model, stop).x)
        found[stop.name] = np.array(
            [psnr(renderer.picture(p.view, background), p.over(background), p.weight) for p in mine]
        )
    return found


def largest_contribution(
    device, model: AnchorModel, photos: list[LoadedPhoto], stops: tuple
) -> np.ndarray:
    """(A,) pixels that an anchor's splats make up in the photo where they make up most.

    A splat makes up the sum of alpha T over the picture of its own stop; what hides behind others,
    or lies outside of every photo, makes up nothing.
    """
    renderer, most = ModelRenderer(device, model), np.zeros(len(model.anchors))
    for stop in stops:
        renderer.set_control(stop_for(model, stop).x)
        for photo in photos:
            if photo.modality != stop.name:
                continue
            projected, tiles, frame = renderer.draw(photo.view, BLACK)
            grad = device.zeros(frame.image.shape)
            record = rasterize_backward(
                device, projected, tiles, frame, grad, None, absolute=False, weight=True
            )
            weight = device.download(record)[:, 11].reshape(len(most), -1)
            most = np.maximum(most, weight.sum(axis=1, dtype=np.float64))
    return most


def outline(renderer: ModelRenderer, photo: LoadedPhoto) -> np.ndarray:
    """(H, W) bool: where the model at the renderer's control value covers the photo's view."""
    _, _, frame = renderer.draw(photo.view, BLACK)
    return 1 - renderer.device.download(frame.transmittance) > COVERED


def outline_ious(
    device, model: Model, photos: list[LoadedPhoto], stops: tuple
) -> dict[tuple[str, str], float]:
    """Mean over the photos' views of (both) / (either) of the outlines at every pair of stops.

    1: the stops have one shape, as far as outlines tell; 0: nothing in common.
    """
    renderer, outlines = ModelRenderer(device, model), {}
    for stop in stops:
        renderer.set_control(stop_for(model, stop).x)
        outlines[stop.name] = [outline(renderer, photo) for photo in photos]
    found = {}
    for a, b in combinations(outlines, 2):
        both = [(x & y).sum() for x, y in zip(outlines[a], outlines[b], strict=True)]
        either = [(x | y).sum() for x, y in zip(outlines[a], outlines[b], strict=True)]
        seen = [i / u for i, u in zip(both, either, strict=True) if u]
        found[a, b] = float(np.mean(seen)) if seen else 1.0
    return found
