"""The style path of a film: which stop a scene shows when, and how it goes from one to the next.

Equation 5 of 3SGS, f_t = (1 - beta_t) f_start + beta_t f_end, between the neighbours of any number
of keys.  The blend of two keys is `StopBlend.between`, the function that the slider, shifts,
selectors and reactions go by: straight between the two, at the measured pace of the pair.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from shapeshift.runtime_models.stop_weights import Control, StopBlend
from shapeshift.scene.control import ease

KEY = re.compile(
    r"\s*(?P<word>\S.*?)@(?P<at>[0-9]{1,9}(?:\.[0-9]*)?|\.[0-9]+)(?P<unit>s|%|)(?=\s|$)"
)
MOST_KEYS = 1000
REST = 0.25  # of the time of a way: how long a slide stands at its ends
SECONDS, PERCENT = "s", "%"


@dataclass(frozen=True)
class StyleKey:
    """A control of the scene at a time, or at a place of the camera's path."""

    control: Control
    at: float  # seconds, or the share 0..1 of the path


@dataclass(frozen=True)
class StylePath:
    """The control of one object over time: beta_t runs from 0 to 1 between two keys, smoothstep.

    Before the first key its control holds, after the last one that one's; two equal neighbours
    hold what they say.
    """

    keys: tuple[StyleKey, ...]  # at least one; times rise
    blend: StopBlend  # of the object's model

    def control(self, at: float) -> Control:
        """What the object shows at a time (or place) in the unit of the keys."""
        for start, end in pairwise(self.keys):
            if at < end.at:
                if at <= start.at or start.control == end.control:
                    return start.control
                beta = ease((at - start.at) / (end.at - start.at))
                return self.blend.between(start.control, end.control, beta)
        return self.keys[-1].control


@dataclass
class AutoSlide:
    """A style path that is walked again and again, there and back, as long as somebody looks."""

    path: StylePath
    period_s: float  # of a round
    seconds: float = 0.0  # since it began

    @staticmethod
    def between(start: Control, end: Control, blend: StopBlend, leg_s: float) -> "AutoSlide":
        """From one control to another in `leg_s` seconds, a rest, and the same way back."""
        rest_s = REST * leg_s
        times = (0.0, leg_s, leg_s + rest_s, 2 * leg_s + rest_s)
        keys = (StyleKey(c, t) for c, t in zip((start, end, end, start), times, strict=True))
        return AutoSlide(StylePath(tuple(keys), blend), 2 * (leg_s + rest_s))

    @property
    def control(self) -> Control:
        return self.path.control(self.seconds % self.period_s)

    @property
    def over(self) -> bool:
        """It goes on until a hand takes over."""
        return False


@dataclass(frozen=True)
class WrittenKey:
    """A key as it was written: what to show in words, still of no certain model."""

    word: str  # a stop's name, a number, a way or a blend: what `parse_control` reads
    at: float  # seconds, or the share 0..1 of the path


@dataclass(frozen=True)
class WrittenPath:
    """A style path as a text has it, for `StylePath`s of all objects."""

    keys: tuple[WrittenKey, ...]
    unit: str = SECONDS  # or PERCENT: keys stand at places of the camera's path

    def text(self) -> str:
        """The inverse of `read_style_path`."""
        scale = 100 if self.unit == PERCENT else 1
        return " ".join(f"{key.word}@{key.at * scale:.6g}{self.unit}" for key in self.keys)

    def stretched(self, factor: float) -> "WrittenPath":
        """The same for a film of `factor` times the seconds; places of a path stay."""
        if self.unit == PERCENT:
            return self
        return replace(self, keys=tuple(replace(k, at=k.at * factor) for k in self.keys))


def read_style_path(text: str, seconds: float) -> WrittenPath:
    """`RGB@0 Thermal@3s Opened@6s`, or in percent of the camera's path, `RGB@0% Opened@100%`.

    Names may hold spaces.  ValueError, one sentence, for what is no such path or ends after the
    film of so many seconds.
    """
    keys, units, place = [], set(), 0
    while text[place:].strip():
        found = KEY.match(text, place)
        if not found:
            raise ValueError(
                f"'{text[place:].strip()[:60]}' is no key of a style path; NAME@SECONDS or NAME@50%"
                " is wanted, such as RGB@0 Thermal@3s."
            )
        at, unit = float(found["at"]), found["unit"]
        if at > 0 or unit:  # 0 is the start in both
            units.add(unit or SECONDS)
        keys.append(WrittenKey(found["word"], at / 100 if unit == PERCENT else at))
        place = found.end()
    if len(units) > 1:
        raise ValueError("it has keys in seconds and in %; write all of them in one.")
    path = WrittenPath(tuple(keys), units.pop() if units else SECONDS)
    _check(path, seconds)
    return path


def _check(path: WrittenPath, seconds: float) -> None:
    if not 1 <= len(path.keys) <= MOST_KEYS:
        raise ValueError(f"it has {len(path.keys)} keys; 1 to {MOST_KEYS} are wanted.")
    for before, key in pairwise(path.keys):
        if not before.at < key.at:
            raise ValueError(
                f"'{key.word[:60]}' does not come after '{before.word[:60]}'; times must rise."
            )
    last = path.keys[-1].at
    if path.unit == PERCENT and not last <= 1:
        raise ValueError(f"it goes on to {last:.6g} times the path; 100% is the end.")
    if path.unit == SECONDS and not last <= seconds:
        raise ValueError(f"it goes on to {last:.6g} s, the film ends at {seconds:.6g} s.")


def style_path_of(path: WrittenPath, controls: Sequence[Control], blend: StopBlend) -> StylePath:
    """The path of one object, for which the words stand for these controls, one a key."""
    keys = (StyleKey(c, key.at) for c, key in zip(controls, path.keys, strict=True))
    return StylePath(tuple(keys), blend)
