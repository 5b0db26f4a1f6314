"""launch.py segment: a scene and label maps of its photos to a scene file of objects.

python3 launch.py segment room.shift capture --masks labels --out room.scene.json
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from shapeshift.app.command_line import EXPERT, POSITIONAL
from shapeshift.app.opening import ReadingOptions, open_capture, open_model
from shapeshift.app.paths import full
from shapeshift.app.terminal import open_console, print_json, say
from shapeshift.runtime_models.program import program

if TYPE_CHECKING:
    from shapeshift.decomposition.completion.plane import Plane
    from shapeshift.decomposition.label_photos import Counts, Progress
    from shapeshift.decomposition.masks.specs import ObjectSpecs
    from shapeshift.decomposition.partition import LabelledView
    from shapeshift.decomposition.score import LabelScore
    from shapeshift.decomposition.segment_scene import Segmented
    from shapeshift.rasterizer.device import Device
    from shapeshift.runtime_models.model import AnchorModel, Model, SplatLayers
    from shapeshift.scene.captures.capture import Capture

DECIMALS = 4  # of shares in a report


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Cut a scene into objects by label maps of its photos (0 background, 1 to 254 objects, 255
    says nothing): writes the labelled scene, and a scene file whose objects can be taken."""

    scene: Annotated[Path, POSITIONAL]
    """A package, or a file of splats."""
    capture: Annotated[Path, POSITIONAL]
    """The folder of posed photos that it was trained on."""
    out: Path
    """The scene file to write, NAME.scene.json; the labelled scene is written beside it."""
    masks: Path | None = None
    """A folder of label maps, 8-bit grey PNGs with the photos' names: rgb/012.png for rgb/012.jpg.
    Not every photo needs one; four that see all sides are enough.  Default: made from the prompts
    of --objects."""
    objects: Path | None = None
    """objects.json (docs/objects.md): names, masses and colliders of the labels, and prompts, which
    say where an object is in a photo.  Default: they are called object 1, object 2, ..."""
    segmenter: Path | None = None
    """A folder with ONNX files of SAM, MobileSAM, SAM 2 or SAM 3 (docs/objects.md).  Default: none,
    colours, heat and shape find compact things."""
    photos: Annotated[int, EXPERT] = 24
    """How many photos a segmenter is asked about, those of the prompts and others far apart."""
    score: Path | None = None
    """A folder of true label maps, named in the same way: says how well the cut scene shows them.
    Default: not scored."""
    report: Path | None = None
    """A folder for pictures of what was found.  Default: none are drawn."""
    complete: bool = True
    """Fill the background where objects stood, verified against the photos, and make what is
    touched of each object, cut at the plane that it stood on; into the folder NAME.colliders."""
    shadows: bool = False
    """With --complete: take out the shadows of objects, too, which no photo can confirm."""
    downscale: Annotated[int | None, EXPERT] = None
    """Divide the photos' sides by this number.  Default: as in the training, if the scene knows it,
    else such that neither exceeds 1024 pixels."""
    json: bool = False
    """JSON on standard output instead of a table."""
    overwrite: bool = False
    """Replace what an earlier run wrote; never what is read."""


def run(options: Options) -> int:
    from shapeshift.app.decomposition.segment_steps import note_of, write_report
    from shapeshift.app.progress import working
    from shapeshift.decomposition.masks.specs import read_specs
    from shapeshift.decomposition.segment_scene import scores_of
    from shapeshift.rasterizer.device import open_device

    refuse_inputs(options)
    refuse_outputs(options)
    model, device = open_labelled(options), open_device()
    capture = straight_capture(options, model)
    with working("reading label maps"):
        true = read_maps(options, options.score, capture, model) if options.score else []
    specs = read_specs(options.objects) if options.objects else None
    with bar() as progress:
        found, counts = cut(options, specs, model, capture, device, progress, say)
    with working("scoring"):
        scores = scores_of(device, found, true) if true else ()
    if options.json:
        print_json(facts_of(found, scores, options, counts))
    else:
        print_counts(found, counts)
        print_tables(found, scores)
    tell_gaps(found)
    if options.report is not None:
        write_report(device, found, options.report, options.overwrite)
        say(f"pictures in {full(options.report)}")
    note_of(options.out).unlink(missing_ok=True)
    path = model_path(options, model)
    say(
        f"{full(options.out)} and {path.name} beside it; next: {program()} view {full(options.out)}"
    )
    return 0


