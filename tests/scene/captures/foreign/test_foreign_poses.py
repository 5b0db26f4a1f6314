"""Poses that lie beside photos in other programs' files.

The truth is geometry: points of the file's world, projected by the program's own documented formula
(written here anew), must lie at the same pixels through the view and the lens that are read.  The
world that is read is the file's after one turn and one shift: it is fitted to the cameras (Kabsch),
and must bring to +Y what the program means by up, without a scale.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.foreign.read_realityscan import world_from_angles
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.undistort import pixels_of
from tests.support.scene import foreign_files as write
from tests.support.scene.foreign_files import SIZE, Shot, make_shots, save_photos

PX = 1e-4  # numbers are written whole; float32 tangents of the views leave some 1e-5 of a pixel
SURVEY = np.array([512345.5, 5412345.25, 431.0])  # UTM
Y_DOWN = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # as COLMAP leaves worlds: -y up
POINTS = np.random.default_rng(3).uniform(-0.7, 0.7, (40, 3))
W, H = SIZE


def in_camera(shot: Shot, points: np.ndarray) -> np.ndarray:
    return (points - shot.centre) @ shot.rotation.T


def brown(p, fx, fy, cx, cy, k=(), p1=0.0, p2=0.0, skew=0.0):
    """OpenCV's, with p1 beside y^2; skew in pixels."""
    x, y = p[:, 0] / p[:, 2], p[:, 1] / p[:, 2]
    r2 = x * x + y * y
    d = 1 + sum(value * r2 ** (i + 1) for i, value in enumerate(k))
    u = x * d + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * d + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack([fx * u + skew * v + cx, fy * v + cy], 1)


def fisheye(p, f, cx, cy, k):
    """OpenCV's, of the angle off the axis."""
    r = np.hypot(p[:, 0], p[:, 1])
    t = np.arctan2(r, p[:, 2])
    d = t * (1 + sum(value * t ** (2 * i + 2) for i, value in enumerate(k)))
    return np.stack([f * d * p[:, 0] / r + cx, f * d * p[:, 1] / r + cy], 1)


def sphere(p):
    longitude = np.arctan2(p[:, 0], p[:, 2])
    latitude = np.arctan2(p[:, 1], np.hypot(p[:, 0], p[:, 2]))
    return np.stack([W / 2 + longitude * W / math.tau, H / 2 + latitude * H / math.pi], 1)


def read_pixels(photo: Photo, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 2) pixels of the file, and which of the points (ours) the view shows."""
    matrix, fx, fy, cx, cy = photo.view.pinhole()
    seen = points @ matrix[:3, :3].T + matrix[:3, 3]
    tangents = seen[:, :2] / seen[:, 2:]
    straight = tangents * (fx, fy) + (cx, cy)
    if photo.lens is None:
        return straight, seen[:, 2] > 0
    inside = ((straight >= 0) & (straight <= photo.view.size)).all(axis=1)
    return pixels_of(photo.lens, tangents), (seen[:, 2] > 0) & inside


def ours_from_file(capture: Capture, shots: list[Shot]) -> tuple[np.ndarray, np.ndarray]:
    """The turn and shift (float64) that brings the file's cameras to those that were read."""
    by_name = {Path(photo.path).name: photo for photo in capture.photos}
    true = np.array([shot.centre for shot in shots])
    read = np.array(
        [by_name[Path(s.name).name].view.world_from_eye.position for s in shots], np.float64
    )
    a, b = true - true.mean(axis=0), read - read.mean(axis=0)
    u, _, vt = np.linalg.svd(b.T @ a)
    turn = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    shift = read.mean(axis=0) - turn @ true.mean(axis=0)
    assert np.abs(true @ turn.T + shift - read).max() < 1e-6, "no rigid motion: a scale, a mirror"
    return turn, shift


