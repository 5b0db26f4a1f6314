"""The five heads on the device against plain numpy in float64, forward and backward."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import HEADS, SIZE_PER_SPLAT, ControlEncoding, Stop
from shapeshift.runtime_models.package.read_package import read_files
from shapeshift.runtime_models.package.write_package import package_files
from shapeshift.training.export import model_of
from shapeshift.training.heads.gaussians import Activation, Gaussians
from shapeshift.training.heads.networks import (
    ANCHOR_ATTRIBUTES,
    ATTRIBUTE_WIDTH,
    HeadLayout,
    Heads,
    initial_weights,
    padded,
)
from tests.support.models import psi_of
from tests.support.renderer.rasterizer_reference import finite_differences
from tests.support.training.reference import (
    activate_reference,
    directions,
    head_inputs,
    heads_reference,
)

FORMS = ("cpu", "gpu")
VOXEL = 0.05
EYE = np.array([2.0, 1.0, 1.5])


def model(layout: HeadLayout, count: int, seed: int = 0):
    """(weights, anchors, features, control): everything active, so that no gradient is trivial."""
    rng = np.random.default_rng(seed)
    anchors = rng.normal(size=(count, 3)).astype(np.float32)
    features = np.zeros((count, padded(layout.features)), np.float32)
    features[:, : layout.features] = rng.normal(size=(count, layout.features))
    control = rng.random(layout.control).astype(np.float32)
    return initial_weights(layout, rng), anchors, features, control


def plain_heads(layout, networks, anchors, features, control):
    """(units, raw) of every head by name, float64."""
    real = features[:, : layout.features].astype(np.float64)
    return heads_reference(layout, networks, real, directions(anchors, EYE), control)


def raw_of(raw, layout, name):
    head = HEADS.index(name)
    start = layout.raw_at[head]
    return raw[:, start : start + layout.outs[head]]


def relative(found, wanted) -> float:
    return float(np.abs(found - wanted).max() / max(np.abs(wanted).max(), 1e-30))


EVERY = tuple(ANCHOR_ATTRIBUTES)
LAYOUTS = [
    HeadLayout(splats=5),
    HeadLayout(splats=10),
    HeadLayout(splats=1, features=1, hidden=1, control=1),
    HeadLayout(splats=3, features=7, hidden=9, control=5, attributes=EVERY),
    HeadLayout(splats=4, features=32, hidden=64, control=16, attributes=EVERY),
    HeadLayout(splats=2, features=8, hidden=16),
    HeadLayout(splats=2, features=5, hidden=130),
    HeadLayout(splats=3, features=7, hidden=9, control=5, view_dependent=False, attributes=EVERY),
    HeadLayout(splats=3, features=7, hidden=9, control=5, attributes=()),
    HeadLayout(splats=3, features=7, hidden=9, control=5, attributes=("frame",)),
    HeadLayout(splats=3, features=7, hidden=9, attributes=("color",)),
    HeadLayout(splats=3, features=7, hidden=9, attributes=("light",)),
    HeadLayout(splats=3, features=7, hidden=9, attributes=("light",), light_channels=1),
    HeadLayout(splats=3, features=7, hidden=9, control=5, fixed=("offset", "scale", "rotation")),
    HeadLayout(splats=2, hidden=12, fixed=HEADS, view_dependent=False),
]


@pytest.mark.parametrize("layout", LAYOUTS, ids=str)
def test_pack_then_unpack_is_the_identity(layout):
    rng = np.random.default_rng(1)
    networks = {}
    for name in HEADS:
        out = layout.splats * SIZE_PER_SPLAT[name]
        widths = [len(layout.first_rows(name)), layout.hidden, out]
        shapes = [s for i, o in pairwise(widths) for s in ((o, i), o)]
        networks[name] = tuple(rng.normal(size=s).astype(np.float32) for s in shapes)
    flat = layout.pack(networks)
    for name, arrays in layout.unpack(flat).items():
        for found, wanted in zip(arrays, networks[name], strict=True):
            np.testing.assert_array_equal(found, wanted)
    assert np.count_nonzero(flat) == sum(a.size for n in networks.values() for a in n)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("layout", LAYOUTS, ids=str)
def test_forward_equals_plain_numpy(device, layout, form):
    heads = Heads(device, layout, form)
    for count in (1, 3, 4, 5, 8, 9, 129):
        weights, anchors, features, control = model(layout, count)
        arrays = map(device.upload, (weights, anchors, features))
        raw = device.download(heads.forward(*arrays, control, EYE))
        wanted = plain_heads(layout, layout.unpack(weights), anchors, features, control)
        for name in HEADS:
            assert relative(raw_of(raw, layout, name), wanted[name][1]) < 2e-6, (count, name)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("layout", LAYOUTS, ids=str)
def test_backward_equals_plain_numpy(device, layout, form):
    heads = Heads(device, layout, form)
    for count in (1, 7, 8, 9, 137):
        check_backward(device, heads, count)


def check_backward(device, heads: Heads, count: int) -> None:
    layout = heads.layout
    weights, anchors, features, control = model(layout, count)
    rng = np.random.default_rng(5)
    on_device = [device.upload(a) for a in (weights, anchors, features)]
    heads.forward(*on_device, control, EYE)
    grad_raw = np.zeros((count, layout.raw_at[-1]), np.float32)
    for name in HEADS:
        raw_of(grad_raw, layout, name)[:] = rng.normal(size=raw_of(grad_raw, layout, name).shape)
    before = rng.normal(size=anchors.shape).astype(np.float32)
    grad_anchors = device.upload(before)
    grads = heads.backward(*on_device, device.upload(grad_raw), grad_anchors)
    grad_weights, grad_features = (device.download(g) for g in grads)

    networks = layout.unpack(weights)
    plain = plain_heads(layout, networks, anchors, features, control)
    found = layout.unpack(grad_weights)
    wanted_features, flow = np.zeros((count, layout.features)), np.zeros((count, 3))
    for name in HEADS:
        w1, *_ = (a.astype(np.float64) for a in networks[name])
        parts = layout.parts_of(name)
        inputs = head_inputs(
            parts, features[:, : layout.features], directions(anchors, EYE), control
        )
        flowing = raw_of(grad_raw, layout, name).astype(np.float64)
        takes, wanted = [inputs, *plain[name][0]], []
        for layer in (1, 0):
            wanted = [flowing.T @ takes[layer], flowing.sum(0), *wanted]
            if layer:
                weight = networks[name][2 * layer].astype(np.float64)
                flowing = (flowing @ weight) * (takes[layer] > 0)
        for got, want in zip(found[name], wanted, strict=True):
            assert relative(got, want) < 5e-6, (count, name)
        wanted_features += (flowing @ w1)[:, : layout.features]
        if "direction" in parts:
            flow = (flowing @ w1)[:, layout.features : layout.features + 3]
    assert relative(grad_features[:, : layout.features], wanted_features) < 5e-6, count
    away = anchors - EYE
    length = np.linalg.norm(away, axis=1, keepdims=True)
    unit = away / length
    through_direction = (flow - unit * (flow * unit).sum(1, keepdims=True)) / length
    added = device.download(grad_anchors) - before
    assert np.abs(added - through_direction).max() < 5e-6 * max(np.abs(before).max(), 1), count


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "layout", [x for x in LAYOUTS if x.features == 7 or x.fixed or not x.view_dependent], ids=str
)
def test_padding_and_what_no_head_sees_never_learn(device, layout, form):
    weights, anchors, features, control = model(layout, 20)
    on_device = [device.upload(a) for a in (weights, anchors, features)]
    heads = Heads(device, layout, form)
    heads.forward(*on_device, control, EYE)
    grad_raw = np.zeros((20, layout.raw_at[-1]), np.float32)
    for name in HEADS:
        raw_of(grad_raw, layout, name)[:] = 1
    moved = device.zeros((20, 3))
    grads = heads.backward(*on_device, device.upload(grad_raw), moved)
    assert layout.view_dependent == bool(device.download(moved).any())
    grad_weights, grad_features = (device.download(g) for g in grads)
    np.testing.assert_array_equal(layout.pack(layout.unpack(grad_weights)), grad_weights)
    assert not grad_features[:, layout.features :].any()


@pytest.mark.parametrize("form", FORMS)
def test_an_eye_at_an_anchor_is_finite(device, form):
    layout = HeadLayout(splats=2)
    weights, anchors, features, control = model(layout, 4)
    anchors[2] = EYE
    on_device = [device.upload(a) for a in (weights, anchors, features)]
    heads = Heads(device, layout, form)
    raw = heads.forward(*on_device, control, EYE)
    grads = heads.backward(*on_device, raw, device.zeros((4, 3)))
    for array in (raw, *grads):
        assert np.isfinite(device.download(array)).all()


def activated(layout, raw, rows):
    """Splats of raw outputs (A, RAW) in float64, fields in the order of Gaussians."""
    raw = raw.astype(np.float64)
    anchors, *own = (rows[n].astype(np.float64) for n in ("anchors", *ATTRIBUTE_WIDTH))
    by_head = {n: raw_of(raw, layout, n) for n in HEADS}
    return activate_reference(by_head, anchors, VOXEL, *own, directions(anchors, EYE))


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("spread", [0.5, 20.0])  # 20: every activation saturates somewhere
def test_activations_and_their_gradient(device, spread, channels):
    layout = HeadLayout(splats=3, attributes=EVERY, light_channels=channels)
    rng = np.random.default_rng(2)
    anchors = rng.normal(size=(21, 3)).astype(np.float32)
    raw = (spread * rng.normal(size=(21, layout.raw_at[-1]))).astype(np.float32)
    activation = Activation(device, layout, VOXEL)
    own = {n: rng.normal(0, 0.7, (21, width)) for n, width in layout.widths.items()}
    rows = {"anchors": anchors} | {n: a.astype(np.float32) for n, a in own.items()}
    there = {name: device.upload(array) for name, array in rows.items()}
    splats = activation.forward(device.upload(raw), there, EYE)
    wanted = activated(layout, raw, rows)
    for got, want in zip(splats.fields(), wanted, strict=True):
        assert relative(device.download(got), want) < 1e-6
    grads = [rng.normal(size=w.shape).astype(np.float32) for w in wanted]
    on_device = Gaussians(*(device.upload(g) for g in grads))
    grad_raw, by_group = activation.backward(device.upload(raw), there, on_device)
    found = device.download(grad_raw)

    def scalar(values):
        return sum(
            (a * g).sum() for a, g in zip(activated(layout, values, rows), grads, strict=True)
        )

    step, real = (
        1e-6,
        np.concatenate(
            [np.arange(s, s + n) for s, n in zip(layout.raw_at, layout.outs, strict=False)]
        ),
    )
    for column in real:
        for row in rng.choice(21, 4, replace=False):
            up, down = (raw.astype(np.float64) for _ in range(2))
            up[row, column] += step
            down[row, column] -= step
            numeric = (scalar(up) - scalar(down)) / (2 * step)
            assert abs(found[row, column] - numeric) < 2e-6 * max(abs(numeric), 1)
    unused = np.setdiff1d(np.arange(layout.raw_at[-1]), real)
    assert not found[:, unused].any()
    for name in ("anchors", "light"):  # which light show depends on where an anchor stands

        def scalar_of(values, name=name):
            splats = activated(layout, raw, rows | {name: values})
            return sum((a * g).sum() for a, g in zip(splats, grads, strict=True))

        numeric = finite_differences(scalar_of, rows[name].astype(np.float64))
        np.testing.assert_allclose(device.download(by_group[name]), numeric, atol=1e-5)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"fixed": ("colour",)}, "no head 'colour' to fix"),
        ({"attributes": ("size",)}, "no attribute 'size'"),
    ],
)  # fmt: skip
def test_networks_that_cannot_be_are_refused(wrong, sentence):
    with pytest.raises(ValueError, match=sentence):
        HeadLayout(**wrong)


def test_rates_shrink_behind_wide_layers():
    for plain in (HeadLayout(), HeadLayout(hidden=8), HeadLayout(fixed=HEADS)):
        assert (plain.rate_shares() == 1).all()
    layout = HeadLayout(splats=2, hidden=64)
    shares = layout.unpack(layout.rate_shares())
    for name in HEADS:
        found = [np.unique(array).tolist() for array in shares[name]]
        assert found == [[1], [1], [0.5], [1]]


def test_what_a_head_does_not_see_changes_no_other_first_weight():
    whole = HeadLayout(splats=3)
    less = replace(whole, fixed=("offset", "color"), view_dependent=False)
    mine, theirs = (
        layout.unpack(initial_weights(layout, np.random.default_rng(4))) for layout in (less, whole)
    )
    for name in HEADS:
        seen = np.isin(whole.first_rows(name), less.first_rows(name))
        np.testing.assert_array_equal(mine[name][0], theirs[name][0][:, seen])
        for ours, full in zip(mine[name][1:], theirs[name][1:], strict=True):
            np.testing.assert_array_equal(ours, full)


@pytest.mark.parametrize("layout", LAYOUTS, ids=str)
def test_a_package_of_every_layout_decodes_as_the_kernels_do(device, layout):
    weights, anchors, features, _ = model(layout, 21)
    encoding, stops = ControlEncoding(layout.control), (Stop("RGB", 0.0), Stop("Heat", 1.0))
    state = {"weights.value": weights, "anchors.value": anchors, "features.value": features}
    rng = np.random.default_rng(5)
    widths = {n: layout.widths[n] for n in layout.per_anchor[2:]}
    own = {n: rng.normal(size=(21, w)).astype(np.float32) for n, w in widths.items()}
    state |= {f"{n}.value": array for n, array in own.items()}
    exported = model_of(state, layout, VOXEL, encoding, stops, {})
    files = package_files(exported, "float32")
    read = read_files(files.__getitem__, "test")
    taken = {n: read.networks[n].inputs for n in HEADS}
    assert ("light" in taken["color"]) == ("light" in layout.per_anchor) == (read.light is not None)
    taken["color"] = tuple(part for part in taken["color"] if part != "light")
    assert taken == {n: layout.parts_of(n) for n in HEADS}
    heads, activation = Heads(device, layout), Activation(device, layout, VOXEL)
    on_device = [device.upload(a) for a in (weights, anchors, features)]
    there = {"anchors": on_device[1]} | {n: device.upload(array) for n, array in own.items()}
    colors = []
    for x in (0.0, 0.3, 1.0):
        psi = psi_of(read, x).astype(np.float32)
        raw = heads.forward(*on_device, psi, EYE)
        ours = activation.forward(raw, there, EYE)
        theirs = evaluate(read, x, EYE)
        for name in ("means", "scales", "opacity", "color"):
            mine = device.download(getattr(ours, name))
            assert np.abs(mine - getattr(theirs, name)).max() < 2e-5, name
        colors.append(theirs.color)
    assert ("color" in layout.fixed) == bool((colors[0] == colors[2]).all())
