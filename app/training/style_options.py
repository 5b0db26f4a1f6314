"""Options of `launch.py style`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from shapeshift.app.command_line import EXPERT, POSITIONAL, REGIONS, Opt
from shapeshift.app.errors import UsageError
from shapeshift.app.opening import ReadingOptions
from shapeshift.app.paths import plain
from shapeshift.runtime_models.model import AnchorModel, BadFile
from shapeshift.runtime_models.parts import find_label

Shape = Literal["", "fur", "blocks", "bubbles", "points", "melt", "explode", "strokes"]


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Put a new stop into a finished scene: a shape by rule, a style of pictures, or both; or
    values by formula of other stops.

    Every other stop stays as it was.  It takes seconds to two minutes and needs no photos.
    """

    scene: Annotated[Path, POSITIONAL]
    """The package to start from; it is not changed."""
    out: Path
    """The package to write: NAME.shift or a folder."""
    name: str = ""
    """What the new stop is called.  Default: after its shape or its pictures."""
    shape: Shape = ""
    """What becomes of the splats, by a rule; a few seconds.  Default: they stay."""
    network: Path | None = None
    """An ONNX file of a feed-forward style network: it paints views of the scene, from which the
    colours are learned.  Default: none."""
    weights: Annotated[str, Opt(metavar="N=W,...")] = ""
    """Which of the styles that the network knows, by numbers from 0, and how much of each: 3, or
    3=0.5,12=0.5.  Default: those of a network that knows one style."""
    image: Path | None = None
    """A style picture, 16 to 4096 pixels a side, or one of this program's own: glass, swirl, ink.
    It needs --vgg, or --clip-model, or a --network that takes its code.  Default: none."""
    text: str = ""
    """The style in words.  With --clip-model any words do; without they choose among the shapes and
    pictures of this program: hairy, molten wax, a pen drawing.  Default: none."""
    vgg: Path | None = None
    """An ONNX file of VGG16's first layers, by which --image gives its strokes and colours.
    Default: none."""
    clip_model: Path | None = None
    """A folder of a CLIP as exporters write one, by which --text or --image gives its meaning:
    vision_model.onnx, text_model.onnx, tokenizer.json, preprocessor_config.json.  Default: none."""
    quality: Literal["full", "preview"] = "full"
    """preview: the colours of --image by --vgg without training, in seconds."""
    encoder: Path | None = None
    """The ONNX file that makes the code of --image for --network.  Default: none."""
    pictures: Path | None = None
    """A folder of pictures of the scene that any other program has painted, one for each of
    --cameras, named as these or in their order.  Default: none."""
    formula: str = ""
    """Values by formula of stops of values, such as "(nir - red) / (nir + red)": numbers, names of
    stops (between quotes, where they have other signs than letters) and + - * / ( ).
    Default: none."""
    range: tuple[float, float] | None = None
    """Of --formula: the values at the palette's ends.  Default: what the scene has."""
    unit: str = ""
    """Of --formula: its unit.  Default: none."""
    palette: str = ""
    """Of --formula: its palette, as of `thermal`.  Default: viridis."""
    cameras: Path | None = None
    """A file of cameras from which the scene is looked at.  Default: a dome of --views about it."""
    from_: Annotated[str, Opt(metavar="STOP")] = ""
    """The stop that the new one starts from.  Default: the first."""
    after: Annotated[str, Opt(metavar="STOP")] = ""
    """The stop that it comes after on the slider.  Default: the last."""
    strength: float = 1.0
    """How far from the stop that it starts from to the full style, 0 to 1."""
    region: Annotated[tuple[str, ...], REGIONS] = ()
    """Change only what lies here: sphere:x,y,z:radius box:x,y,z:hx,hy,hz half:x,y,z:nx,ny,nz,
    label:NAME of an object, painted:FILE.scene.json.  Several add up.  Default: everything."""
    keep: Annotated[tuple[str, ...], REGIONS] = ()
    """Leave what lies here as it is, in the words of --region.  Default: nothing."""
    remove: Annotated[str, Opt(metavar="STOP")] = ""
    """Take this stop out instead, with all that it alone had.  Default: none."""
    steps: int = 400
    """Steps of training towards pictures, 1 to 100,000."""
    sheet: Path | None = None
    """A PNG to write: views of the stop that it starts from above those of the new one.  Default:
    none."""
    seed: int = 0
    """Seed of all random numbers: the same seed gives the same bytes."""
    overwrite: bool = False
    """Replace an earlier file of --out; never the scene that is read."""
    views: Annotated[int | None, EXPERT] = None
    """How many views the dome has, 1 to 500.  Default: 48; of --vgg and --clip-model 24."""
    size: Annotated[int | None, EXPERT] = None
    """Pixels of the longer side of these views, 32 to 640.  Default: 384; of --vgg and
    --clip-model 256."""
    patches: Annotated[int, EXPERT] = 4
    """Into how many patches a view is cut for --clip-model, 1 to 64; 1: the whole alone."""
    pace: Annotated[bool, EXPERT] = True
    """Measure how fast the picture changes on the ways to the new stop, so that equal ways of the
    slider are equal changes; --no-pace: leave that out."""
    device: Annotated[Literal["cpu", "gpu"] | None, EXPERT] = None
    """Kind of OpenCL device that must be used.  Default: the fastest that there is."""


