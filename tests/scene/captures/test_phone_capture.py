"""A phone's capture: a bent lens, photos that are not there, names of another machine.

Its photos are traced through the lens by the formulas of OpenCV's documentation, solved here; what
is read must be the tracer's photo through a pinhole.
"""

import numpy as np
import pytest
from PIL import Image

from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training.synthetic.balls import dome_views, place, radiance
from shapeshift.training.synthetic.solids import unit
from shapeshift.training.synthetic.tracer import photograph
from tests.support.scene.captures import write_transforms

SIDE, FOCAL, FINER = 120, 130.0, 2
K1, K2, P1, P2 = 0.12, -0.08, 0.004, -0.003
FISHEYE = (0.05, -0.01, 0.002, -0.001)


def phone_tangents(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of bent tangents, by iteration of the formula that bends them."""
    u, v = x.copy(), y.copy()
    for _ in range(80):
        r = u * u + v * v
        radial = 1 + K1 * r + K2 * r * r
        u, v = (
            (x - 2 * P1 * u * v - P2 * (r + 2 * u * u)) / radial,
            (y - P1 * (r + 2 * v * v) - 2 * P2 * u * v) / radial,
        )
    return u, v


def fisheye_tangents(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    bent = np.hypot(x, y)
    angle = bent.copy()
    for _ in range(80):
        powers = sum(k * angle ** (2 * i + 2) for i, k in enumerate(FISHEYE))
        angle = bent / (1 + powers)
    grown = np.where(bent > 0, np.tan(angle) / np.maximum(bent, 1e-12), 1)
    return x * grown, y * grown


LENSES = {
    "phone": (phone_tangents, {"camera_model": "OPENCV",
                               "distortion_params": [K1, K2, 0.0, 0.0, P1, P2]}),
    "fisheye": (fisheye_tangents, {"camera_model": "OPENCV_FISHEYE",
                                   **dict(zip(("k1", "k2", "k3", "k4"), FISHEYE, strict=True))}),
}  # fmt: skip


def taken(view, tangents) -> np.ndarray:
    """(SIDE, SIDE, 3) uint8, each pixel the mean of FINER x FINER rays."""
    rows, columns = ((g.ravel() + 0.5) / FINER for g in np.mgrid[: SIDE * FINER, : SIDE * FINER])
    u, v = tangents((columns - SIDE / 2) / FOCAL, (rows - SIDE / 2) / FOCAL)
    pose = view.world_from_eye.matrix()
    d = unit(np.stack([u, -v, -np.ones_like(u)], axis=1) @ pose[:3, :3].T)
    color, _ = radiance(place(), "RGB")(np.broadcast_to(pose[:3, 3], d.shape), d)
    means = color.reshape(SIDE, FINER, SIDE, FINER, 3).mean(axis=(1, 3))
    return np.rint(255 * means).astype(np.uint8)


@pytest.mark.parametrize("lens", LENSES)
def test_what_is_read_is_what_a_pinhole_sees(tmp_path, lens):
    tangents, said = LENSES[lens]
    frames = []
    for i, view in enumerate(dome_views(3, 4, SIDE)):
        if i != 1:
            Image.fromarray(taken(view, tangents)).save(tmp_path / f"IMG_{i}.png")
        matrix = view.world_from_eye.matrix().tolist()
        frames.append({"file_path": f"D:\\scan\\IMG_{i}.png", "transform_matrix": matrix})
    write_transforms(tmp_path, frames, fl_x=FOCAL, w=SIDE, h=SIDE, up=[0, 1, 0], **said)
    capture = read_capture(tmp_path)
    assert any("1 of 3 photos" in doubt for doubt in capture.doubts)
    assert any("2 photos are undistorted" in doubt for doubt in capture.doubts)
    assert len(capture.photos) == 2
    for photo in capture.photos:
        pixels = load_photo(photo)
        truth, _ = photograph(photo.view, radiance(place(), "RGB"))
        error = np.abs(pixels.rgb / 255 - truth)[~pixels.lost]
        moved = np.abs(np.roll(pixels.rgb, 1, axis=1) / 255 - truth)[~pixels.lost]
        # Pixels of edges are means of other rays; half a pixel beside would double what is wrong.
        assert (error.max(axis=1) > 0.1).mean() < 0.06
        assert 10 * np.log10((moved**2).mean() / (error**2).mean()) > 6, "right to half a pixel"
        assert pixels.lost.mean() < 0.1
