"""What is drawn over an eye's picture: known pixels of panel, hands and lines in both eyes."""

from dataclasses import replace

import moderngl
import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.vr.drawn import FINE as FINE_INK
from shapeshift.vr.drawn import WRONG, Drawn, PanelQuad, arc, drawn_of
from shapeshift.vr.frame import LOST
from shapeshift.vr.glove import LIT, Capsule
from shapeshift.vr.locomotion import Arc, Comfort
from shapeshift.vr.overlay import FINE, PLAIN, Overlay, box_of, capsule_mesh
from shapeshift.vr.panel import Carried, carry
from shapeshift.vr.play_space import PlaySpace
from shapeshift.vr.touching import Touched
from tests.support.renderer.frames import texture_target
from tests.support.vr.vr_hands import HEAD, OPEN, PLANE, a_frame, eyes, hand_at, pixel_of

SIZE = (500, 450)
EYES = eyes(SIZE)
SURFACE, ACCENT, TEXT = (27, 28, 30), (242, 161, 69), (230, 230, 232)
SPOT = (220.0, 100.0)  # units: the middle of the bright square on the panel below
LEFT, RIGHT = hand_at((-0.10, 1.22, -0.45)), hand_at((0.2, 1.2, -0.5))
CARRIES = hand_at((0.02, 1.2, -0.6))  # the panel, all of it in view of both eyes
GROUND = (40, 90, 160)  # of the picture below


@pytest.fixture(params=[FINE, PLAIN], ids=["fine", "plain"])
def overlay(ctx, request):
    with Overlay(ctx, request.param) as made:
        yield made


@pytest.fixture
def target(ctx):
    with texture_target(ctx, SIZE) as made:
        yield made


@pytest.fixture
def panel(ctx):
    """A dark panel with a square of the accent's colour right of its middle, above it."""
    made = ctx.texture(PLANE.size, 4)
    paint(made, ACCENT)
    yield made
    made.release()


def paint(texture: moderngl.Texture, ink: tuple[int, int, int]) -> None:
    """The square in another colour; row 0 is below, as in all that GL draws."""
    pixels = np.full((PLANE.size[1], PLANE.size[0], 4), 255, np.uint8)
    pixels[..., :3] = SURFACE
    pixels[80:120, 200:240, :3] = ink
    texture.write(np.ascontiguousarray(pixels[::-1]))
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)


def picture(overlay: Overlay, target: moderngl.Framebuffer, drawn: Drawn, eye: int = 0):
    """(H, W, 3) uint8, row 0 on top."""
    target.clear(*(c / 255 for c in GROUND), 1.0)
    overlay.draw(target, EYES[eye], drawn)
    return np.frombuffer(target.read(components=3), np.uint8).reshape(*SIZE[::-1], 3)[::-1]


def at(image: np.ndarray, eye: int, place) -> np.ndarray:
    return image[pixel_of(EYES[eye], np.asarray(place, float))].astype(int)


def shown(left=CARRIES, right=LOST) -> Carried:
    carried = OPEN
    for _ in range(2):
        carried = carry(carried, a_frame(left, right), 1.0)
    return carried


def place_on(carried: Carried, at) -> np.ndarray:
    """(3,) metres of the room of a place on the panel, units."""
    return PLANE.play_point(carried.play_from_panel, at)


def only_panel(carried: Carried, texture: moderngl.Texture) -> Drawn:
    return Drawn(panel=PanelQuad(texture, carried.play_from_panel, PLANE.size_m))


@pytest.mark.parametrize("eye", [0, 1])
def test_the_panel_is_where_it_hangs_in_both_eyes(overlay, target, panel, eye):
    carried = shown()
    image = picture(overlay, target, only_panel(carried, panel), eye)

    def color(x: float, y: float) -> np.ndarray:
        return at(image, eye, place_on(carried, (x, y)))

    assert np.abs(color(*SPOT) - ACCENT).max() < 4
    mirrored = (SPOT[0], 360 - SPOT[1]), (320 - SPOT[0], SPOT[1])  # neither upside down nor turned
    for place in (*mirrored, (160, 180), (10, 180), (160, 350)):
        assert np.abs(color(*place) - SURFACE).max() <= 2
    outside = color(-10, 180), color(330, 180), color(160, 370)
    for one in (*outside, color(1, 1), color(319, 359)):  # beside it, and its round corners
        np.testing.assert_array_equal(one, GROUND)


