"""Series of names that cameras of heat write: a photo of heat and one of light with one number.

Their colours are alike, and no word says what they show; that both are there, with the same
numbers, does.
"""

import re
from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

HEAT, LIGHT, BLEND = "thermal", "rgb", "blend"  # BLEND: one laid over the other
ROLES = (HEAT, LIGHT, BLEND)
DIGIT = re.compile(r"\d")  # names are matched once a shape: no pattern below may name a digit
FEWEST_SHARED = 2  # numbers: one may be by chance


class Series(NamedTuple):
    """Whole names without their endings by what they show; the first group is what is shared."""

    heat: re.Pattern
    light: re.Pattern
    blend: re.Pattern


def series(heat: str, light: str, blend: str = r"(?!)") -> Series:
    return Series(*(re.compile(pattern, re.IGNORECASE) for pattern in (heat, light, blend)))


TAKEN = r"(\d{8}[_-]\d{6}(?:[_-]\d{3})?)"  # day and time of FLIR's Vue and Duo
HELD = r"((?:FLIR|HM|HIK|HIKMICRO)[_-]?\d{4,}(?:[_-]\d+)*)"  # FLIR and HIKMICRO, held in a hand
SERIES = (
    series(r"T(\d{6,})", r"P(\d{6,})"),  # Parrot's Anafi Thermal
    series(r"IRX_?(\d+)", r"MAX_?(\d+)", r"MIX_?(\d+)"),  # Autel
    series(r"([A-Z]*\d{3,})T", r"([A-Z]*\d{3,})V", r"([A-Z]*\d{3,})X"),  # Snap-on
    series(
        rf"{HELD}(?:[ _-]?(?:IR|T))?",
        rf"{HELD}[ _-]?(?:photo|visual|visible|vis|vl|v|dc|rgb|digital|camera)",
        rf"{HELD}[ _-]?(?:msx|pip|fusion|blend|mix)",
    ),
    series(r"(?:HM|IR)_?(\d{6,})", r"(?:VL|VM|VIS|DC|V)_?(\d{6,})"),  # HIKMICRO
    series(rf"{TAKEN}_(?:\d\d?b|R|IR)", TAKEN),  # FLIR's Duo Pro
)


def roles_of(files: Sequence[str]) -> list[str]:
    """Of each name, without ending, one of ROLES where it is of a series that shows two of them
    with the same numbers; else "".
    """
    out = [""] * len(files)
    shapes = [DIGIT.sub("0", name) for name in files]
    for forms in SERIES:
        fitting = {shape for shape in set(shapes) if role_in(forms, shape)}
        if not fitting:  # nearly always: thousands of photos have a few shapes
            continue
        rows: dict[str, dict[str, list[int]]] = {role: defaultdict(list) for role in ROLES}
        for row, name in enumerate(files):
            if out[row] or shapes[row] not in fitting:
                continue
            if (found := role_in(forms, name)) is not None:
                rows[found[0]][found[1]].append(row)
        for role in ROLES:
            mine = rows[role].keys()
            if any(len(mine & rows[o].keys()) >= FEWEST_SHARED for o in ROLES if o != role):
                for row in (row for each in rows[role].values() for row in each):
                    out[row] = role
    return out


def role_in(forms: Series, name: str) -> tuple[str, str] | None:
    """The role of a name in a series, and its number; None: it is not of that."""
    for role, form in zip(ROLES, forms, strict=True):
        if found := form.fullmatch(name):
            return role, found[1].lower()
    return None


def told_apart(one: str, other: str) -> tuple[str, str] | None:
    """HEAT and LIGHT of two names that are so in one series, whatever their numbers."""
    for forms in SERIES:
        roles = [found[0] if (found := role_in(forms, name)) else "" for name in (one, other)]
        if set(roles) == {HEAT, LIGHT}:
            return roles[0], roles[1]
    return None
