"""What is compared: a scene at one x, or a folder of pictures."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.app.document import Document, open_document
from shapeshift.app.opening import ReadingOptions
from shapeshift.app.paths import plain
from shapeshift.runtime_models.files.plain_text import one_line
from shapeshift.runtime_models.model import BadFile

PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff")
SCENE_MARKS = (
    "scene.json",
    "meta.json",
    "lod-meta.json",
    "lod.json",
)  # folders of these hold no photographs


@dataclass(frozen=True)
class SceneSide:
    """A scene as it is at x."""

    name: str
    subject: Document  # at that x
    stated: bool = True  # x was given, or each object has its own; else the first stop's was taken


@dataclass(frozen=True)
class PictureSide:
    """Pictures that are there already, in the order of their names."""

    name: str
    files: tuple[Path, ...]


def open_side(text: str, options: ReadingOptions) -> SceneSide | PictureSide:
    """What a path, or a path with @stop or @x, stands for.  Raises BadFile, UsageError."""
    path, at = split_stop(text)
    if not at and (files := pictures_in(path)):
        return PictureSide(path.name, files)
    subject, name = open_document(path, options), path.resolve().name
    if at:
        return SceneSide(f"{name} @ {at}", subject.placed(at, f"'{text}'"))
    if subject.file:
        return SceneSide(name, subject)
    return SceneSide(name, Document(subject.at(min(subject.stops, default=0.0))), False)


def split_stop(text: str) -> tuple[Path, str]:
    """(path, stop or ""): a path that is there as it is written has no stop."""
    before, sign, at = text.rpartition("@")
    if not sign or not before or not at or plain(text).exists():
        return plain(text), ""
    return plain(before), at


def pictures_in(path: Path) -> tuple[Path, ...]:
    """The pictures of a folder that is no scene, or the one picture that a file is; () for none."""
    if path.is_file():
        return (path,) if path.suffix.lower() in PICTURES else ()
    if not path.is_dir() or any((path / mark).exists() for mark in SCENE_MARKS):
        return ()
    from shapeshift.runtime_models.splats.layers.read_layers import layer_files
    from shapeshift.runtime_models.splats.read_output_folder import newest_cloud

    if layer_files(path) or newest_cloud(path) is not None:
        return ()
    return tuple(sorted(f for f in path.iterdir() if f.suffix.lower() in PICTURES and f.is_file()))


def match_pictures(a: PictureSide, b: PictureSide) -> tuple[list[tuple[str, Path, Path]], str]:
    """((name, a's file, b's file), ...) by equal names, else in order; and how, for a word on it.

    Raises BadFile where neither fits.
    """
    by_name = [{f.stem: f for f in side.files} for side in (a, b)]
    common = [stem for stem in by_name[0] if stem in by_name[1]]
    if common:
        left = len(a.files) + len(b.files) - 2 * len(common)
        matching = f"matched by name{f', {left} without a partner left out' if left else ''}"
        return [(stem, by_name[0][stem], by_name[1][stem]) for stem in common], matching
    if len(a.files) != len(b.files):
        raise BadFile(
            f"{a.name} holds {len(a.files)} pictures and {b.name} {len(b.files)}, and no two have "
            "a name in common; give folders of equal names or equal numbers."
        )
    return [(f.stem, f, g) for f, g in zip(a.files, b.files, strict=True)], "matched in order"


def read_picture(path: Path) -> np.ndarray:
    """(H, W, 3) float32 display sRGB 0..1; what is see-through lies over black.  Raises BadFile."""
    from shapeshift.scene.captures.photo import read_pixels

    return read_pixels(path)[0]


# Pictures of a comparison: the difference, amplified, and A, B and difference side by side.

AMPLIFICATIONS = (1, 2, 5, 10, 20, 50, 100, 200)
BRIGHT = 0.8  # what the 99.9th percentile of an amplified difference may reach
PERCENTILE = 99.9
NO_DIFFERENCE = (0.5, 0.5, 0.5)  # grey: signed differences lie around it
TEXT, BEHIND = (235, 235, 235), (16, 16, 16)


def amplification(differences: list[np.ndarray]) -> int:
    """The largest of AMPLIFICATIONS at which nearly all differences (H, W, 3) stay visible."""
    largest = max((float(np.percentile(np.abs(d), PERCENTILE)) for d in differences), default=0.0)
    fitting = [a for a in AMPLIFICATIONS if a * largest <= BRIGHT]
    return fitting[-1] if fitting else AMPLIFICATIONS[0]


def difference_picture(a: np.ndarray, b: np.ndarray, amplify: int) -> np.ndarray:
    """(H, W, 3) grey where the two are equal, lighter where b is brighter, by channel."""
    return np.clip(np.array(NO_DIFFERENCE, np.float32) + amplify * (b - a) / 2, 0, 1)


def written(picture: np.ndarray, text: str) -> np.ndarray:
    """The picture with a line in its upper left corner."""
    from PIL import Image, ImageDraw

    from shapeshift.renderer.debug.letters import drawable, letters

    image = Image.fromarray((np.clip(np.nan_to_num(picture), 0, 1) * 255 + 0.5).astype(np.uint8))
    draw = ImageDraw.Draw(image)
    height = max(11, image.height // 28)  # pixels of a letter
    font, text = letters(height), drawable(text, height)
    margin = height // 2
    width = draw.textlength(text, font) + 2 * margin
    draw.rectangle((0, 0, width, height + 2 * margin), fill=BEHIND)
    draw.text((margin, margin), one_line(text), fill=TEXT, font=font)
    return np.asarray(image, np.float32) / 255


def scale_text(amplify: int) -> str:
    """What a difference picture's colours mean; 255 steps are black to white."""
    reach = 255 / amplify
    return f"difference x {amplify}  (black -{reach:.3g}, white +{reach:.3g} of 255)"


def sheet(a: np.ndarray, b: np.ndarray, names: tuple[str, str], amplify: int) -> np.ndarray:
    """(H, 3 W, 3) A, B and their difference side by side, each with its name."""
    difference = written(difference_picture(a, b, amplify), scale_text(amplify))
    parts = [written(a, f"A  {names[0]}"), written(b, f"B  {names[1]}"), difference]
    return np.concatenate(parts, axis=1)
