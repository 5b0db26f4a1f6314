"""What styles are worth: how steady a new stop is between views, what it costs, what it moves.

    python tools/training/styles.py SCENE --out docs/bench/styles.csv [--networks FOLDER] \
        [--pictures FOLDER] [--only NAME ...] [--cameras FILE]

warp: RMSE of a picture's colours against those of a view 3 or 24 degrees beside it, carried over by
depth, where both see the same place.  `source` is the stop that the style starts from, `frames` the
style network's own pictures of the same views, frame by frame.  gradient: mean change from a pixel
to the next, what is left of strokes.  drift: the worst of 8 views of all old stops.
"""

import argparse
import platform
import resource
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.rasterizer.surface import rasterize_depth, surface  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.runtime_models.package.feature_codes import EXACT  # noqa: E402
from shapeshift.runtime_models.package.read_package import read_package  # noqa: E402
from shapeshift.runtime_models.package.write_package import write_package  # noqa: E402
from shapeshift.scene.cameras.camera_list import CameraReading  # noqa: E402
from shapeshift.scene.cameras.framing import default_background, orbit_path  # noqa: E402
from shapeshift.scene.cameras.read_cameras import read_camera_list  # noqa: E402
from shapeshift.scene.pose import View  # noqa: E402
from shapeshift.training.drawing import camera_of  # noqa: E402
from shapeshift.training.evaluation.evaluate import ModelRenderer  # noqa: E402
from shapeshift.training.styles.add_style import (  # noqa: E402
    BEHIND,
    NewStyle,
    add_style,
    drift_db,
)
from shapeshift.training.styles.carried_pictures import (  # noqa: E402
    CarriedPictures,
    colors_from,
)
from shapeshift.training.styles.image_network import ImageNetwork  # noqa: E402
from shapeshift.training.styles.style_pictures import StyleView  # noqa: E402
from shapeshift.training.styles.train_stop import dome_views, resized_views  # noqa: E402

COLUMNS = (
    "scene,style,cpu_s,bytes,bytes_before,drift_db,warp3_source,warp3,warp3_frames,warp24_source,"
    "warp24,warp24_frames,gradient_source,gradient,gradient_frames"
)
SIZE = (384, 288)
PLACES, STEP_DEG, FAR = 4, 3.0, 8  # places about the scene; views there are 3 and 24 degrees apart
LEAST_PIXELS = 200
# name: (rule, styles of multistyle26.onnx, painted for few views and carried by depth)
STYLES = {
    "fur": ("fur", {}, True),
    "blocks": ("blocks", {}, True),
    "strokes": ("strokes", {}, True),
    "pastel (12)": ("", {12: 1.0}, True),
    "mosaic (19)": ("", {19: 1.0}, True),
    "blend (3 and 12)": ("", {3: 0.5, 12: 0.5}, True),
    "strokes, mosaic (19)": ("strokes", {19: 1.0}, True),
    "mosaic (19), each view anew": ("", {19: 1.0}, False),
    "pastel (12), each view anew": ("", {12: 1.0}, False),
}


def cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def seen(renderer: ModelRenderer, view: View, behind: tuple) -> StyleView:
    """A view of the stop that a renderer shows."""
    device = renderer.device
    projected, tiles, frame = renderer.draw(view, behind)
    picture = np.clip(device.download(frame.image).transpose(1, 2, 0), 0, 1)
    surfaces = surface(device, *renderer.geometry[:3], camera_of(view), projected)
    drawn = rasterize_depth(device, projected, tiles, surfaces, view.size)
    coverage = 1 - device.download(drawn.frame.transmittance)
    depth = device.download(drawn.metres) / np.maximum(coverage, 1e-6)
    return StyleView(0, view, picture, coverage, depth, picture)


def warp_error(one: StyleView, other: StyleView, here: np.ndarray, there: np.ndarray) -> float:
    """RMSE of the picture `here` of one view against `there` of another; NaN where few pixels are
    seen by both.
    """
    colors, same = colors_from(one, other, there)
    same &= one.coverage > 0.95
    if same.sum() < LEAST_PIXELS:
        return float("nan")
    return float(np.sqrt(((colors - here)[same] ** 2).mean()))


