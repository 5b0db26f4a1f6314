"""How an object looks apart from its model: exposure, gamma, tint, opacity; and the sky behind."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.shapes import three
from shapeshift.scene.pose import View

Color = tuple[float, float, float]  # display sRGB
DISPLAY_GAMMA = 2.2  # of a display, by which stops of light become display values
WHITE = (1.0, 1.0, 1.0)
LIMITS = {"exposure": (-10.0, 10.0), "gamma": (0.1, 10.0), "tint": (0.0, 4.0), "opacity": (0, 1)}
ROWS = 64  # of a sky's picture at a time: they stay in the cache


@dataclass(frozen=True)
class Appearance:
    """What is shown of a colour c, display sRGB, is (gain c) ^ (1 / gamma), channel by channel;
    gain = tint * 2 ^ (exposure / 2.2).

    What a value stop has measured keeps its colours: they stand for values.
    """

    exposure: float = 0.0  # stops of light: each doubles it, which is 2 ^ (1 / 2.2) as displayed
    gamma: float = 1.0  # above 1: darker tones become brighter
    tint: Color = WHITE  # times the colours
    opacity: float = 1.0  # times the opacity of every splat; 0: not seen

    def __post_init__(self) -> None:
        """Refuses what is out of LIMITS: ValueError with a sentence."""
        for name, (least, most) in LIMITS.items():
            value = getattr(self, name)
            numbers = value if name == "tint" else (value,)
            if not (len(numbers) == (3 if name == "tint" else 1)
                    and all(least <= number <= most for number in numbers)):  # fmt: skip
                count = "three numbers" if name == "tint" else "a number"
                raise ValueError(f"{name} is {value}, expected {count} from {least:g} to {most:g}.")

    @property
    def gain(self) -> np.ndarray:
        """(3,) by which colours are multiplied before the power."""
        return np.array(self.tint, np.float64) * 2 ** (self.exposure / DISPLAY_GAMMA)

    @property
    def power(self) -> float:
        return 1 / self.gamma

    @property
    def keeps_colors(self) -> bool:
        """Whether colours stay as they are, to the bit."""
        return (self.exposure, self.gamma, self.tint) == (0.0, 1.0, WHITE)

    def graded(self, color: np.ndarray) -> np.ndarray:
        """(..., 3) display sRGB of colours (..., 3); the slow twin of the pass `grade`."""
        lit = color * self.gain
        return lit if self.power == 1 else np.where(lit < 0, 0, lit) ** self.power

    def under(self, other: "Appearance") -> "Appearance":
        """This one and then the other as one: of an object in a scene that has one, too.

        (h (g c)^p)^q = (g h^(1/p) c)^(p q).  What leaves LIMITS is held to them.
        """
        stops = self.exposure + other.exposure * self.gamma
        tint = np.array(self.tint) * np.array(other.tint) ** self.gamma
        return Appearance(
            exposure=_held("exposure", stops),
            gamma=_held("gamma", self.gamma * other.gamma),
            tint=three(float(t) for t in np.clip(tint, *LIMITS["tint"])),
            opacity=self.opacity * other.opacity,
        )


def _held(name: str, value: float) -> float:
    least, most = LIMITS[name]
    return min(max(value, least), most)


NEUTRAL = Appearance()


@dataclass(frozen=True)
class Sky:
    """Colours behind everything by the direction of sight, display sRGB.

    From horizon to zenith, and below it to ground, they go evenly with the sine of the elevation.
    """

    zenith: Color
    horizon: Color
    ground: Color

    def __post_init__(self) -> None:
        for name in ("zenith", "horizon", "ground"):
            check_color(getattr(self, name), name)

    def colors(self, sine: np.ndarray) -> np.ndarray:
        """(..., 3) display sRGB at sines (...) of the elevation, -1 to 1."""
        up = np.maximum(sine, 0)[..., None]
        down = np.maximum(-sine, 0)[..., None]
        zenith, horizon, ground = map(np.array, (self.zenith, self.horizon, self.ground))
        return horizon + up * (zenith - horizon) + down * (ground - horizon)

    def picture(self, view: View) -> np.ndarray:
        """(H, W, 3) float32, row 0 on top: the sky as a view sees it; the passes' slow twin."""
        (left, right, low, high), (width, height) = view.tangents, view.size
        up = up_of_eye(view)
        x = left + (np.arange(width) + 0.5) * (right - left) / width
        out = np.empty((height, width, 3), np.float32)
        for first in range(0, height, ROWS):
            rows = np.arange(first, min(first + ROWS, height)) + 0.5
            y = (high - rows * (high - low) / height)[:, None]
            sine = (up[0] * x + up[1] * y - up[2]) / np.sqrt(x * x + y * y + 1)
            out[first : first + ROWS] = self.colors(sine)
        return out


Background = Color | Sky  # behind everything


def up_of_eye(view: View) -> np.ndarray:
    """(3,) the world's +Y along the axes of the eye."""
    return view.world_from_eye.matrix()[1, :3]


def check_color(color: Sequence[float], name: str) -> None:
    """ValueError for what is no colour to be seen behind everything."""
    if not (len(color) == 3 and all(0 <= c <= 1 and math.isfinite(c) for c in color)):
        raise ValueError(f"{name} is {color}, expected three values of display sRGB from 0 to 1.")


def behind_of(sky: Sky | None) -> Background | None:
    """What is drawn behind everything: of a sky of one colour that colour."""
    if sky is not None and sky.zenith == sky.horizon == sky.ground:
        return sky.horizon
    return sky


def plain_color(background: Background) -> Color:
    """One colour for it, where there can be no other: that at the horizon."""
    return background.horizon if isinstance(background, Sky) else background