def test_the_eyes_see_it_from_two_sides(overlay, target, panel):
    carried = shown()
    drawn = only_panel(carried, panel)
    columns = [
        np.nonzero((picture(overlay, target, drawn, eye) != GROUND).any(axis=(0, 2)))[0].mean()
        for eye in (0, 1)
    ]
    middle = [pixel_of(view, carried.play_from_panel.position)[1] for view in EYES]
    assert columns[0] - columns[1] == pytest.approx(middle[0] - middle[1], abs=6)
    assert middle[0] - middle[1] > 15


def test_a_world_of_any_scale_has_the_same_panel(overlay, target):
    """The eye in the world sees it where the eye in the room does: the room is all it needs."""
    turned = Pose(np.array([4.0, -2.0, 7.0]), np.array([0.9238795, 0, 0.3826834, 0]))
    play_space = PlaySpace(turned, 3.0)
    place = LEFT.grip.position
    assert pixel_of(play_space.view(EYES[0]), play_space.point(place)) == pixel_of(EYES[0], place)


def test_the_picture_follows_the_texture(overlay, target, panel):
    carried = shown()
    first = picture(overlay, target, only_panel(carried, panel))
    again = picture(overlay, target, only_panel(carried, panel))
    np.testing.assert_array_equal(first, again)
    paint(panel, TEXT)
    there = place_on(carried, SPOT)
    now = picture(overlay, target, only_panel(carried, panel))
    assert np.abs(at(now, 0, there) - TEXT).max() < 4


def test_nothing_to_draw_leaves_the_picture_and_the_context_alone(ctx, overlay, target):
    other = ctx.framebuffer([ctx.texture((8, 8), 4)])
    other.use()
    image = picture(overlay, target, Drawn())
    assert (image == GROUND).all() and not overlay._targets  # no memory
    drawn = drawn_of({"left": LEFT, "right": RIGHT}, shown(right=RIGHT))
    assert (picture(overlay, target, drawn) != GROUND).any()
    assert ctx.fbo is other and ctx.error == "GL_NO_ERROR"
    target.use()
    other.color_attachments[0].release()
    other.release()


def test_two_sizes_of_eyes_in_turn(ctx, overlay, target, panel):
    drawn = only_panel(shown(), panel)
    first = picture(overlay, target, drawn)
    small = ctx.framebuffer([ctx.texture((64, 48), 4)])
    small.clear(0, 0, 0, 1)
    overlay.draw(small, EYES[0].resized((64, 48)), drawn)
    assert np.frombuffer(small.read(components=3), np.uint8).any()
    np.testing.assert_array_equal(picture(overlay, target, drawn), first)
    small.color_attachments[0].release()
    small.release()


def test_hands_are_where_they_are_and_a_lost_one_is_not(overlay, target):
    carried = Carried(PLANE)
    drawn = drawn_of({"left": LEFT, "right": RIGHT}, carried)
    for eye in (0, 1):
        image = picture(overlay, target, replace(drawn, lines=()), eye)
        for capsule in drawn.hands[3:4] + drawn.hands[20:21]:
            color = at(image, eye, (capsule.a + capsule.b) / 2)
            assert np.ptp(color) < 25 and color.mean() > 70  # light grey, lit
        half = SIZE[0] // 2
        assert (image[:, :half] != GROUND).any() and (image[:, half:] != GROUND).any()
    lost = drawn_of({"left": LOST, "right": LOST}, carried)
    assert lost.hands == lost.lines == ()


