"""The end of launch.py segment: what is touched of every object, and what stood behind it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from shapeshift.decomposition.assemble import Assembled
    from shapeshift.decomposition.label_photos import Progress
    from shapeshift.decomposition.segment_scene import Segmented
    from shapeshift.rasterizer.device import Device
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
) -> "tuple[SceneFile, Segmented]":
    """With a completed background and colliders in files; of plain splats the same.

    Raises BadFile.
    """
    from shapeshift.app.training.evaluate import trained_downscale
    from shapeshift.decomposition.assemble import assemble
    from shapeshift.decomposition.photo_views import photo_views, row_evidence
    from shapeshift.runtime_models.model import AnchorModel
    from shapeshift.scene.colliders.collider import Making
    from shapeshift.scene.document.scene_file import HULLS

    if not isinstance(found.model, AnchorModel):
        settings.notice(
            "Nothing is completed: plain splats have no features that copies could keep."
        )
        return file, found
    wanted = {p.spec.label: None for p in found.parts if p.rows and p.spec.collider == HULLS}
    factor = settings.downscale or trained_downscale(found.model.provenance)
    views = photo_views(device, found, capture, factor)
    made = assemble(
        device, found.model, views, row_evidence(device, found.model, views), wanted,
        shadows=settings.shadows, background=capture.background or (0.0, 0.0, 0.0),
        making=Making(progress=lambda what, part: settings.progress(what, int(100 * part), 100)),
    )  # fmt: skip
    names = {part.spec.label: part.spec.name for part in found.parts}
    for sentence in sentences_of(made, names):
        settings.notice(sentence)
    return write_colliders(file, found, made, settings.out), replace(found, model=made.model)


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
