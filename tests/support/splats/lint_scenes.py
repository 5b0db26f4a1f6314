"""Clouds with and without faults, as readers give them."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.files.blocks import each_block
from shapeshift.runtime_models.lint.lint import judge
from shapeshift.runtime_models.splats.operations.activate import any_invalid, invalid_in
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, RawSplats, Reading
from tests.support.splats.ply_files import some_splats


def cloud(count: int, sigma: float, extent: float = 3.0, seed: int = 0) -> RawSplats:
    """A scene as trainers make them: spread over `extent`, sizes about sigma, logs and logits."""
    rng = np.random.default_rng(seed)
    raw = raw_splats(count, 1, seed)
    raw.means[:] = rng.uniform(-extent / 2, extent / 2, (count, 3))
    raw.scales[:] = np.log(sigma) + rng.normal(0, 0.7, (count, 3))
    raw.opacity[:] = rng.normal(1, 3, count)
    return raw


def ours(raw: RawSplats) -> PlainSplats:
    """Judged, whatever it fills."""
    return judge(copied(raw), Reading(allow_huge=True))


def raw_splats(count: int, coefficients: int = 4, seed: int = 0, **coding) -> RawSplats:
    """In our axes, so that a test reads its own numbers again."""
    plain = some_splats(count, coefficients, seed)
    arrays = [plain.means, plain.scales, plain.wxyz * 3, plain.opacity, plain.sh]
    if coding.get("logits", True):
        arrays[3] = 8 * plain.opacity - 4
    if coding.get("log_scales", True):
        arrays[1] = np.log(plain.scales)
    return RawSplats(*(a.copy() for a in arrays), file="a.ply", format="ply", up="+Y", **coding)


def copied(raw: RawSplats) -> RawSplats:
    names = ("means", "scales", "wxyz", "opacity", "sh")
    return replace(raw, **{name: getattr(raw, name).copy() for name in names})


def invalid_rows(raw: RawSplats) -> np.ndarray:
    """(K,) rising rows with a number that is not usual as it is filed.

    NaN or Inf anywhere, a quaternion of next to no or of boundless length, a scale or opacity that
    its coding does not have.  A block is judged by its least and largest numbers; only where those
    are odd is it looked at row by row.
    """
    found: list[np.ndarray] = []

    def look(rows: slice, _: None) -> None:
        if any_invalid(raw, rows):
            found.append(rows.start + np.flatnonzero(invalid_in(raw, rows)))

    each_block(len(raw.means), look)
    return np.sort(np.concatenate(found)) if found else np.empty(0, np.intp)
