"""render: which views and names, what is overwritten, and pictures against the reference."""

import json

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.app.drawing import is_our_png, open_renderer, parse_size, save_png, split_controls
from shapeshift.app.errors import UsageError
from shapeshift.renderer.colors.palette import palette_colors
from shapeshift.renderer.reference import reference_image
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.cameras.framing import default_view
from shapeshift.scene.cameras.read_cameras import read_cameras
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import look_at, stereo_pair
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.models import random_package

TINY = ["--size", "40x30", "--context", "none"]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return random_package(tmp_path_factory.mktemp("scene"), 50, k=4)


def render(*arguments):
    return cli.main(["render", *map(str, arguments)])


def picture(path):
    return np.asarray(Image.open(path), np.float64) / 255


def wanted(scene, x, view):
    """The reference as a PNG should show it: the palette at a thermal stop, over black."""
    scene = Scene((SceneObject("scene", read_model(scene), x=x),))
    rgba = reference_image(scene, view)
    if x < 1:
        return rgba[..., :3].clip(0, 1)
    # Equation of the palette pass: straight colour -> luminance -> colour map, premultiplied again.
    alpha = rgba[..., 3:]
    straight = rgba[..., :3] / np.maximum(alpha, 1e-6)
    place = (straight @ (0.2126, 0.7152, 0.0722)).clip(0, 1) * 255
    table = palette_colors("ironbow")
    colors = [np.interp(place, np.arange(256), table[:, c]) for c in range(3)]
    return np.stack(colors, axis=-1) * alpha


@pytest.mark.parametrize("drawing", [["--context", "none"], ["--drawing", "quads"]], ids=str)
@pytest.mark.parametrize("x", [0, 1])
def test_pictures_are_those_of_the_reference(scene, tmp_path, x, drawing):
    if "quads" in drawing and not gl_is_here():
        pytest.skip("no GL here")
    assert render(scene, "--x", x, "--size", "64x48", "--out", tmp_path, *drawing) == 0
    want = wanted(scene, x, default_view(read_model(scene), (64, 48)))
    got = picture(tmp_path / f"0000_x{x:.3f}.png")
    assert psnr(got, want) > 50  # bytes of a PNG alone allow 59
    assert got.std() > 0.05  # something is there


def gl_is_here():
    from shapeshift.renderer.gl.context import NoContext, open_context

    try:
        open_context().release()
    except NoContext:
        return False
    return True


def test_a_camera_file_decides_the_views_and_their_size(scene, tmp_path):
    row = {
        "width": 48, "height": 36, "fx": 40.0, "fy": 40.0, "position": [0.2, 0.1, -3.0],
        "rotation": np.eye(3).tolist(),
    }  # fmt: skip
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps([row, row | {"width": 30, "position": [0, 0, -4]}]))
    out = tmp_path / "out"
    assert render(scene, "--camera", file, "--out", out, "--context", "none") == 0
    views = read_cameras(file)
    for i, view in enumerate(views):
        got = picture(out / f"000{i}_x0.000.png")
        assert got.shape[:2] == view.size[::-1]
        assert psnr(got, wanted(scene, 0, view)) > 50


def test_off_centre_stereo_from_our_own_list(scene, tmp_path):
    matrix = look_at((0.5, 0.4, 3.0), (0.0, 0.0, 0.0)).matrix().tolist()
    file = tmp_path / "eyes.json"
    file.write_text(json.dumps([{"matrix": matrix, "tangents": [-0.5, 0.3, -0.2, 0.4]}]))
    assert render(scene, "--camera", file, "--stereo", "0.3", "--out", tmp_path, *TINY) == 0
    (view,) = read_cameras(file, (40, 30))
    got = picture(tmp_path / "0000_x0.000.png")
    obj = Scene((SceneObject("scene", read_model(scene)),))
    halves = [reference_image(obj, eye)[..., :3] for eye in stereo_pair(view, 0.3)]
    assert psnr(got, np.concatenate(halves, axis=1).clip(0, 1)) > 50


