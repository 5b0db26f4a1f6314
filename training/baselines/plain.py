"""Plain 3DGS splats of one modality, trained with the anchor model's rasterizer, loss and photos.

The yardstick: what an anchor model saves and gains is compared with this.
"""

from dataclasses import dataclass, replace

import numpy as np

from shapeshift.rasterizer.reference import rotations
from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.rotation import normalize
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.pose import View
from shapeshift.training.baselines.plain_settings import PlainRates, PlainSettings
from shapeshift.training.baselines.plain_step import (
    GROUPS,
    REST,
    PlainDensificationStats,
    PlainStep,
)
from shapeshift.training.checkpoint import CONTENTS, refuse_other_capture
from shapeshift.training.drawing import Color
from shapeshift.training.first_anchors.first_anchors import neighbour_distance, photo_colors
from shapeshift.training.first_anchors.hull import (
    choose_voxel,
    voxel_centres,
)
from shapeshift.training.first_anchors.initial import (
    Report,
    initial_points,
)
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.photo_store.open_photos import PhotoRoom, open_photos
from shapeshift.training.photos import BLACK, LoadedPhoto, choose_downscale
from shapeshift.training.run import SETTLE, Run
from shapeshift.training.schedule import Budget, Schedule
from shapeshift.training.step import GUARD_EVERY, SNAPSHOT_EVERY, DivergenceGuard
from shapeshift.training.supervision.backgrounds import choose_background, has_one_exposure
from shapeshift.training.supervision.exposure import Exposures
from shapeshift.training.supervision.targets import Targets

GROW_FROM, GROW_UNTIL = 1 / 60, 0.5  # of the run, as 3DGS: steps 500 to 15,000 of 30,000
DEGREES = 30  # a degree of the harmonics more after each 1 / DEGREES of the run, as 3DGS
FIRST_OPACITY = 0.1
NOTED = (
    "voxel", "origin", "iteration", "elapsed", "start_s", "densified_at", "rate_scale",
    "run_length",
)  # fmt: skip


def one_modality(capture: Capture, name: str) -> Capture:
    """The capture as if nothing but one modality had been photographed.

    Raises BadFile where it has no training photos.
    """
    photos = tuple(p for p in capture.photos if p.modality == name)
    if not any(p.split == "train" for p in photos):
        raise BadFile(f"{capture.folder}: modality '{name}' has no training photos.")
    return replace(capture, stops=tuple(s for s in capture.stops if s.name == name), photos=photos)


def group_rates(rates: PlainRates, extent: float) -> dict[str, np.ndarray]:
    """Rates as the optimiser takes them: one a group."""
    each = {name: getattr(rates, name) for name in PlainRates.__dataclass_fields__}
    each["means"] *= extent
    return {name: np.array([rate], np.float32) for name, rate in each.items() if name != "decay"}


