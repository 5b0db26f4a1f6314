"""Array contracts, checked where data enters: `check(means=(means, "N 3"))`."""

import numpy as np


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
        finite = np.isfinite(array)
        if not finite.all():
            first = np.argwhere(~finite)[0].tolist()
            raise ValueError(f"{name} has {(~finite).sum()} NaN or Inf, first at {first}")
    return sizes