def test_real_photos_are_drawn_again_through_their_own_cameras(data, tmp_path):
    """--camera with the capture that another program rendered from the same splats."""
    folder = data / "anatomy_leg_3modal_views"
    told = json.loads((folder / "transforms_multimodal.json").read_text())
    few = tmp_path / "transforms.json"
    frames = [dict(f, file=str(folder / "full" / f["file"])) for f in told["frames"][:3]]
    few.write_text(json.dumps(told | {"frames": frames, "modalities": ["full"]}))
    out = tmp_path / "out"
    assert render(data / "anatomy_leg_ml3dgs", "--x", "1", "--camera", few, "--out", out,
                  "--background", 1, 1, 1) == 0  # fmt: skip
    for i, frame in enumerate(frames):
        photo = np.asarray(Image.open(frame["file"]).convert("RGB")) / 255
        assert psnr(picture(out / f"000{i}_x1.000.png"), photo) > 45


def test_only_what_was_asked_for_is_overwritten(scene, tmp_path, capsys):
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "0000_x0.000.png").write_text("mine too")
    assert render(scene, "--out", tmp_path, *TINY) == 2
    assert "0000_x0.000.png exists" in capsys.readouterr().err
    assert (tmp_path / "0000_x0.000.png").read_text() == "mine too"
    assert render(scene, "--out", tmp_path, "--overwrite", *TINY) == 0
    assert picture(tmp_path / "0000_x0.000.png").shape == (30, 40, 3)
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert {p.name for p in tmp_path.iterdir()} == {"notes.txt", "0000_x0.000.png"}


@pytest.mark.parametrize(
    ("words", "last"),
    [((), 0), (("--x", "sweep:3"), 2), (("--frames", 3), 2), (("--camera", "front"), 0),
     (("--camera", "eyes"), 1), (("--camera", "eyes", "--x", "sweep:2"), 3)],
)  # fmt: skip
def test_pictures_that_exist_are_found_before_the_scene_is_opened(
    tmp_path, capsys, monkeypatch, words, last
):
    """The last picture of each run is there; the scene is one that nobody could open."""
    broken = tmp_path / "broken.shift"
    broken.write_bytes(b"PK")
    poses = (np.eye(4), np.diag([1.0, -1, -1, 1]))
    rows = [{"matrix": pose.tolist(), "fov_y": 0.8} for pose in poses]
    (tmp_path / "eyes").write_text(json.dumps(rows))
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "out"
    out.mkdir()
    x = split_controls(words[-1:])[-1] if "--x" in words else 0
    (out / f"{last:04}_x{x:.3f}.png").write_text("mine")
    (out / f"{last + 1:04}_x{x:.3f}.png").write_text("mine, in nobody's way")
    assert render(broken, "--out", out, *words, *TINY) == 2
    assert f"{last:04}_x{x:.3f}.png exists; choose" in capsys.readouterr().err
    assert render(broken, "--out", out, *words, *TINY, "--overwrite") == 2
    assert "broken.shift is not a package" in capsys.readouterr().err  # then it is the scene's turn
    assert {p.read_text()[:4] for p in out.iterdir()} == {"mine"}


