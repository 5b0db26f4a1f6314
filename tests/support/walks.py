"""Walks through the program as it runs: which functions are entered, and how deep a launch lies."""

import sys
from collections import Counter
from collections.abc import Callable
from itertools import groupby
from pathlib import Path
from types import CodeType, FrameType

ROOT = Path(__file__).resolve().parents[2]
OURS = tuple(
    f"{ROOT / folder}/"
    for folder in (
        "app", "decomposition", "rasterizer", "renderer", "runtime_models", "scene", "shapeshift",
        "training", "vr",
    )
)  # fmt: skip


class Arrived(BaseException):
    """The end of a walk; nothing of the program catches it."""


def is_ours(code: CodeType) -> bool:
    """Whether it is a function of the product, no comprehension and no lambda."""
    return code.co_filename.startswith(OURS) and not code.co_name.startswith("<")


def walk(
    work: Callable[[], object], kinds: tuple[type, ...], end: str = ""
) -> list[tuple[str, str]]:
    """(file, function) of the product in the order in which they are first entered with one of
    `kinds` among their arguments, until the function called `end`.

    Each once, so that a loop over photos counts as one look at a photo; properties are no steps.
    """
    steps: dict[tuple[str, str], None] = {}

    def note(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event != "call" or not is_ours(code):
            return
        names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        given = [frame.f_locals.get(name) for name in names]
        if not any(isinstance(value, kinds) for value in given):
            return
        if given and isinstance(getattr(type(given[0]), code.co_name, None), property):
            return
        steps[(str(Path(code.co_filename).relative_to(ROOT)), code.co_qualname)] = None
        if end and code.co_qualname == end:
            sys.setprofile(None)
            raise Arrived

    sys.setprofile(note)
    try:
        work()
    except Arrived:
        pass
    else:
        assert not end, f"{end} was not reached"
    finally:
        sys.setprofile(None)
    return list(steps)


def returns(steps: list[tuple[str, str]]) -> dict[str, int]:
    """File -> how often the walk comes back to it after it has left it."""
    stays = [file for file, _ in groupby(file for file, _ in steps)]
    return {file: count - 1 for file, count in Counter(stays).most_common()}


def calls_below(top: str) -> list[str] | None:
    """Functions of the product that are under way below the one called `top`, the first first; None
    while that is not under way.
    """
    names, frame = [], sys._getframe(1)
    while frame is not None:
        if is_ours(frame.f_code):
            if frame.f_code.co_qualname == top:
                return names[::-1]
            names.append(frame.f_code.co_qualname)
        frame = frame.f_back
    return None
