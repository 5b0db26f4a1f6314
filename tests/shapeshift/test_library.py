"""`import shapeshift as ss`: what a library gives, beside the commands and beside numpy."""

import ast
import inspect
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import shapeshift as ss
from shapeshift.app.command_line import parse
from shapeshift.app.commands import render as render_command
from shapeshift.renderer.reference import reference_image
from shapeshift.runtime_models.read_scene import read_model
from tests.support.splat_scenes import random_layers
from tests.support.touch_scene import TOUCH

ROOT = Path(__file__).resolve().parents[2]
SMALL = (64, 48)
BUDGET_S = 0.1  # of processor time: the import of a shell's prompt is not felt


@pytest.fixture(scope="module")
def demo() -> ss.Scene:
    return ss.load(ss.DEMO)


# ---- the package


def test_the_import_is_lazy():
    """Two thousand lines of this program and no package of others, but for what Python has."""
    code = (
        "import time, sys; before = set(sys.modules); start = time.process_time()\n"
        "import shapeshift\nspent = time.process_time() - start\n"
        "new = {name.split('.')[0] for name in set(sys.modules) - before}\n"
        "print(spent, sorted(new)); print(shapeshift.load); import numpy"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    spent, new = done.stdout.splitlines()[0].split(" ", 1)
    assert float(spent) < BUDGET_S
    assert new == "['shapeshift']"
    assert "function load" in done.stdout


def test_every_name_is_there_listed_and_typed():
    for name in ss.__all__:
        assert getattr(ss, name) is getattr(ss, name), name
    assert set(ss.__all__) <= set(dir(ss))
    with pytest.raises(AttributeError, match="'shapeshift' has no attribute 'lode'"):
        _ = ss.lode
    tree = ast.parse((ROOT / "shapeshift/__init__.pyi").read_text())
    typed = {
        alias.asname: f"{node.module}.{alias.name}"
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert typed == {name: f"shapeshift.{ss._MODULE_OF[name]}.{name}" for name in ss.__all__}
    assert (ROOT / "shapeshift/py.typed").exists()
    assert (
        ss.__version__
        == subprocess.run(
            [sys.executable, "-m", "shapeshift", "--version"],
            cwd=ROOT,
            capture_output=True,
            text=True,
        ).stdout.split()[1]
    )


def public_of_the_face() -> list:
    """Functions and methods, with the name that an error message needs."""
    out = []
    for name in ss.__all__:
        obj = getattr(ss, name)
        if not getattr(obj, "__module__", "").startswith("shapeshift.api"):
            continue
        out.append((name, obj))
        if inspect.isclass(obj):
            out += [
                (f"{name}.{n}", m.fget if isinstance(m, property) else getattr(m, "__func__", m))
                for n, m in vars(obj).items()
                if not n.startswith("_") and (isinstance(m, property | staticmethod) or callable(m))
            ]
    return out


@pytest.mark.parametrize(("name", "obj"), public_of_the_face())
def test_every_public_thing_says_what_it_does_and_shows_it(name, obj):
    text = inspect.getdoc(obj)
    assert text and len(text) > 40, name


def test_the_largest_things_have_an_example_of_two_lines():
    for name in ("load", "export", "compare", "bench", "chart", "simulate", "cameras", "train",
                 "evaluate", "info", "poses", "lint", "lod", "fit", "colliders",
                 "stability"):  # fmt: skip
        text = inspect.getdoc(getattr(ss, name))
        assert text.count(f"ss.{name}(") >= 1, name
        assert "Raises" in text, name


# ---- scenes


def test_it_opens_what_the_commands_open_and_refuses_as_they_do(demo, tmp_path):
    model = read_model(ss.DEMO)
    np.testing.assert_array_equal(demo.model.anchors, model.anchors)
    assert demo.stops == model.stops and demo.x == model.stops[0].x
    assert [obj.name for obj in ss.load(TOUCH).objects][:2] == ["background", "cube"]
    with pytest.raises(ss.BadFile, match=r"nothing\.ply does not exist; wanted is"):
        ss.load(tmp_path / "nothing.ply")
    with pytest.raises(ss.UsageError, match="up is for one model"):
        ss.load(TOUCH, up="+Z")
    assert ss.info(ss.DEMO) == demo.info() and demo.info()["splats"] == demo.splat_count


def test_x_is_a_number_a_name_a_way_or_a_blend_and_nothing_else(demo):
    assert demo.at("thermal").x == 0.5 and demo.at(0.25).x == 0.25 and demo.at(None) is demo
    way = demo.at("RGB..Opened:0.5").x  # paced: even steps change the picture evenly
    assert [name for name, _ in way.parts] == ["RGB", "Opened"]
    assert way == demo.model.blend.between(0.0, 1.0, 0.5) and demo.at(way).x is way
    for wrong in ("Nope", "", "2"):
        with pytest.raises(ss.UsageError, match=r"^x: .*RGB, Thermal, Opened"):
            demo.at(wrong)
    for wrong in (-0.01, 1.01, float("nan"), float("inf")):
        with pytest.raises(ss.UsageError, match="0 to 1"):
            demo.at(wrong)
    for edge in (0.0, 1.0):
        assert demo.at(edge).x == edge
    assert demo.x == 0.0, "the scene itself has not moved"


def test_objects_are_placed_hidden_and_found(demo):
    room = ss.load(TOUCH)
    moved = room.with_object("cube", position=(1, 2, 3), x="fire", visible=False)
    cube = moved.object("cube")
    assert tuple(cube.world_from_object.position) == (1, 2, 3)
    assert cube.x == 0.5 and not cube.visible
    assert room.object("cube").visible and room.object("cube").x == 0.0
    with pytest.raises(ss.UsageError, match="there is no object 'cup'; there are background, cube"):
        room.object("cup")
    with pytest.raises(ss.UsageError, match="several objects"):
        room.with_model(demo.model)
    with pytest.raises(ss.UsageError, match=r"take scene\.object\(NAME\)\.model"):
        _ = room.model
    with pytest.raises(ValueError, match="quaternion of length 1"):
        room.with_object("cube", wxyz=(1, 1, 0, 0))


def test_an_object_by_its_name_gives_scenes_in_which_it_is_elsewhere():
    room = ss.load(TOUCH)
    cube = room.objects["cube"]
    assert cube.drawn is room.object("cube") and cube.name == "cube" and "cube" in repr(cube)
    before = cube.pose.position
    moved = cube.move(by=(0, 0.5, 0)).objects["cube"]
    np.testing.assert_array_equal(moved.pose.position, before + np.array([0, 0.5, 0]))
    assert tuple(cube.move((1, 2, 3), (0, 1, 0, 0)).objects["cube"].pose.wxyz) == (0, 1, 0, 0)
    assert cube.at("fire").objects["cube"].x == 0.5 and cube.x == 0.0
    assert not cube.show(False).objects["cube"].visible and cube.visible
    np.testing.assert_array_equal(room.object("cube").world_from_object.position, before)
    with pytest.raises(ValueError, match="a position or by, not both"):
        cube.move((0, 0, 0), by=(1, 0, 0))
    with pytest.raises(ss.UsageError, match="there is no object 'cup'; there are background, cube"):
        _ = room.objects["cup"]


def test_objects_are_a_tuple_still():
    objects = ss.load(TOUCH).objects
    assert isinstance(objects, tuple) and objects[0].name == "background"
    assert objects[-1] is list(objects)[-1] and objects[:2] == tuple(objects)[:2]


def test_a_scene_without_an_object_has_neither_it_nor_its_body():
    room = ss.load(TOUCH)
    names = [obj.name for obj in room.objects]
    left = room.without("cube")
    assert [obj.name for obj in left.objects] == [name for name in names if name != "cube"]
    assert "cube" not in [item.name for item in left.subject.file.all_items]
    assert [obj.name for obj in room.objects] == names and room.without().objects == room.objects
    everything = room.without(*names)
    assert not everything.objects and everything.subject.file.background is None
    (step, *_) = ss.simulate(left, seconds=0.05)
    assert "cube" not in [obj.name for obj in step.scene.objects]
    with pytest.raises(ss.UsageError, match="there is no object 'cup'"):
        room.without("cube", "cup")


# ---- pictures


def test_a_picture_is_that_of_the_command(demo, tmp_path):
    words = [str(ss.DEMO), "--out", str(tmp_path), "--x", "Thermal", "--size", "64x48"]
    assert render_command.run(parse(render_command.Options, words, "render")) == 0
    (path,) = tmp_path.glob("*.png")
    picture = demo.render("Thermal", size=SMALL)
    np.testing.assert_array_equal(picture.to_uint8(), np.asarray(Image.open(path)))
    assert picture.shape == (48, 64, 3) and picture.dtype == np.float32
    assert isinstance(picture, ss.Picture) and isinstance(picture, np.ndarray)


def test_a_picture_is_that_of_the_float64_reference():
    """An oracle that shares nothing with the drawing but the drawing rule."""
    scene = ss.Scene.from_model(random_layers(200))
    view = scene.views("front", size=SMALL)[0]
    settings = ss.RenderSettings(background=(0.2, 0.4, 0.6))
    rgba = reference_image(scene.drawn, view, settings)
    wanted = rgba[..., :3] + (1 - rgba[..., 3:]) * np.array(settings.background)
    drawn = scene.render(camera=view, settings=settings)
    assert ss.psnr(np.asarray(drawn), wanted.astype(np.float32)) > 60  # float32 beside float64
    behind = scene.render(camera=view, background=(0.2, 0.4, 0.6))
    np.testing.assert_array_equal(drawn, behind)


def test_two_eyes_lie_side_by_side_and_numbers_are_numbers(demo):
    both = demo.render(size=SMALL, eye_distance=0.06)
    assert both.shape == (48, 128, 3) and np.abs(both[:, :64] - both[:, 64:]).max() > 0.1
    depth = demo.render(size=SMALL, output="depth")
    radius = demo.bounds[1]
    assert depth.shape == (48, 64) and 0 < np.nanmin(depth) < np.nanmax(depth) < 20 * radius
    normal = demo.render(size=SMALL, output="normal")
    lengths = np.linalg.norm(normal[np.isfinite(depth)], axis=1)
    np.testing.assert_allclose(lengths[np.isfinite(lengths)], 1, atol=1e-5)
    coverage = demo.render(size=SMALL, output="coverage")
    assert 0 <= coverage.min() and coverage.max() <= 1
    with pytest.raises(ss.UsageError, match="output is 'heat'; choose picture, depth"):
        demo.render(output="heat")
    with pytest.raises(ss.UsageError, match="eye_distance is 1"):
        demo.render(eye_distance=1.0)


def test_cameras_are_words_files_views_and_lists(demo, tmp_path):
    orbit = demo.views("orbit", 5, SMALL)
    assert len(orbit) == 5 and {view.size for view in orbit} == {SMALL}
    rows = [{"matrix": v.world_from_eye.matrix().tolist(), "width": 64, "height": 48,
             "tangents": list(v.tangents)} for v in orbit]  # fmt: skip
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps(rows))
    listed = ss.cameras(path)
    assert len(listed.views) == 5
    for camera in (path, str(path), listed, orbit):
        seen = demo.views(camera)
        for a, b in zip(seen, orbit, strict=True):
            np.testing.assert_allclose(a.world_from_eye.position, b.world_from_eye.position)
    assert demo.views(orbit[3]) == [orbit[3]]
    assert demo.views(orbit[3], size=(8, 8))[0].size == (8, 8)
    for wrong in ([], [1, 2], 7.5 * np.ones(2)):
        with pytest.raises(ss.UsageError, match="a camera is 'orbit'"):
            demo.views(wrong)
    with pytest.raises(ss.UsageError, match="count is 0"):
        demo.views("orbit", 0)
    with pytest.raises(ss.BadFile, match=r"elsewhere\.json does not exist"):
        demo.views("elsewhere.json")
    ss.cameras(path, out=tmp_path / "model", to="colmap-txt")
    assert len(ss.cameras(tmp_path / "model").views) == 5
    with pytest.raises(ss.UsageError, match="exists"):
        ss.cameras(path, out=tmp_path / "model", to="colmap-txt")


def test_cameras_of_a_file_stand_as_in_it_also_where_a_scene_lies_far_from_zero(tmp_path):
    layers = random_layers(60)
    far = replace(layers, means=layers.means + np.float32([50_000, 0, 0]))
    scene = ss.load(ss.Scene.from_model(far).export(tmp_path / "far.ply").path)
    assert abs(scene.origin[0] - 50_000) < 2  # it is drawn about a zero of its own
    eye = ss.look_at((50_000, 1, 3), (50_000, 0, 0))
    view = ss.View(eye, ss.perspective(1.0, SMALL), 0.05, 100.0, SMALL)
    (seen,) = scene.views(ss.CameraList((view,), ("a",), "ours"))
    np.testing.assert_allclose(seen.world_from_eye.position, eye.position - scene.origin)


def test_a_film_spreads_x_over_its_frames(demo):
    frames = list(demo.frames(x="sweep", count=3, size=SMALL))
    assert len(frames) == 3
    view = demo.views("orbit", 3, SMALL)[1]
    np.testing.assert_array_equal(frames[1], demo.render(0.5, view))
    ends = list(demo.frames(x=[0.0, 1.0], count=3, size=SMALL))
    np.testing.assert_array_equal(ends[1], frames[1])
    with pytest.raises(ss.UsageError, match="2 values for 3 frames"):
        demo.frames(x=["RGB", "Thermal"], count=3)  # refused now, not at the first picture


# ---- arrays that show themselves


def test_a_picture_is_an_array_in_every_respect(tmp_path):
    values = np.linspace(-0.5, 1.5, 2 * 3 * 3, dtype=np.float32).reshape(2, 3, 3)
    picture = values.view(ss.Picture)
    assert np.shares_memory(np.from_dlpack(picture), values)
    assert memoryview(picture).shape == (2, 3, 3)
    assert isinstance(picture[:1], ss.Picture) and isinstance(picture + 1, ss.Picture)
    assert isinstance(np.concatenate([picture, picture], axis=1), ss.Picture)
    wanted = np.floor(np.clip(values, 0, 1) * 255 + 0.5).astype(np.uint8)
    np.testing.assert_array_equal(picture.to_uint8(), wanted)
    (tmp_path / "a").mkdir()
    for name in ("p.png", "p.webp", "p.jpg", "deep/p.npy"):
        assert picture.save(tmp_path / name).stat().st_size
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "p.png")), wanted)
    np.testing.assert_array_equal(np.load(tmp_path / "deep/p.npy"), values)
    for name in ("p", "p.exe"):
        with pytest.raises(ss.UsageError, match="no ending of a picture"):
            picture.save(tmp_path / name)
    with pytest.raises(ss.UsageError, match="is no picture"):
        picture[..., 0, :2].ravel().save(tmp_path / "q.png")