def compare(capture: Capture, shots: list[Shot], formula, up, points=POINTS, tolerance=PX):
    """All photos, all points that they show."""
    turn, shift = ours_from_file(capture, shots)
    assert np.abs(turn @ np.asarray(up) - (0, 1, 0)).max() < 1e-6
    points = points + np.mean([s.centre for s in shots], axis=0) * (1, 1, 1)
    shown = 0
    by_shot = {Path(shot.name).name: shot for shot in shots}
    assert {Path(p.path).name for p in capture.photos} == by_shot.keys()
    for photo in capture.photos:
        wanted = formula(in_camera(by_shot[Path(photo.path).name], points))
        found, good = read_pixels(photo, points @ turn.T + shift)
        assert np.abs(found[good] - wanted[good]).max(initial=0) < tolerance
        shown += good.sum()
    assert shown >= 8 * len(shots)


def sfm_shots():
    return make_shots(turn=Y_DOWN)


SFM_UP = (0, -1, 0)


# name -> (writer(folder) -> file, shots, formula, up)
def cases():
    air, sfm = make_shots(middle=SURVEY), sfm_shots()
    out = {}
    f = {"f": 38.0, "cx": 1.2, "cy": -0.8, "k1": -0.2, "k2": 0.05, "k3": -0.01, "k4": 0.002,
         "p1": 0.02, "p2": -0.015, "b1": 0.7, "b2": 0.4}  # fmt: skip
    local = (2.5, Rotation.from_rotvec([0.3, -1, 0.4]).as_matrix(), np.array([5.0, 6, 7]))

    def agisoft(p):  # of its manual: P1 goes with x
        return brown(p, 38.7, 38, W / 2 + 1.2, H / 2 - 0.8, (-0.2, 0.05, -0.01, 0.002),
                     -0.015, 0.02, 0.4)  # fmt: skip

    out["metashape"] = (lambda d: write.metashape(d, sfm, f, local=local), sfm, agisoft, SFM_UP)
    out["metashape labels without endings"] = (
        lambda d: write.metashape(d, sfm, f, label=lambda n: Path(n).stem),
        sfm,
        agisoft,
        SFM_UP,
    )
    here = np.array([4177000.0, 855000.0, 4728000.0])  # on the ellipsoid, about 48 N 11.6 E
    up = geodetic_normal(here)
    turn = np.linalg.svd(np.column_stack([up, np.eye(3)[:, :2]]))[0]
    turn = np.column_stack([np.cross(turn[:, 1], up), turn[:, 1] - up * (turn[:, 1] @ up), up])
    turn = np.column_stack([turn[:, 0] / np.linalg.norm(turn[:, 0]),
                            turn[:, 1] / np.linalg.norm(turn[:, 1]), up])  # fmt: skip
    turn[:, 0] = np.cross(turn[:, 1], up)
    earth = make_shots(middle=here, turn=turn)
    out["metashape on the earth"] = (
        lambda d: write.metashape(d, earth, f, local=(3.0, turn, here)),
        earth,
        agisoft,
        up,
    )
    fish = {"f": 20.0, "cx": 0.5, "cy": 0.25, "k1": -0.05, "k2": 0.01, "p1": 0.004, "p2": 0.003}
    out["metashape fisheye"] = (
        lambda d: write.metashape(d, sfm, fish, "equidistant_fisheye"), sfm,
        lambda p: brown(bent(p, lambda t: t), 20, 20, W / 2 + 0.5, H / 2 + 0.25, (-0.05, 0.01),
                        0.003, 0.004), SFM_UP)  # fmt: skip
    out["metashape equisolid"] = (
        lambda d: write.metashape(d, sfm, fish, "equisolid_fisheye"), sfm,
        lambda p: brown(bent(p, lambda t: 2 * np.sin(t / 2)), 20, 20, W / 2 + 0.5, H / 2 + 0.25,
                        (-0.05, 0.01), 0.003, 0.004), SFM_UP)  # fmt: skip
    out["metashape spherical"] = (
        lambda d: write.metashape(d, sfm, {"f": W / math.tau}, "spherical"),
        sfm,
        sphere,
        SFM_UP,
    )
    b = {"f": 34.2, "x": 21.5, "y": 14.0, "K1": -0.25, "K2": 0.08, "K3": -0.02, "P1": 0.02,
         "P2": 0.01}  # fmt: skip

    def bentley(p):
        return brown(p, 38, 38, 21.5, 14, (-0.25, 0.08, -0.02), 0.01, 0.02)

    out["blocks exchange"] = (lambda d: write.blocks(d, air, b), air, bentley, (0, 0, 1))
    out["blocks exchange, angles, y up"] = (
        lambda d: write.blocks(d, air, b, True, "XRightYUp"),
        air,
        bentley,
        (0, 0, 1),
    )
    r = {"f": 32.4, "px": 0.02, "py": -0.03, "k1": -0.2, "k2": 0.05, "k3": -0.01, "k4": 0.0,
         "t1": 0.02, "t2": -0.01}  # fmt: skip

    def epic(p):  # of its own template for OpenCV: k1, k2, t2, t1, k3
        return brown(p, 36, 36, W / 2 + 0.8, H / 2 - 1.2, (-0.2, 0.05, -0.01), -0.01, 0.02)

    out["realityscan"] = (lambda d: write.realityscan(d, air, r), air, epic, (0, 0, 1))
    out["realityscan, newer names"] = (
        lambda d: write.realityscan(d, air, r, True),
        air,
        epic,
        (0, 0, 1),
    )
    out["realityscan, xmp"] = (lambda d: write.xmp(d, air, r), air, epic, (0, 0, 1))
    lens = (37.0, 21.0, 14.5)
    out["openmvg k3"] = (
        lambda d: write.openmvg(d, sfm, lens, "pinhole_radial_k3",
                                {"disto_k3": [-0.2, 0.05, 0.01]}),
        sfm, lambda p: brown(p, 37, 37, 21, 14.5, (-0.2, 0.05, 0.01)), SFM_UP)  # fmt: skip
    out["openmvg brown"] = (
        lambda d: write.openmvg(
            d, sfm, lens, "pinhole_brown_t2", {"disto_t2": [-0.2, 0.05, 0.01, 0.02, -0.01]}, True
        ),
        sfm,
        lambda p: brown(p, 37, 37, 21, 14.5, (-0.2, 0.05, 0.01), 0.02, -0.01),
        SFM_UP,
    )
    out["openmvg fisheye"] = (
        lambda d: write.openmvg(d, sfm, lens, "fisheye", {"fisheye": [0.1, -0.05, 0.01, 0.002]}),
        sfm,
        lambda p: fisheye(p, 37, 21, 14.5, (0.1, -0.05, 0.01, 0.002)),
        SFM_UP,
    )
    out["openmvg spherical"] = (
        lambda d: write.openmvg(d, sfm, (), "spherical", {}),
        sfm,
        sphere,
        SFM_UP,
    )
    out["meshroom 1.0"] = (
        lambda d: write.alicevision(d, sfm, (1, 0, 0), {
            "type": "radial3", "pxFocalLength": "37", "principalPoint": ["21", "14.5"],
            "distortionParams": ["-0.2", "0.05", "0.01"]}),
        sfm, lambda p: brown(p, 37, 37, 21, 14.5, (-0.2, 0.05, 0.01)), SFM_UP)  # fmt: skip
    out["meshroom 1.2.1"] = (
        lambda d: write.alicevision(
            d,
            sfm,
            (1, 2, 1),
            {
                "type": "brown",
                "pxFocalLength": ["37", "36"],
                "principalPoint": ["1", "-0.5"],
                "distortionParams": ["-0.2", "0.05", "0.01", "0.02", "-0.01"],
            },
        ),
        sfm,
        lambda p: brown(p, 37, 36, 21, 14.5, (-0.2, 0.05, 0.01), 0.02, -0.01),
        SFM_UP,
    )
    new = {"type": "pinhole", "sensorWidth": "36", "focalLength": "33.3", "pixelRatio": "1.25",
           "principalPoint": ["1", "-0.5"], "undistortionType": "none"}  # fmt: skip
    out["meshroom 1.2.8"] = (
        lambda d: write.alicevision(
            d, sfm, (1, 2, 8), new | {"distortionType": "radialk1", "distortionParams": ["-0.2"]}
        ),
        sfm,
        lambda p: brown(p, 37, 46.25, 21, 14.5, (-0.2,)),
        SFM_UP,
    )
    out["meshroom 1.2.11"] = (
        lambda d: write.alicevision(
            d,
            sfm,
            (1, 2, 11),
            new
            | {
                "distortionType": "fisheye",
                "distortionParams": ["0.1", "-0.05", "0.01", "0.002"],
                "pixelRatio": "1",
            },
        ),
        sfm,
        lambda p: fisheye(p, 37, 21, 14.5, (0.1, -0.05, 0.01, 0.002)),
        SFM_UP,
    )
    perspective = {"projection_type": "perspective", "focal": 0.9, "k1": -0.2, "k2": 0.05}
    z_up = make_shots()
    out["opensfm"] = (
        lambda d: write.opensfm(d, z_up, perspective),
        z_up, lambda p: brown(p, 36, 36, W / 2, H / 2, (-0.2, 0.05)), (0, 0, 1))  # fmt: skip
    brown_lens = {"projection_type": "brown", "focal_x": 0.9, "focal_y": 0.95, "c_x": 0.02,
                  "c_y": -0.01, "k1": -0.2, "k2": 0.05, "p1": 0.02, "p2": -0.01,
                  "k3": 0.01}  # fmt: skip

    def opensfm_brown(p):
        return brown(p, 36, 38, 20.8, 14.6, (-0.2, 0.05, 0.01), 0.02, -0.01)

    out["opensfm brown"] = (
        lambda d: write.opensfm(d, z_up, brown_lens),
        z_up,
        opensfm_brown,
        (0, 0, 1),
    )
    out["opensfm fisheye"] = (
        lambda d: write.opensfm(d, z_up, {"projection_type": "fisheye", "focal": 0.9, "k1": -0.05,
                                          "k2": 0.01}),
        z_up, lambda p: fisheye(p, 36, W / 2, H / 2, (-0.05, 0.01)), (0, 0, 1))  # fmt: skip
    out["opensfm fisheye62"] = (
        lambda d: write.opensfm(d, z_up, {
            "projection_type": "fisheye62", "focal_x": 0.9, "focal_y": 0.9, "c_x": 0.0, "c_y": 0.0,
            "k1": -0.05, "k2": 0.01, "k3": 0.0, "k4": 0.0, "k5": 0.0, "k6": 0.0,
            "p1": 0.02, "p2": -0.01}),
        z_up, fisheye62, (0, 0, 1))  # fmt: skip
    out["opensfm spherical"] = (
        lambda d: write.opensfm(d, z_up, {"projection_type": "spherical"}),
        z_up,
        sphere,
        (0, 0, 1),
    )
    out["odm"] = (lambda d: write.odm(d, air, brown_lens), air, opensfm_brown, (0, 0, 1))
    out["bundler"] = (
        lambda d: write.bundler(d, sfm, (37.0, -0.2, 0.05)), sfm,
        lambda p: brown(p, 37, 37, W / 2, H / 2, (-0.2, 0.05)), SFM_UP)  # fmt: skip
    out["visualsfm"] = (lambda d: write.nvm(d, sfm, 37.0, 0.3), sfm, visualsfm, SFM_UP)
    out["pix4d"] = (
        lambda d: write.pix4d(
            d, air, (37, 21, 14.5, (-0.2, 0.05, 0.01), (0.02, -0.01)), SURVEY // 1
        ),
        air,
        lambda p: brown(p, 37, 37, 21, 14.5, (-0.2, 0.05, 0.01), 0.02, -0.01),
        (0, 0, 1),
    )
    phone = [replace(s, name=f"imgl/{i:05d}.jpg") for i, s in enumerate(sfm)]
    out["scaniverse"] = (
        lambda d: write.scaniverse(d, phone, (18.5, 10.5, 7.25)), phone,
        lambda p: brown(p, 37, 37, 21, 14.5), SFM_UP)  # fmt: skip
    return out