def cut(
    options: Options,
    specs: "ObjectSpecs | None",
    model: "AnchorModel | SplatLayers",
    capture: "Capture",
    device: "Device",
    progress: "Progress",
    notice: Callable[[str], None],
) -> "tuple[Segmented, dict[int, Counts]]":
    """Writes the labelled model and the scene file; what was found, and what became of each label
    in the photos where a segmenter was asked.  Raises BadFile, UsageError.
    """
    from shapeshift.app.decomposition import segment_steps as steps
    from shapeshift.app.errors import UsageError
    from shapeshift.decomposition.judge import judged
    from shapeshift.decomposition.segment_scene import named_objects, scene_of_parts, segment
    from shapeshift.decomposition.upright_scene import planes_under, scale_sentence, upright_scene
    from shapeshift.scene.document.write_scene_file import write_scene_file

    counts: dict[int, Counts] = {}
    if options.masks is not None:
        pictures = read_maps(options, options.masks, capture, model)
        objects = named_objects(pictures, specs.objects if specs else ())
        found = segment(
            device, model, pictures, objects, len(capture.photos),
            lambda done, count: progress("evidence of photos", done, count),
        )  # fmt: skip
    else:
        assert specs is not None, "refused before"
        settings = steps.PromptSettings(
            options.out, options.segmenter, options.photos, progress, notice
        )
        found, counts = steps.find_by_prompts(device, model, capture, specs, settings)
    if not any(part.rows for part in found.parts):
        raise UsageError("no object got any part of the scene; look at the label maps.")
    progress("asking other photos", 0, 1)
    found = judged(device, found, capture)
    device.pool.free_held()  # what large photos were drawn in
    path = model_path(options, model)
    file = scene_of_parts(found, path.name, options.out.parent)
    planes: dict[int, Plane] = {}
    where = options.out, options.downscale, options.shadows
    how = steps.CompletionSettings(*where, progress, notice)
    if options.complete:
        file, found, planes = steps.completed(device, file, found, capture, how)
    planes = planes or planes_under(found.model, found.parts)
    file, told = upright_scene(file, found, capture.ups, planes)
    for sentence in (*told, scale_sentence(found, capture.metres)):
        notice(sentence)
    steps.begin_writing(options.out)
    write_model(found.model, path)
    if options.complete:
        file, found = steps.at_rest(file, found, how)
    write_scene_file(file, options.out)
    return found, counts


def straight_capture(
    options: Options, model: "AnchorModel | SplatLayers", hear: Callable[..., object] = say
) -> "Capture":
    """The capture, its cameras where the training found them.  Raises BadFile."""
    from shapeshift.training.calibration.extrinsics import rig_of, with_extrinsics

    return with_extrinsics(
        open_capture(options.capture, options.memory or None, hear), rig_of(model.provenance)
    )


def read_maps(
    options: Options, folder: Path, capture: "Capture", model: "AnchorModel | SplatLayers"
) -> "list[LabelledView]":
    """The label maps of a folder.  Raises BadFile."""
    from shapeshift.app.training.evaluate import trained_downscale
    from shapeshift.decomposition.segment_scene import read_pictures

    factor = options.downscale or trained_downscale(model.provenance)
    return read_pictures(folder, capture, model, factor)


@contextmanager
def bar() -> "Iterator[Progress]":
    """A bar, or a line a minute without a terminal."""
    from shapeshift.app.progress import progress_bar

    with progress_bar() as shown:
        task = shown.add_task("photos", total=None)
        yield lambda what, done, of: shown.update(task, description=what, completed=done, total=of)


