"""launch.py table: one shape-shifting model compared with separate models and plain splats."""

import os
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.cluster.open_cluster import NONE, ClusterOptions
from shapeshift.app.command_line import EXPERT, MODALITY, POSITIONAL, FieldsOf, Opt
from shapeshift.app.opening import open_capture
from shapeshift.app.paths import full
from shapeshift.app.terminal import say
from shapeshift.app.training.run_loop import INTERRUPTED
from shapeshift.app.training.table_parts import MEAN, NAMES, TableRow, VggRow, finish, mean_row
from shapeshift.app.training.train_options import (
    OF_SPLATS,
    SETTINGS,
    Asked,
    MachineOptions,
    with_settings,
)
from shapeshift.app.training.train_options import Options as TrainOptions
from shapeshift.runtime_models.program import portable_program
from shapeshift.training.baselines.plain_settings import PlainSettings
from shapeshift.training.settings import LEFT, TrainSettings

if TYPE_CHECKING:
    from shapeshift.app.training.train_baselines import TrainedFile
    from shapeshift.scene.captures.capture import Capture
    from shapeshift.training.evaluation.vgg_distance import VggDistance

NO_VGG = "no VGG distance: --vgg names no file"
PLACES = {
    "joint": "joint.shift", "separate": "separate", "splats": "splats", "spz": "spz",
}  # in --out  # fmt: skip


Method = Literal["joint", "separate", "splats", "spz"]
METHODS: tuple[Method, ...] = ("joint", "separate", "splats", "spz")
USUAL = ("max_anchors", "downscale", "masks", "background")  # as of train


@dataclass(frozen=True)
class Options(ClusterOptions, MachineOptions):
    """Train a capture in three ways with the same budget and compare them on held-out photos.

    The form is that of the paper's Tables 1 and 2: method by modality.
    """

    capture: Annotated[Path, POSITIONAL]
    """A folder of posed photos; each modality needs held-out ones."""
    out: Path
    """A folder for the models, table.csv and table.md.  A method that is in it is not run again."""
    asked: Annotated[Asked, FieldsOf(TrainSettings, USUAL, ("seed",), left=LEFT)] = field(
        default_factory=dict
    )
    splats: Annotated[Asked, FieldsOf(PlainSettings, lines=OF_SPLATS)] = field(default_factory=dict)
    settings: Annotated[Path | None, SETTINGS] = None
    """A TOML file with a setting a line, as of train.  Default: none."""
    seconds: float | None = None
    """Budget of every method; its models share it.  Default: none, give this or --iterations."""
    iterations: int | None = None
    """The same in steps, with the same bits on every run.  Default: none."""
    methods: tuple[Method, ...] = METHODS
    """joint: one shape-shifting model.  separate: one anchor model a modality.  splats: plain 3DGS
    splats, one set a modality, as PLY.  spz: those splats packed, without training again."""
    vgg: Annotated[Path | None, EXPERT] = None
    """An ONNX file of VGG16's first layers: adds a distance of its features, which is no LPIPS.
    Default: not measured."""
    calibrate: Annotated[str | None, MODALITY] = None
    """A modality whose cameras' offset is found first, for all methods alike, as of train.
    Default: none."""
    only: Annotated[str, Opt(expert=True, metavar="PART")] = ""
    """Train this model alone, such as joint or splats:RGB: the parts of a comparison may be trained
    by several machines into one folder.  Default: all."""
    resume: Annotated[bool, EXPERT] = False
    """With --only: go on where an earlier attempt at it was interrupted."""