def test_a_hand_before_the_panel_hides_it_and_one_behind_is_hidden(overlay, target, panel):
    carried = shown()
    normal = carried.play_from_panel.matrix()[:3, 2]
    place = place_on(carried, (160.0, 180.0))
    dot = Capsule(place, place, (0.02, 0.02), (1.0, 1.0, 1.0))
    for away, hidden in ((0.05, False), (-0.05, True)):
        ball = replace(dot, a=place + normal * away, b=place + normal * away)
        image = picture(overlay, target, replace(only_panel(carried, panel), hands=(ball,)))
        bright = at(image, 0, ball.a).min() > 150
        assert bright != hidden
        line = replace(
            only_panel(carried, panel), lines=(replace(ball, color=(0.0, 1.0, 0.0, 1.0)),)
        )
        green = at(picture(overlay, target, line), 0, ball.a)
        assert (green[1] > 250 and green[0] < 5) != hidden


def test_what_holds_something_has_a_lit_cuff(overlay, target):
    carried = Carried(PLANE)
    hands = {"left": LOST, "right": RIGHT}
    drawn = drawn_of(hands, carried, touched=Touched(held={"right": "cube"}))
    assert drawn.lines == ()  # its ray would be in the way
    cuff = drawn.hands[-1]
    color = at(picture(overlay, target, drawn), 0, (cuff.a + cuff.b) / 2)
    assert color[0] > 1.3 * color[2] and cuff.color == LIT


def test_a_ray_ends_in_a_dot_on_the_panel(overlay, target, panel):
    carried = shown()
    spot = place_on(carried, (160.0, 180.0))
    right = hand_at((0.3, 1.0, -0.1), spot)
    carried = carry(carried, a_frame(CARRIES, right), 0.0)
    assert carried.on_panel
    drawn = drawn_of({"left": CARRIES, "right": right}, carried, panel=panel)
    (beam, dot) = drawn.lines
    np.testing.assert_allclose(beam.b, spot, atol=1e-4)
    np.testing.assert_allclose(dot.a, spot, atol=1e-4)
    image = picture(overlay, target, replace(drawn, hands=()))
    assert at(image, 0, spot).min() > 150  # was the panel's dark surface


@pytest.mark.parametrize("fine", [True, False])
def test_the_arc_has_a_ring_where_it_lands(overlay, target, fine):
    seconds = np.linspace(0, 0.9, 20)[:, None]
    points = np.array([0.1, 1.2, -0.4]) + seconds * (0, 2.0, -3.0) - 4.9 * seconds**2 * (0, 1, 0)
    landing = np.array([0.1, 0.0, -3.4])
    comfort = Comfort(arc=Arc(points, landing, fine))
    drawn = drawn_of({"left": LOST, "right": LOST}, Carried(PLANE), comfort)
    color = np.array(FINE_INK if fine else WRONG) * 255
    for eye in (0, 1):
        image = picture(overlay, target, drawn, eye)
        assert np.abs(at(image, eye, points[3]) - color).max() < 60
        ring = [part for part in drawn.lines[len(points) - 1 :]]
        hit = [np.abs(at(image, eye, part.a) - color).max() < 60 for part in ring]
        assert np.mean(hit) > 0.8
    assert len(arc(points, None, False)) == len(points) - 1


def test_the_vignette_darkens_from_the_edge_around_straight_ahead(overlay, target):
    plain = np.array(GROUND)
    for eye in (0, 1):
        image = picture(overlay, target, Drawn(vignette=1.0), eye).astype(int)
        ahead = HEAD.position + EYES[eye].world_from_eye.position * (1, 0, 0) - np.array([0, 0, 5])
        np.testing.assert_array_equal(at(image, eye, ahead), plain)
        assert image[0, 0].max() == image[-1, -1].max() == 0
        half = picture(overlay, target, Drawn(vignette=0.4), eye).astype(int)
        assert (half >= image).all() and half.sum() > image.sum()
    assert (picture(overlay, target, Drawn(vignette=0.0)) == GROUND).all()


