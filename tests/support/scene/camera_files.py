"""What the tests of camera files share: views, files, a comparison."""

from pathlib import Path

import numpy as np

from shapeshift.scene.cameras.camera_list import CameraList
from shapeshift.scene.cameras.write_cameras import COLMAP_FORMS
from shapeshift.scene.pose import Pose, View, perspective

HALF = np.diag([1.0, -1.0, -1.0, 1.0])
NAMES = ("a.png", "sub folder/b ä ツ.jpg", "c")


def views(count: int = 3, plain: bool = False, seed: int = 0) -> tuple[View, ...]:
    """Views anywhere; `plain` ones have square pixels, one size and a line of sight in the middle.

    Near and far are what the forms without them are read with.
    """
    rng = np.random.default_rng(seed)
    out = []
    for _ in range(count):
        wxyz = rng.normal(size=4)
        pose = Pose(rng.normal(size=3) * 10, wxyz / np.linalg.norm(wxyz))
        size = (640, 360) if plain else tuple(int(n) for n in rng.integers(10, 4000, 2))
        tangents = perspective(float(rng.uniform(0.2, 2.5)), size)
        if not plain:
            tangents = tuple(t * f for t, f in zip(tangents, rng.uniform(0.3, 2, 4), strict=True))
        out.append(View(pose, tangents, 0.05, 1000.0, size))
    return tuple(out)


def cameras(plain: bool = False, count: int = 3) -> CameraList:
    return CameraList(views(count, plain), NAMES[:count] + ("",) * (count - 3), "test")


def target(folder: Path, form: str) -> Path:
    return folder / "model" if form in COLMAP_FORMS else folder / "cameras.json"


def assert_same(got, wanted, atol: float = 1e-6) -> None:
    assert len(got) == len(wanted)
    for one, other in zip(got, wanted, strict=True):
        np.testing.assert_allclose(
            one.world_from_eye.matrix(), other.world_from_eye.matrix(), atol=atol
        )
        np.testing.assert_allclose(one.tangents, other.tangents, atol=atol)
        assert one.size == other.size
        assert (one.near, one.far) == (other.near, other.far)