def run(options: Options) -> int:
    from shapeshift.app.charts.chart_rows import RowsFile
    from shapeshift.app.cluster.open_cluster import check_cluster
    from shapeshift.app.errors import UsageError
    from shapeshift.app.training.table_parts import train_by_cluster, train_here
    from shapeshift.rasterizer.device import open_device
    from shapeshift.training.calibration.extrinsics import with_extrinsics
    from shapeshift.training.evaluation.vgg_distance import VggDistance

    options = with_settings(options)
    if options.seconds is None and options.iterations is None:
        raise UsageError("a comparison needs a budget: give --seconds or --iterations.")
    if not options.methods:
        raise UsageError("--methods names none; leave it out for all.")
    if "spz" in options.methods and "splats" not in options.methods:
        raise UsageError("--methods spz packs the files of splats; add splats before it.")
    if options.out.exists() and not options.out.is_dir():
        raise UsageError(f"{options.out} is a file; --out is a folder.")
    if options.resume and not options.only:
        raise UsageError("--resume goes on with one model; add --only, or leave it out.")
    check_cluster(options)
    check_settings(options)
    capture, device = open_capture(options.capture, options.memory), open_device(options.device)
    distance = None if options.vgg is None else VggDistance(options.vgg)
    check_capture(capture, options, distance)
    options.out.mkdir(parents=True, exist_ok=True)
    if options.only:
        return run_part(device, capture, options)
    head = [command_line(options), machine_line(device), capture_line(capture, options, distance)]
    table = RowsFile(options.out / "table.csv", VggRow if distance else TableRow, head)
    say(head[1])
    rig = offset_of(device, capture, options)
    capture = with_extrinsics(capture, rig)
    methods = sorted(set(options.methods), key=list(PLACES).index)
    done = {row.method for row in table.rows if row.modality == MEAN}
    by_cluster = {}
    if options.cluster != NONE:
        lacking = [method for method in methods if method not in done and method != "spz"]
        by_cluster = train_by_cluster(capture, options, lacking)
    for method in methods:
        if method in done:
            say(f"{NAMES[method]}: already in {full(table.path)}")
            continue
        runs: dict[str, TrainedFile] | None
        if method in by_cluster:
            runs = by_cluster[method]
        elif method == "spz":
            say(f"{NAMES[method]}:")
            runs = pack_splats(capture, options.out, table.rows)
        else:
            say(f"{NAMES[method]}:")
            runs = train_here(method, device, capture, options, train_options(method, options), rig)
        if runs is None:
            say(f"{options.out}: interrupted; the same command goes on.")
            return INTERRUPTED
        for row in rows_of(method, device, capture, options, runs, distance):
            table.add(row)
    finish(table.rows, options.out, head)
    say(f"written to {full(options.out)}: table.csv, table.md and the models")
    return 0


def check_settings(options: Options) -> None:
    """Raises UsageError for numbers that no training can have, before anything is read."""
    from shapeshift.app.training.train_baselines import plain_settings
    from shapeshift.app.training.train_options import settings_of

    settings_of(train_options("joint", options).asked)
    plain_settings(train_options("splats", options))


def run_part(device, capture: "Capture", options: Options) -> int:
    """--only: the bytes that its model has in the whole comparison, without a row."""
    from shapeshift.app.training.table_parts import chosen_part, train_part
    from shapeshift.training.calibration.extrinsics import with_extrinsics

    part = chosen_part(capture, options)
    rig = offset_of(device, capture, options)
    asked, moved = train_options(part.method, options), with_extrinsics(capture, rig)
    if train_part(part, device, moved, asked, rig, options.resume):
        say(f"{full(part.file)}: done")
        return 0
    say(f"{full(part.file)}: interrupted, --resume goes on")
    return INTERRUPTED


def check_capture(capture: "Capture", options: Options, distance: "VggDistance | None") -> None:
    """What would come to light after the training, now.  Raises BadFile."""
    from shapeshift.runtime_models.model import BadFile
    from shapeshift.training.evaluation.vgg_distance import check_size
    from shapeshift.training.photos import choose_downscale

    factor = options.asked.get("downscale") or choose_downscale(capture.photos)
    for stop in capture.stops:
        held_out = capture.of(stop.name, "test")
        if not held_out:
            raise BadFile(
                f"{capture.folder}: no photo of modality '{stop.name}' is held out for testing; "
                "mark some with split 'test'."
            )
        if distance is not None:
            for photo in held_out:
                check_size(*photo.view.divided(factor).size)


def offset_of(device, capture: "Capture", options: Options) -> str:
    """TrainSettings.rig of what --calibrate finds, once for all methods: it is kept in --out."""
    from shapeshift.app.charts.chart_rows import write_text
    from shapeshift.app.training.run_loop import calibrated
    from shapeshift.app.training.train_options import settings_of

    if options.calibrate is None:
        return ""
    kept = options.out / "rig.json"
    if not kept.exists():
        settings = settings_of(train_options("joint", options).asked)
        write_text(kept, calibrated(device, capture, settings, options.calibrate).rig)
    return kept.read_text(encoding="utf-8")


