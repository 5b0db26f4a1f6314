"""VGG16's layers by their order, and style losses on a small network of its form."""

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.training.style_features.nnfm_pictures import (
    StyleTerms,
    VggPictureLoss,
    VggStyle,
    covered_part,
)
from shapeshift.training.style_features.vgg_features import vgg_layers
from shapeshift.training.styles.style_pictures import StyleView
from tests.support.training.onnx_files import tiny_vgg, vision_transformer, write_model

RNG = np.random.default_rng
ALL = StyleTerms(1.0, 0.5, 0.25, 0.125, ("relu2_1", "relu3_1"))


@pytest.fixture(scope="module")
def vgg(tmp_path_factory):
    return tiny_vgg(tmp_path_factory.mktemp("vgg") / "vgg.onnx")


def picture(seed, height=24, width=20):
    return RNG(seed).random((height, width, 3)).astype(np.float32)


def test_layers_are_found_by_their_order_whatever_they_are_called(tmp_path, vgg):
    wanted = ("relu1_1", "relu1_2", "relu2_2", "relu3_1", "relu3_3")
    assert vgg_layers(vgg, wanted) == ("input", {name: name for name in wanted})
    rows = [
        ("Conv", ["pixels", "w"], ["/features/0/Conv_output_0"], {}),
        ("Relu", ["/features/0/Conv_output_0"], ["/features/1/Relu_output_0"], {}),
        ("Flatten", ["/features/1/Relu_output_0"], ["flat"], {}),
        ("Relu", ["flat"], ["classes"], {}),
    ]
    shape, more = {"pixels": [1, 3, 8, 8]}, {"w": RNG(0).normal(size=(2, 3, 1, 1))}
    path = write_model(tmp_path / "other.onnx", rows, shape, ["classes"], more)
    assert vgg_layers(path, ("relu1_1",))[1] == {"relu1_1": "/features/1/Relu_output_0"}
    with pytest.raises(BadFile, match=r"has the layers relu1_1; relu3_1 of VGG16 is wanted"):
        vgg_layers(path, ("relu3_1",))


def test_networks_that_are_no_vgg_are_refused(tmp_path):
    with pytest.raises(BadFile, match="has the layers of no VGG; relu3_1 of VGG16 is wanted"):
        VggStyle(vision_transformer(tmp_path / "vit.onnx"), [picture(0)])
    with pytest.raises(BadFile, match="is no file"):
        VggStyle(tmp_path / "absent.onnx", [picture(0)])
    shape = {"a": [1, 3, 8, 8], "b": [1, 3, 8, 8]}
    path = write_model(tmp_path / "n.onnx", [("Add", ["a", "b"], ["c"], {})], shape, ["c"], {})
    with pytest.raises(BadFile, match="has 2 inputs; VGG16 takes one picture"):
        VggStyle(path, [picture(0)])


def test_pictures_that_are_too_small(vgg):
    with pytest.raises(BadFile, match="15x40 pixels are too small for VGG16"):
        VggStyle(vgg, [picture(0, 40, 15)])
    VggStyle(vgg, [picture(0, 16, 16)])


def test_the_gradient_is_that_of_the_weighted_sum(vgg):
    """Along its own signs, where differences are the clearest; kinks are crossed, hence 2 %."""
    style = VggStyle(vgg, [picture(1), picture(2)], ALL)
    shown, content = picture(3), style.content_of(picture(4))
    losses, gradient = style(shown, content)
    assert set(losses) == {
        f"{loss}.{layer}" for loss in ("nnfm", "moments", "gram", "content") for layer in ALL.layers
    }
    step = 1e-3 * np.sign(gradient)
    ends = [style.weighted(style(shown + way * step, content)[0]) for way in (1, -1)]
    assert (gradient * step).sum() == pytest.approx((ends[0] - ends[1]) / 2, rel=0.02)


def test_a_picture_is_in_its_own_style(vgg):
    own = picture(1)
    style = VggStyle(vgg, [own], ALL)
    losses, _ = style(own, style.content_of(own))
    assert max(losses.values()) < 1e-5
    other, _ = style(picture(2), style.content_of(own))
    assert min(other.values()) > 1e-4


def test_the_same_seed_picks_the_same_features(vgg, monkeypatch):
    monkeypatch.setattr("shapeshift.training.style_features.nnfm_pictures.MOST_STYLE_FEATURES", 5)
    first, again, other = (VggStyle(vgg, [picture(1)], seed=s)(picture(2))[0] for s in (0, 0, 1))
    assert first == again != other


@pytest.mark.parametrize("layers", [("relu3_1",), ("relu2_2", "relu3_3")])
def test_another_size_is_another_network_of_the_same_weights(vgg, layers):
    style = VggStyle(vgg, [picture(1)], StyleTerms(layers=layers))
    small = picture(2, 16, 16)
    large = np.tile(small, (2, 2, 1))
    assert style(small)[1].shape == (16, 16, 3) and style(large)[1].shape == (32, 32, 3)


def test_no_loss_or_no_layer_is_no_style():
    for terms in ({"nnfm": 0.0}, {"layers": ()}):
        with pytest.raises(ValueError, match="at least one loss"):
            StyleTerms(**terms)


def test_the_covered_part_of_a_picture():
    empty = np.zeros((100, 200), np.float32)
    assert covered_part(empty) == (slice(0, 100), slice(0, 200))
    one = empty.copy()
    one[50, 100] = 1
    assert covered_part(one) == (slice(34, 66), slice(84, 116))
    one[2, 1] = 1  # 49 rows and 16 about them: 96; 100 columns and 16: 128, held at the border
    assert covered_part(one) == (slice(0, 96), slice(0, 128))
    assert covered_part(np.ones((100, 200))) == (slice(0, 100), slice(0, 200))


def test_only_the_covered_part_has_a_gradient(vgg):
    style = VggStyle(vgg, [picture(1)], StyleTerms(content=1.0))
    coverage = np.zeros((80, 96), np.float32)
    coverage[30:40, 50:60] = 1
    shown = picture(2, 80, 96)
    view = StyleView(0, None, shown, coverage, coverage, shown)
    loss = VggPictureLoss(style)
    value, gradient = loss.at(view)(shown)
    rows, columns = covered_part(coverage)
    outside = gradient.copy()
    outside[rows, columns] = 0
    assert value > 0 and not outside.any() and abs(gradient[35, 55]).max() > 0
    part = style(shown[rows, columns], style.content_of(shown[rows, columns]))
    assert value == pytest.approx(style.weighted(part[0]), rel=1e-3)  # content is kept in float16
