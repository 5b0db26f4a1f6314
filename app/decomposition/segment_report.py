"""Pictures of what `segment` found: label maps beside what the cut scene shows, and its objects."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.app.decomposition.show_views import show_objects
from shapeshift.app.drawing import make_folder, open_renderer, save_png
from shapeshift.app.paths import file_name
from shapeshift.app.progress import tracked
from shapeshift.decomposition.label_pictures import LabelPictures
from shapeshift.decomposition.masks.label_maps import SILENT
from shapeshift.decomposition.partition import LabelledView
from shapeshift.decomposition.segment_scene import Segmented
from shapeshift.rasterizer.device import Device
from shapeshift.scene.cameras.framing import default_background
from shapeshift.scene.four_views import FOUR_VIEWS, color_of
from shapeshift.scene.scene import Scene, SceneObject

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
