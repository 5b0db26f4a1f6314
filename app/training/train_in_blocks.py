"""launch.py train --blocks: a coarse run of the whole, its cut, a task a block, one scene."""

import json
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from shapeshift.app.cluster.task import Task
from shapeshift.app.errors import UsageError, as_typed
from shapeshift.app.inspection.capture_facts import print_files
from shapeshift.app.opening import open_capture
from shapeshift.app.paths import full
from shapeshift.app.terminal import say
from shapeshift.app.training.train_options import LINES, Asked, Options
from shapeshift.runtime_models.program import program

if TYPE_CHECKING:
    from shapeshift.app.cluster.run_task import Shown
    from shapeshift.runtime_models.model import AnchorModel
    from shapeshift.scene.captures.capture import Capture
    from shapeshift.training.blocks.cut import Wanted
    from shapeshift.training.blocks.starts import CutBlock, CutList

ENDING = ".blocks"
OF_BLOCKS = ("iterations", "max_anchors", "max_mb")  # settings that a block may have of its own
COARSE, CUT, LINES_FILE = "coarse.shift", "cut", "settings.toml"  # in the folder of the work


def run_blocks(options: Options) -> int:
    """Raises UsageError, BadFile; a second start goes on where the first was ended."""
    found, model = train_blocks(options, say)
    say(*summary(options, found, model))
    return 0


def train_blocks(
    options: Options, hear: Callable[..., object], shown: "Shown | None" = None, said: str = "--",
    pace: bool = True,
) -> "tuple[CutList, AnchorModel]":  # fmt: skip
    """The cut and the scene, which is written.  Raises UsageError, BadFile.

    hear: told what a person should know; shown: instead of a bar; said: what stands before the
    name of an option where it is typed; pace: measure how evenly the slider moves.
    """
    from shapeshift.app.cluster.open_cluster import open_cluster
    from shapeshift.app.training.saving import check_writable, room_of
    from shapeshift.runtime_models.blocks.write_blocks import refuse_foreign_folder
    from shapeshift.training.blocks.starts import read_cut

    wanted = wanted_of(options.blocks, said)
    refuse_options(options, said)
    check_writable(options.out)
    refuse_foreign_folder(options.out)
    capture = open_capture(options.capture, options.memory, hear)
    if hear is say:  # the command, not the library
        print_files(capture.files)
    if wanted.count is None and wanted.grid is None:
        refuse_one(options, capture, said)
    work = work_folder(options.out)
    work.mkdir(parents=True, exist_ok=True)
    room_of(options.out, options.photo_mb)  # refused now, not after the run of the whole
    with open_cluster(options.cluster, options.certificates, options.gpus, shown) as cluster:
        cluster.run([coarse_task(options, work)])
        cluster.run([cut_task(options, work)])
        found = read_cut(work / CUT)
        hear(*describe_cut(found))
        cluster.run([block_task(options, work, n, row) for n, row in trained(found)])
    return found, join(work, found, options.out, pace)


def wanted_of(text: str, said: str = "--") -> "Wanted":
    from shapeshift.training.blocks.cut import Wanted

    try:
        return Wanted.of(text)
    except ValueError as error:
        raise UsageError(f"{said}{error}") from None


def refuse_options(options: Options, said: str) -> None:
    """Raises UsageError for what cannot go with --blocks."""
    from shapeshift.training.settings import TrainSettings, adjusted

    if options.out.suffix != ENDING:
        raise UsageError(
            f"{said}out is {options.out.name}; {said}blocks writes a folder, name it "
            f"{options.out.stem}{ENDING}."
        )
    if options.asked.get("seconds") is not None:
        raise UsageError(
            f"{said}seconds: blocks are counted in steps, so that an ended run goes on to the same "
            f"bits; give {said}iterations and {typed('coarse_iterations', said)}."
        )
    if options.asked.get("poses") == "refine":
        raise UsageError(
            f"{said}poses refine: blocks keep the poses that are stated; refine them in a run "
            f"without {said}blocks first."
        )
    if options.model == "splats" or options.separate:
        raise UsageError("--blocks: plain splats and --separate are trained as a whole; leave it.")
    for name in options.splats:
        raise UsageError(f"{name} is of plain splats; leave it out.")
    for name, value, least in (
        ("coarse_iterations", options.coarse_iterations, 1),
        ("block_photos", options.block_photos, 0),
    ):
        if value is not None and value < least:
            raise UsageError(f"{typed(name, said)} is {value}; it has to be at least {least}.")
    try:  # now, not in the tasks
        adjusted(TrainSettings(), options.asked)
    except ValueError as error:
        raise as_typed(error, TrainSettings, said=said) from None


def typed(name: str, said: str) -> str:
    """An option as it is given: on the command line, or in Python."""
    return said + (name.replace("_", "-") if said else name)