class PlainTrainer(Run):
    """One run over a capture of one modality.  `steps` trains; `splats` gives what there is."""

    primitive, param_group = "splats", "means"
    settings: PlainSettings

    def __init__(
        self, device, capture: Capture, settings: PlainSettings, report: Report | None = None,
        room: PhotoRoom | None = None, resume: tuple[dict[str, np.ndarray], dict] | None = None,
    ) -> None:  # fmt: skip
        """report: called with words while the first points take long; room: for the photos; resume:
        what `checkpoint` of a run with the same photos gave.  Raises BadFile."""
        self.device, self.capture, self.settings = device, capture, settings
        (self.stop,) = capture.stops
        self.budget = Budget(settings.iterations, settings.seconds)
        self.factor = settings.downscale or choose_downscale(capture.photos)
        self.photos = open_photos(capture, self.factor, settings.masks, room)
        self.leave_out_still(settings.background)
        photos, self.held_out = self.photos.train, self.photos.test
        with self.counted_start():
            background = choose_background(settings.background, capture.background, photos)
        if settings.background == "auto":
            self.capture = replace(capture, background=background)  # hulls are carved out of it
        self.schedule = Schedule({self.stop.name: photos}, settings.seed, background)
        self.extent = extent_of([p.view for p in photos])
        self.targets = Targets(device, self.photos.most)
        self.exposures = Exposures(device, self.schedule.photos, has_one_exposure(photos))
        self.iteration, self.elapsed, self.densified_at = 0, 0.0, -SETTLE
        self.run_length, self.rate_scale = settings.iterations, 1.0
        self.warnings = self.photos.warnings() + self.still.warnings()
        if resume is None:
            with self.counted_start():
                values = self.first_values(photos, report)
            self.adam = Adam(device, values, self.all_rates())
            self.stats = PlainDensificationStats(device, self.count)
        else:
            self.restore(*resume)
        self.step = PlainStep(device, self.adam, settings.sh_degree)
        self.guard = DivergenceGuard(self.adam.state())
        self.next_snapshot = self.iteration + SNAPSHOT_EVERY
        if resume is not None:
            self.guard.first_loss = dict(resume[1]["first_loss"])

    def first_values(
        self, photos: list[LoadedPhoto], report: Report | None
    ) -> dict[str, np.ndarray]:
        """Round, faint splats at the first points, in the colours of the photos."""
        settings = self.settings
        rng = np.random.default_rng([settings.seed, 0])
        first = initial_points(self.capture, photos, rng, settings.points, report, settings.seconds)
        points, self.origin = np.concatenate([first.points, first.guesses]), first.origin
        self.warnings += first.doubts
        most = min(settings.splats, settings.max_splats)
        self.voxel = settings.voxel or choose_voxel(points, most, rng)
        means = voxel_centres(points, self.voxel)
        count = len(means)
        colors = photo_colors(means, photos, self.schedule.background or BLACK)
        values = {
            "means": means,
            "scales": np.log(neighbour_distance(means))[:, None].repeat(3, axis=1),
            "wxyz": np.tile([1.0, 0, 0, 0], (count, 1)),
            "opacity": np.full(count, np.log(FIRST_OPACITY / (1 - FIRST_OPACITY))),
            "base": (colors - 0.5) / C0,
            "rest": np.zeros((count, REST[settings.sh_degree], 3)),
        }
        return {name: array.astype(np.float32) for name, array in values.items()}

    def checkpoint(self) -> tuple[dict[str, np.ndarray], dict]:
        """(state, notes) from which `resume` goes on to the same bits."""
        notes = {name: getattr(self, name) for name in NOTED}
        notes |= {"first_loss": self.guard.first_loss, "settings": self.settings.as_dict()}
        notes[CONTENTS] = self.contents
        return self.adam.state() | self.statistics(), notes | {"plain_splats_of": self.stop.name}

    def restore(self, state: dict[str, np.ndarray], notes: dict) -> None:
        """Everything as it was when the checkpoint was written.  Raises BadFile."""
        if notes.get("plain_splats_of") != self.stop.name:
            raise BadFile(
                f"the checkpoint is not of plain splats of '{self.stop.name}'; train anew without "
                "--resume."
            )
        refuse_other_capture(self.capture, notes[CONTENTS])
        for name in NOTED:
            setattr(self, name, notes[name])
        self.set_start(notes["start_s"])
        values = {name: state[f"{name}.value"] for name in GROUPS}
        self.adam = Adam(self.device, values, self.all_rates())
        self.adam.load(state)
        self.load_statistics(state)

    def statistics(self) -> dict[str, np.ndarray]:
        """What is summed up beside what the optimiser holds."""
        sums = self.device.download(self.stats.sums)
        return self.exposures.state() | {"densify.grad2d": sums}

    def load_statistics(self, state: dict[str, np.ndarray]) -> None:
        self.exposures.load(state)
        self.stats = PlainDensificationStats(self.device, self.count)
        self.stats.sums = self.device.upload(state["densify.grad2d"])

    @property
    def count(self) -> int:
        return len(self.adam["means"])

    @property
    def splat_count(self) -> int:
        return self.count

    def rates(self) -> PlainRates:
        """The settings' learning rates for a run of this length."""
        return self.settings.rates(self.run_length or 0)

    def all_rates(self) -> dict[str, np.ndarray]:
        return group_rates(self.rates(), self.extent)

    def compile_kernels(self) -> None:
        """Compile every kernel for every photo size, outside of the time that is counted."""
        before, known = self.adam.state(), self.statistics()
        background = self.schedule.background or BLACK
        photos = self.schedule.photos[self.stop.name]
        for photo in {photo.kind: photo for photo in photos}.values():
            self.adam.step(self.photo_gradients(photo, background), 0.0)
            loss, visible = self.empty_loss(photo, background), self.visible()
            self.guard.observe(self.stop.name, loss, visible, 1.0)
        self.adam.load(before)
        self.load_statistics(known)

    def empty_loss(self, photo: LoadedPhoto, background: Color) -> float:
        """The loss of a picture without splats; the first splats, coloured, are better already."""
        loss, (width, height) = self.targets.loss(photo), photo.view.size
        image = np.broadcast_to(np.array(background, np.float32)[:, None, None], (3, height, width))
        target = self.targets.target(photo, background)
        loss.compare(self.device.upload(image), target)
        return loss.value()

    def photo_gradients(self, photo: LoadedPhoto, background: Color) -> dict[str, object]:
        depth = self.targets.shape_term(photo, self.settings)
        self.drawing = self.step.draw(photo.view, background, depth is not None)
        target = self.target(photo, background)
        loss = self.targets.loss(photo)
        return self.step.gradients(self.drawing, loss, target, self.stats, depth)

    def one_step(self) -> tuple[float | None, bool]:
        """(loss or None, whether the guard rolled back)."""
        photo = self.schedule.photo(self.iteration)
        background = self.schedule.background_of(self.iteration, photo)
        fraction = self.budget.fraction(self.iteration, self.elapsed)
        self.step.used = REST[min(self.settings.sh_degree, int(DEGREES * fraction))]
        grads = self.photo_gradients(photo, background)
        self.adam.step(grads, self.rate_scale * self.rates().decay ** fraction)
        self.iteration += 1
        loss, rolled_back = None, False
        if self.iteration % GUARD_EVERY == 0:
            loss = self.targets.loss(photo).value()
            rolled_back = self.check_divergence(loss)
        self.fix_run_length()
        if self.settings.grow and GROW_FROM <= fraction <= GROW_UNTIL:
            if self.remaining_steps() >= SETTLE:
                self.densify()
        return loss, rolled_back

    def remaining_steps(self) -> float:
        """How many more the budget allows, as fast as they have been."""
        done = self.budget.fraction(self.iteration, self.elapsed)
        return self.iteration * (1 - done) / max(done, 1e-9)

    def check_divergence(self, loss: float) -> bool:
        """The guard's look at the last step; True when it turned the run back."""
        if self.guard.is_healthy(self.stop.name, loss, self.visible(), 1.0):
            if self.iteration >= self.next_snapshot and self.guard.stable and self.settled:
                self.guard.save_snapshot(self.adam.state())
                self.next_snapshot = self.iteration + SNAPSHOT_EVERY
            return False
        self.adam.load(self.guard.rollback())
        self.stats = PlainDensificationStats(self.device, self.count)
        self.rate_scale /= 2
        self.exposures.reset(self.budget.fraction(self.iteration, self.elapsed), self.iteration)
        return True

    def densify(self) -> None:
        """Clones, halves and farewells every so many steps; opacities are set back more rarely.

        What is drawn by chance follows from the seed and the step alone.
        """
        settings = self.settings
        if self.iteration % settings.interval(self.run_length or 0) == 0:
            stats = self.device.download(self.stats.sums)
            state = self.adam.state()
            change = choose_densification(state, stats, settings, self.extent)
            rng = np.random.default_rng([settings.seed, 3, self.iteration])
            self.adam.load(apply_densification(state, change, rng))
            self.stats = PlainDensificationStats(self.device, self.count)
            self.densified_at = self.iteration
        if self.iteration % settings.reset_every == 0:
            self.adam.load(reset_opacity(self.adam.state()))
            self.densified_at = self.iteration

    def held_out_psnr(self, most: int = 2) -> dict[str, float]:
        """Mean PSNR in dB over the first held-out photos, as they are trained."""
        background, values = self.schedule.background or BLACK, []
        for photo in self.held_out[:most]:
            drawing = self.step.draw(photo.view, background)
            values.append(self.psnr_of(drawing, photo, background))
        return {self.stop.name: float(np.mean(values))} if values else {}

    def splats(self) -> PlainSplats:
        """The splats as a PLY holds them; harmonics that were not switched on yet are zero."""
        value = {n: a for n, a in self.adam.state().items() if n.endswith(".value")}
        sh = np.concatenate([value["base.value"][:, None], value["rest.value"]], axis=1)
        return PlainSplats(
            value["means.value"],
            np.exp(value["scales.value"]),
            normalize(value["wxyz.value"]),
            1 / (1 + np.exp(-value["opacity.value"])),
            sh,
            self.capture.origin,
        )