def path_of(model: AnchorModel, cameras: Path | None) -> list[list[View]]:
    """At each of PLACES, three views: the first, and others 3 and 24 degrees beside it."""
    if cameras is not None:
        views = resized_views(read_camera_list(cameras, CameraReading()).views, SIZE[0])
        step = max(len(views) // (PLACES + 1), 1)
        return [[views[i * step], views[i * step + 1], views[i * step + 2]] for i in range(PLACES)]
    around = dome_views(model, 1, SIZE)[0]
    centre = np.median(model.anchors, axis=0)
    away = float(np.linalg.norm(around.world_from_eye.position - centre))
    radius = away / 2.8
    count = round(360 / STEP_DEG)
    ring = orbit_path(count, centre, radius, SIZE, distance=away, elevation=0.5)
    starts = [round(i * count / PLACES) for i in range(PLACES)]
    return [[ring[i], ring[i + 1], ring[i + FAR]] for i in starts]


def measures(stacks: list[list[StyleView]], pictures: list[list[np.ndarray]]) -> list[float]:
    """warp error near and far, and the mean gradient."""
    pairs = list(zip(stacks, pictures, strict=True))
    near, far = (
        float(np.nanmean([warp_error(s[0], s[k], p[0], p[k]) for s, p in pairs])) for k in (1, 2)
    )
    change = [np.abs(np.diff(image, axis=1)).mean() for group in pictures for image in group]
    return [near, far, float(np.mean(change))]


def stop_stacks(device, model: AnchorModel, name: str, path: list[list[View]], behind: tuple):
    renderer = ModelRenderer(device, model)
    renderer.set_control(next(stop.x for stop in model.stops if stop.name == name))
    return [[seen(renderer, view, behind) for view in group] for group in path]


def row_of(device, scene: Path, name: str, networks: Path, arguments) -> str:
    rule, weights, carried = STYLES[name]
    model = read_package(scene)
    behind = default_background(model, BEHIND)
    network = ImageNetwork(networks / "multistyle26.onnx", weights) if weights else None
    pictures = CarriedPictures(network) if network is not None and carried else network
    began = cpu_s()
    source = model.stops[0].name
    views = dome_views(model, 48, SIZE)
    if arguments.cameras is not None:
        views = resized_views(read_camera_list(arguments.cameras, CameraReading()).views, SIZE[0])
        views = views[:: max(len(views) // 48, 1)]
    style = NewStyle("Style", source, source, rule, steps=arguments.steps)
    made = add_style(device, model, style, pictures, views if pictures else ())
    spent = cpu_s() - began
    folder = arguments.pictures
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "style.shift"
    size = write_package(made, file, EXACT)
    made = read_package(file)
    file.unlink()
    drift = min(drift_db(device, model, made).values())
    path = path_of(model, arguments.cameras)
    before, after = (stop_stacks(device, m, n, path, behind)
                     for m, n in ((model, source), (made, "Style")))  # fmt: skip
    shown = [[[view.source for view in group] for group in stacks] for stacks in (before, after)]
    found = [measures(before, shown[0]), measures(after, shown[1]), [float("nan")] * 3]
    rows = [group[0] for group in shown[0]], [group[0] for group in shown[1]]
    sheet = list(rows)
    if network is not None:
        frames = [
            [
                view.coverage[..., None] * network.stylise(view.source)
                + (1 - view.coverage[..., None]) * np.array(behind, np.float32)
                for view in group
            ]
            for group in before
        ]
        found[2] = measures(before, frames)
        sheet.insert(1, [group[0] for group in frames])
    write_picture(folder / f"{scene.stem}_{name}.png", sheet)
    near, far, change = zip(*found, strict=True)
    numbers = [spent, size, scene.stat().st_size, drift, *near, *far, *change]
    words = ["" if n != n else f"{n:.4f}" if n < 2 else f"{n:.1f}" for n in numbers[4:]]
    head = [f"{spent:.1f}", str(size), str(scene.stat().st_size), f"{drift:.1f}"]
    return ",".join([scene.stem, f'"{name}"', *head, *words])


def write_picture(path: Path, rows: list[list[np.ndarray]]) -> None:
    from PIL import Image

    sheet = np.concatenate([np.concatenate(row, axis=1) for row in rows])
    Image.fromarray((np.clip(sheet, 0, 1) * 255 + 0.5).astype(np.uint8)).save(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument(
        "--networks", type=Path, default=HERE.parents[2] / "shared/data/models_style"
    )
    parser.add_argument("--pictures", type=Path, required=True)
    parser.add_argument("--only", nargs="*", default=list(STYLES))
    parser.add_argument("--cameras", type=Path)
    parser.add_argument("--steps", type=int, default=400)
    arguments = parser.parse_args()
    device = open_device()
    known = arguments.out.read_text().splitlines() if arguments.out.exists() else []
    lines = [line for line in known if not line.startswith(("#", "scene,"))]
    for scene in arguments.scenes:
        for name in arguments.only:
            line = row_of(device, scene, name, arguments.networks, arguments)
            print(line, flush=True)  # noqa: T201
            key = ",".join(line.split(",cpu")[0].split('"')[:2])
            lines = [old for old in lines if ",".join(old.split('"')[:2]) != key] + [line]
            command = "python tools/training/styles.py SCENE --out docs/bench/styles.csv"
            machine = f"# {platform.machine()}, {device.name}, {device.platform}"
            text = [f"# {command} --pictures FOLDER", machine, COLUMNS, *lines]
            arguments.out.write_text("\n".join(text) + "\n")


if __name__ == "__main__":
    main()