def refuse_one(options: Options, capture: "Capture", said: str) -> None:
    """Raises UsageError where --blocks auto would cut nothing: before the coarse run, not after."""
    from shapeshift.training.blocks.starts import expected_anchors

    count, most = len(expected_anchors(capture)), most_anchors(options)
    if count <= most:
        raise UsageError(
            f"{said}blocks auto: {count:,} anchors are expected, {most:,} fit into one block "
            f"({typed('max_anchors', said)}); leave out {said}blocks, or give a number."
        )


def most_anchors(options: Options) -> int:
    from shapeshift.training.settings import TrainSettings

    return options.asked.get("max_anchors", TrainSettings().max_anchors)


def work_folder(out: Path) -> Path:
    """Where the parts of the work lie: beside the scene, as a checkpoint does."""
    return out.absolute().with_name(out.name + ".work")


def words_of(asked: Asked) -> list[str]:
    """Settings as they are typed."""
    pairs = [(f"--{name.replace('_', '-')}", str(value)) for name, value in asked.items()]
    return [word for pair in pairs for word in pair]


def shared_words(options: Options) -> list[str]:
    device = ["--device", options.device] if options.device else []
    numbers = {"--memory": options.memory, "--photo-mb": options.photo_mb}
    given = [[name, str(value)] for name, value in numbers.items() if value is not None]
    return [*device, *(word for pair in given for word in pair)]


def capture_path(options: Options) -> str:
    return str(options.capture.absolute())


def task_of(name: str, argv: list[str], reads: list[str], writes: list[Path]) -> Task:
    """One that goes on from the checkpoint beside the package that it writes."""
    from shapeshift.training.checkpoint import checkpoint_path

    checkpoint = str(checkpoint_path(writes[0]))
    files = tuple(map(str, writes))
    return Task(
        name, tuple(argv), tuple(reads), files, slots_of(argv), checkpoint, ("--resume",)
    )  # fmt: skip


def slots_of(argv: Sequence[str]) -> dict[str, int]:
    """What a task holds: the GPU of its worker, where one is asked for."""
    return {"gpu": 1} if ("--device", "gpu") in pairwise(argv) else {}


def coarse_task(options: Options, work: Path) -> Task:
    """The whole capture in one run, as ever."""
    from shapeshift.runtime_models.files.whole_file import write_whole
    from shapeshift.training.checkpoint import checkpoint_path

    capture, out = capture_path(options), work / COARSE
    asked: Asked = {"max_anchors": most_anchors(options)} | options.asked  # as blocks have
    asked.pop("iterations", None)
    if options.coarse_iterations is not None:
        asked["iterations"] = options.coarse_iterations
    reads, points = [capture], str(asked.get("points", ""))
    if points and Path(points).is_file():
        points = str(Path(points).absolute())
        asked["points"] = points
        reads.append(points)
    calibrate = ["--calibrate", options.calibrate] if options.calibrate else []
    lines = "".join(f"{n} = {json.dumps(asked.pop(n))}\n" for n in LINES if n in asked)
    argv = ["train", capture, "--out", str(out), *words_of(asked), *calibrate]
    if lines:
        write_whole(work / LINES_FILE, lines.encode())
        argv += ["--settings", str(work / LINES_FILE)]
        reads.append(str(work / LINES_FILE))
    return task_of(
        "coarse run", [*argv, *shared_words(options)], reads, [out, checkpoint_path(out)]
    )


def cut_task(options: Options, work: Path) -> Task:
    from shapeshift.training.checkpoint import checkpoint_path

    capture, coarse, out = capture_path(options), str(work / COARSE), work / CUT
    argv = ["train", capture, "--out", str(out), "--cut", coarse, "--blocks", options.blocks]
    argv += ["--block-photos", str(options.block_photos)]
    argv += words_of({"max_anchors": most_anchors(options)})
    reads = [capture, coarse, str(checkpoint_path(work / COARSE))]
    words = [*argv, *shared_words(options)]
    return Task("cut", tuple(words), tuple(reads), (str(out),), slots_of(words))


def block_task(options: Options, work: Path, number: int, row: "CutBlock") -> Task:
    capture, out = capture_path(options), work / f"{number}.shift"
    start = str(work / CUT / row.start)
    own = {name: options.asked[name] for name in OF_BLOCKS if name in options.asked}
    argv = ["train", capture, "--out", str(out), "--block", start, *words_of(own)]
    return task_of(f"block {number}", [*argv, *shared_words(options)], [capture, start], [out])


def trained(found: "CutList") -> "list[tuple[int, CutBlock]]":
    return [(n, row) for n, row in enumerate(found.blocks) if row.start]


def describe_cut(found: "CutList") -> list[str]:
    """What a person should know of the cut, a line a block."""
    lines = [f"{len(found.blocks)} blocks, turned by {found.turn_degrees:g} degrees"]
    for number, row in enumerate(found.blocks):
        stays = f"; it stays as the coarse run left it: {row.why}" if row.coarse else ""
        lines.append(f"block {number}: {row.anchors:,} anchors, {row.photos} photos{stays}")
    return lines


