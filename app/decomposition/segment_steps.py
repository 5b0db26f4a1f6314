"""The end of launch.py segment: what is touched of every object, and what stood behind it."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.decomposition.show_views import show_objects
from shapeshift.app.drawing import make_folder, open_renderer, save_png
from shapeshift.app.paths import file_name, full
from shapeshift.app.progress import tracked
from shapeshift.decomposition.label_pictures import LabelPictures
from shapeshift.decomposition.masks.label_maps import SILENT
from shapeshift.decomposition.partition import LabelledView
from shapeshift.decomposition.segment_scene import Segmented
from shapeshift.rasterizer.device import Device
from shapeshift.scene.cameras.framing import default_background
from shapeshift.scene.four_views import FOUR_VIEWS, color_of
from shapeshift.scene.scene import Scene, SceneObject

if TYPE_CHECKING:
    from shapeshift.decomposition.assemble import Assembled
    from shapeshift.decomposition.completion.plane import Plane
    from shapeshift.decomposition.label_photos import Counts, Progress
    from shapeshift.decomposition.masks.specs import ObjectSpecs
    from shapeshift.decomposition.shown import ShownAnchors
    from shapeshift.runtime_models.model import AnchorModel, SplatLayers
    from shapeshift.scene.captures.capture import Capture
    from shapeshift.scene.document.scene_file import SceneFile

COLLIDERS = ".colliders"  # a folder, after the scene file's name without its ending


@dataclass(frozen=True)
class CompletionSettings:
    """Where to, and what may be done."""

    out: Path  # NAME.scene.json
    downscale: int | None  # of the photos; None: as in the training
    shadows: bool
    progress: "Progress"
    notice: Callable[[str], None]  # takes sentences


def completed(
    device: "Device",
    file: "SceneFile",
    found: "Segmented",
    capture: "Capture",
    settings: CompletionSettings,
) -> "tuple[SceneFile, Segmented, dict[int, Plane]]":
    """With a completed background and colliders in files, and what each label stands on; of plain
    splats the same file, and no planes.

    Raises BadFile.
    """
    from shapeshift.app.training.evaluate import trained_downscale
    from shapeshift.decomposition.assemble import assemble
    from shapeshift.decomposition.photo_views import photo_views, row_evidence, sights_of
    from shapeshift.runtime_models.model import AnchorModel
    from shapeshift.scene.colliders.collider import Making
    from shapeshift.scene.document.scene_file import HULLS

    if not isinstance(found.model, AnchorModel):
        settings.notice(
            "Nothing is completed: plain splats have no features that copies could keep."
        )
        return file, found, {}
    wanted = {p.spec.label: None for p in found.parts if p.rows and p.spec.collider == HULLS}
    factor = settings.downscale or trained_downscale(found.model.provenance)
    views = photo_views(device, found, capture, factor)
    made = assemble(
        device, found.model, views, row_evidence(device, found.model, views), wanted,
        shadows=settings.shadows,
        background=default_background(found.model, capture.background or (0.0, 0.0, 0.0)),
        making=Making(progress=lambda what, part: settings.progress(what, int(100 * part), 100)),
        sights=sights_of(capture, found.model.stops),
    )  # fmt: skip
    names = {part.spec.label: part.spec.name for part in found.parts}
    for sentence in sentences_of(made, names):
        settings.notice(sentence)
    file = write_colliders(file, found, made, settings.out)
    return file, replace(found, model=made.model), made.planes


def colliders_folder(out: Path) -> Path:
    """Beside the scene file, named as it."""
    from shapeshift.scene.document.scene_file import ENDING

    return out.with_name(out.name[: -len(ENDING)] + COLLIDERS)


def collider_paths(names: Sequence[str], out: Path) -> dict[str, Path]:
    """Where the collider of each object is written, and that of the background."""
    from shapeshift.app.paths import file_name

    found: dict[str, Path] = {}
    folder = colliders_folder(out)
    for number, name in enumerate(names):
        path = folder / f"{file_name(name)}.glb"
        taken = path in found.values()
        found[name] = path.with_stem(f"{path.stem}-{number}") if taken else path
    return found


def write_colliders(
    file: "SceneFile", found: "Segmented", made: "Assembled", out: Path
) -> "SceneFile":
    """Writes proxies and ground beside the scene file; the file that names them."""
    from shapeshift.runtime_models.files.whole_file import make_folders
    from shapeshift.scene.colliders.collider_pieces import write_collider
    from shapeshift.scene.document.scene_file import BACKGROUND

    specs = [part.spec for part in found.parts if part.spec.label in made.proxies]
    proxies = {spec.name: made.proxies[spec.label] for spec in specs}
    paths = collider_paths([BACKGROUND, *proxies], out)
    begin_writing(out)
    make_folders(out.parent, colliders_folder(out).name)
    for name, proxy in proxies.items():
        write_collider(proxy.collider.parts, proxy.collider.mesh, paths[name])
    write_collider((), made.ground, paths[BACKGROUND])
    relative = {name: path.relative_to(out.parent).as_posix() for name, path in paths.items()}
    items = tuple(
        replace(item, collider=relative[item.name]) if item.name in relative else item
        for item in file.items
    )
    background = file.background and replace(file.background, collider=relative[BACKGROUND])
    return replace(file, items=items, background=background)


def at_rest(
    file: "SceneFile", found: "Segmented", settings: CompletionSettings
) -> "tuple[SceneFile, Segmented]":
    """The scene with every object on what carries it, and what a test of some seconds says of it.

    The labelled model has been written beside the file.  Of pairs that begin too far inside each
    other it is said that nothing moves them.  Raises BadFile.
    """
    from shapeshift.runtime_models.model import AnchorModel, BadFile
    from shapeshift.runtime_models.shapes import four, three
    from shapeshift.scene.colliders.collider_files import colliders_of
    from shapeshift.scene.document.scene_file import read_models
    from shapeshift.scene.world.rigid_object import same_pose
    from shapeshift.scene.world.settle import begin, settle
    from shapeshift.scene.world.world import World

    if not isinstance(found.model, AnchorModel):  # nothing was made for it to be touched
        return file, found
    settings.progress("seeing whether it rests", 0, 1)
    placed, models = read_models(file)
    world = World(placed, models, colliders_of(placed, models))
    starts = {name: obj.pose for name, obj in world.objects.items()}
    try:
        begin(world)
    except BadFile as why:
        settings.notice(str(why))
        return file, found
    for finding in world.findings:
        settings.notice(f"{finding.what}: {finding.done}.")
    rests = {rest.name: rest for rest in settle(world)}
    for rest in rests.values():
        if why := rest.sentence():
            settings.notice(f"{why}.")

    items = []
    for item in file.items:
        rest = rests.get(item.name)
        if rest is not None:
            item = replace(item, floats=rest.kept)
            if not same_pose(rest.pose, starts[item.name]):
                at, turn = three(rest.pose.position), four(rest.pose.wxyz)
                item = replace(item, position=at, wxyz=turn, placed=True)
        items.append(item)
    return replace(file, items=tuple(items)), replace(found, rests=tuple(rests.values()))


def sentences_of(made: "Assembled", names: dict[int, str]) -> Iterator[str]:
    """What became of each object."""
    for label, proxy in made.proxies.items():
        score, count = proxy.score, len(proxy.collider.parts)
        pieces = f"{count} piece{'s' * (count > 1)}"
        covers = f", IoU {score.iou:.2f} in {score.views} photos" if score.views else ""
        yield f"{names[label]}: touched as {proxy.name} of {pieces}{covers}."
    for label, why in made.failed.items():
        yield f"{names[label]}: touched by all of its splats: {why}"
    for one in made.completions:
        yield f"{names[one.label]}: {one.sentence()}."


# launch.py segment --objects: prompts in a few photos, a segmenter of the user's or none.
#
# Nothing is printed here: `notice` takes sentences, `progress` what is done now.

MASKS, WORK, UNFINISHED = (
    ".masks",
    ".masks.unfinished",
    ".unfinished",
)  # after the scene file's name, without its ending


@dataclass(frozen=True)
class PromptSettings:
    """How masks are made from prompts."""

    out: Path  # NAME.scene.json; label maps of a segmenter go to NAME.masks beside it
    segmenter: Path | None  # a folder; None: a walk over pixels and anchors
    photos: int  # that a segmenter is asked about
    progress: "Progress"
    notice: Callable[[str], None]


def find_by_prompts(
    device: "Device",
    model: "AnchorModel | SplatLayers",
    capture: "Capture",
    specs: "ObjectSpecs",
    settings: PromptSettings,
) -> "tuple[Segmented, dict[int, Counts]]":
    """The labelled model, and what became of each label in the photos: {} without a segmenter.

    Raises BadFile.
    """
    from shapeshift.decomposition.masks.work_photos import work_photos
    from shapeshift.decomposition.shown import ShownAnchors
    from shapeshift.decomposition.walk_objects import segment_by_walk

    shown = ShownAnchors(device, model)
    if settings.segmenter is not None:
        return find_by_segmenter(shown, capture, specs, settings.segmenter, settings)
    found = segment_by_walk(shown, work_photos(capture, model.stops), specs, settings.progress)
    settings.notice(
        "No --segmenter: objects are found by colours, heat and shape alone, which does for "
        "compact things; look at them."
    )
    return found, {}


def find_by_segmenter(
    shown: "ShownAnchors",
    capture: "Capture",
    specs: "ObjectSpecs",
    folder: Path,
    settings: PromptSettings,
) -> "tuple[Segmented, dict[int, Counts]]":
    from shapeshift.decomposition.find_objects import (
        files_about,
        label_by_segmenter,
        write_label_maps,
    )
    from shapeshift.decomposition.masks.sam_files import open_segmenter
    from shapeshift.decomposition.partition import LabelledView
    from shapeshift.decomposition.segment_scene import segment
    from shapeshift.runtime_models.files.whole_file import discard_folder

    segmenter = open_segmenter(folder)
    if not segmenter.reads_text and any(spec.text for spec in specs.objects):
        settings.notice(f"{segmenter.name} does not read: 'text' is not used.")
    if not segmenter.takes_boxes:
        settings.notice(f"{segmenter.name} takes no boxes: each counts as a click in its middle.")
    work, progress = beside(settings.out, WORK), settings.progress
    about: dict[str, object] = {"scene": digest_of(shown.model),
             "segmenter": files_about([p for p in folder.iterdir() if p.is_file()])}  # fmt: skip
    try:
        labels = label_by_segmenter(
            shown, capture, specs, segmenter, work, about, progress, settings.photos
        )
    except KeyboardInterrupt:
        settings.notice(f"{full(work)} keeps the masks so far; the same command goes on there.")
        raise
    begin_writing(settings.out)
    write_label_maps(labels, beside(settings.out, MASKS))
    pictures = [
        LabelledView(photo.view, photo.stop.x, here, photo.photo.path)
        for photo, here in zip(labels.photos, labels.maps, strict=True)
    ]
    found = segment(
        shown.device, shown.model, pictures, specs.objects, len(capture.photos),
        lambda done, count: progress("evidence of photos", done, count),
    )  # fmt: skip
    discard_folder(work)
    return found, labels.counts


def note_of(out: Path) -> Path:
    """A file beside the scene file that is there from before the first of a run's files is written
    until all are: what a killed run left is not refused as somebody's.
    """
    return beside(out, UNFINISHED)


def begin_writing(out: Path) -> None:
    from shapeshift.runtime_models.files.whole_file import write_whole

    out.parent.mkdir(parents=True, exist_ok=True)
    write_whole(note_of(out), b"segment has not ended here; the same command goes on.\n")


def digest_of(model: "AnchorModel | SplatLayers") -> str:
    """Of where its anchors or splats are: another training has others."""
    from shapeshift.runtime_models.model import AnchorModel

    places = model.anchors if isinstance(model, AnchorModel) else model.means
    return hashlib.sha256(np.ascontiguousarray(places).tobytes()).hexdigest()


def beside(out: Path, ending: str) -> Path:
    """A folder beside the scene file, named as it."""
    from shapeshift.scene.document.scene_file import ENDING

    return out.with_name(out.name[: -len(ENDING)] + ending)


# Pictures of what `segment` found: label maps beside what the cut scene shows, and its objects.

VIEWS = 4  # label maps that a sheet shows, from all sides
UNKNOWN = 0.25  # grey of pixels that say nothing


def write_report(device: Device, found: Segmented, folder: Path, overwrite: bool) -> None:
    """labels.png: rows of a view as it is, its label map, what the cut scene shows of labels;
    views.png: the four views of the first one at every stop; NAME.png: each object alone where it
    is largest.
    """
    make_folder(folder)
    views = spread(found.pictures, VIEWS)
    parts = [part for part in found.parts if part.rows]
    pictures = LabelPictures(device, found.model)
    with open_renderer("auto", "auto") as (renderer, _):
        background = default_background(found.model, (0.0, 0.0, 0.0))
        renderer.settings = replace(renderer.settings, background=background)

        def drawn(picture: LabelledView, x, mode: str) -> np.ndarray:
            obj = SceneObject("scene", found.model, x=x)
            renderer.update(show_objects(Scene((obj,)), mode))
            renderer.draw([picture.view])
            return np.array(renderer.resolved(0))[..., :3]

        rows = []
        for each in tracked(views, "pictures"):
            shown = pictures.label_map(each.view, each.x)
            rows.append([drawn(each, each.x, "full"), colored(each.labels), colored(shown)])
        save_png(sheet(rows), folder / "labels.png")
        stops = [stop.x for stop in found.model.stops]
        four = [[drawn(views[0], x, mode) for mode in FOUR_VIEWS] for x in stops]
        save_png(sheet(four), folder / "views.png")
        for part in tracked(parts, "objects"):
            label = part.spec.label
            pixels = [int((picture.labels == label).sum()) for picture in found.pictures]
            best = found.pictures[int(np.argmax(pixels))]
            alone = drawn(best, best.x, f"isolated:{label}")
            save_png(alone, folder / f"{label:03d}_{file_name(part.spec.name)}.png")


def spread(pictures: Sequence[LabelledView], most: int) -> list[LabelledView]:
    """Some of the pictures, each taken as far from the others as can be; the first one first."""
    eyes = np.array([p.view.world_from_eye.position for p in pictures])
    chosen, away = [0], np.linalg.norm(eyes - eyes[0], axis=1)
    while len(chosen) < min(most, len(pictures)):
        chosen.append(int(away.argmax()))
        away = np.minimum(away, np.linalg.norm(eyes - eyes[chosen[-1]], axis=1))
    return [pictures[i] for i in chosen]


def colored(labels: np.ndarray) -> np.ndarray:
    """(H, W, 3) float32 of a label map: black the background, grey what says nothing."""
    table = np.array([color_of(label) for label in range(256)], np.float32)
    table[0], table[SILENT] = 0, UNKNOWN
    return table[labels]


def sheet(rows: list[list[np.ndarray]]) -> np.ndarray:
    """Pictures (H, W, 3) in rows; those of other sizes are cut or filled up with black."""
    height = max(p.shape[0] for row in rows for p in row)
    width = max(p.shape[1] for row in rows for p in row)
    out = np.zeros((height * len(rows), width * max(map(len, rows)), 3), np.float32)
    for i, row in enumerate(rows):
        for j, picture in enumerate(row):
            h, w, _ = picture.shape
            out[i * height : i * height + h, j * width : j * width + w] = picture
    return out