def geodetic_normal(place):
    """The gradient of the ellipsoid through a place: no iteration, right to 1e-4 at 5 km height."""
    a, b = 6378137.0, 6356752.314245
    # Height is taken off along the normal, twice.
    at = np.array(place, float)
    for _ in range(20):
        g = at / np.array([a * a, a * a, b * b])
        n = g / np.linalg.norm(g)
        x = np.array(place) - n * ((np.array(place) - at) @ n)
        at = x / math.sqrt((x[0] / a) ** 2 + (x[1] / a) ** 2 + (x[2] / b) ** 2)
    return n


def bent(p, of):
    """A camera's points moved to where tangents are of(angle)."""
    r = np.hypot(p[:, 0], p[:, 1])
    reach = of(np.arctan2(r, p[:, 2]))
    return np.stack([reach * p[:, 0] / r, reach * p[:, 1] / r, np.ones(len(p))], 1)


def fisheye62(p):
    r = np.hypot(p[:, 0], p[:, 1])
    t = np.arctan2(r, p[:, 2])
    d = t * (1 - 0.05 * t**2 + 0.01 * t**4)
    x, y = d * p[:, 0] / r, d * p[:, 1] / r
    r2 = x * x + y * y
    u = x + 2 * 0.02 * x * y - 0.01 * (r2 + 2 * x * x)
    v = y + 0.02 * (r2 + 2 * y * y) - 2 * 0.01 * x * y
    return np.stack([36 * u + W / 2, 36 * v + H / 2], 1)


