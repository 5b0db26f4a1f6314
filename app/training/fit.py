"""launch.py fit: the smallest scene that shows a capture as well as the largest, and why."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from shapeshift.app.cluster.open_cluster import NONE, ClusterOptions
from shapeshift.app.command_line import EXPERT, MODALITY, POSITIONAL, FieldsOf, Opt
from shapeshift.app.terminal import open_console, print_json, say
from shapeshift.app.training.train_options import SETTINGS, Asked, MachineOptions, with_settings
from shapeshift.training.settings import LEFT, TrainSettings, suited

if TYPE_CHECKING:
    from shapeshift.rasterizer.device import Device
    from shapeshift.runtime_models.model import AnchorModel
    from shapeshift.scene.captures.capture import Capture
    from shapeshift.training.fit.ablation import Ablation, Trial
    from shapeshift.training.fit.fit import FitReport, ReportProgress, TrainSeeds


USUAL = ("max_anchors", "downscale", "masks", "background")
LINES = ("splats_per_anchor", "features", "hidden", "fixed", "anchor_attributes")  # as of train


@dataclass(frozen=True)
class Options(ClusterOptions, MachineOptions):
    """Take away what a scene does not need: train without one part after the other, and compare
    the held-out photos.  The options say how large a model it starts from.
    """

    capture: Annotated[Path, POSITIONAL]
    """A folder of posed photos, as of train."""
    out: Path
    """The package to write: NAME.shift or a folder."""
    asked: Annotated[Asked, FieldsOf(TrainSettings, USUAL, ("seed",), LINES, LEFT)] = field(
        default_factory=dict
    )
    settings: Annotated[Path | None, SETTINGS] = None
    """A TOML file with a setting a line, as of train.  Default: none."""
    tolerance_db: float = 0.1
    """dB that each modality may lose in all against the largest model, its error included."""
    seeds: int = 2
    """Trainings of every trial.  Two seeds of one model differ by about 0.2 dB."""
    json: bool = False
    """Print the report as JSON on standard output."""
    iterations: int | None = None
    """Steps of every training.  Default: 600."""
    seconds: float | None = None
    """Train every trial for this long instead.  Default: no limit, --iterations decides."""
    final_iterations: int | None = None
    """Train the chosen model again for this many steps.  Default: the trial's model is written."""
    final_seconds: float | None = None
    """Train the chosen model again for this long.  Default: the trial's model is written."""
    calibrate: Annotated[str | None, MODALITY] = None
    """A modality whose cameras' offset is found first, as of train.  Default: none."""
    only: Annotated[Path | None, Opt(expert=True, metavar="SETTINGS")] = None
    """Do one training by hand: of the settings in this file, as --cluster writes them; --out is the
    package that it leaves.  Default: the whole search."""
    resume: Annotated[bool, EXPERT] = False
    """With --only: go on where an earlier attempt at it was interrupted."""


TRIAL = 600  # steps
FINAL = {"iterations": "final_iterations", "seconds": "final_seconds"}  # of the last run
WRITTEN = "the fitted model of the first seed with this report in it"
CLOCKS = ("decode_ms", "train_s")  # how keys of the report end that hold times


def run(options: Options) -> int:
    from shapeshift.app.opening import open_capture
    from shapeshift.app.pace import with_pace
    from shapeshift.app.paths import full
    from shapeshift.app.training.run_loop import calibrated
    from shapeshift.app.training.run_trials import calibrated_once, run_trial, say_of_clock
    from shapeshift.app.training.train_options import settings_of
    from shapeshift.rasterizer.device import open_device
    from shapeshift.runtime_models.package.write_package import refuse_foreign

    options = with_settings(options)
    if options.only is not None:
        return run_trial(options)
    refuse_options(options)
    refuse_foreign(options.out)
    settings = settings_of(options.asked | budget(options.iterations, options.seconds))
    longer = options.final_iterations, options.final_seconds
    last = (
        None
        if longer == (None, None)
        else settings_of(options.asked | budget(*longer), None, FINAL)
    )
    capture, device = open_capture(options.capture, options.memory), open_device(options.device)
    settings = suited(settings, options.asked, capture)
    if options.calibrate is not None:
        if options.cluster == NONE:
            settings = calibrated(device, capture, settings, options.calibrate)
        else:
            settings = calibrated_once(device, capture, settings, options)
    say_of_clock(options)
    with trainings(options) as (show_progress, train_seeds):
        need = searched(options, device, capture, (settings, last), show_progress, train_seeds)
    result = need.as_dict()
    size = write_fitted(with_pace(noted_model(need, capture)), need, options.out)
    print_report(need)
    say(f"{full(options.out)}: {size:,} bytes, {WRITTEN}")
    if options.json:
        print_json(result)
    return 0


def searched(
    options: Options, device: "Device", capture: "Capture",
    settings: "tuple[TrainSettings, TrainSettings | None]", report: "ReportProgress",
    train_seeds: "TrainSeeds | None" = None,
) -> "FitReport":  # fmt: skip
    """The smallest model of a capture, and how it was found.

    settings: of the largest, with the cameras' offset where one is known, and of the last run,
    None: without one.  train_seeds: who trains; None: this process.  Raises BadFile.
    """
    from shapeshift.training.calibration.extrinsics import with_extrinsics
    from shapeshift.training.fit.fit import Fit

    largest, last = settings
    if options.calibrate is not None:
        capture = with_extrinsics(capture, largest.rig)
    return Fit(
        device, capture, largest, options.tolerance_db, options.seeds, report, last=last,
        train_seeds=train_seeds,
    ).run()  # fmt: skip


