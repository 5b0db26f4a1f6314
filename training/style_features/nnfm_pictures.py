"""A new stop from a style picture: strokes by VGG16's features, colours by mean and covariance."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from shapeshift.training.gradients.onnx_graph import OnnxGraph
from shapeshift.training.gradients.reverse_mode import GradientSession
from shapeshift.training.style_features.pixel_descent import DescentSettings, PixelDescent, Slope
from shapeshift.training.style_features.vgg_features import VggFeatures, as_input
from shapeshift.training.styles.style_pictures import StyleView

# How far pictures are from a style, by the features of VGG16, and the gradient by their pixels.

MOST_STYLE_FEATURES = 2048  # of a layer that NNFM looks at, picked by the seed
LAYERS = ("relu3_1",)  # ARF's block: strokes of some ten pixels


@dataclass(frozen=True)
class StyleTerms:
    """The weights of the losses, of each layer the same; 0 leaves one out."""

    nnfm: float = 1.0
    moments: float = 0.0
    gram: float = 0.0
    content: float = 0.0
    layers: tuple[str, ...] = LAYERS

    def __post_init__(self) -> None:
        if not sum((self.nnfm, self.moments, self.gram, self.content)) > 0 or not self.layers:
            raise ValueError("a style needs at least one loss and one layer")


class VggStyle:
    """Losses and gradients of pictures by one VGG16 file and some style pictures."""

    def __init__(
        self,
        path: Path,
        style: Sequence[np.ndarray],
        terms: StyleTerms | None = None,
        seed: int = 0,
    ) -> None:
        """style: pictures (H, W, 3) display sRGB 0..1, 16 pixels a side or more.  BadFile."""
        self.terms = terms or StyleTerms()
        self.vgg = VggFeatures(path, self.terms.layers)
        self.gradients = lru_cache(12)(self._open_gradients)
        self.wanted = self._wanted_of(style, seed)

    def _wanted_of(self, style: Sequence[np.ndarray], seed: int) -> dict[str, np.ndarray]:
        """What the losses compare with, by the names of the graph's inputs."""
        each = [matrices(self.vgg(picture)) for picture in style]
        rng, found = np.random.default_rng(seed), {}
        for layer in self.terms.layers:
            features = np.concatenate([of[layer] for of in each], axis=1)  # (C, N)
            if self.terms.nnfm:
                picked = rng.permutation(features.shape[1])[:MOST_STYLE_FEATURES]
                found[f"nnfm.{layer}"] = unit_rows(features[:, picked])
            if self.terms.moments:
                means, deviations = moments_of(features)
                found |= {f"means.{layer}": means, f"deviations.{layer}": deviations}
            if self.terms.gram:
                found[f"gram.{layer}"] = gram_of(features)
        return found

    def content_of(self, photo: np.ndarray) -> dict[str, np.ndarray]:
        """What the content loss compares with; nothing where there is none."""
        if not self.terms.content:
            return {}
        return {f"photo.{layer}": f for layer, f in matrices(self.vgg(photo)).items()}

    def __call__(
        self, picture: np.ndarray, content: dict[str, np.ndarray] | None = None
    ) -> tuple[dict[str, float], np.ndarray]:
        """The losses of a picture (H, W, 3) by `loss.layer`, and the gradient (H, W, 3) of all."""
        session = self.gradients((picture.shape[1], picture.shape[0]))
        given = {self.vgg.input: as_input(picture), **self.wanted, **(content or {})}
        losses, gradient = session(given)
        return losses, np.ascontiguousarray(255 * gradient[0].transpose(1, 2, 0)[..., ::-1])

    def weighted(self, losses: dict[str, float]) -> float:
        """The sum of which the gradient is."""
        weights = {name: getattr(self.terms, name.partition(".")[0]) for name in losses}
        return sum(weights[n] * value for n, value in losses.items()) / len(self.vgg.names)

    def _open_gradients(self, size: tuple[int, int]) -> GradientSession:
        graph, losses = self.vgg.read(size), {}
        for layer, name in self.vgg.names.items():
            _, channels, height, width = graph.shape(name)
            features = graph.reshape(name, (channels, height * width))
            graph.shapes[features] = channels, height * width
            for loss, weight, value in self._add_losses(graph, layer, features):
                losses[f"{loss}.{layer}"] = value, weight / len(self.vgg.names)
        return GradientSession(graph, losses, self.vgg.input)

    def _add_losses(self, graph: OnnxGraph, layer: str, features: str):
        """(name, weight, value) of every loss of one layer."""
        terms, shapes = self.terms, {name: v.shape for name, v in self.wanted.items()}

        def given(name: str) -> str:
            return graph.add_input(f"{name}.{layer}", shapes[f"{name}.{layer}"])

        if terms.nnfm:
            value = add_nnfm(graph, features, given("nnfm"))
            yield "nnfm", terms.nnfm, value
        if terms.moments:
            moments = given("means"), given("deviations")
            yield "moments", terms.moments, add_moments(graph, features, *moments)
        if terms.gram:
            yield "gram", terms.gram, add_gram(graph, features, given("gram"))
        if terms.content:
            photo = graph.add_input(f"photo.{layer}", graph.shape(features))
            yield "content", terms.content, add_content(graph, features, photo)