def visualsfm(p):
    """The measured place m for which (1 + k |m|^2) m is the straight one: roots of a cubic."""
    tangents = p[:, :2] / p[:, 2:]
    out = []
    for x, y in tangents:
        r = math.hypot(x, y)
        roots = np.roots([0.3, 0, 1, -r])
        real = min(abs(root.real) for root in roots if abs(root.imag) < 1e-9)
        out.append((37 * x * real / r + W / 2, 37 * y * real / r + H / 2))
    return np.array(out)


CASES = cases()


@pytest.mark.parametrize("name", CASES)
def test_points_lie_where_the_programs_own_formula_puts_them(name, tmp_path):
    make, shots, formula, up = CASES[name]
    save_photos(tmp_path / "photos", shots)
    file = make(tmp_path / "photos")
    folder = file.parent if file.parent.name == "photos" else file.parent.parent
    capture = read_capture(folder)
    centre = np.mean([s.centre for s in shots], axis=0)
    compare(capture, shots, formula, up, POINTS * 0.9 + middle_of(shots) - centre)


def test_realityscans_angles_are_its_matrix():
    """A camera that a user published with both, from its XMP and its CSV (two decimals less)."""
    matrix = [[0.982594073038806, 0.185426733553445, -0.0112166890261935],
              [-0.032113633044729, 0.11008102707942, -0.993403685341366],
              [-0.18296885582437, 0.976472781986697, 0.114]]  # fmt: skip
    angles = np.radians([163.736597399311, 83.4154313461628, 174.386496244756])
    found = np.diag([1, -1, -1]) @ world_from_angles(*angles).T
    assert np.abs(found - matrix)[:2].max() < 1e-12 and np.abs(found - matrix).max() < 2e-4


def middle_of(shots: list[Shot]) -> np.ndarray:
    """Where the cameras look."""
    return np.mean([s.centre + 3.2 * s.rotation[2] for s in shots], axis=0)
