"""Networks, files and views that colour a stop: small networks made here, and real ones."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.framing import view_from
from shapeshift.training.styles.carried_pictures import (
    CarriedPictures,
    PictureFiles,
    colors_from,
    files_for,
    read_picture,
    sampled,
)
from shapeshift.training.styles.image_network import ImageNetwork, encode_style, resized
from shapeshift.training.styles.style_pictures import StyleView, Turns
from shapeshift.training.styles.train_stop import dome_views, resized_views, turns
from tests.support.new_stops import framed_model

PICTURE = np.random.default_rng(0).uniform(size=(24, 32, 3)).astype(np.float32)


def network(path: Path, shape=(1, 3, "h", "w"), styles: int = 0, gain: float = 1.0) -> Path:
    """An ONNX file that turns a picture into its negative, or mixes that by a style's weight."""
    from onnx import TensorProto, helper, save

    def value(name, shape):
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)

    one = helper.make_tensor("one", TensorProto.FLOAT, [1], [gain])
    nodes = [helper.make_node("Sub", ["one", "picture"], ["negative"])]
    inputs, last = [value("picture", shape)], "negative"
    if styles:
        inputs.append(value("styles", [styles]))
        nodes += [
            helper.make_node("ReduceSum", ["styles"], ["sum"], keepdims=0),
            helper.make_node("Mul", ["negative", "sum"], ["mixed"]),
        ]
        last = "mixed"
    graph = helper.make_graph(nodes, "negative", inputs, [value(last, shape)], [one])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    save(model, path)
    return path


@pytest.mark.parametrize("shape", [(1, 3, "h", "w"), (1, "h", "w", 3)])
@pytest.mark.parametrize("gain", [1.0, 255.0])
def test_networks_of_either_layout_and_range(tmp_path, shape, gain):
    """0..1 or 0..255, planes or pixels: told by the file and by what it gives."""
    found = ImageNetwork(network(tmp_path / "a.onnx", shape, gain=gain), {}).stylise(PICTURE)
    np.testing.assert_allclose(found, 1 - PICTURE, atol=1e-5)


def test_a_network_of_one_size_is_given_that_size(tmp_path):
    path = network(tmp_path / "a.onnx", (1, 3, 48, 64))
    found = ImageNetwork(path, {}).stylise(PICTURE)
    assert found.shape == PICTURE.shape and found.dtype == np.float32
    np.testing.assert_allclose(found.mean(), 1 - PICTURE.mean(), atol=0.01)


def test_styles_are_blended_by_their_weights(tmp_path):
    path = network(tmp_path / "a.onnx", styles=4)
    found = ImageNetwork(path, {1: 0.25, 3: 0.5}).stylise(PICTURE)
    np.testing.assert_allclose(found, 0.75 * (1 - PICTURE), atol=1e-5)


@pytest.mark.parametrize(("weights", "styles", "wanted"), [
    ({}, 4, "knows 4 styles; --weights says which"), ({4: 1.0}, 4, "styles 0 to 3, not 4"),
    ({0: 1.0}, 0, "knows one style; leave out --weights"),
])  # fmt: skip
def test_styles_that_a_network_has_not_are_refused(tmp_path, weights, styles, wanted):
    with pytest.raises(BadFile, match=wanted):
        ImageNetwork(network(tmp_path / "a.onnx", styles=styles), weights)


def test_files_that_are_no_style_networks_are_refused(tmp_path):
    with pytest.raises(BadFile, match="is no file"):
        ImageNetwork(tmp_path / "none.onnx", {})
    (tmp_path / "a.onnx").write_bytes(b"nonsense")
    with pytest.raises(BadFile, match="is not a readable ONNX file"):
        ImageNetwork(tmp_path / "a.onnx", {})
    with pytest.raises(BadFile, match="wanted is a picture of 3 channels in"):
        ImageNetwork(network(tmp_path / "b.onnx", (1, 4, "h", "w")), {})
    with pytest.raises(BadFile, match="1 to 4096 are wanted"):
        ImageNetwork(network(tmp_path / "c.onnx", (1, 3, 5000, 8)), {}).stylise(PICTURE)