def refuse_inputs(options: Options) -> None:
    """What cannot be meant, before any work.  Raises UsageError."""
    from shapeshift.app.errors import UsageError

    if options.masks is None and options.objects is None:
        raise UsageError(
            "give --objects objects.json with a prompt an object, or --masks FOLDER with label "
            "maps; docs/objects.md says how to make them."
        )
    if options.masks is not None and options.segmenter is not None:
        raise UsageError("--masks has the label maps already; leave out --segmenter.")
    if options.downscale is not None and not 1 <= options.downscale <= 64:
        raise UsageError(f"--downscale is {options.downscale}, expected 1 to 64.")
    if not options.photos >= 1:
        raise UsageError(f"--photos is {options.photos}; give 1 or more.")


def refuse_outputs(options: Options) -> None:
    """Before any work; what a run that was killed has left may be replaced.  Raises UsageError."""
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.document.scene_file import ENDING, is_scene_file

    if options.downscale is not None and not 1 <= options.downscale <= 64:
        raise UsageError(f"--downscale is {options.downscale}, expected 1 to 64.")
    if is_scene_file(options.scene):
        raise UsageError(f"{options.scene} is a scene file; name the one model that is to be cut.")
    if not options.out.name.lower().endswith(ENDING) or options.out.name.lower() == ENDING:
        raise UsageError(f"--out is {options.out.name}; name a file that ends in {ENDING}.")
    stem = options.out.name[: -len(ENDING)]
    written = [options.out, *(options.out.with_name(stem + end) for end in (".shift", ".ply"))]
    if options.complete:
        written.append(options.out.with_name(stem + ".colliders"))
    read = {options.scene.resolve(), options.capture.resolve()}
    replaced = options.overwrite or options.out.with_name(stem + ".unfinished").is_file()
    for path in written:
        if path.resolve() in read:
            raise UsageError(f"{path} is read in this run; choose another --out.")
        if path.exists() and not replaced:
            raise UsageError(f"{path} exists; choose another --out or add --overwrite.")
    folder = options.report
    if folder is not None and folder.exists() and not folder.is_dir():
        raise UsageError(f"--report is {folder}, which is a file; name a folder.")
    if folder is not None and folder.is_dir() and any(folder.iterdir()) and not replaced:
        raise UsageError(f"{folder} holds files; choose another --report or add --overwrite.")
    if options.segmenter is not None:
        maps = options.out.with_name(stem + ".masks")
        if maps.exists() and not (replaced and maps.is_dir()):
            raise UsageError(f"{maps} exists; choose another --out or add --overwrite.")


def open_labelled(options: Options) -> "AnchorModel | SplatLayers":
    """The model, of a kind that can have labels.  Raises BadFile, UsageError."""
    return labelled(open_model(options.scene, options), str(options.scene))


def labelled(model: "Model", where: str) -> "AnchorModel | SplatLayers":
    """The model, if it is of a kind that can have labels.  Raises UsageError."""
    from shapeshift.app.errors import UsageError
    from shapeshift.runtime_models.model import AnchorModel, SplatLayers

    if not isinstance(model, AnchorModel | SplatLayers):
        raise UsageError(
            f"{where} is a Scaffold-GS model, whose splats depend on the eye; export it as "
            ".ply first, and segment that."
        )
    if isinstance(model, SplatLayers) and len(model.stops) > 1:
        raise UsageError(
            f"{where} has {len(model.stops)} layers of plain splats; a labelled scene is a "
            "package, or splats of one file: segment one layer."
        )
    return model


def model_path(options: Options, model: "AnchorModel | SplatLayers") -> Path:
    """The labelled scene, beside the scene file."""
    from shapeshift.runtime_models.model import AnchorModel
    from shapeshift.scene.document.scene_file import ENDING

    ending = ".shift" if isinstance(model, AnchorModel) else ".ply"
    return options.out.with_name(options.out.name[: -len(ENDING)] + ending)


def write_model(model: "AnchorModel | SplatLayers", path: Path) -> None:
    """A package with the features as they were filed, or a PLY with a column of labels."""
    import numpy as np

    from shapeshift.runtime_models.model import AnchorModel
    from shapeshift.runtime_models.package.write_package import write_package
    from shapeshift.runtime_models.splats.plain_splats import PlainSplats
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply

    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(model, AnchorModel):
        features = model.features
        halves = np.array_equal(features.astype(np.float16), features)
        write_package(model, path, "float16" if halves else "float32")
        return
    arrays = (model.means, model.scales, model.wxyz, model.opacity, model.sh)
    write_ply(
        PlainSplats(*arrays, model.origin, model.antialiased, model.labels, model.extra), path
    )


