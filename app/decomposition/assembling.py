"""The end of launch.py segment: what is touched of every object, and what stood behind it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from shapeshift.app.terminal import say

if TYPE_CHECKING:
    from shapeshift.app.decomposition.segment import Options
    from shapeshift.decomposition.assemble import Assembled
    from shapeshift.decomposition.completion.verify import PhotoView
    from shapeshift.decomposition.segment_scene import Segmented
    from shapeshift.rasterizer.device import Device
    from shapeshift.scene.captures.capture import Capture, Photo
    from shapeshift.scene.document.scene_file import SceneFile

Progress = Callable[[str, int, int], None]  # what is done now, how many of how many
FOLDER = "colliders"  # beside the scene file
MOST_VIEWS = 24  # that verify and score: well spread, they say what all would


def completed(
    device: "Device",
    file: "SceneFile",
    found: "Segmented",
    capture: "Capture",
    options: "Options",
    progress: Progress,
) -> "tuple[SceneFile, Segmented]":
    """With a completed background and colliders in files; of plain splats the same.

    Raises BadFile.
    """
    from shapeshift.app.training.evaluate import trained_downscale
    from shapeshift.decomposition.assemble import RowEvidence, assemble
    from shapeshift.runtime_models.model import AnchorModel
    from shapeshift.scene.colliders.collider import Making
    from shapeshift.scene.document.scene_file import HULLS

    if not isinstance(found.model, AnchorModel):
        say("Nothing is completed: plain splats have no features that copies could keep.")
        return file, found
    wanted = {p.spec.label: None for p in found.parts if p.rows and p.spec.collider == HULLS}
    factor = options.downscale or trained_downscale(found.model.provenance)
    views = photo_views(found, photos_of(options, capture), factor)
    making = Making(progress=lambda what, part: progress(what, int(100 * part), 100))
    made = assemble(
        device, found.model, views, RowEvidence(found.own, found.behind), wanted,
        shadows=options.shadows, background=capture.background or (0.0, 0.0, 0.0), making=making,
    )  # fmt: skip
    tell_assembled(made, {part.spec.label: part.spec.name for part in found.parts})
    return write_colliders(file, found, made, options.out), replace(found, model=made.model)


def photos_of(options: "Options", capture: "Capture") -> "list[Photo]":
    """One each of the label maps that were given; none where they were found by prompts."""
    from shapeshift.decomposition.label_folder import find_maps

    if options.masks is None:
        return []
    return [photo for photo, _ in find_maps(options.masks, capture)]


def photo_views(
    found: "Segmented", photos: "Sequence[Photo]", factor: int | None
) -> "list[PhotoView]":
    """MOST_VIEWS of the label maps, evenly, with their photos where those show colours."""
    import numpy as np

    from shapeshift.decomposition.completion.verify import PhotoView
    from shapeshift.decomposition.label_folder import stop_of
    from shapeshift.decomposition.segment_scene import factor_of
    from shapeshift.scene.captures.photo import load_photo

    stops, views = found.model.stops, []
    step = -(-len(found.pictures) // MOST_VIEWS)
    known = photos or [None] * len(found.pictures)  # None: nothing to compare with
    for photo, labelled in list(zip(known, found.pictures, strict=True))[::step]:
        pixels = None
        if (
            photo is not None and stop_of(photo, stops).kind != "thermal"
        ):  # false colours are no display values
            pixels = load_photo(photo, factor_of(photo, factor)).rgb.astype(np.float32) / 255
        fits = pixels is not None and pixels.shape[:2] == labelled.labels.shape
        views.append(PhotoView(labelled, pixels if fits else None))
    return views


def collider_paths(names: Sequence[str], out: Path) -> dict[str, Path]:
    """Where the collider of each object is written, and that of the background."""
    from shapeshift.app.paths import file_name

    found: dict[str, Path] = {}
    for number, name in enumerate(names):
        path = out.parent / FOLDER / f"{file_name(name)}.glb"
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
    make_folders(out.parent, FOLDER)
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


def tell_assembled(made: "Assembled", names: dict[int, str]) -> None:
    """A sentence an object."""
    for label, proxy in made.proxies.items():
        score, count = proxy.score, len(proxy.collider.parts)
        pieces = f"{count} piece{'s' * (count > 1)}"
        covers = f", IoU {score.iou:.2f} in {score.views} photos" if score.views else ""
        say(f"{names[label]}: touched as {proxy.name} of {pieces}{covers}.")
    for label, why in made.failed.items():
        say(f"{names[label]}: touched by all of its splats: {why}")
    for one in made.completions:
        say(f"{names[one.label]}: {one.sentence()}.")
