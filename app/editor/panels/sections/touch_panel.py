"""The panel's section "Touch": play, step, put back, pads of two axes, what has answered."""

from typing import cast

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import button_row, item_label, tip
from shapeshift.app.editor.state.touch_state import TouchState
from shapeshift.scene.document.scene_file import named_stops
from shapeshift.scene.world.reactions import TwoAxes
from shapeshift.scene.world.rigid_object import RigidObject

Vec = imgui.ImVec2
PAD, KNOB = 120.0, 9.0  # logical pixels: a pad's height, and half of its knob


def draw_touch(touch: TouchState, ui_scale: float, colliders: bool = True) -> None:
    """Buttons for what the keys do, the pads, and the last reactions; `colliders`: who shows the
    picture can draw them.
    """
    world = touch.living
    play = "Play" if world.paused else "Pause"
    tips = {
        f"{play}###play": "Key T. While objects move, drag one to carry it.",
        "Step": "One step of 1/90 s. Shift+T.",
        "Put back": "Everything where it was before it was touched. Key R.",
    }
    clicked = button_row(tips, ui_scale, 3)
    deeds = {f"{play}###play": touch.toggle, "Step": touch.step, "Put back": touch.reset_objects}
    if clicked:
        deeds[clicked]()
    if colliders:
        _, touch.colliders = imgui.checkbox(item_label("show colliders"), touch.colliders)
        tip("Key J. What the physics touches: green moves, blue stays.", ui_scale)
    name = pad_object(touch)
    axes = world.objects[name].item.two_axes if name is not None else None
    if name is not None and axes is not None:
        draw_pad(touch, name, axes, ui_scale)
    for line in touch.reactions:
        imgui.text_disabled(line)


def pad_object(touch: TouchState) -> str | None:
    """Whose pad is shown: of those that have one the chosen object, else the first."""
    names = [n for n, obj in touch.living.objects.items() if obj.item.two_axes is not None]
    chosen = touch.chosen
    return chosen if chosen in names else names[0] if names else None


def draw_pad(touch: TouchState, name: str, axes: TwoAxes, ui_scale: float) -> None:
    """A square to drag in: to the sides balance -1 to 1, upwards power 0 to 1."""
    obj = touch.living.objects[name]
    balance, power = touch.pads[name] = pad_of(
        axes, obj.machine.blend.slider_x(obj.reaction_state.x), touch.pads.get(name, (0.0, 1.0))
    )
    imgui.text_disabled(f"{name}: balance {balance:+.2f}, power {power:.2f}")
    corner = imgui.get_cursor_screen_pos()
    width, height = imgui.get_content_region_avail().x, PAD * ui_scale
    inset = KNOB * ui_scale  # the knob stays within the pad
    half, reach = width / 2 - inset, height - 2 * inset
    imgui.invisible_button(f"pad {name}", Vec(width, height))
    middle, low = corner.x + width / 2, corner.y + height - inset
    if imgui.is_item_active() or imgui.is_item_deactivated():  # also where it was let go
        mouse = imgui.get_io().mouse_pos
        balance = min(max((mouse.x - middle) / half, -1.0), 1.0)
        power = min(max((low - mouse.y) / reach, 0.0), 1.0)
        touch.pads[name] = balance, power
        touch.control(name, axes.x(balance, power, obj.machine.blend))
    tip("To the sides: which of two; upwards: how much of it.", ui_scale)
    draw = imgui.get_window_draw_list()
    end, line = Vec(corner.x + width, corner.y + height), theme.color(theme.TRACK, 0.8)
    draw.add_rect_filled(corner, end, theme.color(theme.RAISED), 4 * ui_scale)
    draw.add_line(Vec(middle, low - reach), Vec(middle, low), line, ui_scale)
    draw.add_line(Vec(middle - half, low), Vec(middle + half, low), line, ui_scale)
    for side, word in zip((-1, 1), side_names(obj, axes), strict=True):
        size = imgui.calc_text_size(word)
        left = corner.x + inset / 2 if side < 0 else end.x - inset / 2 - size.x
        draw.add_text(Vec(left, low - size.y - inset / 2), theme.color(theme.MUTED), word)
    knob = Vec(middle + balance * half, low - power * reach)
    draw.add_line(Vec(middle, low), knob, theme.color(theme.ACCENT, 0.5), 2 * ui_scale)
    draw.add_circle_filled(knob, 7 * ui_scale, theme.color(theme.ACCENT))
    draw.add_circle_filled(knob, 3 * ui_scale, theme.color(theme.SURFACE))


def side_names(obj: RigidObject, axes: TwoAxes) -> tuple[str, str]:
    """What is at both sides: a state or a stop that lies there, "" where none does."""
    stops = named_stops(obj.item, obj.drawn.model)
    below, above = (next((s.name for s in stops if s.x == x), "") for x in (axes.below, axes.above))
    return below, above


def pad_of(axes: TwoAxes, x: float, last: tuple[float, float]) -> tuple[float, float]:
    """Balance and power that give x: the last ones if they do, else with as much power as before.

    Beyond both sides, where nothing gives x, the nearest.
    """
    balance, power = last
    if abs(x_of(axes, balance, power) - x) < 1e-4:
        return last
    best = (0.0, power)
    for side, sign in ((axes.above, 1.0), (axes.below, -1.0)):
        reach = side - axes.rest
        part = min(max((x - axes.rest) / reach, 0.0), 1.0) if reach else 0.0
        needed = max(power, part)  # less power could not reach so far
        found = (sign * part / needed, needed) if part > 0 else (0.0, power)
        if abs(x_of(axes, *found) - x) < abs(x_of(axes, *best) - x) - 1e-9:
            best = found
    return best


def x_of(axes: TwoAxes, balance: float, power: float) -> float:
    """Where both lead; without the model's stops that is a place on the slider, never a blend."""
    return cast(float, axes.x(balance, power))
