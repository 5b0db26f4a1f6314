"""render --shape-of: the parts drawn one by one and mixed outside of it; what it refuses."""

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from tests.support.models import random_package

SIZE = (64, 240)  # wide, high: the blur is one pixel


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return random_package(tmp_path_factory.mktemp("scene"), 80, k=4)


def render(scene, out, *more: object) -> np.ndarray:
    """(H, W, 3) 0..255 of the one picture that the command writes."""
    size = "x".join(map(str, SIZE))
    options = ["--size", size, "--context", "none", "--out", str(out), *map(str, more)]
    assert cli.main(["render", str(scene), *options]) == 0
    (path,) = out.glob("*.png")
    return np.asarray(Image.open(path), np.float64)


def fine(photo: np.ndarray) -> np.ndarray:
    """(H, W, 1): luminance less its Gaussian of one pixel, in the plane at once."""
    luminance = photo @ (0.2126, 0.7152, 0.0722)
    steps = np.arange(-3, 4)
    bell = np.exp(-0.5 * (steps[:, None] ** 2 + steps**2))
    padded = np.pad(luminance, 3, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, bell.shape)
    return (luminance - (windows * bell).sum((2, 3)) / bell.sum())[..., None]


@pytest.mark.parametrize("detail", [0.0, 1.0, 2.5])
def test_the_shape_of_one_x_is_under_the_colours_of_the_other(scene, tmp_path, detail):
    heat, photo = (render(scene, tmp_path / str(x), "--x", x) for x in (1, 0))
    shaped = ("--shape-of", 0, "--detail", detail)
    found = render(scene, tmp_path / "both", "--x", 1, *shaped)
    wanted = (heat + detail * fine(photo)).clip(0, 255)
    # 8 bits: half a step of the result and of heat, and of the photo's fine part up to two halves
    assert np.abs(found - wanted).max() <= 1.0 + detail
    if detail:
        assert np.abs(found - heat).max() > 10
    else:
        np.testing.assert_array_equal(found, heat)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--shape-of", "Foo"), "--shape-of: 'Foo' is no x"),
        (("--shape-of", 0, "--detail", -0.1), "--detail is -0.1, expected 0 to 10"),
        (("--shape-of", 0, "--detail", "nan"), "--detail is nan, expected 0 to 10"),
        (("--shape-of", 0, "--debug", "rings"), "goes without --debug and --output"),
        (("--shape-of", 0, "--output", "depth"), "goes without --debug and --output"),
    ],
    ids=["no such stop", "less than none", "nan", "debug", "depth"],
)
def test_what_cannot_be_is_said_and_nothing_is_written(scene, tmp_path, capsys, more, said):
    out = tmp_path / "out"
    options = ["--size", "40x30", "--context", "none", "--out", str(out), *map(str, more)]
    assert cli.main(["render", str(scene), *options]) != 0
    assert said in capsys.readouterr().err
    assert not list(out.glob("*.png"))
