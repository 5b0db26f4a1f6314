"""Previews without training beside 3SGS's own form, part by part: what each is worth and costs.

    python tools/training/zero_shot.py SCENE --out docs/bench/zero_shot.csv --pictures FOLDER

embedding: `carried` is the mean of what the views see at a splat, in its principal axes; `trained`
is 3SGS 2.1, 32 numbers a splat and an affine map, by L1 on rendered features, Adam, through our
rasterizer.  decoder: `nearest` takes the colour of the style's nearest place, mean over 8
neighbours; `linear` is one 3-D convolution over them, in closed form; `cnn` is 3SGS 2.3, two layers
over 8 neighbours with a sigmoid, trained on the scene and the style pictures at hand.
content_rmse: the scene's own colours from its features without a style.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE.parent / "scene"), str(HERE)]

from style_images import STYLE_PX, cpu_s, measures, path_of, save  # noqa: E402

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.package.read_package import read_package  # noqa: E402
from shapeshift.scene.cameras.framing import default_background  # noqa: E402
from shapeshift.training.drawing import draw_splats, splats_backward  # noqa: E402
from shapeshift.training.evaluation.evaluate import ModelRenderer  # noqa: E402
from shapeshift.training.heads.gaussians import Gaussians  # noqa: E402
from shapeshift.training.style_features import zero_shot  # noqa: E402
from shapeshift.training.style_features.made_styles import MADE_STYLES  # noqa: E402
from shapeshift.training.style_features.splat_features import (  # noqa: E402
    LAYERS,
    NUMBERS,
    carry_features,
    drawn,
    scene_views,
)
from shapeshift.training.style_features.vgg_features import VggFeatures  # noqa: E402
from shapeshift.training.style_features.vgg_style import VggStyle  # noqa: E402
from shapeshift.training.styles.add_style import BEHIND  # noqa: E402

COLUMNS = (
    "scene,embedding,decoder,style,embedding_s,decoder_s,style_s,content_rmse,nnfm_source,nnfm,"
    "warp3_source,warp3,warp24_source,warp24,gradient_source,gradient"
)
PASSES, HIDDEN, BATCH, DECODER_STEPS = 5, 64, 2048, 600
BLACK = (0.0, 0.0, 0.0)


class Adam:
    """The optimiser, for a few arrays of numpy."""

    def __init__(self, rate: float, *arrays: np.ndarray) -> None:
        self.rate, self.arrays, self.step = rate, arrays, 0
        self.first = [np.zeros_like(a) for a in arrays]
        self.second = [np.zeros_like(a) for a in arrays]

    def update(self, *gradients: np.ndarray) -> None:
        self.step += 1
        rows = zip(self.arrays, gradients, self.first, self.second, strict=True)
        for array, gradient, first, second in rows:
            first += 0.1 * (gradient - first)
            second += 0.001 * (gradient**2 - second)
            size = np.sqrt(second / (1 - 0.999**self.step)) + 1e-8
            array -= self.rate * first / (1 - 0.9**self.step) / size


def trained_embedding(device, model, vgg: Path, scene, behind):
    """3SGS 2.1: (n, 32) and A, b such that A f + b, rendered, is what VGG16 sees."""
    renderer, network = ModelRenderer(device, model), VggFeatures(vgg, tuple(n for n, _ in LAYERS))
    renderer.set_control(model.stops[0].x)
    rng = np.random.default_rng(0)
    low = np.zeros((model.splat_count, NUMBERS + 1), np.float32)
    low[:, -1] = 1  # what is rendered of it is the sum of the weights w
    low[:, :NUMBERS] = 0.1 * rng.normal(size=(len(low), NUMBERS))
    channels = len(scene.center)
    a = rng.normal(size=(NUMBERS, channels)).astype(np.float32) / np.sqrt(NUMBERS)
    b = np.zeros(channels, np.float32)
    optimiser = Adam(0.02, low, a, b)
    views = scene_views(model)
    targets = []
    for view in views:
        maps = network(drawn(device, renderer, view, behind)[0])
        height, width = maps["relu3_1"].shape[1:]
        half = maps["relu2_1"][:, : 2 * height, : 2 * width]
        half = half.reshape(-1, height, 2, width, 2).mean(axis=(2, 4))
        both = np.concatenate([half, maps["relu3_1"]]).reshape(channels, -1).T
        targets.append((both - scene.center) / (scene.deviation + 1e-3))
    for step in range(PASSES * len(views)):
        view = views[step % len(views)].resized((width, height))
        shown, drawings = render_all(device, renderer, low, view)
        error = shown[:, :NUMBERS] @ a + shown[:, NUMBERS:] * b - targets[step % len(views)]
        slope = np.sign(error) * (shown[:, NUMBERS:] > 0.5) / len(error)
        back = slope @ a.T / channels
        gradient = render_back(device, drawings, back, (height, width), len(low))
        optimiser.update(gradient, shown[:, :NUMBERS].T @ slope / channels,
                         (slope * shown[:, NUMBERS:]).sum(axis=0) / channels)  # fmt: skip
        optimiser.rate = 0.02 * 0.1 ** (step / (PASSES * len(views)))
    axes = a * (scene.deviation + 1e-3)
    # The axes at right angles, so that AdaIN is the same formula.
    q, r = np.linalg.qr(axes.T.astype(np.float64))
    moved = low[scene.rows, :NUMBERS] @ r.T + (b * (scene.deviation + 1e-3)) @ q
    return replace(scene, low=moved.astype(np.float32), axes=q.T.astype(np.float32))


def render_all(device, renderer, low: np.ndarray, view):
    """(pixels, 33) of the splats' numbers, blended, three a pass; and the drawings."""
    means, scales, wxyz, opacity = renderer.geometry
    found, drawings = [], []
    for at in range(0, low.shape[1], 3):
        three = np.ascontiguousarray(low[:, at : at + 3])
        drawing = draw_splats(
            device, Gaussians(means, scales, wxyz, opacity, device.upload(three)), view, BLACK
        )
        image = device.download(drawing.frame.image)
        found.append(image.reshape(3, -1).T.copy())
        drawings.append(drawing)
    return np.concatenate(found, axis=1), drawings


