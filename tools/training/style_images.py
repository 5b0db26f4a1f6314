"""What styles from a picture are worth: by turns with VGG16, and as a preview without training.

    python tools/training/style_images.py SCENE --out docs/bench/style_images.csv [--vgg FILE] \
        [--pictures FOLDER] [--only WAY ...] [--styles NAME ...]

cpu_s: of the whole new stop; of a preview without what is done once a scene, which is once_s.
nnfm: of held-out views to the style picture (relu3_1 of what is covered), of the stop that the
style starts from and of the new one.  warp: RMSE of a picture's colours against those of a view 3
or 24 degrees beside it, carried over by depth.  gradient: mean change from a pixel to the next.
"""

import argparse
import platform
import resource
import sys
from pathlib import Path

import numpy as np
from PIL import Image

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE.parent / "scene")]

from film import warp_rmse  # noqa: E402

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.package.feature_codes import EXACT  # noqa: E402
from shapeshift.runtime_models.package.read_package import read_package  # noqa: E402
from shapeshift.runtime_models.package.write_package import write_package  # noqa: E402
from shapeshift.scene.cameras.framing import default_background, orbit_path  # noqa: E402
from shapeshift.scene.pose import View  # noqa: E402
from shapeshift.training.evaluation.evaluate import ModelRenderer  # noqa: E402
from shapeshift.training.style_features.named_styles import MADE_STYLES  # noqa: E402
from shapeshift.training.style_features.nnfm_pictures import (  # noqa: E402
    VggStyle,
    covered_part,
    nnfm_pictures,
)
from shapeshift.training.style_features.splat_features import (  # noqa: E402
    StylePreview,
    drawn,
    recolor_rule,
    scene_views,
)
from shapeshift.training.styles.add_style import (  # noqa: E402
    BEHIND,
    NewStyle,
    add_style,
    drift_db,
)
from shapeshift.training.styles.image_network import resized  # noqa: E402
from shapeshift.training.styles.train_stop import dome_views  # noqa: E402

COLUMNS = (
    "scene,way,style,once_s,cpu_s,bytes,bytes_before,drift_db,nnfm_source,nnfm,warp3_source,warp3,"
    "warp24_source,warp24,gradient_source,gradient"
)
SIZE, LOOKED_AT = (384, 288), (256, 192)  # of the views that are compared, and for nnfm
PLACES, STEP_DEG, FAR = 4, 3.0, 8  # places about the scene; views there are 3 and 24 degrees apart
STYLE_PX = 256


def cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def path_of(model) -> list[list[View]]:
    """At each of PLACES, three views: the first, and others 3 and 24 degrees beside it."""
    around = dome_views(model, 1, SIZE)[0]
    centre = np.median(model.anchors, axis=0)
    away = float(np.linalg.norm(around.world_from_eye.position - centre))
    count = round(360 / STEP_DEG)
    ring = orbit_path(count, centre, away / 2.8, SIZE, distance=away, elevation=0.5)
    return [[ring[i], ring[i + 1], ring[i + FAR]] for i in range(0, count, count // PLACES)]


def seen(device, model, name: str, path: list[list[View]], behind) -> list[list[tuple]]:
    """(picture, metres, coverage) of every view of a stop."""
    renderer = ModelRenderer(device, model)
    renderer.set_control(next(stop.x for stop in model.stops if stop.name == name))
    found = []
    for group in path:
        row = []
        for view in group:
            picture, metres = drawn(device, renderer, view, behind)
            through = device.download(renderer.draw(view, behind)[2].transmittance)
            row.append((picture, metres, 1 - through))
        found.append(row)
    return found


def measures(path: list[list[View]], stacks: list[list[tuple]], style: VggStyle) -> list[float]:
    """nnfm of what is covered, warp error near and far, and the mean gradient."""
    near, far = (
        float(np.nanmean([warp_rmse(p[0], s[0], p[k], s[k])
                          for p, s in zip(path, stacks, strict=True)])) for k in (1, 2)
    )  # fmt: skip
    likeness = []
    for group in stacks:
        picture, _, coverage = group[0]
        factor = SIZE[0] // LOOKED_AT[0] if SIZE[0] % LOOKED_AT[0] == 0 else SIZE[0] / LOOKED_AT[0]
        rows, columns = (
            slice(int(s.start / factor), int(s.stop / factor)) for s in covered_part(coverage)
        )
        losses, _ = style(resized(picture, LOOKED_AT)[rows, columns])
        likeness.append(losses["nnfm.relu3_1"])
    change = [np.abs(np.diff(image, axis=1)).mean() for group in stacks for image, *_ in group]
    return [float(np.mean(likeness)), near, far, float(np.mean(change))]


def by_turns(device, model, vgg: Path, picture: np.ndarray, behind, steps: int):
    """(seconds once, the model with the new stop), as `style --image --vgg` makes it."""
    source = model.stops[0].name
    pictures, views = nnfm_pictures(vgg, [picture]), dome_views(model, 24, (256, 192))
    style = NewStyle("Style", source, source, steps=steps)
    return 0.0, add_style(device, model, style, pictures, views)


def as_preview(device, model, vgg: Path, picture: np.ndarray, behind, steps: int):
    """The same without training, as `style --quality preview` makes it."""
    began, source = cpu_s(), model.stops[0]
    preview = StylePreview(device, model, source.name, vgg, scene_views(model), behind)
    once = cpu_s() - began
    rule = recolor_rule(preview.colors(picture))
    style = NewStyle("Style", source.name, source.name)
    return once, add_style(device, model, style, recolor=rule)


WAYS = {"turns": by_turns, "preview": as_preview}


def row_of(device, scene: Path, way: str, name: str, arguments) -> str:
    model = read_package(scene)
    behind, picture = default_background(model, BEHIND), MADE_STYLES[name](STYLE_PX, 0)
    began = cpu_s()
    once, made = WAYS[way](device, model, arguments.vgg, picture, behind, arguments.steps)
    spent = cpu_s() - began - once
    folder = arguments.pictures
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{scene.stem}_{way}_{name}.shift"
    size = write_package(made, file, EXACT)
    made = read_package(file)
    drift = min(drift_db(device, model, made).values())
    path, style = path_of(model), VggStyle(arguments.vgg, [picture])
    before, after = (seen(device, m, n, path, behind)
                     for m, n in ((model, model.stops[0].name), (made, "Style")))  # fmt: skip
    one, other = measures(path, before, style), measures(path, after, style)
    sheet = [[group[0][0] for group in stacks] for stacks in (before, after)]
    rows = np.concatenate([np.concatenate(row, axis=1) for row in sheet])
    save(folder / f"{scene.stem}_{way}_{name}.png", rows)
    numbers = [f"{value:.4f}" for pair in zip(one, other, strict=True) for value in pair]
    head = [scene.stem, way, name, f"{once:.1f}", f"{spent:.1f}", size, scene.stat().st_size]
    return ",".join(map(str, [*head, f"{drift:.1f}", *numbers]))


def save(path: Path, picture: np.ndarray) -> None:
    Image.fromarray((np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8)).save(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    vgg = HERE.parents[2] / "shared/data/models_vgg16/vgg16_caffe_relu1_2-4_3.onnx"
    parser.add_argument("--vgg", type=Path, default=vgg)
    parser.add_argument("--pictures", type=Path, required=True)
    parser.add_argument("--only", nargs="*", default=list(WAYS))
    parser.add_argument("--styles", nargs="*", default=list(MADE_STYLES))
    parser.add_argument("--steps", type=int, default=400)
    arguments = parser.parse_args()
    device = open_device(None)
    known = arguments.out.read_text().splitlines() if arguments.out.exists() else []
    lines = [line for line in known if not line.startswith(("#", "scene,"))]
    for way in arguments.only:
        for name in arguments.styles:
            line = row_of(device, arguments.scene, way, name, arguments)
            lines = [each for each in lines if each.split(",")[:3] != line.split(",")[:3]]
            lines.append(line)
            sys.stdout.write(line + "\n")
            sys.stdout.flush()
            head = [
                "# python tools/training/style_images.py SCENE --out docs/bench/style_images.csv "
                "--pictures FOLDER",
                f"# {arguments.steps} steps of turns; {platform.machine()}, seconds of a processor "
                "that others used too",
                COLUMNS,
            ]
            arguments.out.write_text("\n".join([*head, *sorted(lines)]) + "\n")


if __name__ == "__main__":
    main()
