"""How far pictures are from a style, by the features of VGG16, and the gradient by their pixels."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from shapeshift.training.gradients.gradient_session import GradientSession
from shapeshift.training.gradients.onnx_graph import OnnxGraph
from shapeshift.training.style_features import style_losses
from shapeshift.training.style_features.vgg_features import VggFeatures, as_input

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
                found[f"nnfm.{layer}"] = style_losses.unit_rows(features[:, picked])
            if self.terms.moments:
                means, deviations = style_losses.moments_of(features)
                found |= {f"means.{layer}": means, f"deviations.{layer}": deviations}
            if self.terms.gram:
                found[f"gram.{layer}"] = style_losses.gram_of(features)
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
            value = style_losses.add_nnfm(graph, features, given("nnfm"))
            yield "nnfm", terms.nnfm, value
        if terms.moments:
            moments = given("means"), given("deviations")
            yield "moments", terms.moments, style_losses.add_moments(graph, features, *moments)
        if terms.gram:
            yield "gram", terms.gram, style_losses.add_gram(graph, features, given("gram"))
        if terms.content:
            photo = graph.add_input(f"photo.{layer}", graph.shape(features))
            yield "content", terms.content, style_losses.add_content(graph, features, photo)


def matrices(maps: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """(C, N) of every layer's (C, h, w)."""
    return {layer: np.ascontiguousarray(m.reshape(len(m), -1)) for layer, m in maps.items()}