def test_a_file_in_place_of_the_folder_is_one_sentence(scene, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert render(scene, "--out", tmp_path / "file", *TINY) == 2
    assert "file is a file; name a folder" in capsys.readouterr().err


def test_no_gl_is_said_and_the_tiles_draw(scene, tmp_path, capsys, monkeypatch):

    from shapeshift.renderer.gl import context

    def none(kind="auto"):
        raise context.NoContext("no GL on this machine.")

    monkeypatch.setattr(context, "open_context", none)
    assert render(scene, "--out", tmp_path, "--size", "8x8") == 0
    assert "Drawing with OpenCL alone: no GL on this machine." in capsys.readouterr().err
    for strict in (["--drawing", "quads"], ["--context", "egl"]):
        assert render(scene, "--out", tmp_path / "b", *strict) == 2
        assert capsys.readouterr().err == "shapeshift render: no GL on this machine.\n"


def test_renderer_without_gl_is_a_renderer():
    with open_renderer("none", "auto") as (renderer, ctx):
        assert ctx is None and renderer.backends["drawing"].startswith("tiles")


def test_sizes():
    assert parse_size(" 640X360 ") == (640, 360)
    assert parse_size("1x16384") == (1, 16384)
    assert parse_size("16384x8192") == (16384, 8192)
    bad = ("", "640", "640x", "x360", "-1x5", "6.5x3", "640x360x3", "64 x 36", "٣x٣", "1e2x5",
           "0x0", "1x0", "16385x1", "16384x8193", "9" * 400 + "x1")  # fmt: skip
    for text in bad:
        with pytest.raises(UsageError, match="--shape is"):
            parse_size(text, "--shape")


def test_controls():
    assert split_controls(()) == []
    assert split_controls(("0", "Thermal", "0.25")) == ["0", "Thermal", "0.25"]
    assert split_controls(("sweep:3", "0.1")) == [0.0, 0.5, 1.0, "0.1"]
    bad = ("sweep:", "sweep:1", "sweep:-3", "sweep:1e9", "sweep:100001", "sweep:" + "9" * 50)
    for text in bad:
        with pytest.raises(UsageError, match="--x is"):
            split_controls((text,))


def test_exposure_opacity_and_a_sky(scene, tmp_path):
    more = (*TINY, "--background", "0", "0", "0")
    assert render(scene, "--out", tmp_path / "plain", *more) == 0
    assert render(scene, "--out", tmp_path / "dark", "--exposure", "-2.2", *more) == 0
    plain, dark = (picture(tmp_path / name / "0000_x0.000.png") for name in ("plain", "dark"))
    unclipped = plain < 1  # before a black background half of everything; 8 bits each
    assert np.abs(dark - plain / 2)[unclipped].max() <= 1.01 / 255
    sky = ("--sky", "ff0000", "#00ff00", "0000FF", "--opacity", "0")
    assert render(scene, "--out", tmp_path / "sky", *TINY, *sky) == 0
    shown = picture(tmp_path / "sky" / "0000_x0.000.png")
    # The camera looks down a little: green level with the eye, blue below it.
    assert np.all(np.diff(shown[:, 20, 2]) >= 0) and np.abs(shown.sum(axis=2) - 1).max() < 0.01


REFUSED = {
    ("--frames", "100001"): "--frames is 100001, expected 1 to 100000",
    ("--frames", "-1"): "--frames is -1",
    ("--frames", "1000", "--x", "sweep:1000"): "1000000 pictures",
    ("--stereo", "nan"): "--stereo is nan",
    ("--stereo", "-0.1"): "--stereo is -0.1",
    ("--background", "nan", "0", "0"): "--background",
    ("--opacity", "1.1"): "--opacity is 1.1, expected a number from 0 to 1",
    ("--gamma", "0"): "--gamma is 0.0, expected a number from 0.1 to 10",
    ("--tint", "1", "1", "nan"): "--tint is",
    ("--sky", "ffffff", "blue", "000000"): "--sky has the colour 'blue'",
    ("--sky", "ffffff", "0000ff", "000000", "--background", "0", "0", "0"): "leave one of the two",
    ("--size", "16384x16384"): "134,217,728 pixels",
    ("--fov-y", "nan"): "--fov-y is nan, expected degrees between 0 and 180",
    ("--fov-y", "500"): "--fov-y is 500",
    ("--camera", "sideways"): "sideways does not exist; wanted is a list of cameras",
}


@pytest.mark.parametrize("extra", REFUSED, ids=" ".join)
def test_bad_options_are_one_sentence(scene, tmp_path, capsys, extra):
    assert render(scene, "--out", tmp_path / "out", *extra) == 2
    told = capsys.readouterr()
    assert REFUSED[extra] in told.err and told.out == "" and told.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_missing_scene_is_one_sentence(tmp_path, capsys):
    assert render(tmp_path / "none.shift", "--out", tmp_path / "out") == 2
    assert "none.shift does not exist" in capsys.readouterr().err
    assert render(tmp_path / "none.shift", "--camera", "auto", "--out", tmp_path / "out") == 2
    assert "none.shift does not exist" in capsys.readouterr().err


def test_png_holds_the_bytes_and_the_maker(tmp_path):
    image = np.zeros((2, 3, 3))
    image[0] = [[0, 0.5, 1], [-1, 2, np.nan], [0.499 / 255, 0.501 / 255, 254.6 / 255]]
    save_png(image, tmp_path / "a.png")
    got = np.asarray(Image.open(tmp_path / "a.png"))
    np.testing.assert_array_equal(got[0], [[0, 128, 255], [0, 255, 0], [0, 1, 255]])
    assert is_our_png(tmp_path / "a.png")
    Image.fromarray(got).save(tmp_path / "b.png")
    assert not is_our_png(tmp_path / "b.png")
    (tmp_path / "empty.png").write_bytes(b"")
    assert not is_our_png(tmp_path / "empty.png")


def test_a_picture_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "a.png"
    path.write_text("before")

    def full(self, where, **options):
        where.write(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", full)
    with pytest.raises(OSError):
        save_png(np.zeros((2, 2, 3)), path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"] and path.read_text() == "before"
