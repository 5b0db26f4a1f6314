"""render --output depth, normal, coverage: numbers instead of colours, and what they mean."""

import io
import json
import math
import struct
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.drawing import SOFTWARE
from shapeshift.runtime_models.files.plain_text import name_line
from shapeshift.runtime_models.files.whole_file import write_whole

if TYPE_CHECKING:
    from shapeshift.renderer.renderer import Renderer
    from shapeshift.renderer.surface import Surface


# PNG files of 16 bits a number: depth, normals, coverage.  Pillow writes no such colours.

MARK = b"\x89PNG\r\n\x1a\n"
MOST = 65535
GREY, COLOR = 0, 2  # colour types
UP = 2  # filter: each row is the difference to the one above, which packs better


def write_png16(pixels: np.ndarray, path: Path, texts: dict[str, str] | None = None) -> None:
    """(H, W) or (H, W, 3) uint16 to a grey or colour PNG, whole or not at all.

    texts: Latin-1, one tEXt entry each, after the name of this program.
    """
    height, width = pixels.shape[:2]
    bytes_ = np.ascontiguousarray(pixels, ">u2").reshape(height, -1).view(np.uint8)
    rows = np.full((height, 1 + bytes_.shape[1]), UP, np.uint8)
    rows[:, 1:] = np.diff(bytes_, axis=0, prepend=np.zeros_like(bytes_[:1]))  # modulo 256
    kind = COLOR if pixels.ndim == 3 else GREY
    data = MARK + _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, kind, 0, 0, 0))
    for key, text in ({"Software": SOFTWARE} | (texts or {})).items():
        data += _chunk(b"tEXt", key.encode("latin-1") + b"\0" + text.encode("latin-1"))
    data += _chunk(b"IDAT", zlib.compress(rows.tobytes(), 6)) + _chunk(b"IEND", b"")
    write_whole(path, data)


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


LEGEND = "legend.json"  # what the numbers of all pictures mean
FARTHER = MOST  # what a depth picture says of all that is too far for it
MEANINGS = {
    "depth": "metres along the view to where rays are halfway through the splats, blended as "
    "colours are; .png: 0 where less than half of a pixel is covered, else round(metres / "
    "metres_per_step), 65535 for all that is farther; .npy: float32 metres, NaN where nothing is",
    "normal": "directions of the surface, length 1, in eye axes: x right, y up, z towards the eye; "
    ".png: round((n + 1) / 2 * 65535), 0 0 0 where less than half of a pixel is covered; .npy: "
    "float32, NaN where nothing is",
    "coverage": "how much of the background is hidden; .png: round(c * 65535); .npy: float32, 0..1",
}


def draw_outputs(
    renderer: "Renderer", scenes: list, views: list, paths: list[Path], eye_distance: float,
    output: str, metres_per_step: float,
) -> None:  # fmt: skip
    """A .png and a .npy of each scene from its view, two eyes side by side, and one legend."""
    from shapeshift.app.progress import tracked
    from shapeshift.scene.pose import stereo_pair

    summaries: dict[str, dict] = {}
    legend: dict[str, object] = {"output": output, "meaning": MEANINGS[output]}
    if output == "depth":
        legend["metres_per_step"] = metres_per_step
    legend["pictures"] = summaries
    work = list(zip(scenes, views, paths, strict=True))
    for scene, view, path in tracked(work, "drawing"):
        renderer.update(scene)
        eyes = stereo_pair(view, eye_distance) if eye_distance > 0 else [view]
        values = np.concatenate([values_of(renderer.surface(e), output) for e in eyes], axis=1)
        summaries[path.name] = summary(values)
        texts = {key: str(text) for key, text in legend.items() if key != "pictures"}
        write_png16(as_steps(values, output, metres_per_step), path, texts)
        held = io.BytesIO()
        np.save(held, values)
        write_whole(path.with_suffix(".npy"), held.getvalue())
    text = json.dumps(legend, indent=1) + "\n"
    write_whole(paths[0].with_name(LEGEND), text.encode())


def values_of(surface: "Surface", output: str) -> np.ndarray:
    """(H, W) or (H, W, 3) float32 of one output."""
    if output == "coverage":
        return surface.coverage
    return surface.depth() if output == "depth" else surface.normals()


def summary(values: np.ndarray) -> dict[str, float | None]:
    """The least and the largest number, None where there is none; and the share that has one."""
    known = values[np.isfinite(values)]
    least, largest = (float(known.min()), float(known.max())) if known.size else (None, None)
    return {"least": least, "largest": largest, "known": round(known.size / values.size, 6)}


def as_steps(values: np.ndarray, output: str, metres_per_step: float) -> np.ndarray:
    """uint16 as MEANINGS says; a depth that is there is never 0."""
    if output == "depth":
        with np.errstate(invalid="ignore"):
            steps = np.clip(np.rint(values / metres_per_step), 1, FARTHER)
        return np.where(np.isfinite(values), steps, 0).astype(np.uint16)
    part = (values + 1) / 2 if output == "normal" else values
    return np.rint(np.clip(np.nan_to_num(part, nan=0.0), 0, 1) * MOST).astype(np.uint16)


def choose_unit(centre: np.ndarray, radius: float, views: list) -> float:
    """Metres a step: the finest power of ten whose steps reach the scene's far side."""
    away = [np.linalg.norm(view.world_from_eye.position - centre) for view in views]
    farthest = max(away) + radius
    if not 0 < farthest < math.inf:
        return 0.001
    return 10.0 ** math.ceil(math.log10(farthest / (MOST - 1)))


# A legend in the corner of a debug picture.

Rows = list[tuple[str, tuple[float, float, float]]]
TEXT = (235, 235, 235)
BEHIND = (16, 16, 16)


def with_legend(picture: np.ndarray, rows: Rows) -> np.ndarray:
    """(H, W, 3) display sRGB with the rows (text, colour) written into its upper left corner."""
    if not rows:
        return picture
    from PIL import Image, ImageDraw

    from shapeshift.renderer.debug.letters import drawable, letters

    image = Image.fromarray((np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8))
    draw = ImageDraw.Draw(image)
    height = max(11, image.height // 45)  # pixels of a line's letters
    font = letters(height)
    rows = [(drawable(name_line(text), height), color) for text, color in rows]
    line, margin = round(height * 1.4), round(height * 0.6)
    width = max(draw.textlength(text, font) for text, _ in rows) + height + 3 * margin
    draw.rectangle((0, 0, width, line * len(rows) + margin), fill=BEHIND)
    for i, (text, color) in enumerate(rows):
        top = margin + i * line
        fill = tuple(round(255 * c) for c in color)
        draw.rectangle((margin, top, margin + height, top + height), fill=fill)
        draw.text((height + 2 * margin, top), text, fill=TEXT, font=font)
    return np.asarray(image, np.float32) / 255
