"""--up and --flip: what lies where, looks how and is which way round after every turn."""

import itertools

import numpy as np
import pytest

from shapeshift.runtime_models.colors.spherical_harmonics import COEFFICIENTS, shade
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.rotation import rotation_matrices
from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.operations.rotate_splats import (
    HALF_TURN,
    OURS_FROM_UP,
    UPSIDE_DOWN,
    ours_from_file,
    quaternion_of,
    rotate_harmonics,
    rotate_quaternions,
    rotate_splats,
    rotator,
)
from shapeshift.runtime_models.splats.plain_splats import AXES, Reading
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.splats.ply_files import some_splats

QUARTERS = [
    np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
    np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
]  # about x, y and z


def random_rotations(count: int) -> list[np.ndarray]:
    q = np.random.default_rng(5).normal(size=(count, 4))
    return list(rotation_matrices(q / np.linalg.norm(q, axis=1, keepdims=True)))


TURNS = [ours_from_file(*w) for w in itertools.product(AXES, (False, True), (False, True))]
ALL = [*TURNS, *QUARTERS, *random_rotations(4)]


def directions(count: int) -> np.ndarray:
    d = np.random.default_rng(3).normal(size=(count, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def axis_of(name: str) -> np.ndarray:
    return np.eye(3)["XYZ".index(name[1])] * (1 if name[0] == "+" else -1)


@pytest.mark.parametrize("up", AXES)
def test_the_axis_that_is_named_becomes_up(up):
    rotation = ours_from_file(up)
    np.testing.assert_array_equal(rotation @ axis_of(up), [0, 1, 0])
    np.testing.assert_array_equal(ours_from_file(up, flip=True) @ axis_of(up), [0, -1, 0])


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("count", COEFFICIENTS)
def test_a_half_turn_by_signs_is_the_turn_of_any_rotation(axis, count):
    """The short way through a diagonal matrix beside the long one through any."""
    signs = np.where(np.arange(3) == axis, 1.0, -1.0)
    rng = np.random.default_rng(axis)
    means, wxyz = rng.normal(size=(7, 3)).astype("f4"), rng.normal(size=(7, 4)).astype("f4")
    sh = rng.normal(size=(7, count, 3)).astype("f4")
    short = [means.copy(), wxyz.copy(), sh.copy()]
    rotator(np.diag(signs), count)(*short)
    np.testing.assert_allclose(short[0], means @ np.diag(signs), atol=1e-7)
    np.testing.assert_allclose(
        np.abs((short[1] * rotate_quaternions(wxyz, np.diag(signs))).sum(1)),
        (wxyz * wxyz).sum(1), rtol=1e-5,
    )  # fmt: skip
    wanted = np.einsum("ij,njc->nic", rotate_harmonics(np.diag(signs), count), sh)
    np.testing.assert_allclose(short[2], wanted, atol=1e-5)
    strided = [np.repeat(array, 2, axis=0)[::2] for array in (means, wxyz, sh)]
    rotator(np.diag(signs), count)(*strided)
    for one, other in zip(short, strided, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("rotation", ALL)
def test_every_turn_is_a_turn_and_no_mirror(rotation):
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)


def test_flip_is_half_a_turn_and_its_own_inverse():
    np.testing.assert_array_equal(UPSIDE_DOWN @ UPSIDE_DOWN, np.eye(3))
    np.testing.assert_array_equal(OURS_FROM_UP["-Y"], HALF_TURN)


@pytest.mark.parametrize("up", ["", "Y", "+y", "up", "+W", "--Y"])
def test_other_axes_are_one_sentence(up):
    with pytest.raises(BadFile, match=r"\+X, -X, \+Y, -Y, \+Z, -Z are known"):
        ours_from_file(up)


@pytest.mark.parametrize("count", COEFFICIENTS)
@pytest.mark.parametrize("rotation", ALL)
def test_each_splat_one_by_one(rotation, count):
    """Places, axes of the ellipsoid with their lengths, and colours, by their meaning."""
    was = some_splats(12, count)
    now = rotate_splats(was, rotation)
    before, after = rotation_matrices(was.wxyz), rotation_matrices(now.wxyz)
    np.testing.assert_array_equal(now.scales, was.scales)
    np.testing.assert_array_equal(now.opacity, was.opacity)
    d = directions(40)
    for i in range(12):
        np.testing.assert_allclose(now.means[i], rotation @ was.means[i], atol=1e-6)
        for axis in range(3):  # a column of the matrix is where that axis of the splat points
            np.testing.assert_allclose(after[i][:, axis], rotation @ before[i][:, axis], atol=2e-6)
        seen = np.repeat(now.sh[i : i + 1], 40, axis=0), np.repeat(was.sh[i : i + 1], 40, axis=0)
        np.testing.assert_allclose(shade(seen[0], d @ rotation.T), shade(seen[1], d), atol=2e-5)
    np.testing.assert_allclose(np.linalg.norm(now.wxyz, axis=1), 1, atol=1e-6)


@pytest.mark.parametrize("count", COEFFICIENTS)
def test_turns_follow_each_other_as_matrices_do(count):
    was = some_splats(30, count)
    for first, second in itertools.product(ALL[::3], ALL[1::3]):
        one = rotate_splats(was, second @ first)
        two = rotate_splats(rotate_splats(was, first), second)
        assert_same(one, two)
        np.testing.assert_allclose(
            rotate_harmonics(second, count) @ rotate_harmonics(first, count),
            rotate_harmonics(second @ first, count),
            atol=2e-6,
        )


@pytest.mark.parametrize("rotation", QUARTERS)
def test_four_quarters_are_nothing(rotation):
    was = some_splats(300, 16)
    now = was
    for _ in range(4):
        now = rotate_splats(now, rotation)
    assert_same(now, was)


@pytest.mark.parametrize("rotation", ALL)
def test_there_and_back(rotation):
    was = some_splats(300, 16)
    assert_same(rotate_splats(rotate_splats(was, rotation), rotation.T), was)


def test_half_a_turn_is_nothing_but_signs():
    was = some_splats(300, 16)
    now = rotate_splats(was, HALF_TURN)
    for name in ("means", "wxyz", "sh"):
        a, b = np.abs(getattr(was, name)), np.abs(getattr(now, name))
        np.testing.assert_array_equal(
            np.sort(a.reshape(300, -1), 1), np.sort(b.reshape(300, -1), 1)
        )
    slow = rotate_splats(was, HALF_TURN + 1e-30 * np.eye(3)[::-1])  # by way of matrices
    assert_same(now, slow)
    assert rotate_splats(was, np.eye(3)) is was


@pytest.mark.parametrize("rotation", ALL)
def test_the_quaternion_of_a_matrix_is_its_turn(rotation):
    q = quaternion_of(rotation)
    np.testing.assert_allclose(rotation_matrices(q[None])[0], rotation, atol=1e-12)


def assert_same(a, b) -> None:
    np.testing.assert_allclose(a.means, b.means, atol=2e-6)
    np.testing.assert_allclose(a.sh, b.sh, atol=2e-5)
    np.testing.assert_allclose(np.abs((a.wxyz * b.wxyz).sum(1)), 1, atol=2e-6)  # q is -q
    np.testing.assert_allclose(a.origin, b.origin, atol=1e-6)


def test_an_origin_turns_with_its_scene():
    from dataclasses import replace

    was = replace(some_splats(5), origin=(5e6, -3.0, 7.25e5))
    for rotation in ALL:
        np.testing.assert_allclose(
            rotate_splats(was, rotation).origin, rotation @ was.origin, rtol=1e-12
        )


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("up", AXES)
def test_a_file_read_turned_written_and_read_again_is_the_same(tmp_path, up, flip):
    write_ply(some_splats(257, 16), tmp_path / "a.ply")
    first = read_plain(tmp_path / "a.ply", Reading(up=up, flip=flip))
    write_ply(first, tmp_path / "b.ply")
    again = read_plain(tmp_path / "b.ply")
    assert_same(again, first)
    np.testing.assert_allclose(again.scales, first.scales, rtol=1e-6)
    plain = read_plain(tmp_path / "a.ply", Reading(up="+Y"))  # the file's own axes
    assert_same(first, rotate_splats(plain, ours_from_file(up, flip)))


def test_a_real_file_upside_down_is_its_own_picture_turned(data):
    path = data / "anatomy_leg_ml3dgs" / "layer2.ply"
    was, now = read_plain(path), read_plain(path, Reading(flip=True))
    assert_same(now, rotate_splats(was, UPSIDE_DOWN))
    assert now.findings == was.findings == ()


@pytest.mark.parametrize("reading", [Reading(up="-Y"), Reading(flip=True), Reading(up="+Z")])
def test_packages_have_one_way_up(reading):
    from shapeshift.app.commands.headless import DEMO

    with pytest.raises(BadFile, match=r"is a package, and \+Y is up .*--up and --flip"):
        read_model(DEMO, reading)
    assert read_model(DEMO, Reading(up="+Y")).splat_count > 0


@pytest.mark.parametrize("words", [["--up", "-Z"], ["--up=-Z"], ["--up", "+Z"], ["--up=+Z"]])
def test_the_option_takes_an_axis_with_its_sign(words):
    from shapeshift.app.command_line import parse
    from shapeshift.app.commands.info import Options

    options = parse(Options, ["scene.ply", *words], "info")
    assert options.reading().up == words[-1][-2:]
    assert parse(Options, [*words, "--flip", "scene.ply"], "info").reading().flip