def pack_splats(capture: "Capture", out: Path, rows: list[TableRow]) -> "dict[str, TrainedFile]":
    """Each modality: the files of `splats` as spz, trained when those were."""
    from shapeshift.app.errors import UsageError
    from shapeshift.app.training.train_baselines import TrainedFile
    from shapeshift.runtime_models.splats.formats import read_plain
    from shapeshift.runtime_models.splats.layers.layer_list import (
        layer_name,
        write_layer_list,
    )
    from shapeshift.runtime_models.splats.plain_splats import Reading
    from shapeshift.runtime_models.splats.spz.write_spz import write_spz

    layers, runs, reading = [], {}, Reading(allow_huge=True)
    for number, stop in enumerate(capture.stops):
        source = out / PLACES["splats"] / layer_name(number, stop)
        layers.append((stop, read_plain(source, reading)))
        made = next(r for r in rows if (r.method, r.modality) == ("splats", stop.name))
        file = out / PLACES["spz"] / layer_name(number, stop, ".spz")
        runs[stop.name] = TrainedFile(file, made.seconds, made.steps, made.start_s)
    try:
        write_layer_list(layers, out / PLACES["spz"], write_spz, ".spz")
    except ValueError as error:  # places that spz cannot hold
        raise UsageError(f"{error}  Leave spz out of --methods.") from None
    return runs


def train_options(method: str, options: Options) -> TrainOptions:
    """What `launch.py train` would be asked for, without --calibrate: its offset is found once."""
    budget = {"seconds": options.seconds, "iterations": options.iterations}
    asked = {name: value for name, value in budget.items() if value is not None} | options.asked
    of_splats = method == "splats"
    if of_splats:
        asked.pop("max_anchors", None)
    return TrainOptions(
        options.capture, options.out, asked, options.splats if of_splats else {},
        model="splats" if of_splats else "anchors", separate=method == "separate",
        device=options.device, memory=options.memory,
    )  # fmt: skip


def rows_of(
    method: str, device, capture: "Capture", options: Options, runs: dict, distance
) -> list[TableRow]:
    """The rows of a method: its files, read back from disk, on the held-out photos."""
    from shapeshift.runtime_models.read_scene import read_model
    from shapeshift.runtime_models.splats.plain_splats import Reading
    from shapeshift.training.baselines.plain import one_modality
    from shapeshift.training.evaluation.evaluate import bytes_on_disk, evaluate_model
    from shapeshift.training.photos import choose_downscale

    factor = options.asked.get("downscale") or choose_downscale(capture.photos)
    kind, reading, rows = VggRow if distance else TableRow, Reading(allow_huge=True), []
    whole = read_model(options.out / PLACES[method], reading) if method != "separate" else None
    for stop in capture.stops:
        part, made = one_modality(capture, stop.name), runs[stop.name]
        score = evaluate_model(
            device, whole or read_model(made.file, reading), part, factor,
            options.asked.get("masks", "auto"), options.asked.get("background", "auto"), distance,
        )[stop.name]  # fmt: skip
        rows.append(kind(
            method, stop.name, round(score.psnr_db, 3), round(score.median_db, 3),
            round(score.ssim, 5),
            bytes_on_disk(made.file) / 1e6, round(made.seconds, 1), round(made.start_s, 1),
            made.steps, score.alive, score.photos,
            *([] if score.vgg is None else [round(score.vgg, 5)]),
        ))  # fmt: skip
    return [*rows, mean_row(rows, list({run.file: run for run in runs.values()}.values()))]


def command_line(options: Options) -> str:
    """The command without folders: what else is asked for stands in it, methods aside."""
    words = [portable_program(), "table", options.capture.resolve().name]
    named = {each.name: getattr(options, each.name) for each in fields(options)}
    places = ("cluster", "certificates", "gpus", "only", "resume")
    for unnamed in ("capture", "out", "methods", "asked", "splats", "settings", *places):
        del named[unnamed]
    for name, value in (named | options.asked).items():
        if value is not None:
            shown = value.name if isinstance(value, Path) else value
            words.append(f"--{name.replace('_', '-')} {shown}")
    if lines := ", ".join(f"{name} = {value}" for name, value in options.splats.items()):
        words.append(f"--settings FILE ({lines})")
    return " ".join([*words, "--out DIR"])


def machine_line(device) -> str:
    from shapeshift.app.measure import processor

    return f"{processor()}, {os.cpu_count()} cores; {device.platform}: {device.name}"


def capture_line(capture: "Capture", options: Options, distance: "VggDistance | None") -> str:
    from shapeshift.training.photos import choose_downscale

    factor = options.asked.get("downscale") or choose_downscale(capture.photos)
    each = []
    for stop in capture.stops:
        train, test = (capture.of(stop.name, split) for split in ("train", "test"))
        width, height = test[0].view.size
        each.append(f"{stop.name} {len(train)} + {len(test)} photos of {width}x{height}")
    vgg = NO_VGG if distance is None else f"VGG distance by {distance.name}"
    return f"{'; '.join(each)}; sides divided by {factor}; {vgg}"
