"""A glass in the hand: which stop it shows, when it is there, and what both eyes see through it."""

from dataclasses import replace
from types import SimpleNamespace

import moderngl
import numpy as np
import pytest

from shapeshift.app.errors import UsageError
from shapeshift.app.headset.over.glass_state import GlassState, seen_through, stop_named, stop_now
from shapeshift.app.headset.over.hand_glass import HandGlass
from shapeshift.app.headset.panel_picture import PANEL, PanelPicture
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.selectors.selector import Sphere
from shapeshift.vr.drawn import Drawn
from shapeshift.vr.frame import LOST, SIDES
from shapeshift.vr.glass import RADIUS_M
from shapeshift.vr.openxr.view_configuration import with_insets
from shapeshift.vr.panel import Carried
from shapeshift.vr.touching import Touched
from tests.support.renderer.frames import texture_target
from tests.support.renderer.heat_scenes import model
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.vr.vr_glass import BEFORE, away_of, upright
from tests.support.vr.vr_hands import HEAD, a_frame, eyes, hand_at
from tests.support.vr.vr_panel import Wearer, a_state, some_things

RENDERERS = EITHER_ON_GL
SIZE = (320, 290)  # of away_of, too
EYES = eyes(SIZE)
# With insets in which the glass lies off the middle, a third as wide as the eyes see.
INSETS = [replace(view, tangents=(-0.42, 0.28, -0.35, 0.40)) for view in EYES]
FOUR = with_insets([*EYES, *INSETS])
ALIKE = model(40, "offset", "scale", "rotation", "opacity")  # networks that see no control
OTHER = model(40)  # its shape follows the control


def test_a_stop_is_named_whatever_its_capitals_and_others_are_listed():
    editor = some_things()
    assert stop_named(editor, "") == ""
    assert stop_named(editor, "WARM") == "warm"
    with pytest.raises(UsageError, match="--glass is hot, expected one of the stops: layer 0"):
        stop_named(editor, "hot")
    nothing = SimpleNamespace(movable=[])
    with pytest.raises(UsageError, match="nothing here has stops"):
        stop_named(nothing, "hot")
    assert (stop_now(editor, "warm"), stop_now(editor, "hot")) == ("warm", "")


def test_what_has_the_stop_is_at_it_as_a_whole_and_the_rest_stays():
    editor = some_things()
    shown = editor.scene
    part = Sphere(x=0.1, centre=np.zeros(3), radius=0.2)
    painted = [replace(obj, selectors=(part,)) for obj in shown.objects]
    scene, moved = seen_through(editor, Scene(tuple(painted)), "heat")
    assert [obj.name for obj in moved.objects] == ["leg", "gone"]
    for before, obj in zip(painted, scene.objects, strict=True):
        if obj.name in ("leg", "gone"):
            assert (obj.x, obj.selectors) == (1.0, ())
        else:
            assert obj is before
    assert seen_through(editor, shown, "nowhere")[1].objects == ()


@pytest.fixture
def glass(ctx):
    with Renderer(ctx) as renderer:
        made = HandGlass(ctx, renderer)
        yield made
        made.close()


def held_in(glass: HandGlass, state, carried: Carried | None = None, **hands) -> str:
    """The hand that has it; "" for none."""
    state.glass.held = None
    state.shown = state.editor.scene
    frame = a_frame(**hands)
    drawn = glass.hold(frame, state, carried or Carried(PANEL))
    sides = [side for side in SIDES if drawn[side] is not frame.hands[side]]
    assert len(sides) <= 1 and bool(sides) == (state.glass.held is not None)
    return sides[0] if sides else ""


def test_it_is_in_the_hand_of_the_panel_while_nothing_else_is(glass):
    state = a_state()
    both = {"left": upright(), "right": upright()}
    assert held_in(glass, state, **both) == "", "off by default"
    state.glass.stop = "heat"
    assert held_in(glass, state, **both) == "left"
    assert held_in(glass, state, left=LOST, right=upright()) == ""
    assert held_in(glass, state, Carried(PANEL, open=True), **both) == ""
    state.user.touched = Touched(held={"left": "leg", "right": None})
    assert held_in(glass, state, **both) == ""
    state.user.touched = Touched(held={"left": None, "right": "leg"})
    assert held_in(glass, state, **both) == "left"
    state.worn.choose(panel_hand="right")
    state.user.touched = Touched()
    assert held_in(glass, state, **both) == "right"
    state.worn.choose(panel_hand="left", hands="right")
    assert held_in(glass, state, left=LOST, right=upright()) == "right", "the only one"
    state.worn.choose(hands="both")
    joints = np.zeros((26, 4))
    assert held_in(glass, state, left=replace(upright(), joints=joints)) == "left", "bare"
    state.editor.settings = replace(state.editor.settings, debug="depth")
    assert held_in(glass, state, **both) == ""
    state.editor.settings = replace(state.editor.settings, debug="")
    state.glass.stop = "nowhere"
    assert held_in(glass, state, **both) == ""