# Growing and pruning of plain splats by the rules of 3DGS (Kerbl et al., 2023, section 5.2).
#
# Where the screen gradient is large, a small splat is cloned and a large one is split in two; what
# has become transparent goes.  Unlike there nothing goes for being large, on the screen or in the
# world: at the cap, walls of a room went and did not come back (docs/bench/ideas.md).

LARGE = 0.01  # of the extent: larger ones are split, not cloned
SMALLER = 1.6  # times: each of two halves
AFTER_RESET = 0.01  # opacity that all are cut to


@dataclass(frozen=True)
class Densification:
    """What a look at the stats decided, of N splats."""

    gone: np.ndarray  # (N,) bool, transparent
    cloned: np.ndarray  # (C,) indices
    split: np.ndarray  # (S,) indices; each becomes two


def extent_of(views: list[View]) -> float:
    """Metres: 1.1 times the farthest camera from the middle of all, as 3DGS measures a scene."""
    eyes = np.array([view.world_from_eye.position for view in views])
    return max(1.1 * float(np.linalg.norm(eyes - eyes.mean(0), axis=1).max()), 1e-6)


def choose_densification(
    state: dict[str, np.ndarray],
    stats: np.ndarray,  # (N, 2) of PlainDensificationStats
    settings: PlainSettings,
    extent: float,
) -> Densification:
    """Which splats go, are cloned or are split; where room is short, the strongest first."""
    largest = np.exp(state["scales.value"].astype(np.float64)).max(axis=1)
    opacity = 1 / (1 + np.exp(-state["opacity.value"].astype(np.float64)))
    gone = ~(opacity >= settings.prune_opacity)  # NaN goes, too
    if gone.all():
        gone[:] = False
    grad2d = stats[:, 0] / np.maximum(stats[:, 1], 1)
    chosen = np.flatnonzero((grad2d >= settings.grow_threshold) & ~gone)
    room = max(settings.max_splats - int((~gone).sum()), 0)
    chosen = chosen[np.argsort(-grad2d[chosen], kind="stable")][:room]
    small = largest[chosen] <= LARGE * extent
    return Densification(gone, np.sort(chosen[small]), np.sort(chosen[~small]))


