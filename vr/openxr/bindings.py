"""Which button of which controller does what: a table of interaction profiles.  No OpenXR here.

An action set has one action a meaning; the runtime converts a click to 0 or 1 where a number is
wanted, and re-binds to controllers that are not listed.
"""

from collections.abc import Mapping

POSES = ("grip", "aim")
NUMBERS = ("squeeze", "trigger")  # 0..1
PLANES = ("stick", "pad")  # -1..1, two of them
CLICKS = ("stick_click", "pad_click", "primary", "secondary", "menu")
HAPTIC = "pulse"

CENTRE = 0.35  # of a trackpad's radius: a press within is its button, farther out its direction

_ALWAYS = {"grip": "input/grip/pose", "aim": "input/aim/pose", HAPTIC: "output/haptic"}
_STICK = {"stick": "input/thumbstick", "stick_click": "input/thumbstick/click"}

# profile: action -> its path on either hand, or {side: path} where the hands differ
PROFILES: dict[str, Mapping[str, str | Mapping[str, str]]] = {
    "/interaction_profiles/valve/index_controller": {
        **_ALWAYS,
        **_STICK,
        "squeeze": "input/squeeze/value",
        "trigger": "input/trigger/value",
        "primary": "input/a/click",
        "secondary": {"right": "input/b/click"},
        "menu": {"left": "input/b/click"},  # it has no menu button
    },
    "/interaction_profiles/oculus/touch_controller": {
        **_ALWAYS,
        **_STICK,
        "squeeze": "input/squeeze/value",
        "trigger": "input/trigger/value",
        "primary": {"left": "input/x/click", "right": "input/a/click"},
        "secondary": {"left": "input/y/click", "right": "input/b/click"},
        "menu": {"left": "input/menu/click"},  # the right one is the system's
    },
    "/interaction_profiles/htc/vive_controller": {
        **_ALWAYS,
        "squeeze": "input/squeeze/click",
        "trigger": "input/trigger/value",
        "pad": "input/trackpad",
        "pad_click": "input/trackpad/click",
        "menu": "input/menu/click",
    },
    "/interaction_profiles/microsoft/motion_controller": {
        **_ALWAYS,
        **_STICK,
        "squeeze": "input/squeeze/click",
        "trigger": "input/trigger/value",
        "primary": "input/trackpad/click",
        "menu": "input/menu/click",
    },
    # One button: it takes hold where there is something within reach, else it acts.
    "/interaction_profiles/khr/simple_controller": {
        **_ALWAYS,
        "squeeze": "input/select/click",
        "trigger": "input/select/click",
        "menu": "input/menu/click",
    },
}


def paths(profile: str) -> list[tuple[str, str]]:
    """(action, whole path) of both hands."""
    rows = []
    for action, where in PROFILES[profile].items():
        sides = where if isinstance(where, Mapping) else {"left": where, "right": where}
        rows += [(action, f"/user/hand/{side}/{path}") for side, path in sides.items()]
    return rows


def pressed_pad(x: float, y: float, pressed: bool) -> tuple[tuple[float, float], bool]:
    """A trackpad as a stick and a button: it speaks while it is pressed, in its centre a button."""
    if not pressed:
        return (0.0, 0.0), False
    if not x * x + y * y > CENTRE * CENTRE:
        return (0.0, 0.0), True
    return (x, y), False
