"""Whole frames by both drawing back ends on a GL context: against the reference, and each other."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.device import NoDevice
from shapeshift.renderer.colors.palette import value_blend
from shapeshift.renderer.gl.context import is_software
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.resolve import Resolve
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import BadFile, SplatLayers, Stop
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.cameras.framing import default_view
from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.models import without_control
from tests.support.renderer.frames import step_error
from tests.support.splat_scenes import (
    alone,
    front_view,
    only,
    poisoned,
    psnr_db,
    random_layers,
    random_model,
    stereo_views,
    two_objects,
)

DRAWINGS = ("quads", "tiles")
AWAY = View(look_at((0, 0, 9), (0, 0, 20)), (-0.5, 0.5, -0.5, 0.5), 0.1, 50, (32, 16))


@pytest.fixture
def opened(ctx):
    """Opens renderers on the test's context and closes them at its end."""
    made = []

    def open_renderer(drawing: str, **choices) -> Renderer:
        try:
            made.append(Renderer(ctx, drawing, **choices))
        except NoDevice as reason:
            pytest.skip(str(reason))
        return made[-1]

    yield open_renderer
    for renderer in made:
        renderer.close()


def drawn(renderer: Renderer, scene: Scene, view: View) -> np.ndarray:
    renderer.update(scene)
    renderer.draw([view])
    return renderer.image()


