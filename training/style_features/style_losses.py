"""Losses between the features of a picture and those of a style, as nodes of an ONNX graph.

Features are (C, N): C channels at N places.  Every loss is one number that does not depend on how
large the features of a network are, so that one set of weights serves every layer.
"""

import numpy as np

from shapeshift.training.gradients.onnx_graph import OnnxGraph

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