def facts_of(
    found: "Segmented",
    scores: "Sequence[LabelScore]",
    options: Options,
    counts: "dict[int, Counts]",
) -> dict:
    """The tables as JSON has them."""
    from math import isfinite

    from shapeshift.decomposition.score import mean_score

    rows: dict[str, dict] = {
        part.spec.name: {
            "label": part.spec.label,
            "photos": part.photos,
            "rows": part.rows,
            "pixels": round(part.pixels, 1),
            "agreement": round(judged.agreement, DECIMALS) if isfinite(judged.agreement) else None,
            "doubt": judged.doubt,
            **(vars(counts[part.spec.label]) if counts else {}),
        }
        for part, judged in zip(found.parts, found.judged, strict=True)
    }
    for rest in found.rests:
        rows[rest.name]["rest"] = rest.row()
    for score in scores:
        figures = {"iou": score.iou, "boundary_iou": score.boundary_iou, "accuracy": score.accuracy}
        rows[score.object.name] |= {
            name: round(value, DECIMALS) if isfinite(value) else None
            for name, value in figures.items()
        }
    facts: dict = {"scene": full(options.out), "photos": len(found.pictures), "objects": rows}
    if scores:
        facts["miou"] = round(mean_score(scores), DECIMALS)
    return facts


def print_counts(found: "Segmented", counts: "dict[int, Counts]") -> None:
    """What became of each object in the photos that a segmenter was asked about."""
    from rich.table import Table

    if not counts:
        return
    table = Table("object", "photos given", "accepted", "rejected", "unknown")
    for part in found.parts:
        here = counts[part.spec.label]
        cells = (here.given, here.accepted, here.rejected, here.unknown)
        table.add_row(part.spec.name, *map(str, cells))
    open_console(stderr=False).print(table)


def print_tables(found: "Segmented", scores: "Sequence[LabelScore]") -> None:
    from rich.table import Table

    from shapeshift.decomposition.score import mean_score
    from shapeshift.runtime_models.model import AnchorModel

    rows = "anchors" if isinstance(found.model, AnchorModel) else "splats"
    rests = {rest.name: rest.word for rest in found.rests}
    table = Table("label", "object", "photos", rows, "pixels", "agrees", *["rests"] * bool(rests),
                  "doubt")  # fmt: skip
    for part, judged in zip(found.parts, found.judged, strict=True):
        table.add_row(
            str(part.spec.label), part.spec.name, f"{part.photos:,}", f"{part.rows:,}",
            f"{part.pixels:,.0f}", percent(judged.agreement) + " %" * (judged.agreement > 0),
            *[rests.get(part.spec.name, "")] * bool(rests), judged.doubt,
        )  # fmt: skip
    console = open_console(stderr=False)
    console.print(table)
    if not scores:
        return
    table = Table("object", "IoU %", "boundary IoU %", "accuracy %", "photos")
    for score in scores:
        figures = (score.iou, score.boundary_iou, score.accuracy)
        table.add_row(score.object.name, *map(percent, figures), f"{score.views}")
    means = [mean_score(scores, name) for name in ("iou", "boundary_iou", "accuracy")]
    table.add_row("mean", *map(percent, means), "", style="bold")
    console.print(table)


def percent(share: float) -> str:
    return f"{100 * share:.1f}" if share == share else ""


def tell_gaps(found: "Segmented") -> None:
    """What a person should know of it."""
    if found.silent:
        said = "photo has no label map and says" if found.silent == 1 else (
            "photos have no label maps and say"
        )  # fmt: skip
        say(f"{found.silent} {said} nothing.")
    empty = [part.spec.name for part in found.parts if not part.rows]
    if empty:
        why = "no label map shows it" if len(empty) == 1 else "no label map shows them"
        unseen = [part.spec.name for part in found.parts if not part.photos]
        if unseen != empty:
            why = "most of what it covers belongs to others" if len(empty) == 1 else (
                "no label map shows them, or most of what they cover belongs to others"
            )  # fmt: skip
        say(f"Left out, for {why}: {', '.join(empty)}.")