def test_real_networks_give_pictures(data):
    """multistyle26: NCHW with weights; arbitrary: NHWC of one size, its code by an encoder."""
    folder = data / "models_style"
    many = ImageNetwork(folder / "multistyle26.onnx", {12: 1.0}).stylise(PICTURE)
    code = encode_style(folder / "arbitrary_predict.onnx", PICTURE)
    any_style = ImageNetwork(folder / "arbitrary_transform.onnx", {}, code).stylise(PICTURE)
    for found in (many, any_style):
        assert found.shape == PICTURE.shape and 0 <= found.min() and found.max() <= 1
        assert found.std() > 0.02
    with pytest.raises(BadFile, match="they are not of one kind"):
        ImageNetwork(folder / "multistyle26.onnx", {}, code)


@pytest.mark.parametrize(("side", "fits"), [(15, False), (16, True), (4096, True), (4097, False)])
def test_pictures_have_16_to_4096_pixels_a_side(tmp_path, side, fits):
    Image.new("RGB", (side, 16), (255, 0, 0)).save(tmp_path / "a.png")
    if fits:
        assert read_picture(tmp_path / "a.png").shape == (16, side, 3)
        return
    with pytest.raises(BadFile, match="16 to 4096 a side are wanted"):
        read_picture(tmp_path / "a.png")


def test_broken_pictures_are_refused(tmp_path):
    Image.fromarray((PICTURE * 255).astype(np.uint8)).save(tmp_path / "a.png")
    whole = (tmp_path / "a.png").read_bytes()
    (tmp_path / "a.png").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(BadFile, match=r"is broken|not a readable image"):
        read_picture(tmp_path / "a.png")
    with pytest.raises(BadFile, match="is no file"):
        read_picture(tmp_path / "b.png")


def test_pictures_meet_cameras_by_name_or_in_order(tmp_path):
    for name in ("b.png", "a.jpg", "notes.txt"):
        (tmp_path / name).write_bytes(b"")
    a, b = tmp_path / "a.jpg", tmp_path / "b.png"
    assert files_for(tmp_path, ["b", "a"]) == [b, a]
    assert files_for(tmp_path, ["images/b.png", "images/a.png"]) == [b, a]
    assert files_for(tmp_path, ["", ""]) == [a, b]
    assert files_for(tmp_path, ["x", "y"]) == [a, b]
    with pytest.raises(BadFile, match="holds 2 pictures for 3 cameras; there is none for 'c'"):
        files_for(tmp_path, ["a", "b", "c"])
    with pytest.raises(BadFile, match="is no folder"):
        files_for(tmp_path / "none", ["a"])


def flat_view(eye, number: int = 0, size=(64, 48)) -> StyleView:
    """A view of the plane z = 0, whose picture tells the place: x and y as red and green."""
    view = view_from(np.array(eye, float), np.zeros(3), 1.0, size)
    width, height = size
    eye_from_world, fx, fy, cx, cy = view.pinhole()
    world_from_eye = np.linalg.inv(eye_from_world)
    rows, columns = np.mgrid[:height, :width] + 0.5
    rays = np.stack([(columns - cx) / fx, (rows - cy) / fy, np.ones_like(rows)], axis=-1)
    toward = rays @ world_from_eye[:3, :3].T
    depth = -world_from_eye[2, 3] / toward[..., 2]
    places = world_from_eye[:3, 3] + depth[..., None] * toward
    picture = np.concatenate([0.5 + 0.4 * places[..., :2], 0 * depth[..., None]], axis=-1)
    picture = picture.astype(np.float32)
    return StyleView(number, view, picture, np.ones(size[::-1]), depth, picture)


def test_colours_are_carried_to_where_another_view_sees_the_same_place():
    """Against the plane itself: each colour says where it was painted."""
    one, other = flat_view((0, 0, 3)), flat_view((1.0, 0.4, 2.5))
    colors, seen = colors_from(one, other, other.source)
    assert 0.4 < seen.mean() < 1
    np.testing.assert_allclose(colors[seen], one.source[seen], atol=2e-3)
    hidden = StyleView(0, other.view, other.source, other.coverage, 0.5 * other.depth_m,
                       other.source)  # fmt: skip
    assert not colors_from(one, hidden, other.source)[1].any()  # something stands before it
    bare = StyleView(0, other.view, other.source, 0 * other.coverage, other.depth_m, other.source)
    assert not colors_from(one, bare, other.source)[1].any()