def test_a_notebook_shows_pictures_and_prints_the_rest():
    from io import BytesIO

    picture = np.full((2, 4, 3), 0.5, np.float32).view(ss.Picture)
    picture[0, 0] = np.nan
    shown = np.asarray(Image.open(BytesIO(picture._repr_png_())))
    assert shown.shape == (2, 4, 3) and tuple(shown[0, 0]) == (0, 0, 0) and shown[1, 1, 0] == 128
    numbers = np.array([[1.0, 3.0], [np.nan, np.inf]], np.float32).view(ss.Picture)
    shown = np.asarray(Image.open(BytesIO(numbers._repr_png_())))[..., 0]
    np.testing.assert_array_equal(shown, [[0, 255], [64, 64]])
    constant = np.full((2, 2), 7.0, np.float32).view(ss.Picture)
    assert constant._repr_png_()
    for nothing in (picture[0, 0], picture[:0], np.zeros((2, 2, 2, 2)).view(ss.Picture)):
        assert nothing._repr_png_() is None


def test_splats_are_arrays_of_ones_own_and_go_back(demo):
    scene = ss.Scene.from_model(random_layers(50))
    splats = scene.splats()
    n = len(splats.means)
    assert splats.means.shape == (n, 3) and splats.sh.shape[0] == n
    assert all(getattr(splats, name).flags.writeable for name in ("means", "opacity", "sh"))
    view = scene.views("front", size=SMALL)[0]
    before = scene.render(camera=view)
    again = ss.Scene.from_splats(splats)
    assert ss.psnr(again.render(camera=view, background=(0, 0, 0)), before) > 60
    splats.opacity[:] = 1e-6
    assert not np.array_equal(scene.splats().opacity, splats.opacity), "the scene is as it was"
    np.testing.assert_array_equal(scene.render(camera=view), before)
    with pytest.raises(ValueError, match="opacity"):
        ss.Scene.from_splats(replace(splats, opacity=splats.opacity[:-1]))
    with pytest.raises(ss.UsageError, match="1 sets of splats and 2 names"):
        ss.Scene.from_splats(splats, names=("a", "b"))
    with pytest.raises(ss.UsageError, match="sh_degree is 4"):
        scene.splats(sh_degree=4)
    with pytest.raises(ss.UsageError, match="eye is"):
        scene.splats(eye=(0, 0))