# Which anchors a style is for: selectors, labels of objects, regions painted in a scene file.

HALF = 0.5  # of a weight: from there on an anchor is inside


def anchors_inside(
    model: AnchorModel, region: tuple[str, ...], keep: tuple[str, ...]
) -> np.ndarray | None:
    """(A,) bool: what lies in a region and in nothing that is kept; None: all.  Raises UsageError.

    Each text is a selector without X, label:NAME or painted:FILE.scene.json.
    """
    if not region and not keep:
        return None
    inside = np.ones(len(model.anchors), bool)
    if region:
        inside = np.any([chosen(model, text, "--region") for text in region], axis=0)
    for text in keep:
        inside &= ~chosen(model, text, "--keep")
    if not inside.any():
        raise UsageError("--region and --keep leave no anchor of the scene; choose another place.")
    return inside


def chosen(model: AnchorModel, text: str, option: str) -> np.ndarray:
    """(A,) bool: the anchors that one text names.  Raises UsageError where there are none."""
    kind, _, rest = text.partition(":")
    if kind == "label":
        found = labelled(model, rest, option)
    elif kind == "painted":
        found = painted(model, plain(rest), option)
    else:
        found = selected(model, text, option)
    if not found.any():
        raise UsageError(f"{option} '{text}' holds no anchor of the scene; choose another place.")
    return found


def selected(model: AnchorModel, text: str, option: str) -> np.ndarray:
    """(A,) bool: the anchors in a selector."""
    from shapeshift.app.commands.export import with_x
    from shapeshift.scene.cameras.framing import default_view
    from shapeshift.scene.selectors.selector_texts import read_selector

    try:
        eye = default_view(model, (640, 360)).world_from_eye
        return read_selector(with_x(text), (), eye).weights(model.anchors) >= HALF
    except ValueError as error:
        raise UsageError(f"{option} {error}") from None


def labelled(model: AnchorModel, name: str, option: str) -> np.ndarray:
    """(A,) bool: the anchors of an object, by its name or label."""
    try:
        label = find_label(model, name, "the scene")
    except BadFile as error:
        raise UsageError(f"{option} label:{name}: {error}") from None
    return np.asarray(model.labels == label)


def painted(model: AnchorModel, path: Path, option: str) -> np.ndarray:
    """(A,) bool: the anchors in any region that a scene file has painted on such a model."""
    from shapeshift.scene.document.read_scene_file import read_scene_file
    from shapeshift.scene.selectors.selector import Painted

    weights = [
        selector.weight
        for item in read_scene_file(path).all_items
        for selector in item.selectors
        if isinstance(selector, Painted) and len(selector.weight) == len(model.anchors)
    ]
    if not weights:
        raise UsageError(
            f"{option} painted:{path}: no region is painted there on {len(model.anchors):,} "
            "anchors, as many as the scene has."
        )
    return np.any([weight >= HALF for weight in weights], axis=0)
