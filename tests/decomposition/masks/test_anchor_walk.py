"""Walks over anchors: graphs whose answer is known, and models with stops."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from shapeshift.decomposition.masks.anchor_walk import (
    AnchorGraph,
    Nodes,
    make_graph,
    nodes_of,
    normals_of,
    seeds_of_evidence,
)
from tests.support.models import make_random_model

EYES = np.array([[0, 2.0, 3.0]])


def path_graph(count: int, weights: np.ndarray | None = None) -> AnchorGraph:
    """Nodes in a row."""
    one = sparse.diags_array(np.ones(count - 1) if weights is None else weights, offsets=1)
    matrix = sparse.csr_array(one + one.T)
    means = np.arange(3 * count).reshape(-1, 3).astype(float)
    nodes = Nodes(count, np.arange(count), means, np.zeros((count, 3)))
    return AnchorGraph(nodes, matrix, np.asarray(matrix.sum(axis=1)).ravel())


def test_shares_fall_as_the_voltage_along_a_wire():
    """Equal resistors: a straight line; a resistor of ten times falls ten times as much."""
    seeds = np.full(11, -1)
    seeds[0], seeds[-1] = 1, 0
    np.testing.assert_allclose(
        path_graph(11).shares(seeds)[:, 1], 1 - np.arange(11) / 10, atol=1e-4
    )
    weights = np.ones(10)
    weights[4] = 0.1
    voltage = 1 - np.r_[0, (1 / weights).cumsum()] / (1 / weights).sum()
    np.testing.assert_allclose(path_graph(11, weights).shares(seeds)[:, 1], voltage, atol=1e-4)


def test_shares_add_up_to_one():
    rng = np.random.default_rng(0)
    graph = make_graph(
        Nodes(300, np.arange(300), rng.normal(size=(300, 3)), rng.random((300, 3))), EYES
    )
    seeds = np.full(300, -1)
    seeds[:4] = 0, 1, 2, 2
    without = seeds.copy()
    without[0] = -1  # no seed of label 0: the others share everything
    for here in (seeds, without):
        shares = graph.shares(here, 3)
        assert shares.min() >= 0 and shares.max() <= 1
        np.testing.assert_allclose(shares.sum(1), 1, atol=1e-3)
        assert (shares.argmax(1)[here >= 0] == here[here >= 0]).all()


def two_lumps(color: bool, gap: float = 0.0) -> Nodes:
    """A lump of places at 0 and one beside it, touching; 400 together."""
    rng = np.random.default_rng(0)
    means = rng.random((400, 3))
    means[200:, 0] += 1 + gap
    colors = np.zeros((400, 3))
    colors[200:, 1] = color
    colors += rng.normal(0, 0.02, colors.shape)
    return Nodes(400, np.arange(400), means, colors)


@pytest.mark.parametrize(("color", "gap"), [(True, 0.0), (False, 1.0)])
def test_a_thing_ends_where_its_colour_or_its_shape_does(color, gap):
    graph = make_graph(two_lumps(color, gap), EYES)
    seeds = np.full(400, -1)
    seeds[[5, 205]] = 1, 0
    label = graph.walk(seeds)
    assert (label == np.repeat([1, 0], 200)).mean() > 0.98


def test_a_lump_joined_to_no_seed_is_background():
    nodes = two_lumps(False, gap=100.0)
    seeds = np.full(400, -1)
    seeds[5] = 1
    assert (make_graph(nodes, EYES).walk(seeds) == np.repeat([1, 0], 200)).all()


@pytest.mark.parametrize("count", [0, 1, 2, 3, 12])
def test_few_anchors(count):
    rng = np.random.default_rng(count)
    nodes = Nodes(count + 1, np.arange(count), rng.normal(size=(count, 3)), rng.random((count, 3)))
    graph = make_graph(nodes, EYES)
    seeds = np.full(count + 1, -1)
    assert not graph.walk(seeds).any()
    seeds[0] = 1
    label = graph.walk(seeds)
    assert label.shape == (count + 1,) and label[0] == (count > 0) and label[-1] == 0


def test_anchors_in_one_place_and_of_one_colour():
    nodes = Nodes(50, np.arange(50), np.zeros((50, 3)), np.zeros((50, 3)))
    with np.errstate(all="raise", under="ignore"):
        graph = make_graph(nodes, np.zeros((1, 3)))
        seeds = np.full(50, -1)
        seeds[:2] = 1, 0
        assert np.isfinite(graph.shares(seeds)).all()


def test_normals_face_the_nearest_eye():
    rng = np.random.default_rng(0)
    means = rng.random((200, 3))
    means[:, 1] = 0  # a plane
    up = normals_of(means, np.array([[0.5, 2, 0.5]]))
    np.testing.assert_allclose(up, np.tile([0, 1, 0], (200, 1)), atol=1e-9)
    np.testing.assert_allclose(normals_of(means, np.array([[0.5, -2, 0.5]])), -up, atol=1e-9)


def test_nodes_are_the_anchors_that_are_there():
    model = make_random_model(anchors=40, k=3, features=4, hidden=(4,))
    nodes = nodes_of(model, EYES[0])
    assert nodes.count == 40 and len(nodes.rows) == len(nodes.means) == len(nodes.colors)
    thermal = sum(stop.kind == "thermal" for stop in model.stops)
    assert nodes.colors.shape[1] == 3 * (len(model.stops) - thermal) + thermal
    assert nodes.colors.min() >= 0 and nodes.colors.max() <= 1
    gone = replace(model, networks=model.networks | {"opacity": replace(
        model.networks["opacity"], gain=-1e-9)})  # fmt: skip
    assert len(nodes_of(gone, EYES[0]).rows) == 0


def test_seeds_are_what_a_mask_shows_clearly():
    inside = np.array([0.0, 0.5, 9.0, 8.5, 8.6, 1.0, 0.99, 5.0])
    outside = np.array([0.0, 0.5, 0.0, 1.5, 1.4, 9.0, 9.01, 5.0])
    assert seeds_of_evidence(inside, outside).tolist() == [-1, -1, 1, -1, 1, -1, 0, -1]