def test_a_blink_is_dark_but_for_the_panel(overlay, target, panel):
    image = picture(overlay, target, replace(only_panel(shown(), panel), blink=1.0))
    assert (image[0] == 0).all() and image.max() > 200
    half = picture(overlay, target, Drawn(blink=0.5))
    assert np.abs(half.astype(int) - np.array(GROUND) / 2).max() <= 1


def test_a_far_thin_line_is_pale_but_not_broken(overlay, target):
    start, end = np.array([-8.0, 1.6, -20.0]), np.array([8.0, 1.9, -20.0])
    line = Capsule(start, end, (0.001, 0.001), (1.0, 1.0, 1.0, 1.0))
    image = picture(overlay, target, Drawn(lines=(line,))).astype(int)
    columns = [pixel_of(EYES[0], place)[1] for place in (start, end)]
    brighter = (image.sum(axis=2) - sum(GROUND)).max(axis=0)[min(columns) + 3 : max(columns) - 3]
    assert (brighter > 20).all() and brighter.max() < 400


def test_many_capsules_grow_the_buffer(overlay, target):
    places = np.random.default_rng(0).normal(size=(700, 3)) * 0.2 + (0, 1.6, -2)
    balls = tuple(Capsule(p, p, (0.01, 0.01), (1.0, 0.0, 0.0)) for p in places)
    image = picture(overlay, target, Drawn(hands=balls))
    few = picture(overlay, target, Drawn(hands=balls[:40]))
    assert (image != GROUND).any(axis=2).sum() > 2 * (few != GROUND).any(axis=2).sum()


@pytest.mark.parametrize("seed", range(6))
def test_the_box_around_it_cuts_nothing_off(overlay, target, panel, monkeypatch, seed):
    rng = np.random.default_rng(seed)
    ends = rng.normal(size=(9, 2, 3)) * (2.0, 1.0, 0.6 + 2 * (seed % 2)) + (0, 1.6, -2.2)
    radii = rng.uniform(0.0005, 0.2, size=(9, 2))
    parts = tuple(
        Capsule(a, b, tuple(r), (1.0, 0.9, 0.1)) for (a, b), r in zip(ends, radii, strict=True)
    )
    dark = replace(only_panel(shown(), panel), vignette=0.5)
    cases = [Drawn(hands=(part,)) for part in parts]
    cases += [Drawn(lines=(part,), vignette=0.6) for part in parts]
    cases += [
        Drawn(hands=parts[:4], lines=parts[4:]),
        dark,
    ]
    boxed = [picture(overlay, target, drawn) for drawn in cases]
    monkeypatch.setattr("shapeshift.vr.overlay.box_of", lambda *_: (0, 0, *SIZE))
    for drawn, cut in zip(cases, boxed, strict=True):
        np.testing.assert_array_equal(cut, picture(overlay, target, drawn))


def test_what_is_behind_the_eye_costs_nothing():
    behind = np.array([0.0, 1.6, 3.0])
    drawn = Drawn(hands=(Capsule(behind, behind, (0.1, 0.1), LIT),))
    assert box_of(drawn, EYES[0], SIZE) is None and box_of(Drawn(), EYES[0], SIZE) is None


@pytest.mark.parametrize("detail", [FINE, PLAIN])
def test_the_capsules_mesh_is_a_closed_ball_seen_from_outside(detail):
    mesh, faces = capsule_mesh(detail.around, detail.below)
    places = mesh[:, :3] + mesh[:, 3:] * (0, 0, 1.0)  # stretched: the equator is there twice
    corners = places[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = corners.mean(axis=1) - (0, 0, 0.5)
    solid = np.linalg.norm(normal, axis=1) > 1e-9  # at the poles facets have no area
    assert ((normal * outward).sum(axis=1)[solid] > 0).all()
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(4 / 3 * np.pi + np.pi, rel=0.24)
    np.testing.assert_allclose(np.linalg.norm(mesh[:, :3], axis=1), 1, atol=1e-6)
