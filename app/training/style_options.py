"""Options of `launch.py style`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from shapeshift.app.command_line import EXPERT, POSITIONAL, REGIONS, Opt
from shapeshift.app.opening import ReadingOptions

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
