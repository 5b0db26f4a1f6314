"""What a run of anchors and one of plain splats have in common: budget, pace, looks at photos."""

import os
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from shapeshift.rasterizer.device import Device
from shapeshift.runtime_models.files.hashes import ABSENT
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.baselines.plain_settings import PlainSettings
from shapeshift.training.checkpoint import contents_of, files_of, name_in
from shapeshift.training.drawing import Color, DrawnView
from shapeshift.training.evaluation.metrics import psnr
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import Target
from shapeshift.training.photo_store.open_photos import TrainingPhotos
from shapeshift.training.photos import LoadedPhoto
from shapeshift.training.schedule import Budget, Schedule
from shapeshift.training.settings import TrainSettings
from shapeshift.training.supervision.exposure import Exposures
from shapeshift.training.supervision.still_background import StillBackground, leave_out_still
from shapeshift.training.supervision.targets import Targets

SETTLE = 50  # steps after growing in which the picture is worse: no evaluation, no export
LENGTH_STEPS = 20  # steps after which the length of a timed run is known


@dataclass(frozen=True)
class Progress:
    """What a step has to say."""

    iteration: int  # steps done
    fraction: float  # of the budget, 0..1
    loss: float | None  # every few steps
    anchors: int
    elapsed: float  # seconds that the run has used: Run.seconds
    rolled_back: bool = False  # the guard turned the run back


def clock_of(device: Device) -> Callable[[], float]:
    """What tells the seconds that training takes.

    Where a processor computes, processor time of all threads: seconds of one core, which do not
    depend on what else the machine does.  The time of other devices is seen by the clock alone.
    """
    return time.process_time if device.kind == "cpu" else time.perf_counter


def used_seconds(device: Device) -> Callable[[], float]:
    """The same with what processes took that this one waited for; on Windows without."""
    if device.kind != "cpu":
        return time.perf_counter
    return lambda: sum(os.times()[:4])


class Run(ABC):
    """A run that an optimiser makes step by step.  Who derives from it sets what is named here."""

    primitive: str  # what Progress counts ...
    param_group: str  # ... and the group of the optimiser that has a row for each
    device: Device
    capture: Capture
    settings: TrainSettings | PlainSettings
    budget: Budget
    adam: Adam
    photos: TrainingPhotos
    still: StillBackground  # what was left out of them
    targets: Targets
    exposures: Exposures
    drawing: DrawnView  # the last one
    start_s = 0.0  # seconds that went by before the first step, by used_seconds, without reading
    iteration: int  # steps done
    schedule: Schedule
    elapsed: float  # seconds that the steps took, by clock_of, without reading photos
    densified_at: int  # iteration of the last change of what is counted
    run_length: int | None  # iterations in all; None until a timed run's is known

    @cached_property
    def contents(self) -> dict[str, list]:
        """What its photos are, for a run that goes on; read when it is asked for."""
        return contents_of(self.capture)

    def forget_photo(self, sentence: str) -> None:
        """One that a sentence says cannot be read: mended, it is another file than it was."""
        for photo in self.capture.photos:
            if any(path_end(p).removeprefix("...") in sentence for p in files_of(photo)):
                self.contents[name_in(self.capture, photo)][0] = ABSENT

    @property
    @abstractmethod
    def splat_count(self) -> int:
        """How many splats the model has at any stop, absent ones too."""

    @abstractmethod
    def compile_kernels(self) -> None:
        """Compile every kernel for every photo size, outside of the time that is counted."""

    @abstractmethod
    def one_step(self) -> tuple[float | None, bool]:
        """(loss or None, whether the guard rolled back)."""

    @abstractmethod
    def all_rates(self) -> dict[str, np.ndarray]:
        """Learning rates of every group, as the optimiser takes them."""

    def steps(self) -> Iterator[Progress]:
        """Train until the budget is used; yields after every step."""
        self.compile_kernels()
        clock, processor = clock_of(self.device), self.device.kind == "cpu"
        while self.budget.fraction(self.iteration, self.elapsed) < 1:
            start = clock() - self.photos.seconds(processor)
            self.photos.read_ahead(self.schedule.photo, self.iteration)
            loss, rolled_back = self.one_step()
            self.elapsed += clock() - self.photos.seconds(processor) - start
            fraction, count = self.budget.fraction(self.iteration, self.elapsed), self.param_group
            anchors = len(self.adam[count])
            yield Progress(self.iteration, fraction, loss, anchors, self.seconds, rolled_back)

    @contextmanager
    def counted_start(self) -> Iterator[None]:
        """What is done in it is the start: it comes out of the budget."""
        clock, processor = used_seconds(self.device), self.device.kind == "cpu"
        began = clock() - self.photos.seconds(processor)
        yield
        self.set_start(self.start_s + clock() - self.photos.seconds(processor) - began)

    def leave_out_still(self, background: str) -> None:
        """Cuts out of the photos what stands still behind their subject, where that is known."""
        with self.counted_start():
            found = leave_out_still(self.photos, background, self.capture.background)
        self.photos, self.still = found

    def set_start(self, seconds: float) -> None:
        """What the start took; of a run that goes on, what it took then."""
        self.start_s, self.budget = seconds, replace(self.budget, start=seconds)

    @property
    def seconds(self) -> float:
        """What the run has used of its budget."""
        return self.start_s + self.elapsed

    @property
    def settled(self) -> bool:
        """Whether the last growing lies far enough back for the picture to count."""
        return self.iteration - self.densified_at >= SETTLE

    def fix_run_length(self) -> None:
        """A timed run's length follows from its first steps, and its rates from the length."""
        seconds = self.budget.training
        if self.run_length is None and seconds is not None and self.iteration == LENGTH_STEPS:
            self.run_length = int(seconds / (self.elapsed / (LENGTH_STEPS - 1)))
            self.adam.set_rates(self.all_rates())

    def target(self, photo: LoadedPhoto, background: Color, own: bool = True) -> Target:
        """What the last drawing, of this photo, should have been.

        own: it is of the photo's own stop, so that it tells how bright the photo is.
        """
        fraction = self.budget.fraction(self.iteration, self.elapsed)
        begun = self.exposures.has_begun(fraction, self.iteration)
        known = self.exposures if begun else None
        image = self.drawing.frame.image if own else None
        return self.targets.target(photo, background, known, image)

    def visible(self) -> float:
        """The share of all splats that the last drawing has on screen."""
        shown = self.device.view(self.drawing.projected.record)[:, 9] > 0
        return float(shown.sum() / self.splat_count)

    def psnr_of(self, drawing: DrawnView, photo: LoadedPhoto, background: Color) -> float:
        """Decibels of a drawing against its photo."""
        image = self.device.download(drawing.frame.image).transpose(1, 2, 0)
        return psnr(image, photo.over(background), photo.weight)