def matrices(maps: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """(C, N) of every layer's (C, h, w)."""
    return {layer: np.ascontiguousarray(m.reshape(len(m), -1)) for layer, m in maps.items()}


# Losses between the features of a picture and those of a style, as nodes of an ONNX graph.
#
# Features are (C, N): C channels at N places. Every loss is one number that does not depend on
# how large the features of a network are, so that one set of weights serves every layer.

TINY = 1e-8  # added to squared lengths before dividing by them


def add_nnfm(graph: OnnxGraph, features: str, style: str) -> str:
    """1 - the mean cosine of every feature and the style's nearest one (ARF, Zhang et al. 2022).

    style: (M, C) features of unit length.  Which one is nearest has no gradient.
    """
    squares = graph.sum(graph.add_node("Mul", features, features), [0])
    length = graph.add_node("Sqrt", graph.add_node("Add", squares, graph.add_constant(TINY)))
    units = graph.add_node("Div", features, length)  # (C, N)
    alike = graph.add_node("MatMul", style, units)  # (M, N) cosines
    nearest = graph.add_node("ArgMax", alike, axis=0, keepdims=0)  # (N,)
    picked = graph.add_node("Gather", style, nearest, axis=0)  # (N, C)
    across = graph.add_node("Mul", graph.add_node("Transpose", picked, perm=[1, 0]), units)
    cosines = graph.sum(across, [0], keepdims=0)  # (N,)
    return graph.add_node("Sub", graph.add_constant(1.0), mean(graph, cosines, [0]))


def add_moments(graph: OnnxGraph, features: str, means: str, deviations: str) -> str:
    """How far mean and deviation of each channel are from the style's (AdaIN, Huang 2017).

    means, deviations: (C, 1).  The squared differences, of all channels together, over the
    squares of the style's.
    """
    own_means = mean(graph, features, [1], keepdims=1)
    away = graph.add_node("Sub", features, own_means)
    variances = mean(graph, graph.add_node("Mul", away, away), [1], keepdims=1)
    spread = graph.add_node("Add", variances, graph.add_constant(TINY))
    own_deviations = graph.add_node("Sqrt", spread)
    errors = [
        squares(graph, graph.add_node("Sub", own, wanted))
        for own, wanted in ((own_means, means), (own_deviations, deviations))
    ]
    sizes = graph.add_node("Add", squares(graph, means), squares(graph, deviations))
    return graph.add_node("Div", graph.add_node("Add", *errors), at_least_tiny(graph, sizes))


def add_gram(graph: OnnxGraph, features: str, gram: str) -> str:
    """How far the products of all pairs of channels are from the style's (Gatys et al. 2016).

    gram: (C, C), their means over all places.
    """
    places = graph.shape(features)[1]
    turned = graph.add_node("Transpose", features, perm=[1, 0])
    own = graph.scale(graph.add_node("MatMul", features, turned), 1 / places)
    error = squares(graph, graph.add_node("Sub", own, gram))
    return graph.add_node("Div", error, at_least_tiny(graph, squares(graph, gram)))


def add_content(graph: OnnxGraph, features: str, photo: str) -> str:
    """The squared difference to the features of the photo (C, N), over the photo's squares."""
    error = squares(graph, graph.add_node("Sub", features, photo))
    return graph.add_node("Div", error, at_least_tiny(graph, squares(graph, photo)))


def mean(graph: OnnxGraph, value: str, axes: list[int], keepdims: int = 0) -> str:
    return graph.add_node("ReduceMean", value, axes=axes, keepdims=keepdims)


def squares(graph: OnnxGraph, value: str) -> str:
    """The sum of the squares of a matrix's numbers."""
    return graph.sum(graph.add_node("Mul", value, value), [0, 1], keepdims=0)


def at_least_tiny(graph: OnnxGraph, value: str) -> str:
    return graph.add_node("Add", value, graph.add_constant(TINY))


def unit_rows(features: np.ndarray) -> np.ndarray:
    """(N, C) float32 of unit length, of features (C, N)."""
    length = np.sqrt((features**2).sum(axis=0) + TINY)
    return np.ascontiguousarray((features / length).T, np.float32)


def moments_of(features: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(C, 1) means and deviations of features (C, N)."""
    means = features.mean(axis=1, keepdims=True, dtype=np.float64)
    deviations = np.sqrt(((features - means) ** 2).mean(axis=1, keepdims=True))
    return means.astype(np.float32), deviations.astype(np.float32)


def gram_of(features: np.ndarray) -> np.ndarray:
    """(C, C): the mean products of all pairs of channels."""
    return np.ascontiguousarray(features @ features.T / features.shape[1], np.float32)


SHOWN = 0.02  # coverage from which on a pixel belongs to what is looked at
MARGIN = 8  # pixels about it
ROUND = 32  # sides of a part are multiples of it: every size wants a network of its own


class VggPictureLoss:
    """A PictureLoss: distance to the style's features, and to what the source stop shows.

    Only the part of a picture in which the scene is goes through the network.
    """

    def __init__(self, style: VggStyle) -> None:
        self.style = style
        self.contents: dict[int, dict[str, np.ndarray]] = {}  # of views, as float16

    def at(self, view: StyleView) -> Slope:
        part = covered_part(view.coverage)
        content = self._content(view, part)

        def slope(picture: np.ndarray) -> tuple[float, np.ndarray]:
            gradient = np.zeros(picture.shape, np.float32)
            losses, gradient[part] = self.style(picture[part], content)
            return self.style.weighted(losses), gradient

        return slope

    def _content(self, view: StyleView, part: tuple[slice, slice]) -> dict[str, np.ndarray]:
        if view.number not in self.contents:
            content = self.style.content_of(np.clip(view.source[part], 0, 1))
            self.contents[view.number] = {n: f.astype(np.float16) for n, f in content.items()}
        return {n: f.astype(np.float32) for n, f in self.contents[view.number].items()}


def covered_part(coverage: np.ndarray) -> tuple[slice, slice]:
    """The rows and columns of a picture that show something; the whole where nothing is shown."""
    found = []
    for axis, side in enumerate(coverage.shape):
        there = np.flatnonzero((coverage > SHOWN).any(axis=1 - axis))
        if not len(there):
            return slice(0, coverage.shape[0]), slice(0, coverage.shape[1])
        length = there[-1] + 1 - there[0] + 2 * MARGIN
        length = min(-(-length // ROUND) * ROUND, side)
        first = (there[0] + there[-1] + 1 - length) // 2
        first = min(max(first, 0), side - length)
        found.append(slice(int(first), int(first + length)))
    return found[0], found[1]


def nnfm_pictures(
    vgg: Path,
    styles: Sequence[np.ndarray],
    terms: StyleTerms | None = None,
    settings: DescentSettings | None = None,
    seed: int = 0,
) -> PixelDescent:
    """A StylePictures of style pictures (H, W, 3) and a VGG16 file.  Raises BadFile."""
    loss = VggPictureLoss(VggStyle(vgg, styles, terms, seed))
    colors = np.concatenate([picture.reshape(-1, 3) for picture in styles])
    return PixelDescent(loss, colors, settings)