def render_back(device, drawings, back: np.ndarray, size, count: int) -> np.ndarray:
    """(count, 33) gradients of the splats' numbers; of the weights none."""
    padded = np.concatenate([back, np.zeros((len(back), 1))], axis=1).astype(np.float32)
    found = []
    for i, drawing in enumerate(drawings):
        planes = np.ascontiguousarray(padded[:, 3 * i : 3 * i + 3].T.reshape(3, *size))
        grad, _ = splats_backward(device, drawing, device.upload(planes))
        found.append(device.download(grad.color).reshape(count, 3).copy())
    return np.concatenate(found, axis=1)


def own_colors(scene):
    """The scene as its own style: what AdaIN leaves as it is."""
    features = scene.low @ scene.axes + scene.center
    return zero_shot.StyleFeatures(
        scene.low, scene.colors, features.mean(axis=0), features.std(axis=0)
    )


class Nearest:
    """Ours."""

    def __init__(self, scene, styles) -> None:
        self.scene = scene

    def content(self) -> np.ndarray:
        return zero_shot.styled_colors(self.scene, own_colors(self.scene))

    def style(self, style) -> np.ndarray:
        return zero_shot.styled_colors(self.scene, style)


def gathered(low: np.ndarray, neighbours: np.ndarray) -> np.ndarray:
    return np.concatenate([low, low[neighbours].mean(axis=1), np.ones((len(low), 1))], axis=1)


class Linear:
    """One 3-D convolution with two weights, own and neighbours', by least squares."""

    def __init__(self, scene, styles) -> None:
        self.scene = scene
        x = [gathered(scene.low, scene.neighbours)]
        x += [np.concatenate([s.low, s.low, np.ones((len(s.low), 1))], axis=1) for s in styles]
        x = np.concatenate(x)
        y = np.concatenate([scene.colors, *[s.colors for s in styles]])
        scale = np.abs(x).mean(axis=0) + 1e-6
        x = x / scale
        square = x.T @ x + 1e-2 * len(x) * np.eye(x.shape[1])
        self.weights = np.linalg.solve(square, x.T @ y) / scale[:, None]

    def content(self) -> np.ndarray:
        return gathered(self.scene.low, self.scene.neighbours) @ self.weights

    def style(self, style) -> np.ndarray:
        moved = zero_shot.adain(self.scene, style)
        return gathered(moved, self.scene.neighbours) @ self.weights


