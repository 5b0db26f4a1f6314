"""tint: a colour over the decoded ones, row by row, which come back when it goes.

No network runs for it: what lies under a tint is kept, and mixed anew when the tint changes.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from shapeshift.renderer.colors.color_cache import ColorCache
from shapeshift.renderer.drawing import Drawing
from shapeshift.scene.scene import SceneObject, Tint


@contextmanager
def tinted(drawing: Drawing, i: int, obj: SceneObject, colored: ColorCache) -> Iterator[None]:
    """In the body the colours of object i, in the set in use, are its own; after it with its tint.

    The body decodes them, or does nothing where only the tint is another one.
    """
    lift(drawing, i, colored)
    yield
    if obj.tint is not None:
        lay(drawing, i, obj.tint, colored)


def lift(drawing: Drawing, i: int, colored: ColorCache) -> None:
    """Gives the rows under the tint their own colours back."""
    if colored.untinted:
        rows, own_color, own_heat = colored.untinted
        color, heat = drawing.read_colors(i)
        color[rows] = own_color
        if heat is not None and own_heat is not None:
            heat[rows] = own_heat
        drawing.replace_colors(i, color, heat)
    colored.tint, colored.untinted = None, ()


def lay(drawing: Drawing, i: int, tint: Tint, colored: ColorCache) -> None:
    """Mixes the tint in, and keeps what lies under it; heat fades as the colour beside it does."""
    color, heat = drawing.read_colors(i)
    strength = per_splat(np.atleast_1d(tint.strength), len(color))  # (n,)
    rows = np.flatnonzero(strength > 0)
    colored.tint = tint
    if not len(rows):
        return
    own_heat = None if heat is None else heat[rows]
    colored.untinted = (rows, color[rows], own_heat)
    color, heat = mixed(color, heat, rows, strength[rows, None], tint)
    drawing.replace_colors(i, color, heat)


def mixed(
    color: np.ndarray, heat: np.ndarray | None, rows: np.ndarray, share: np.ndarray, tint: Tint
) -> tuple[np.ndarray, np.ndarray | None]:
    """color (n, 3) and heat (n, 4) with the rows (m,) mixed with the tint by their share (m, 1)."""
    over = per_splat(np.atleast_2d(np.asarray(tint.color, np.float32)), len(color))[rows]
    color = color.copy()
    color[rows] = (1 - share) * color[rows] + share * over
    if heat is not None:
        heat = heat.copy()
        heat[rows] *= 1 - share
    return color, heat


def per_splat(values: np.ndarray, count: int) -> np.ndarray:
    """(count, ...) float32 of values one an anchor, or of one for all."""
    values = values.astype(np.float32)
    return np.repeat(values, -(-count // len(values)), axis=0)[:count] if len(values) else values
