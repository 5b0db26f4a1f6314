"""A value by formula of several stops, such as (nir - red) / (nir + red).

Its words are numbers, names of stops and + - * / ( ), and nothing is ever run as code: a parser of
its own reads it into steps, which a loop of six cases works through on arrays of numbers.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.stop import Stop

LONGEST_FORMULA = 400  # letters
DEEPEST = 32  # ( within (
LARGEST_NUMBER = 1e30
# A number, a name of letters, digits and _, a name between quotes, or one sign.
WORD = re.compile(
    r"\s*(?:(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)(?![\w.])"
    r"|(?P<name>[^\W\d]\w*)|'(?P<one>[^']*)'|\"(?P<two>[^\"]*)\"|(?P<sign>[-+*/()]))"
)
WANTED = "a number, a stop or ( is wanted"
HOW = (
    "formulas hold numbers, stops (between quotes, where their names have other signs) and "
    "+ - * / ( )"
)


@dataclass(frozen=True)
class Formula:
    """A formula as steps: a number or a stop is put on a pile, a sign takes what is on top."""

    text: str
    steps: tuple[float | str, ...]  # float: a number; "=NAME": a stop; "+-*/", and "!" turns a sign

    @property
    def names(self) -> tuple[str, ...]:
        """Of its stops, as it writes them, each once, in their order."""
        found = (step[1:] for step in self.steps if isinstance(step, str) and step[0] == "=")
        return tuple(dict.fromkeys(found))

    def value(self, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """(...) float64 of arrays (...) by its names; NaN where one is not known, where it divides
        by zero, and where it leaves the numbers.
        """
        pile: list[np.ndarray] = []
        with np.errstate(all="ignore"):
            for step in self.steps:
                if not isinstance(step, str):
                    pile.append(np.array(step))
                elif step[0] == "=":
                    pile.append(np.asarray(values[step[1:]], np.float64))
                elif step == "!":
                    pile.append(-pile.pop())
                else:
                    second, first = pile.pop(), pile.pop()
                    made = _joined(step, first, second)
                    pile.append(np.where(np.isfinite(made), made, np.nan))
        (made,) = pile
        return np.where(np.isfinite(made), made, np.nan)


def _joined(sign: str, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    if sign == "+":
        return first + second
    if sign == "-":
        return first - second
    return first * second if sign == "*" else first / np.where(second == 0, np.nan, second)


def read_formula(text: str) -> Formula:
    """ValueError, one sentence, for what is none."""
    if not 0 < len(text) <= LONGEST_FORMULA:
        raise ValueError(
            f"a formula of {len(text)} letters; 1 to {LONGEST_FORMULA} are wanted, such as "
            "(nir - red) / (nir + red)."
        )
    formula = Formula(text, tuple(_Reader(text).whole()))
    if not formula.names:
        raise ValueError(f"the formula '{text}' names no stop; {HOW}.")
    return formula


class _Reader:
    """Reads one word after the other; what follows a product or a sum is left for its caller."""

    def __init__(self, text: str) -> None:
        self.text, self.at, self.depth = text, 0, 0
        self.kind, self.word = "", ""
        self._next()

    def whole(self) -> list[float | str]:
        steps = self._sum()
        if self.kind:
            raise self._error(f"the end, or one of + - * / is wanted before '{self.word}'")
        return steps

    def _next(self) -> None:
        """The next word; kind "": there is none."""
        found = WORD.match(self.text, self.at)
        if found is None:
            rest = self.text[self.at :].strip()
            if rest:
                raise self._error(f"'{rest[:20]}' is none of its words")
            self.kind, self.word = "", ""
            return
        self.at = found.end()
        kind = str(found.lastgroup)
        self.word = found.group(kind)
        self.kind = "name" if kind in ("one", "two") else kind

    def _error(self, why: str) -> ValueError:
        return ValueError(f"the formula '{self.text}': {why}; {HOW}.")

    def _sum(self) -> list[float | str]:
        return self._row("+-", self._product)

    def _product(self) -> list[float | str]:
        return self._row("*/", self._signed)

    def _row(self, signs: str, part) -> list[float | str]:
        steps = part()
        while self.kind == "sign" and self.word in signs:
            sign = self.word
            self._next()
            steps += [*part(), sign]
        return steps

    def _signed(self) -> list[float | str]:
        turned = False
        while self.kind == "sign" and self.word in "+-":
            turned ^= self.word == "-"
            self._next()
        return [*self._atom(), "!"] if turned else self._atom()

    def _atom(self) -> list[float | str]:
        kind, word = self.kind, self.word
        if kind == "number":
            number = float(word)
            if not (math.isfinite(number) and number <= LARGEST_NUMBER):
                raise self._error(f"the number {word:.20} is too large")
            self._next()
            return [number]
        if kind == "name" and word:
            self._next()
            return [f"={word}"]
        if (kind, word) != ("sign", "("):
            raise self._error(f"{WANTED} {f'instead of {word!r}' if kind else 'at its end'}")
        self.depth += 1
        if self.depth > DEEPEST:
            raise self._error(f"more than {DEEPEST} ( within each other")
        self._next()
        steps = self._sum()
        if (self.kind, self.word) != ("sign", ")"):
            raise self._error("a ) is missing")
        self.depth -= 1
        self._next()
        return steps


def sources_of(formula: Formula, stops: Sequence[Stop], own: str = "") -> dict[str, Stop]:
    """The stop of each of a formula's names: written so, or else so but for capitals.

    own: the name of the formula's stop.  ValueError, one sentence: there is none, it shows no
    values in a range, or it is by formula itself.
    """
    others = [stop for stop in stops if stop.name != own]
    exact, loose = ({key(s.name): s for s in others} for key in (str, str.casefold))
    found = {}
    for name in formula.names:
        stop = exact.get(name) or loose.get(name.casefold())
        names = ", ".join(s.name for s in others if s.is_measured and not s.formula) or "none"
        if stop is None:
            raise ValueError(
                f"the formula '{formula.text}': there is no stop '{name:.60}'; of values there are "
                f"{names}."
            )
        if not stop.is_measured or stop.value_range is None or stop.formula:
            why = "is by formula itself" if stop.formula else "shows no values in a range"
            raise ValueError(
                f"the formula '{formula.text}': the stop '{stop.name}' {why}; those that do are "
                f"{names}."
            )
        found[name] = stop
    return found


def check_formulas(stops: Sequence[Stop]) -> None:
    """ValueError, one sentence, where a stop's formula is none, or of stops that are not there."""
    for stop in stops:
        if stop.formula:
            sources_of(read_formula(stop.formula), stops, stop.name)
