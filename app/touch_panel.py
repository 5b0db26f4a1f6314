"""The panel's section "Touch": play, step, put back, pads of two axes, what has answered."""

from typing import TYPE_CHECKING

from imgui_bundle import imgui

from app import theme
from app.panel_rows import button_row, tip
from scene.reactions import TwoAxes

if TYPE_CHECKING:
    from app.touch import Touch

Vec = imgui.ImVec2
PAD = 120.0  # logical pixels, of a pad's height


def draw_touch(touch: "Touch", ui_scale: float) -> None:
    """Buttons for what the keys do, the pads, and the last reactions."""
    world = touch.world
    play = "Play" if world.paused else "Pause"
    clicked = button_row((f"{play}###play", "Step", "Put back"), ui_scale, 3)
    tip("T, Shift+T, R. While things move, drag one to carry it.", ui_scale)
    deeds = {f"{play}###play": touch.toggle, "Step": touch.step, "Put back": touch.put_back}
    if clicked:
        deeds[clicked]()
    _, touch.marks.colliders = imgui.checkbox("show colliders", touch.marks.colliders)
    tip("Key C. What the physics touches: green moves, blue stays.", ui_scale)
    for name, thing in world.things.items():
        if thing.item.two_axes is not None:
            imgui.push_id(name)
            draw_pad(touch, name, thing.item.two_axes, ui_scale)
            imgui.pop_id()
    for line in touch.told:
        imgui.text_disabled(line)


def draw_pad(touch: "Touch", name: str, axes: TwoAxes, ui_scale: float) -> None:
    """A square to drag in: to the sides balance -1 to 1, upwards power 0 to 1."""
    x = touch.world.things[name].standing.x
    balance, power = touch.pads[name] = pad_of(axes, x, touch.pads.get(name, (0.0, 1.0)))
    imgui.text_disabled(f"{name}: balance {balance:+.2f}, power {power:.2f}")
    corner = imgui.get_cursor_screen_pos()
    width, height = imgui.get_content_region_avail().x, PAD * ui_scale
    imgui.invisible_button("pad", Vec(width, height))
    if imgui.is_item_active():
        mouse = imgui.get_io().mouse_pos
        balance = min(max(2 * (mouse.x - corner.x) / width - 1, -1.0), 1.0)
        power = min(max(1 - (mouse.y - corner.y) / height, 0.0), 1.0)
        touch.pads[name] = balance, power
        touch.control(name, axes.x(balance, power))
    tip("To the sides: which of two; upwards: how much of it.", ui_scale)
    draw = imgui.get_window_draw_list()
    end, line = Vec(corner.x + width, corner.y + height), theme.color(theme.TRACK, 0.8)
    draw.add_rect_filled(corner, end, theme.color(theme.RAISED), 4 * ui_scale)
    middle = corner.x + width / 2
    draw.add_line(Vec(middle, corner.y), Vec(middle, end.y), line, ui_scale)
    draw.add_line(Vec(corner.x, end.y), end, line, ui_scale)
    knob = Vec(middle + balance * width / 2, end.y - power * height)
    draw.add_line(Vec(middle, end.y), knob, theme.color(theme.ACCENT, 0.5), 2 * ui_scale)
    draw.add_circle_filled(knob, 7 * ui_scale, theme.color(theme.ACCENT))
    draw.add_circle_filled(knob, 3 * ui_scale, theme.color(theme.SURFACE))


def pad_of(axes: TwoAxes, x: float, last: tuple[float, float]) -> tuple[float, float]:
    """Balance and power that give x: the last ones if they do, else with as much power as before.

    Beyond both sides, where nothing gives x, the nearest.
    """
    balance, power = last
    if abs(axes.x(balance, power) - x) < 1e-4:
        return last
    best = (0.0, power)
    for side, sign in ((axes.above, 1.0), (axes.below, -1.0)):
        reach = side - axes.rest
        part = min(max((x - axes.rest) / reach, 0.0), 1.0) if reach else 0.0
        needed = max(power, part)  # less power could not reach so far
        found = (sign * part / needed, needed) if part > 0 else (0.0, power)
        if abs(axes.x(*found) - x) < abs(axes.x(*best) - x) - 1e-9:
            best = found
    return best
