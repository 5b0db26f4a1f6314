"""`launch.py vr` through lenses that hide much; Monado's remote headset has none that may be asked.

masked_eyes.py vr ...    arguments as of launch.py
"""

import ctypes
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
# Of the tangents of an eye: a frame around its middle, cut to triangles by shared corners.
PART = 0.6


def frame_mesh(tangents: tuple[float, float, float, float]):
    """(8, 2) corners and 24 numbers of them: all but the middle PART of a picture's sides."""
    left, right, down, up = tangents
    middle = ((left + right) / 2, (down + up) / 2)
    outer = [(left, down), (right, down), (right, up), (left, up)]
    inner = [tuple(m + PART * (o - m) for o, m in zip(c, middle, strict=True)) for c in outer]
    order = []
    for i in range(4):
        j = (i + 1) % 4
        order += [i, j, 4 + j, i, 4 + j, 4 + i]
    return [*outer, *inner], order


def answer(mask, corners, order) -> bool:
    """As a runtime fills an XrVisibilityMaskKHR."""
    mask.vertex_count_output, mask.index_count_output = len(corners), len(order)
    if mask.vertex_capacity_input:
        for i, (x, y) in enumerate(corners):
            mask.vertices[i].x, mask.vertices[i].y = x, y
        ctypes.memmove(mask.indices, (ctypes.c_uint32 * len(order))(*order), 4 * len(order))
    return True


def main(arguments: list[str]) -> int:
    sys.path.insert(0, str(ROOT))
    import math

    import shapeshift  # noqa: F401  makes the folders its subpackages
    from shapeshift.app.cli import main as run
    from shapeshift.vr.openxr.view_configuration import VisibilityMasks, read_mask
    from tests.support.xr.remote import EYE_DEGREES

    def ask(self) -> None:
        for i, (left, right, up, down) in enumerate(EYE_DEGREES):
            tangents = tuple(math.tan(math.radians(angle)) for angle in (left, right, down, up))
            made = frame_mesh(tangents)
            self._meshes[i] = read_mask(
                self._instance.xr, lambda mask, made=made: answer(mask, *made)
            )

    VisibilityMasks.ask = ask
    return run(arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