def mixed(count: int) -> Scene:
    """Plain splats with and without directions, and a model of networks."""
    model = SceneObject("model", random_model(count // 40), Pose(np.full(3, 0.1), IDENTITY), x=0.4)
    return Scene((*two_objects(count).objects, model))


IDENTITY = np.array([1.0, 0, 0, 0])


@pytest.fixture(scope="module")
def mono():
    scene, view = mixed(20_000), front_view()
    return scene, view, reference_image(scene, view)


@pytest.fixture(scope="module")
def stereo():
    scene, views = mixed(20_000), stereo_views()
    return scene, views, [reference_image(scene, v) for v in views]


@pytest.mark.parametrize(
    ("choices", "least_db"),
    [
        ({"drawing": "tiles"}, 80),
        ({"drawing": "quads", "target": "rgba32f"}, 75),
        ({"drawing": "quads", "target": "rgba32f", "mlps": "gl", "sort": "gl"}, 75),
        ({"drawing": "quads"}, 74),
        ({"drawing": "quads", "target": "rgba16f"}, 53),
    ],
    ids=lambda c: "-".join(c.values()) if isinstance(c, dict) else "",
)
def test_a_random_scene_equals_the_reference(opened, mono, stereo, choices, least_db):
    renderer = opened(**choices)
    scene, view, reference = mono
    assert psnr_db(drawn(renderer, scene, view), reference) > least_db
    scene, views, references = stereo
    renderer.update(scene)
    stats = renderer.draw(views)
    told = "another scene; colours for each eye"
    assert (stats.geometry_runs, stats.color_runs) == (3, 6), told
    for i, reference in enumerate(references):
        assert psnr_db(renderer.image(i), reference) > least_db


def test_quads_and_tiles_draw_the_same(opened, mono):
    scene, view, _ = mono
    quads = drawn(opened("quads", target="rgba32f"), scene, view)
    assert psnr_db(drawn(opened("tiles"), scene, view), quads) > 70


@pytest.fixture(scope="module")
def captures(data):
    """name: (scene, view, reference): the middle of the leg, the upper left of the plant."""
    leg = alone(read_model(data / "anatomy_leg_ml3dgs"), x=0.7)
    plant = alone(read_model(data / "splats_marcelpadilla" / "plant" / "plant.splat"))
    whole = default_view(leg.objects[0].model, (160, 160))
    inner = tuple(0.35 * t for t in whole.tangents)
    leg_view = View(whole.world_from_eye, inner, whole.near, whole.far, whole.size)
    whole = default_view(plant.objects[0].model, (160, 160))
    left, right, down, up = whole.tangents
    aside = View(
        whole.world_from_eye, (left * 0.6, right * 0.1, down * 0.2, up), whole.near, 50, (144, 144)
    )
    pairs = {"leg": (leg, leg_view), "plant": (plant, aside)}
    return {name: (*pair, reference_image(*pair)) for name, pair in pairs.items()}


@pytest.mark.parametrize("drawing", DRAWINGS)
@pytest.mark.parametrize("name", ["leg", "plant"])
def test_a_real_capture_equals_the_reference(opened, captures, name, drawing):
    scene, view, reference = captures[name]
    image = drawn(opened(drawing, target="rgba32f"), scene, view)
    assert reference[..., 3].mean() > 0.03, "something is seen"
    assert psnr_db(image, reference) > 60


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_broken_splats_never_reach_the_image(opened, drawing):
    renderer, view = opened(drawing, target="rgba32f"), front_view((96, 96))
    broken, whole = poisoned(random_layers(3000))
    image = drawn(renderer, alone(broken), view).copy()
    assert np.isfinite(image).all()
    np.testing.assert_array_equal(image, drawn(renderer, alone(only(broken, whole)), view))


@pytest.mark.parametrize("drawing", DRAWINGS)
@pytest.mark.parametrize("scene", [alone(random_layers(300)), Scene(()), alone(random_layers(0))])
def test_nothing_in_front_is_a_clean_image(opened, ctx, drawing, scene):
    renderer = opened(drawing)
    renderer.settings = RenderSettings(background=(0.25, 0.5, 0.75))
    shown = ctx.framebuffer([ctx.texture((32, 16), 4, dtype="f4")])
    renderer.update(scene)
    stats = renderer.draw([AWAY], shown)
    assert stats.drawn == 0 and stats.splats == scene.splat_count == sum(stats.culled.values())
    np.testing.assert_array_equal(renderer.image(), np.zeros((16, 32, 4)))
    want = np.broadcast_to(np.array([0.25, 0.5, 0.75], np.float32), (16, 32, 3))
    np.testing.assert_array_equal(renderer.resolved(), want)
    np.testing.assert_array_equal(pixels(shown), want)


def pixels(framebuffer) -> np.ndarray:
    """(H, W, 3) of a float framebuffer, row 0 on top."""
    width, height = framebuffer.size
    raw = np.frombuffer(framebuffer.read(components=4, dtype="f4"), np.float32)
    return raw.reshape(height, width, 4)[::-1, :, :3]


def heated() -> SplatLayers:
    """A cloud that becomes thermal along the slider."""
    cloud, stops = random_layers(2000), (Stop("rgb", 0.0), Stop("heat", 1.0, "thermal", "ironbow"))
    return replace(cloud, stops=stops)


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_presented_is_what_resolved_says_with_and_without_palette(opened, ctx, drawing):
    renderer, view = opened(drawing, target="rgba32f"), front_view((80, 50))
    scene = alone(heated(), x=0.0)
    renderer.settings = RenderSettings(background=(0.2, 0.1, 0.3))
    shown = ctx.framebuffer([ctx.texture((80, 50), 4, dtype="f4")])
    images = []
    for x in (0.0, 0.5, 1.0):
        scene = alone(scene.objects[0].model, x=x)
        assert value_blend(scene)[1] == pytest.approx(x)
        renderer.update(scene)
        assert "resolve" in renderer.draw([view], [shown]).ms
        images.append(pixels(shown))
        np.testing.assert_allclose(images[-1], renderer.resolved(), atol=2e-4)
    assert np.abs(images[0] - images[2]).max() > 0.3


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_upright_on_screen(opened, ctx, drawing):
    """A red thing above and a green one to the right: in the image and in the framebuffer."""
    size = np.full((2, 3), 0.08)
    red, green = [[1.7, -1.7, -1.7]], [[-1.7, 1.7, -1.7]]
    arrays = ([[0, 0.5, 0], [0.5, 0, 0]], size, [[1, 0, 0, 0]] * 2, [1, 1], [red, green])
    model = SplatLayers(
        *(np.asarray(a, np.float32) for a in arrays), np.zeros(2, np.int32), (Stop("only", 0.0),)
    )
    view = View(look_at((0, 0, 2), (0, 0, 0)), (-0.5, 0.5, -0.5, 0.5), 0.1, 50, (64, 64))
    shown = ctx.framebuffer([ctx.texture((64, 64), 4, dtype="f4")])
    renderer = opened(drawing)
    renderer.update(alone(model))
    renderer.draw([view], shown)
    for image in (renderer.image(), renderer.resolved(), pixels(shown)):
        assert image[16, 32, 0] > 0.9 > 0.1 > image[16, 32, 1]
        assert image[32, 48, 1] > 0.9 > 0.1 > image[32, 48, 0]


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_only_what_changed_is_decoded(opened, drawing):
    renderer = opened(drawing)
    model, near = random_model(50), front_view((32, 32))
    far = front_view((32, 32), distance=5)

    def runs(x: float, view: View, **placed) -> tuple[int, int]:
        renderer.update(alone(model, x=x, **placed))
        stats = renderer.draw([view])
        return stats.geometry_runs, stats.color_runs

    assert runs(0.2, near) == (1, 1)
    assert runs(0.2, near) == (0, 0)
    assert runs(0.2, far) == (0, 1)
    assert runs(0.3, far) == (1, 1)
    assert runs(0.3, far, world_from_object=Pose(np.ones(3), IDENTITY)) == (0, 1)
    model = without_control(model, "offset", "scale", "rotation", "opacity")
    assert runs(0.3, near) == (1, 1)
    before = renderer.image().copy()
    assert runs(0.9, near) == (0, 1)  # all stops share the shape
    assert not np.array_equal(renderer.image(), before)
    wanted = reference_image(alone(model, x=0.9), near)
    assert np.abs(renderer.image() - wanted).max() < 0.02


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_a_sweep_of_x_allocates_nothing_and_keeps_the_count(opened, drawing):
    renderer, view = opened(drawing), front_view((32, 32))
    scene = Scene(
        (*alone(random_layers(500, layers=2)).objects, SceneObject("m", random_model(40)))
    )

    def frame(x: float) -> int:
        renderer.update(
            Scene(tuple(SceneObject(o.name, o.model, x=float(x)) for o in scene.objects))
        )
        return renderer.draw([view]).splats

    frame(0.0)
    before = renderer.drawing.allocations
    assert {frame(x) for x in np.linspace(0, 1, 200)} == {900}
    assert renderer.drawing.allocations == before
    renderer.update(alone(scene.objects[0].model))
    assert renderer.drawing.allocations > before, "another set of objects is a new arena"


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_hidden_objects_are_not_drawn(opened, drawing):
    renderer, view = opened(drawing, target="rgba32f"), front_view((64, 64))
    cloud, other = two_objects(1000).objects
    hidden = SceneObject(other.name, other.model, other.world_from_object, visible=False)
    with_hidden = drawn(renderer, Scene((cloud, hidden)), view).copy()
    np.testing.assert_array_equal(with_hidden, drawn(renderer, Scene((cloud,)), view))


def test_limits_and_counts_agree_between_the_back_ends(opened):
    scene, view = two_objects(4000), front_view((96, 96))
    stats = {}
    for drawing in DRAWINGS:
        renderer = opened(drawing, target="rgba32f")
        renderer.settings = RenderSettings(max_pixels=1.5, max_distance=4.2, min_alpha=0.02)
        reference = reference_image(scene, view, renderer.settings)
        assert psnr_db(drawn(renderer, scene, view), reference) > 60
        stats[drawing] = renderer.draw([view])
        assert stats[drawing].drawn + sum(stats[drawing].culled.values()) == scene.splat_count
    drawn_by = [s.drawn for s in stats.values()]
    assert abs(drawn_by[0] - drawn_by[1]) <= 2, "rounding at a limit alone may differ"


def test_a_scene_that_does_not_fit_is_refused_and_the_old_one_still_drawn(opened):
    renderer, view = opened("quads"), front_view((32, 32))
    small, large = alone(random_layers(100)), alone(random_layers(5000))
    image = drawn(renderer, small, view)
    limit, renderer.gpu.max_block = renderer.gpu.max_block, 32 * 1000
    with pytest.raises(BadFile, match="5,000 splats and this driver draws 1,000 at most"):
        renderer.update(large)
    assert renderer.draw([view]).splats == 0, "drawing goes on, with nothing"
    np.testing.assert_array_equal(drawn(renderer, small, view), image)
    renderer.gpu.max_block = limit


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_views_and_framebuffers_must_match(opened, ctx, drawing):
    renderer = opened(drawing)
    shown = ctx.framebuffer([ctx.texture((8, 8), 4)])
    for views, target in (([], None), (stereo_views((8, 8)), shown), ([front_view()], [])):
        with pytest.raises(ValueError, match="at least one view, and no or one framebuffer a view"):
            renderer.draw(views, target)


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_the_bound_framebuffer_stays_bound(opened, ctx, drawing):
    renderer = opened(drawing)
    mine = ctx.framebuffer([ctx.texture((8, 8), 4)])
    mine.use()
    renderer.update(alone(random_layers(20)))
    renderer.draw([front_view((16, 16))], ctx.framebuffer([ctx.texture((8, 8), 4)]))
    assert ctx.fbo is mine
    ctx.screen.use()


def test_software_gl_takes_the_cpu_back_ends(opened, ctx):
    renderer = opened("auto")
    if not is_software(ctx):
        assert renderer.backends == {"drawing": "quads (rgba16)", "mlps": "gl", "sort": "gl"}
    else:
        assert renderer.backends["drawing"].startswith("tiles (")
        assert renderer.backends["mlps"] == "opencl"


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_eight_bits_show_what_resolved_says(opened, ctx, drawing):
    """Where the framebuffer is a window's size and format tiles hand over bytes, upright."""
    renderer, view = opened(drawing, target="rgba32f"), front_view((83, 50))
    model = heated()
    renderer.settings = RenderSettings(background=(0.2, 0.1, 0.3))
    same, larger, floats = (
        ctx.simple_framebuffer((83, 50)),
        ctx.simple_framebuffer((100, 60)),
        ctx.framebuffer([ctx.texture((83, 50), 4, dtype="f4")]),
    )
    gpu = Gpu(ctx)
    resolve = Resolve(gpu)
    for x in (0.0, 0.5):
        renderer.update(alone(model, x=x))
        for shown in (same, larger, floats):
            shown.clear(1.0, 1.0, 1.0)
            shown.viewport = (0, 0, 83, 50)
            renderer.draw([view], shown)
            assert resolve.takes_bytes(shown, (83, 50)) == (shown is not floats)
            assert not resolve.takes_bytes(shown, (83, 49))
            width, height = shown.size
            whole = (0, 0, width, height)
            raw = np.frombuffer(shown.read(viewport=whole, components=4), np.uint8)
            got = raw.reshape(height, width, 4)
            want = renderer.resolved()[::-1].clip(0, 1) * 255
            assert np.abs(got[:50, :83, :3] - want).max() < step_error(ctx)
            beyond = (got[50:, :, :3], got[:, 83:, :3])  # the viewport
            assert all((part == 255).all() for part in beyond)
    for each in (same, larger, floats, resolve, gpu):
        each.release()