def test_anchors_that_were_moved_move_the_picture(demo):
    lifted = demo.with_model(
        replace(demo.model, anchors=demo.model.anchors + np.float32([9, 0, 0]))
    )
    assert lifted.path is None and demo.path == ss.DEMO
    np.testing.assert_allclose(lifted.bounds[0] - demo.bounds[0], (9, 0, 0), atol=1e-3)
    np.testing.assert_array_equal(demo.model.anchors, read_model(ss.DEMO).anchors)
    with pytest.raises(ValueError, match="anchors"):
        replace(demo.model, anchors=demo.model.anchors[:, :2])


def test_regions_are_objects_and_texts(demo):
    centre, radius = demo.bounds
    ball = ss.Sphere(centre=tuple(centre), radius=radius, x=0.5)
    text = f"sphere:{','.join(map(str, centre))}:{radius}:Thermal"
    np.testing.assert_array_equal(
        demo.render(select=[ball], size=SMALL), demo.with_regions(text).render(size=SMALL)
    )
    with pytest.raises(ss.UsageError, match="region 'ball:1' begins with 'ball'"):
        demo.with_regions("ball:1")
    assert demo.with_regions(ball).with_regions().objects[0].selectors == ()


# ---- the renderer for loops


def test_a_loop_writes_into_one_array_and_copies_nothing(demo):
    views = demo.views("orbit", 3, SMALL)
    out = np.empty((48, 64, 3), np.float32)
    with ss.Renderer() as renderer:
        renderer.settings = replace(renderer.settings, background=demo.subject.background)
        for view in views:
            assert renderer.render(demo, view, out=out) is out
            np.testing.assert_array_equal(out, demo.render(camera=view))
        assert renderer.stats.geometry_runs == 0, "the second frame decodes nothing"
        assert renderer.stats.drawn > 0 and "splat" in renderer.stats.ms
        for wrong in (np.empty((64, 48, 3), np.float32), np.empty((48, 64, 3))):
            with pytest.raises(ValueError, match=r"\(48, 64, 3\) float32 is wanted"):
                renderer.render(demo, views[0], out=wrong)
        rgba = renderer.premultiplied(demo, views[0])
        over = rgba[..., :3] + (1 - rgba[..., 3:]) * np.float32(renderer.settings.background)
        np.testing.assert_array_equal(over, renderer.render(demo, views[0]))
        left, right = renderer.render_views(demo, ss.stereo_pair(views[0], 0.06))
        assert left.shape == right.shape == (48, 64, 3) and not np.array_equal(left, right)
        renderer.settings = replace(renderer.settings, debug="overdraw")
        assert renderer.render(demo, views[0], out=out) is out
    renderer.close()  # a second time does nothing