def noted_model(need: "FitReport", capture: "Capture") -> "AnchorModel":
    """The fitted model of the first seed with the report in it, and the stops by formula."""
    from shapeshift.runtime_models.stops.formula_stop import with_placed_formulas

    model = need.fitted.models[0]
    report = {**model.provenance, "need": without_times(need.as_dict())}
    return with_placed_formulas(replace(model, provenance=report), capture.formulas)


def write_fitted(model: "AnchorModel", need: "FitReport", out: Path) -> int:
    """Its package, as small as the report found it may be; its bytes."""
    from shapeshift.runtime_models.package.write_package import write_package

    return write_package(model, out, need.fitted.storage)


@contextmanager
def trainings(options: Options) -> "Iterator[tuple[ReportProgress, TrainSeeds | None]]":
    """How progress is shown and who trains, as Fit takes them."""
    from shapeshift.app.cluster.open_cluster import open_cluster
    from shapeshift.app.progress import progress_bar
    from shapeshift.app.training.run_trials import Trials

    if options.cluster != NONE:  # whose tasks have a bar of their own
        with open_cluster(options.cluster, options.certificates, options.gpus) as cluster:
            yield lambda what, done: say(f"{what} ..."), Trials(cluster, options).train_seeds
        return
    with progress_bar() as bar:
        task = bar.add_task("compiling kernels", total=1.0)

        def show_progress(what: str, done: float) -> None:
            bar.update(task, description=what, completed=done)

        yield show_progress, None


def refuse_options(options: Options) -> None:
    """Raises UsageError for what cannot be done: now, not after the trials."""
    from shapeshift.app.cluster.open_cluster import check_cluster
    from shapeshift.app.errors import UsageError
    from shapeshift.app.training.run_trials import check_places

    if options.resume:
        raise UsageError("--resume goes on with one training; add --only, or leave it out.")
    if not options.seeds >= 1:
        raise UsageError(f"--seeds is {options.seeds}; it has to be at least 1.")
    if not 0 <= options.tolerance_db < float("inf"):
        raise UsageError(f"--tolerance-db is {options.tolerance_db}; it has to be at least 0.")
    check_cluster(options)
    if options.cluster != NONE:
        check_places(options)


def budget(iterations: int | None, seconds: float | None) -> Asked:
    """What was asked for of a trial's length; TRIAL where nothing was."""
    given = {"iterations": iterations, "seconds": seconds}
    return {n: value for n, value in given.items() if value is not None} or {"iterations": TRIAL}


def without_times(result: object) -> object:
    """The report but for what clocks say: a package is the same bytes for the same seed."""
    if isinstance(result, dict):
        kept = {key: value for key, value in result.items() if not key.endswith(CLOCKS)}
        return {key: without_times(value) for key, value in kept.items()}
    return [without_times(part) for part in result] if isinstance(result, list) else result


def print_report(need: "FitReport") -> None:
    """The need report on standard error."""
    from rich.table import Table

    wide = None if sys.stderr.isatty() else 160  # into a file, no row needs to be broken
    console, names = open_console(width=wide), list(need.photos)
    table = Table(
        "without", *(f"{n} dB" for n in names), "verdict", "bytes", "decode ms", "train s"
    )
    for verdict in need.decisions:
        table.add_row(verdict.part, *cells(verdict, names))
    console.print(table)
    console.print(
        f"Differences to the model before, ± one standard error over {need.seeds} seeds and "
        f"{', '.join(f'{count} {name}' for name, count in need.photos.items())} held-out photos.  "
        f"A part is dropped where the loss, to the largest model too, and its error stay within "
        f"{need.tolerance_db:g} dB in every modality."
    )
    for (a, b), iou in need.outlines.items():
        console.print(f"Outlines of {a} and {b}: {100 * iou:.1f} % in common")
    for word, found in (("largest", need.full), ("fitted", need.fitted)):
        console.print(f"{word}: {describe(found)}")


def cells(verdict: "Ablation", names: list[str]) -> list[str]:
    """The columns of one row of the report, all but the first."""
    needed = f" ({', '.join(verdict.needed_by)})" if verdict.needed_by and len(names) > 1 else ""
    saved = (f"{verdict.bytes:+,}", f"{verdict.decode_ms:+.2f}", f"{verdict.train_s:+.1f}")
    return [*(str(verdict.change[n]) for n in names), verdict.verdict + needed, *saved]


def describe(found: "Trial") -> str:
    facts = found.as_dict()
    quality = ", ".join(f"{name} {value:.2f} dB" for name, value in facts["psnr_db"].items())
    return (
        f"{quality}; {facts['anchors']:,} anchors of {facts['splats_per_anchor']} splats, "
        f"{facts['features']} features as {facts['storage']}, {facts['bytes']:,} bytes, "
        f"decoded in {facts['decode_ms']:.2f} ms, trained in {facts['train_s']:.1f} s"
    )
