"""render --output depth, normal, coverage: numbers instead of colours, and what they mean."""

import io
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.commands.png16 import MOST, write_png16, write_whole

if TYPE_CHECKING:
    from shapeshift.renderer.renderer import Renderer
    from shapeshift.renderer.surface import Surface

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
    from shapeshift.scene.stereo import stereo_pair

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