def split_splats(values: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Two splats for each one: drawn from it as from a distribution, SMALLER times smaller."""
    two = {name: np.repeat(rows, 2, axis=0) for name, rows in values.items()}
    sigma = np.exp(two["scales"].astype(np.float64))
    away = rotations(two["wxyz"].astype(np.float64)) @ rng.normal(0, sigma)[..., None]
    two["means"] = two["means"] + away[..., 0]
    two["scales"] = two["scales"] - np.log(SMALLER)
    return two


def apply_densification(
    state: dict[str, np.ndarray], change: Densification, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """An optimiser's state afterwards: splats that stay keep their moments, new ones have none."""
    values = {name: state[f"{name}.value"] for name in GROUPS}
    keep = ~change.gone
    keep[change.split] = False
    clones = {name: rows[change.cloned] for name, rows in values.items()}
    split = split_splats({name: rows[change.split] for name, rows in values.items()}, rng)
    out = dict(state)
    for name in GROUPS:
        fresh = np.concatenate([clones[name], split[name]]).astype(np.float32)
        out[f"{name}.value"] = np.concatenate([values[name][keep], fresh])
        for part in ("mean", "square"):
            old = state[f"{name}.{part}"][keep]
            out[f"{name}.{part}"] = np.concatenate([old, np.zeros_like(fresh)])
    return out


def reset_opacity(state: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The state with no opacity above AFTER_RESET, and the optimiser's memory of them gone."""
    most = np.float32(np.log(AFTER_RESET / (1 - AFTER_RESET)))
    cut = np.minimum(state["opacity.value"], most)
    nothing = {f"opacity.{part}": np.zeros_like(cut) for part in ("mean", "square")}
    return state | {"opacity.value": cut} | nothing
