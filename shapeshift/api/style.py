"""A stop put into a scene's model, and taken out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.api.arguments import PathText
from shapeshift.api.opened import OpenedScene
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import plain
from shapeshift.app.training.style_options import Options
from shapeshift.runtime_models.model import AnchorModel
from shapeshift.runtime_models.stops.change_stops import remove_stop

if TYPE_CHECKING:
    from shapeshift.training.styles.style_pictures import StyleView

Paint = Callable[[np.ndarray], np.ndarray]  # (H, W, 3) display sRGB 0..1 to another such picture
Progress = Callable[[str, float], None]


class PaintFunction:
    """A StylePictures: what a function makes of each view's picture."""

    def __init__(self, paint: Paint) -> None:
        from shapeshift.training.styles.style_pictures import Turns

        self.paint = paint
        self.turns: Turns = Turns()

    def make(self, views: "Sequence[StyleView]", done: float) -> list[np.ndarray]:
        made = [np.asarray(self.paint(view.source.copy()), np.float32) for view in views]
        for view, picture in zip(views, made, strict=True):
            if picture.shape != view.source.shape:
                raise UsageError(
                    f"paint gave an array of shape {picture.shape} for a picture of shape "
                    f"{view.source.shape}; as large a picture is wanted."
                )
        return made


def add_formula(scene: OpenedScene, options: Options) -> AnchorModel:
    """What Scene.add_formula gives: the model with one stop more."""
    from shapeshift.app.training.style import check_options, with_formula
    from shapeshift.renderer.pace import measure_pace
    from shapeshift.training.styles.add_style import refuse_plain

    model = refuse_plain(scene.model)
    check_options(options)
    made, _ = with_formula(options, model)
    return replace(made, pace=measure_pace(made)) if options.pace else made


def add_style(
    scene: OpenedScene, options: Options, weights: Mapping[int, float] | None,
    paint: Paint | None, pace: bool, progress: Progress | None,
) -> AnchorModel:  # fmt: skip
    """What Scene.add_style gives: the model with one stop more."""
    from shapeshift.app.training.style import check_options, style_of
    from shapeshift.app.training.style_looks import pictures_and_views, preview_of
    from shapeshift.app.training.style_options import anchors_inside
    from shapeshift.rasterizer.device import open_device
    from shapeshift.renderer.pace import measure_pace
    from shapeshift.training.styles.add_style import add_style as put_in
    from shapeshift.training.styles.add_style import refuse_plain
    from shapeshift.training.styles.carried_pictures import CarriedPictures

    model = refuse_plain(scene.model)
    words = ",".join(f"{n}={w}" for n, w in (weights or {}).items())
    options = replace(options, weights=words)
    try:
        if options.text and options.clip_model is None:
            raise UsageError("text needs clip_model, the folder of a CLIP, or take shape.")
        if paint is None:
            check_options(options)
        elif options.network or options.pictures or options.image or options.text:
            raise UsageError("paint makes the pictures; leave the other ways to make them out.")
        style = style_of(options, model)
        inside = anchors_inside(model, options.region, options.keep)
        pictures, views = pictures_and_views(options, model, painted=paint is not None)
    except UsageError as error:
        raise UsageError(str(error).replace("--", "")) from None
    if paint is not None:
        pictures = CarriedPictures(PaintFunction(paint))
    preview = options.quality == "preview"
    device = open_device(options.device) if preview or pictures is not None else None
    recolor = preview_of(options, device, model, style.source, progress) if preview else None
    made = put_in(device, model, style, pictures, views, inside, progress, recolor)
    return replace(made, pace=measure_pace(made)) if pace else made


def path_of(text: PathText | None) -> Path | None:
    return None if text is None else plain(text)


def without_stop(scene: OpenedScene, name: str) -> AnchorModel:
    """What Scene.without_stop gives."""
    from shapeshift.training.styles.add_style import refuse_plain

    return remove_stop(refuse_plain(scene.model), name)