class Numbered:
    """Paints each view in a colour of its own."""

    turns = Turns()

    def make(self, views, done):
        return [np.full(view.source.shape, 0.1 * (view.number + 1), np.float32) for view in views]


def test_every_place_has_the_colour_of_the_first_key_view_that_sees_it():
    eyes = ((0, 0, 3), (0.6, 0, 3), (-0.6, 0.2, 3), (0, 0, 6))
    views = [flat_view(eye, i) for i, eye in enumerate(eyes)]
    made = CarriedPictures(Numbered(), key_views=2).make(views, 0.0)
    assert (made[0] == np.float32(0.1)).all()
    for view, picture in zip(views[1:], made[1:], strict=True):
        seen = colors_from(view, views[0], views[0].source)[1]
        np.testing.assert_allclose(picture[seen], 0.1, atol=1e-6)
        assert seen.any() and (picture[~seen] > 0.15).mean() > 0.5  # but for sampled borders
    own = np.isclose(made[3], 0.4).all(axis=-1)
    assert own.any()  # what no key view sees is painted anew
    assert not np.isclose(made[3], 0.3).any()  # the third view is no key view


@pytest.mark.parametrize("size", [(1, 1), (2, 1), (3, 3)])
def test_tables_are_sampled_up_to_their_edges(size):
    height, width = size
    table = np.arange(height * width, dtype=np.float32).reshape(size)
    rows, columns = np.mgrid[:height, :width]
    np.testing.assert_allclose(sampled(table, columns + 0.5, rows + 0.5), table)
    far = np.full(size, 1e9)
    np.testing.assert_allclose(sampled(table, far, far), table[-1, -1])
    assert np.isfinite(sampled(table, np.full(size, np.nan), far)).all()


@pytest.mark.parametrize(("views", "steps", "wanted"), [
    (None, None, [([0, 1, 2], 0, 7)]),
    (2, 3, [([0, 1], 0, 3), ([2, 0], 3, 6), ([1, 2], 6, 7)]),
    (9, 7, [([0, 1, 2], 0, 7)]),
])  # fmt: skip
def test_turns_go_through_all_views_and_steps(views, steps, wanted):
    class Maker(Numbered):
        turns = Turns(views, steps)

    assert list(turns(Maker(), 3, 7)) == wanted


def test_a_dome_looks_at_the_scene_from_many_sides():
    model = framed_model(200)
    views = dome_views(model, 40, (64, 48))
    ahead = np.array([-v.world_from_eye.matrix()[:3, 2] for v in views])
    eyes = np.array([v.world_from_eye.position for v in views])
    meant = -eyes / np.linalg.norm(eyes, axis=1, keepdims=True)
    assert ((ahead * meant).sum(axis=1) > 0.9).all() and (eyes[:, 1] > 0).all()
    turn = np.sort(np.arctan2(eyes[:, 0], eyes[:, 2]))
    assert np.diff(turn).max() < 2 * np.pi / 12  # no side is left out
    assert {v.size for v in resized_views(views, 32)} == {(32, 24)}
    assert resized_views(views, 64)[0].size == (64, 48)


def test_a_scene_with_a_first_look_is_painted_from_about_there():
    from dataclasses import replace

    view = {"eye": [0.0, 0.5, 1.5], "target": [0.0, 0.0, 0.0]}
    model = replace(framed_model(50), provenance={"view": view})
    eyes = np.array([v.world_from_eye.position for v in dome_views(model, 20, (64, 48))])
    assert (eyes[:, 2] > 0).all()  # none from behind
    np.testing.assert_allclose(eyes[0], view["eye"], atol=1e-6)


def test_resizing_keeps_the_mean():
    found = resized(PICTURE, (16, 12))
    assert found.shape == (12, 16, 3)
    np.testing.assert_allclose(found.mean(), PICTURE.mean(), atol=0.02)


def test_files_are_given_in_the_order_of_their_views(tmp_path):
    for name, red in (("a", 10), ("b", 200)):
        Image.new("RGB", (32, 24), (red, 0, 0)).save(tmp_path / f"{name}.png")
    files = PictureFiles([tmp_path / "b.png", tmp_path / "a.png"])
    views = [flat_view((0, 0, 3), number, (32, 24)) for number in (1, 0)]
    made = files.make(views, 0.0)
    assert [round(255 * float(p[0, 0, 0])) for p in made] == [10, 200]