def test_a_hand_that_has_it_is_closed_and_shows_no_ray_but_where_it_acts(glass):
    state = a_state()
    state.glass.stop, state.shown = "heat", state.editor.scene
    hand = replace(upright(), aim=hand_at(BEFORE).aim)
    drawn = glass.hold(a_frame(hand), state, Carried(PANEL))["left"]
    assert drawn.squeeze > 0.5 and drawn.aim is None and drawn.grip == hand.grip
    pulled = glass.hold(a_frame(replace(hand, trigger=0.9)), state, Carried(PANEL))["left"]
    assert pulled.aim is hand.aim and pulled.trigger == 0.9
    over = glass.added(Drawn(), state)
    assert over.hands and [card.lines for card in over.cards] == [("heat",), ("K",)]
    state.glass.held = None
    assert glass.added(Drawn(), state) == Drawn()


def a_world(what, x: float = 0.0) -> tuple[SimpleNamespace, Scene]:
    """A state whose one object lies behind the glass, large."""
    middle = np.array([0.05, 1.55, -3.0])
    scene = Scene((SceneObject("thing", what, Pose(middle, HEAD.wxyz), x=x),))
    editor = SimpleNamespace(
        movable=[0], scene=scene, stops=lambda index: what.stops, settings=RenderSettings(),
        messages=SimpleNamespace(problems=[]),
    )  # fmt: skip
    editor.messages.fail = editor.messages.problems.append
    made = a_state()
    state = SimpleNamespace(
        editor=editor, shown=scene, glass=GlassState("Hot"), worn=made.worn, user=made.user
    )
    return state, scene


def shown(renderer, i, framebuffer, play_view, floor, see_through) -> None:
    renderer.present(framebuffer, i)


def pixels(framebuffer: moderngl.Framebuffer) -> np.ndarray:
    """(H, W, 3) int, row 0 below."""
    found = np.frombuffer(framebuffer.read(components=3, alignment=1), np.uint8)
    return found.reshape(*SIZE[::-1], 3).astype(int)


@pytest.mark.parametrize("what", [ALIKE, OTHER], ids=["other colours", "another shape"])
@pytest.mark.parametrize("views", [EYES, FOUR], ids=["eyes", "insets"])
def test_each_eye_sees_the_other_stop_from_its_own_place_within_the_disc(
    ctx, renderer, what, views
):
    """Against whole pictures of both stops, of a renderer that knows no glass."""
    renderer.settings = RenderSettings(background=(0.1, 0.2, 0.3), stereo_colors="shared")
    state, scene = a_world(what)
    hot = Scene((replace(scene.objects[0], x=0.5),))
    wanted = []
    with texture_target(ctx, SIZE) as target:
        for each in (scene, hot):
            renderer.update(each)
            renderer.draw(list(views))
            for i in range(len(views)):
                renderer.present(target, i)
                wanted.append(pixels(target))
        glass = HandGlass(ctx, renderer)
        glass.hold(a_frame(upright()), state, Carried(PANEL))
        for _ in range(2):
            looking = glass.look(state, views, views)
            assert looking.together == (what is ALIKE)
            renderer.update(scene)
            renderer.draw(list(views))
            assert glass.draw(looking, state) is looking
            changed = []
            for i, view in enumerate(views):
                renderer.present(target, i)
                glass.lay(looking, i, target, view, None, shown)
                image, away = pixels(target), away_of(state.glass.held, view)
                slack = 0.008  # metres: two pixels of the soft edge
                inside, outside = away < RADIUS_M - slack, away > RADIUS_M + slack
                # Parts add up as the whole does, but for a rounding of floats at a pixel's edge.
                assert np.abs(image - wanted[len(views) + i])[inside].max() <= 1
                assert np.abs(image - wanted[i])[outside].max() <= 1
                changed.append(np.abs(wanted[len(views) + i] - wanted[i])[inside].max())
            assert min(changed) > 60, "or there was nothing to see"
        state.glass.held = None
        assert glass.look(state, views, views) is None and not renderer.keeps_beside
        glass.close()


def test_where_there_is_no_room_it_is_put_away_and_the_panel_says_so(glass, monkeypatch):
    state, _ = a_world(OTHER)

    def refuse(self, scene) -> None:
        raise BadFile("too many splats")

    glass.hold(a_frame(upright()), state, Carried(PANEL))
    looking = glass.look(state, EYES, EYES)
    monkeypatch.setattr(Renderer, "update", refuse)
    assert glass.draw(looking, state) is None
    assert (state.glass.stop, state.glass.held) == ("", None)
    (told,) = state.editor.messages.problems
    assert "no room for a glass: too many splats" in str(told)


def test_the_panel_chooses_it(ctx):
    picture = PanelPicture(ctx)
    wearer = Wearer(picture)
    wearer.unfold("Look", "Glass")
    wearer.scroll_to("heat")
    wearer.press("heat")
    assert wearer.state.glass.stop == "heat"
    wearer.scroll(1.0)
    wearer.scroll_to("no glass")
    wearer.press("no glass")
    assert wearer.state.glass.stop == ""
    picture.release()
