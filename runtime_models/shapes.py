"""Array contracts, checked where data enters: `check(means=(means, "N 3"))`."""

from collections.abc import Iterable

import numpy as np

from shapeshift.runtime_models.files.blocks import each_block

NUMBERS = 1 << 16  # looked at at a time: a quarter of a megabyte


def check(**arrays: tuple[np.ndarray, str]) -> dict[str, int]:
    """Every array is float32, finite and of its stated shape; equal letters mean equal sizes.

    Returns the sizes found for the letters.  Raises ValueError naming the array, what it is and
    what was expected.
    """
    sizes: dict[str, int] = {}
    for name, (array, spec) in arrays.items():
        dims = spec.split()
        want = [sizes.get(d, d) if d.isalpha() else int(d) for d in dims]
        fits = array.ndim == len(dims) and all(
            (sizes.setdefault(d, n) if d.isalpha() else int(d)) == n
            for d, n in zip(dims, array.shape, strict=True)
        )
        if not fits:
            raise ValueError(
                f"{name} has shape {array.shape}, expected ({', '.join(map(str, want))})"
            )
        if array.dtype != np.float32:
            raise ValueError(f"{name} is {array.dtype}, expected float32")
        if not all_finite(array):
            finite = np.isfinite(array)
            first = np.argwhere(~finite)[0].tolist()
            raise ValueError(f"{name} has {(~finite).sum()} NaN or Inf, first at {first}")
    return sizes


def three(values: Iterable[float]) -> tuple[float, float, float]:
    """Three numbers of an array or list as a tuple of floats."""
    first, second, third = map(float, values)
    return first, second, third


def four(values: Iterable[float]) -> tuple[float, float, float, float]:
    """Four numbers of an array or list as a tuple of floats."""
    first, second, third, fourth = map(float, values)
    return first, second, third, fourth


def column_names(row: np.dtype) -> tuple[str, ...]:
    """The names of a record's fields; () of a plain number."""
    return row.names or ()


def column_offset(row: np.dtype, name: str) -> int:
    """Bytes of a record before one of its fields."""
    assert row.fields is not None, "a record has fields"
    return row.fields[name][1]  # pyright: ignore[reportArgumentType]  # any str is a key


def all_finite(array: np.ndarray) -> bool:
    """Whether no number is NaN or Inf; by least and largest: no array of booleans is made."""
    if not array.flags.c_contiguous:
        return bool(np.isfinite(array).all())
    flat, ends = array.reshape(-1), []

    def look(part: slice, _: None) -> None:
        ends.append((flat[part].min(), flat[part].max()))  # NaN is the least and the largest

    each_block(flat.size, look, block=NUMBERS)
    return bool(np.isfinite(ends).all())
