"""The training loop: a Capture in, step after step, and at any moment an AnchorModel out."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.model import AnchorModel, BadFile
from shapeshift.runtime_models.package.refit_encoding import encoding_for
from shapeshift.scene.cameras.framing import frame_points
from shapeshift.scene.cameras.photo_view import photo_view
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.calibration.pose_refinement import PoseGradient, PoseRefinement
from shapeshift.training.checkpoint import CONTENTS, refuse_other_capture
from shapeshift.training.densify import (
    DensificationStats,
    NewAnchors,
    absent_as_nan,
    anchor_cap,
    densify_and_prune,
    resize_optimizer_state,
)
from shapeshift.training.drawing import Color, camera_of
from shapeshift.training.export import model_of, notes_of
from shapeshift.training.first_anchors.first_anchors import base_colors, first_anchors
from shapeshift.training.first_anchors.initial import Report, initial_points
from shapeshift.training.heads.networks import initial_weights, padded
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import MinScale, min_opacity_share
from shapeshift.training.photo_store.open_photos import PhotoRoom, TrainingPhotos, open_photos
from shapeshift.training.photos import BLACK, LoadedPhoto, choose_downscale, validate_views
from shapeshift.training.run import SETTLE, Run
from shapeshift.training.schedule import (
    WARM_UP_STEPS,
    BlendedShapes,
    Budget,
    LrWarmup,
    Schedule,
    ShapeBlending,
)
from shapeshift.training.settings import Rates, TrainSettings, parameter_rates
from shapeshift.training.step import (
    GUARD_EVERY,
    SNAPSHOT_EVERY,
    DivergenceGuard,
    TrainingStep,
    Visibility,
)
from shapeshift.training.supervision.backgrounds import (
    background_warning,
    choose_background,
    has_one_exposure,
)
from shapeshift.training.supervision.exposure import Exposures
from shapeshift.training.supervision.targets import Targets

GROW_FROM, GROW_UNTIL = 0.05, 0.8  # of the run
EMPTY_PHOTO = 0.002  # mean contrast below which a photo shows nothing but background
FEATURE_SPREAD = 0.1  # standard deviation of the first features


class Trainer(Run):
    """One run.  `steps` trains; `model` may be called between any two steps."""

    primitive = param_group = "anchors"
    storage = "float16"  # of what anchors have, in a package
    settings: TrainSettings

    def __init__(
        self,
        device,
        capture: Capture,
        settings: TrainSettings,
        resume: tuple | None = None,
        loaded: dict[str, list[LoadedPhoto]] | TrainingPhotos | None = None,
        report: Report | None = None,
        room: PhotoRoom | None = None,
    ) -> None:
        """`resume`: (state, notes) of a checkpoint whose settings were compared by the caller.

        loaded: photos of the splits train and test, where they were read before; report: called
        with words while the first points take long; room: where photos that are read now may lie.
        """
        self.device, self.capture, self.settings = device, capture, settings
        self.budget = Budget(settings.iterations, settings.seconds)
        self.factor = settings.downscale or choose_downscale(capture.photos)
        self.stops = capture.stops
        if loaded is None:
            self.photos = open_photos(capture, self.factor, settings.masks, room)
        elif isinstance(loaded, dict):
            self.photos = TrainingPhotos(loaded["train"], loaded["test"])
        else:
            self.photos = loaded
        self.leave_out_still(settings.background)
        self.held_out = self.photos.test
        photos, self.warnings = validate_views(self.photos.train, settings.masks)
        self.warnings += self.photos.warnings() + self.still.warnings()
        by_modality = {s.name: [p for p in photos if p.modality == s.name] for s in self.stops}
        if empty := [name for name, found in by_modality.items() if not found]:
            raise BadFile(f"{capture.folder}: modality '{empty[0]}' has no training photos.")
        with self.counted_start():
            background = choose_background(settings.background, capture.background, photos)
        if settings.background == "auto" and background and background != capture.background:
            self.capture = replace(capture, background=background)  # hulls are carved out of it
            self.warnings.append(background_warning(background))
        self.schedule = Schedule(by_modality, settings.seed, background)
        self.blending = ShapeBlending(settings.blended_shapes, settings.seed, self.stops)
        self.lay_out()
        self.targets = Targets(device, self.photos.most)
        self.exposures = Exposures(device, by_modality, has_one_exposure(photos))
        self.lr_warmup = LrWarmup()
        self.photo_contrast: dict[tuple, float] = {}
        refined = by_modality if settings.poses == "refine" else {}
        self.poses = PoseRefinement(refined)
        views = [photo.view for photo in photos]
        self.min_scale = MinScale(device, views, self.layout.splats, settings.min_scale_px)
        if resume is None:
            with self.counted_start():
                self.initialise(photos, report)
        else:
            self.restore(*resume)
        self.step = self.new_step()
        self.step.min_scale = self.min_scale
        self.step.pose_gradient = PoseGradient(device) if refined else None
        self.guard = DivergenceGuard(self.adam.state() | self.poses.state())
        self.next_snapshot = self.iteration + SNAPSHOT_EVERY
        if resume is not None:
            self.guard.first_loss = dict(resume[1]["first_loss"])

    def lay_out(self) -> None:
        """What the networks are like, and how many anchors there may be."""
        self.encoding = encoding_for([stop.x for stop in self.stops])
        self.layout = self.settings.layout(self.encoding.d, len(self.stops))
        self.anchor_cap = anchor_cap(self.settings, self.layout, self.encoding, self.stops)

    def new_step(self) -> TrainingStep:
        controls = np.stack([self.encoding.encode(stop.x) for stop in self.stops])
        return TrainingStep(self.device, self.layout, self.voxel, self.adam, controls)

    def initialise(self, photos: list[LoadedPhoto], report: Report | None) -> None:
        """Anchors, features and weights of a new run."""
        settings, wide = self.settings, self.layout.widths
        rng = np.random.default_rng([settings.seed, 0])
        first = initial_points(self.capture, photos, rng, settings.points, report, settings.seconds)
        self.warnings += first.doubts
        self.origin, background = first.origin, self.schedule.background
        start = first_anchors(first, self.anchor_cap, photos, background, settings.max_by_shape)
        self.voxel, self.anchor_cap, count = start.voxel, start.most, len(start.anchors)
        features = np.zeros((count, padded(settings.features)), np.float32)
        features[:, : settings.features] = (
            rng.normal(size=(count, settings.features)) * FEATURE_SPREAD
        )
        values = {"weights": initial_weights(self.layout, rng), "features": features}
        values |= {n: getattr(start, n)[:, : wide.get(n)] for n in ("anchors", *self.layout.own)}
        if len(groups := self.layout.color_groups) > 1:
            del values["colors"]
            for group, stop in zip(groups, self.stops, strict=True):
                of_stop = [photo for photo in photos if photo.modality == stop.name]
                values[group] = base_colors(start.anchors, of_stop, background)
        self.iteration, self.elapsed, self.densified_at = 0, 0.0, -SETTLE
        self.rate_scale, self.run_length = 1.0, settings.iterations
        self.adam = Adam(self.device, values, self.all_rates())
        self.min_scale.look(self.adam["anchors"])
        self.stats, self.visibility = self.fresh_statistics(count)

    def fresh_statistics(self, count: int) -> tuple[DensificationStats, Visibility]:
        """Statistics and visibility of `count` anchors of which nothing is known yet."""
        return (
            DensificationStats(self.device, self.layout, count, len(self.stops)),
            Visibility(self.device, count, len(self.stops), self.layout.splats),
        )

    def restore(self, state: dict[str, np.ndarray], notes: dict) -> None:
        """Everything as it was when the checkpoint was written.  Raises BadFile where that was a
        run of other photos.
        """
        refuse_other_capture(self.capture, notes[CONTENTS])
        self.voxel, self.origin = notes["voxel"], notes["origin"]
        self.iteration, self.elapsed = notes["iteration"], notes["elapsed"]
        self.set_start(notes.get("start_s", 0.0))
        self.densified_at, self.rate_scale = notes["densified_at"], notes["rate_scale"]
        self.run_length, self.anchor_cap = notes["run_length"], notes["anchor_cap"]
        self.lr_warmup = LrWarmup(notes["lr_warmup_start"])
        self.layout = self.layout.as_in(state)
        values = {n: state[f"{n}.value"] for n in ("weights", *self.layout.per_anchor)}
        self.adam = Adam(self.device, values, self.all_rates())
        self.adam.load(state)
        self.stats, self.visibility = self.fresh_statistics(self.anchors_count)
        self.stats.load(state)
        self.visibility.load(state)
        self.exposures.load(state)
        self.poses.load(state)
        self.min_scale.load(state, self.adam["anchors"])

    def checkpoint(self) -> tuple[dict[str, np.ndarray], dict]:
        """(state, notes) from which `resume` goes on to the same bits."""
        notes = {
            "voxel": self.voxel, "origin": self.origin, "iteration": self.iteration,
            "elapsed": self.elapsed, "densified_at": self.densified_at,
            "rate_scale": self.rate_scale, "run_length": self.run_length,
            "first_loss": self.guard.first_loss, "settings": self.settings.as_dict(),
            "lr_warmup_start": self.lr_warmup.start, "start_s": self.start_s,
            "anchor_cap": self.anchor_cap, CONTENTS: self.contents,
        }  # fmt: skip
        known = self.stats.state() | self.visibility.state() | self.exposures.state()
        more = self.poses.state() | self.min_scale.state()
        return self.adam.state() | known | more, notes

    @property
    def anchors_count(self) -> int:
        return len(self.adam["anchors"])

    @property
    def splat_count(self) -> int:
        return self.anchors_count * self.layout.splats

    def rates(self) -> Rates:
        """The settings' learning rates for a run of this length."""
        return self.settings.rates(self.run_length or 0)

    def all_rates(self) -> dict[str, np.ndarray]:
        usual = parameter_rates(self.layout, self.rates(), self.voxel)
        return self.lr_warmup.rates(usual, self.iteration)

    def control(self, modality: str) -> np.ndarray:
        return self.encoding.encode(next(s.x for s in self.stops if s.name == modality))

    def compile_kernels(self) -> None:
        """Compile every kernel for every photo size, outside of the time that is counted.

        On the way the guard learns what a healthy picture of every modality has on screen.
        """
        before = self.adam.state()
        known = self.stats.state() | self.visibility.state() | self.exposures.state()
        background = self.schedule.background or BLACK
        for modality, photos in self.schedule.photos.items():
            whole = {photo.kind: photo for photo in photos}.values()
            for photo in whole:
                self.step.update(self.photo_gradients(photo, background), 0.0)
                loss = self.targets.loss(photo).value()
                contrast = self.contrast_ratio(photo, background)
                self.guard.observe(modality, loss, self.visible(), contrast)
        self.adam.load(before)
        self.stats.load(known)
        self.visibility.load(known)
        self.exposures.load(known)

    def photo_gradients(
        self, photo: LoadedPhoto, background: Color, shapes: BlendedShapes | None = None
    ) -> dict[str, object]:
        """Gradients of how a photo differs.  shapes: None for those of its stop."""
        self.stats.stop = stop = [s.name for s in self.stops].index(photo.modality)
        depth, rows = self.targets.shape_term(photo, self.settings), None
        view = self.poses.view(photo)
        if shapes is None:
            control = self.control(photo.modality)
            rows = self.visibility.visible_rows(stop, camera_of(view), self.adam["anchors"])
        else:
            control = shapes.control(self.encoding)
        self.drawing = self.step.draw(view, control, background, depth is not None, rows)
        if shapes is None:
            self.visibility.update_reach(
                stop, rows, self.step.gathered["anchors"], self.drawing.splats
            )
        target = self.target(photo, background, shapes is None)
        loss = self.targets.loss(photo)
        done = self.budget.fraction(self.iteration, self.elapsed)
        share = min_opacity_share(len(self.stops), self.settings.blended_shapes, done)
        return self.step.gradients(self.drawing, loss, target, self.stats, depth, share)

    def probe_pose(self, photo: LoadedPhoto, background: Color, fraction: float) -> None:
        """Now and then, before a photo's step, its gradient by a pose a little beside its own."""
        aside, collected = self.poses.probe(photo, fraction), self.step.pose_gradient
        if aside is None or collected is None:
            return
        depth = self.targets.shape_term(photo, self.settings)
        view, control = self.poses.view(photo, aside), self.control(photo.modality)
        drawing = self.step.draw(view, control, background, depth is not None)
        target = self.targets.target(photo, background, self.exposures)
        self.step.gradients(drawing, self.targets.loss(photo), target, None, depth)
        self.poses.note_probe(photo, aside, collected.by_eye)

    def one_step(self) -> tuple[float | None, bool]:
        """(loss or None, whether the guard rolled back)."""
        photo = self.schedule.photo(self.iteration)
        background = self.schedule.background_of(self.iteration, photo)
        shapes = self.blending.sample(self.iteration, photo.modality)
        fraction = self.budget.fraction(self.iteration, self.elapsed)
        if shapes is None:
            self.probe_pose(photo, background, fraction)
        grads = self.photo_gradients(photo, background, shapes)
        if self.exposures.light_rests(photo.modality, fraction):
            grads.pop("light", None)
        if self.lr_warmup.changes(self.iteration):
            self.adam.set_rates(self.all_rates())
        self.step.update(grads, self.rate_scale * self.rates().decay ** fraction)
        if self.step.pose_gradient is not None and shapes is None:
            self.poses.step(photo, self.step.pose_gradient.by_eye, fraction)
        self.iteration += 1
        loss, rolled_back = None, False
        rounds = -(-self.iteration // len(self.stops))
        if rounds % GUARD_EVERY == 0 and shapes is None:  # every modality, however many there are
            loss = self.targets.loss(photo).value()
            rolled_back = self.check_divergence(photo, background, loss)
        self.fix_run_length()
        if self.settings.grow and self.iteration % self.settings.grow_every == 0:
            if GROW_FROM <= fraction <= GROW_UNTIL and self.remaining_steps() >= SETTLE:
                self.densify()
        return loss, rolled_back

    def contrast_ratio(self, photo: LoadedPhoto, background: Color) -> float:
        """Contrast of the last drawing to its background, over that of its photo."""
        behind = np.asarray(background, np.float32)
        key = (photo.name, photo.view.size, background)
        contrast = self.photo_contrast.get(key)
        if contrast is None:
            contrast = float(np.abs(photo.over(background) - behind).mean())
            if self.schedule.background is not None or not photo.see_through:
                self.photo_contrast[key] = contrast
        if not contrast > EMPTY_PHOTO:
            return 1.0
        image = self.device.view(self.drawing.frame.image)
        return float(np.abs(image - behind[:, None, None]).mean()) / contrast

    def check_divergence(self, photo: LoadedPhoto, background: Color, loss: float) -> bool:
        """The guard's look at the last step; True when it turned the run back."""
        contrast = self.contrast_ratio(photo, background)
        if self.guard.is_healthy(photo.modality, loss, self.visible(), contrast):
            last = photo.modality == self.stops[-1].name
            if self.iteration >= self.next_snapshot and last and self.guard.stable:
                self.guard.save_snapshot(self.adam.state() | self.poses.state())
                self.next_snapshot = self.iteration + SNAPSHOT_EVERY
            return False
        self.lr_warmup = LrWarmup(self.iteration)
        looks = WARM_UP_STEPS // (GUARD_EVERY * len(self.stops))
        self.load_state(self.guard.rollback(looks))
        self.rate_scale /= 2
        self.exposures.reset(self.budget.fraction(self.iteration, self.elapsed), self.iteration)
        return True

    def load_state(self, state: dict[str, np.ndarray]) -> None:
        """Another state, of perhaps other anchors; all as it was where memory does not suffice."""
        fresh = self.fresh_statistics(len(state["anchors.value"]))
        self.adam.load(state)
        self.min_scale.look(self.adam["anchors"])
        self.poses.load(state)
        self.stats, self.visibility = fresh

    def restore_last_good(self) -> bool:
        """Back to the last good state where the run died after the guard's last look."""
        good = all(np.isfinite(array).all() for array in self.adam.state().values())
        if not good:
            self.load_state(self.guard.snapshots[-1])
        return not good

    def densify(self) -> None:
        """New anchors where they are needed; anchors that show nothing go."""
        means = []
        for stop in self.stops:
            splats = self.step.decode(self.encoding.encode(stop.x), np.zeros(3))
            fields = map(self.device.download, (splats.means, splats.opacity))
            means.append(absent_as_nan(*fields))
        now, anchors = self.adam.state(), self.device.download(self.adam["anchors"])
        sizes = np.full(len(anchors), self.voxel)
        if "frame" in self.layout.attributes:
            sizes = self.voxel * np.exp(now["frames.value"][:, :3].mean(axis=1))
        known = self.stats.state(), self.anchor_cap
        kept, new = self.allowed(*densify_and_prune(anchors, sizes, means, *known))
        self.load_state(resize_optimizer_state(now, self.layout.per_anchor, kept, new))
        self.densified_at = self.iteration

    def allowed(self, kept: np.ndarray, new: NewAnchors) -> tuple[np.ndarray, NewAnchors]:
        """Of who stays and who comes, what a run may do: here everything."""
        return kept, new

    def remaining_steps(self) -> int:
        """How many more the budget allows, as fast as they have been."""
        done = self.budget.fraction(self.iteration, self.elapsed)
        return round(self.iteration * (1 - done) / done)

    def held_out_psnr(self, most: int = 2) -> dict[str, float]:
        """Mean PSNR in dB of each modality over its first held-out photos, as they are trained."""
        out = {}
        background = self.schedule.background or BLACK
        for stop in self.stops:
            photos = [p for p in self.held_out if p.modality == stop.name][:most]
            values = []
            for photo in photos:
                drawing = self.step.draw(photo.view, self.control(stop.name), background)
                values.append(self.psnr_of(drawing, photo, background))
            if values:
                out[stop.name] = float(np.mean(values))
        return out

    def model(self) -> AnchorModel:
        provenance = notes_of(self.capture) | {
            "trained_by": "shapeshift train",
            "settings": self.settings.as_dict(),
            "iterations": self.iteration,
            "voxel_m": self.voxel,
            "first_anchors": self.origin,
            "downscale": self.factor,
            "background": self.schedule.background,
            "still_background": bool(self.still.pictures),
            "rate_scale": self.rate_scale,
        }
        state = self.adam.state()
        points = state["anchors.value"]
        bounds = frame_points(points, np.ones(len(points), np.float32))
        if (view := photo_view([p.view for p in self.capture.photos], *bounds)) is not None:
            provenance["view"] = view
        return model_of(state, self.layout, self.voxel, self.encoding, self.stops, provenance)