def join(work: Path, found: "CutList", out: Path, pace: bool = True) -> "AnchorModel":
    """Writes the scene of all blocks; pace: with one that is measured on the whole."""
    from shapeshift.app.pace import with_pace
    from shapeshift.runtime_models.blocks.block_model import joined
    from shapeshift.runtime_models.blocks.read_blocks import BlockList, ListedBlock
    from shapeshift.runtime_models.blocks.write_blocks import write_blocks
    from shapeshift.runtime_models.package.read_package import read_package

    names = [f"{number}.shift" for number in range(len(found.blocks))]
    paths = [
        work / CUT / row.coarse if row.coarse else work / name
        for name, row in zip(names, found.blocks, strict=True)
    ]
    if found.far:
        names, paths = [*names, found.far], [*paths, work / CUT / found.far]
    models = [replace(read_package(path), pace=()) for path in paths]
    whole: AnchorModel = joined(models, names)
    if pace and len(whole.stops) > 1:
        whole = with_pace(whole)
    blocks = tuple(
        ListedBlock(name, row.box) for name, row in zip(names, found.blocks, strict=False)
    )
    listed = BlockList(found.turn_degrees, blocks, found.far or None, whole.stops)
    parts = {
        name: replace(model, pace=whole.pace) for name, model in zip(names, models, strict=True)
    }
    write_blocks(listed, parts, out)
    return whole


def summary(options: Options, found: "CutList", model: "AnchorModel") -> Sequence[str]:
    out, capture = shlex.quote(full(options.out)), shlex.quote(full(options.capture))
    rest = len(found.blocks) - len(trained(found))
    stay = f", {rest} as the coarse run left them" if rest else ""
    return (
        f"{full(options.out)}: {len(found.blocks)} blocks{stay}"
        f"{', and what is far' if found.far else ''}; {len(model.anchors):,} anchors",
        f"The parts lie in {full(work_folder(options.out))}: to train on; else delete it.",
        f"how good: {program()} eval {out} {capture}",
        f"look: {program()} {out}",
    )


# What a training in blocks has cost, and how its scene looks: what a run of the whole says.


@dataclass(frozen=True)
class TrainOutcome:
    """What a training has cost and reached: of one run, or of that of the whole and all blocks."""

    steps: int
    seconds: float
    start_seconds: float  # of these, before first steps
    anchors: int
    warnings: tuple[str, ...]
    psnr_db: dict[str, float]  # of held-out photos, by modality; {} where none is held out


def train_quietly(
    options: Options, pace: bool, progress: Callable[[str], object] | None
) -> tuple["AnchorModel", Path, TrainOutcome]:
    """The scene, where it is, and how its training went, without a word on the terminal.

    progress: hears what is under way.  Raises UsageError, BadFile, in the words of Python.
    """
    from shapeshift.app.cluster.run_task import board_of_words

    def hear(*lines: str) -> None:
        for line in lines:
            if progress is not None:
                progress(line)

    found, model = train_blocks(options, hear, board_of_words(hear), "", pace)
    return model, options.out, outcome_of(options, found, model)


def outcome_of(options: Options, found: "CutList", model: "AnchorModel") -> TrainOutcome:
    """Out of the files of the work, and of looks at the held-out photos."""
    from shapeshift.training.checkpoint import checkpoint_path, read_checkpoint

    work = work_folder(options.out)
    parts = [work / COARSE, *(work / f"{number}.shift" for number, _ in trained(found))]
    notes = [read_checkpoint(checkpoint_path(part))[1] for part in parts]
    start_s = sum(note["start_s"] for note in notes)
    stay = [line for line, row in zip(describe_cut(found)[1:], found.blocks, strict=True)
            if row.coarse]  # fmt: skip
    return TrainOutcome(
        sum(note["iteration"] for note in notes), sum(note["elapsed"] for note in notes) + start_s,
        start_s, len(model.anchors), tuple(stay), decibels_of(options, model),
    )  # fmt: skip


def decibels_of(options: Options, model: "AnchorModel") -> dict[str, float]:
    """Of every modality that has held-out photos, as `eval` scores them."""
    from shapeshift.app.training.evaluate import only, trained_downscale
    from shapeshift.rasterizer.device import open_device
    from shapeshift.training.calibration.extrinsics import rig_of, with_extrinsics
    from shapeshift.training.evaluation.evaluate import evaluate_model

    capture = open_capture(options.capture, options.memory, lambda *said: None)  # was said before
    capture = with_extrinsics(capture, rig_of(model.provenance))
    factor, device = trained_downscale(model.provenance), open_device(options.device)
    masks = options.asked.get("masks", "auto")
    found = {}
    for stop in capture.stops:
        if capture.of(stop.name, "test"):
            one = only(capture, stop.name)
            scores = evaluate_model(
                device, model, one, factor, masks, options.asked.get("background", "auto")
            )
            found[stop.name] = scores[stop.name].psnr_db
    return found