class Cnn:
    """3SGS 2.3: each neighbour with weights of its own, then a layer and a sigmoid."""

    def __init__(self, scene, styles) -> None:
        self.scene, self.size = scene, scene.low.std(axis=0) + 1e-6
        sets = [(scene.low, scene.colors, scene.neighbours)]
        side = round(len(styles[0].low) ** 0.5)
        grid = np.mgrid[:side, :side].reshape(2, -1).T
        _, near = cKDTree(grid).query(grid, k=scene.neighbours.shape[1])
        sets += [(s.low, s.colors, near) for s in styles]
        rng, k = np.random.default_rng(0), scene.neighbours.shape[1]
        self.w = [rng.normal(size=(k * NUMBERS, HIDDEN)) / np.sqrt(k * NUMBERS), np.zeros(HIDDEN),
                  rng.normal(size=(HIDDEN, 3)) / np.sqrt(HIDDEN), np.zeros(3)]  # fmt: skip
        optimiser = Adam(3e-3, *self.w)
        for step in range(DECODER_STEPS):
            low, colors, near = sets[0] if step % 2 else sets[1 + step // 2 % len(styles)]
            rows = rng.integers(len(low), size=BATCH)
            x = (low[near[rows]] / self.size).reshape(BATCH, -1)
            hidden, y = self.forward(x)
            slope = 2 * (y - colors[rows]) * y * (1 - y) / BATCH
            below = slope @ self.w[2].T * (hidden > 0)
            optimiser.update(x.T @ below, below.sum(axis=0), hidden.T @ slope, slope.sum(axis=0))

    def forward(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hidden = np.maximum(x @ self.w[0] + self.w[1], 0)
        return hidden, 1 / (1 + np.exp(-(hidden @ self.w[2] + self.w[3])))

    def decoded(self, low: np.ndarray) -> np.ndarray:
        near = self.scene.neighbours
        return self.forward((low[near] / self.size).reshape(len(near), -1))[1]

    def content(self) -> np.ndarray:
        return self.decoded(self.scene.low)

    def style(self, style) -> np.ndarray:
        return self.decoded(zero_shot.adain(self.scene, style))


DECODERS = {"nearest": Nearest, "linear": Linear, "cnn": Cnn}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    vgg = HERE.parents[2] / "shared/data/models_vgg16/vgg16_caffe_relu1_2-4_3.onnx"
    parser.add_argument("--vgg", type=Path, default=vgg)
    parser.add_argument("--pictures", type=Path, required=True)
    arguments = parser.parse_args()
    arguments.pictures.mkdir(parents=True, exist_ok=True)
    device, model = open_device(None), read_package(arguments.scene)
    behind = default_background(model, BEHIND)
    path, renderer = path_of(model), ModelRenderer(device, model)
    renderer.set_control(model.stops[0].x)
    stacks = []
    for group in path:
        row = []
        for view in group:
            through = device.download(renderer.draw(view, behind)[2].transmittance)
            row.append((*drawn(device, renderer, view, behind), 1 - through))
        stacks.append(row)
    pictures = {name: draw(STYLE_PX, 0) for name, draw in MADE_STYLES.items()}
    began = cpu_s()
    carried = carry_features(device, model, model.stops[0].x, arguments.vgg, scene_views(model),
                             behind)  # fmt: skip
    scenes = {"carried": (cpu_s() - began, carried)}
    began = cpu_s()
    trained = trained_embedding(device, model, arguments.vgg, carried, behind)
    scenes["trained"] = cpu_s() - began, trained
    lines = []
    for embedding, (once, scene) in scenes.items():
        styles = {n: zero_shot.style_features(arguments.vgg, p, scene) for n, p in pictures.items()}
        for decoder, make in DECODERS.items():
            began = cpu_s()
            made = make(scene, list(styles.values()))
            spent = cpu_s() - began
            rmse = float(np.sqrt(((made.content() - scene.colors) ** 2).mean()))
            rows = []
            for name in styles:
                began = cpu_s()
                fresh = zero_shot.style_features(arguments.vgg, pictures[name], scene)
                colors = zero_shot.all_colors(scene, made.style(fresh))
                each = cpu_s() - began
                shown = [
                    [(zero_shot.draw_preview(device, renderer, colors, view, behind), *s[1:])
                     for view, s in zip(group, stack, strict=True)]
                    for group, stack in zip(path, stacks, strict=True)
                ]  # fmt: skip
                rows.append(np.concatenate([group[0][0] for group in shown], axis=1))
                judge = VggStyle(arguments.vgg, [pictures[name]])
                both = measures(path, stacks, judge), measures(path, shown, judge)
                numbers = [f"{v:.4f}" for pair in zip(*both, strict=True) for v in pair]
                head = [arguments.scene.stem, embedding, decoder, name, f"{once:.1f}",
                        f"{spent:.1f}", f"{each:.2f}", f"{rmse:.4f}"]  # fmt: skip
                lines.append(",".join([*head, *numbers]))
                sys.stdout.write(lines[-1] + "\n")
                sys.stdout.flush()
            save(arguments.pictures / f"{embedding}_{decoder}.png", np.concatenate(rows))
    header = ["# python tools/training/zero_shot.py SCENE --out docs/bench/zero_shot.csv "
              "--pictures FOLDER", COLUMNS]  # fmt: skip
    arguments.out.write_text("\n".join([*header, *lines]) + "\n")


if __name__ == "__main__":
    main()
