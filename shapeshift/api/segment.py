"""A scene and photos of it to a scene of objects."""

from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path

from shapeshift.api.arguments import PathText
from shapeshift.api.opened import OpenedScene
from shapeshift.api.read import read_document
from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import plain
from shapeshift.decomposition.masks.specs import ObjectSpec, ObjectSpecs

Progress = Callable[[str, int, int], None]  # what is done now, how many of how many


def segment(
    scene: OpenedScene,
    capture: PathText,
    out: PathText,
    objects: PathText | Sequence[ObjectSpec] | None,
    masks: PathText | None,
    segmenter: PathText | None,
    photos: int,
    complete: bool,
    overwrite: bool,
    progress: Progress | None,
) -> tuple[Document, Path]:
    """What Scene.segment gives, and where it lies."""
    from shapeshift.app.decomposition.segment import (
        Options,
        cut,
        labelled,
        refuse_inputs,
        refuse_outputs,
        straight_capture,
    )
    from shapeshift.app.decomposition.segment_steps import note_of
    from shapeshift.decomposition.masks.specs import checked, read_specs
    from shapeshift.rasterizer.device import open_device
    from shapeshift.runtime_models.splats.plain_splats import Reading

    if objects is None and masks is None:
        raise UsageError("objects with a prompt each are wanted, or masks: a folder of label maps.")
    if masks is not None and segmenter is not None:
        raise UsageError("masks has the label maps already; leave out segmenter.")

    def path(text: PathText | None) -> Path | None:
        return None if text is None else plain(text)

    specs: ObjectSpecs | None = None
    if isinstance(objects, str | PathLike):
        specs = read_specs(plain(objects))
    elif objects is not None:
        specs = checked(objects, Path())
    options = Options(
        scene=scene.path or Path("scene"), capture=plain(capture), out=plain(out),
        masks=path(masks), objects=None if specs is None else specs.folder,
        segmenter=path(segmenter), photos=photos, complete=complete, overwrite=overwrite,
    )  # fmt: skip
    refuse_inputs(options)
    refuse_outputs(options)
    model = labelled(scene.model, "the scene")
    found = straight_capture(options, model, lambda *sentences: None)
    cut(
        options, specs, model, found, open_device(),
        progress or (lambda what, done, of: None), lambda sentence: None,
    )  # fmt: skip
    note_of(options.out).unlink(missing_ok=True)
    return read_document(options.out, Reading())
