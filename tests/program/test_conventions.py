"""CONVENTIONS.md, executed: an assert a row.  If one must change, look at every shader and file."""

import ast
import re
from collections import defaultdict
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import AnchorModel, ControlEncoding, SplatLayers, Stop
from shapeshift.scene.pose import Pose, View, eyes_apart, look_at, perspective, stereo_pair
from tests.support.sources import nodes_of

HALF = np.sqrt(0.5)
HERE = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]))


def random_pose(seed: int) -> Pose:
    rng = np.random.default_rng(seed)
    q = rng.normal(size=4)
    return Pose(rng.normal(size=3), q / np.linalg.norm(q))


def test_positive_quarter_turn_about_y_takes_forward_to_left():
    turn = Pose(np.zeros(3), np.array([HALF, 0, HALF, 0]))
    np.testing.assert_allclose(turn.matrix()[:3, :3] @ [0, 0, -1], [-1, 0, 0], atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_pose_and_matrix_are_inverse_and_orthonormal(seed):
    matrix = random_pose(seed).matrix()
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1)
    np.testing.assert_allclose(Pose.from_matrix(matrix).matrix(), matrix, atol=1e-12)


@pytest.mark.parametrize("wxyz", [(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)])
def test_half_turns_survive_the_matrix(wxyz):
    matrix = Pose(np.zeros(3), np.array(wxyz, float)).matrix()
    assert abs(Pose.from_matrix(matrix).wxyz @ wxyz) == pytest.approx(1)


def test_the_eye_looks_along_minus_z_with_y_up():
    view = look_at((1.0, 2.0, 3.0), (1.0, 2.0, -5.0)).matrix()
    np.testing.assert_allclose(view[:3, :3], np.eye(3), atol=1e-12)


def test_near_is_minus_one_and_far_is_plus_one():
    clip = View(HERE, (-1, 1, -1, 1), 0.1, 50, (64, 64)).clip_from_eye()
    for z, depth in [(-0.1, -1), (-50, 1)]:
        p = clip @ [0, 0, z, 1]
        assert p[2] / p[3] == pytest.approx(depth)


def test_off_centre_eye_puts_its_edges_on_the_clip_edges():
    clip = View(HERE, (-1.3, 0.9, -1.1, 1.0), 0.1, 50, (64, 64)).clip_from_eye()
    for axis, tangent, want in [(0, -1.3, -1), (0, 0.9, 1), (1, -1.1, -1), (1, 1.0, 1)]:
        point = np.array([0, 0, -2.0, 1])
        point[axis] = tangent * 2
        p = clip @ point
        assert p[axis] / p[3] == pytest.approx(want)


@pytest.mark.parametrize("seed", range(5))
def test_pinhole_and_clip_agree_on_where_a_point_is_seen(seed):
    view = View(random_pose(seed), (-1.3, 0.9, -0.8, 1.1), 0.1, 50, (640, 360))
    rng = np.random.default_rng(seed)
    eye = np.array([*rng.uniform(-1, 1, 2), -3.0, 1.0])
    world = view.world_from_eye.matrix() @ eye
    clip = view.clip_from_eye() @ eye
    x_ndc, y_ndc = clip[:2] / clip[3]
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    x, y, z, _ = camera_from_world @ world
    assert z == pytest.approx(3)  # OpenCV's z is forward
    assert fx * x / z + cx == pytest.approx((x_ndc + 1) / 2 * 640)
    assert fy * y / z + cy == pytest.approx((1 - y_ndc) / 2 * 360)  # row 0 is on top


@pytest.mark.parametrize("seed", range(5))
def test_view_from_pinhole_is_the_inverse_of_pinhole(seed):
    view = View(random_pose(seed), (-1.3, 0.9, -0.8, 1.1), 0.05, 1000, (640, 360))
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    back = View.from_pinhole(np.linalg.inv(camera_from_world), (fx, fy), (cx, cy), (640, 360))
    np.testing.assert_allclose(back.tangents, view.tangents, atol=1e-12)
    np.testing.assert_allclose(back.eye_from_world(), view.eye_from_world(), atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("distance", [0.0, 0.064, 0.3])
def test_two_eyes_stand_so_far_apart_about_the_place_of_one(seed, distance):
    """Left first; half the distance to either side along the head's own x, looking the same way."""
    view = View(random_pose(seed), (-1.3, 0.9, -0.8, 1.1), 0.1, 50, (640, 360))
    pair = stereo_pair(view, distance)
    head = view.world_from_eye
    local = [np.linalg.inv(head.matrix()) @ [*eye.world_from_eye.position, 1] for eye in pair]
    np.testing.assert_allclose(local[0], [-distance / 2, 0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(local[1], [distance / 2, 0, 0, 1], atol=1e-12)
    for eye in pair:
        np.testing.assert_array_equal(eye.world_from_eye.wxyz, head.wxyz)
        assert replace(eye, world_from_eye=head) == replace(view, world_from_eye=head)


def test_eyes_of_a_scene_without_a_scale():
    """64 mm where the middle splat is 1.8 m away, and in proportion."""
    assert eyes_apart(np.array([1.0, 1.8, 40.0])) == pytest.approx(0.064)
    assert eyes_apart(np.full(7, 18.0)) == pytest.approx(0.64)
    assert eyes_apart(np.zeros(0)) == pytest.approx(0.064)


def test_perspective_has_the_asked_field_of_view():
    left, right, down, up = perspective(0.8, (640, 360))
    assert np.arctan(up) - np.arctan(down) == pytest.approx(0.8)
    assert (right - left) / (up - down) == pytest.approx(640 / 360)


def test_control_encoding_is_equations_6_and_7():
    psi = ControlEncoding(d=16, spacing=1 / 15, sigma=0.04).encode(0.4)
    want = [np.exp(-((i / 15 - 0.4) ** 2) / (2 * 0.04**2)) for i in range(16)]
    np.testing.assert_allclose(psi, want, rtol=1e-6, atol=1e-38)  # below: float32 has 0
    assert psi.argmax() == 6


def test_layers_cumulative_and_exclusive():
    stops = tuple(Stop(n, x) for n, x in [("a", 0.0), ("b", 0.5), ("c", 1.0)])
    one = np.ones((3, 1), np.float32)
    arrays = (np.repeat(one, 3, 1), np.repeat(one, 3, 1), np.repeat(one, 4, 1), one[:, 0])
    sh, layer = np.ones((3, 1, 3), np.float32), np.arange(3, dtype=np.int32)
    both = {m: SplatLayers(*arrays, sh, layer, stops, m) for m in ("cumulative", "exclusive")}
    want = {
        "cumulative": {0.0: (1, 0, 0), 0.25: (1, 0.5, 0), 0.5: (1, 1, 0), 1.0: (1, 1, 1)},
        "exclusive": {0.0: (1, 0, 0), 0.25: (0.5, 0.5, 0), 0.5: (0, 1, 0), 1.0: (0, 0, 1)},
    }
    for mode, rows in want.items():
        for x, weights in rows.items():
            np.testing.assert_allclose(both[mode].weights(x), weights, atol=1e-7)


def test_bad_arrays_say_what_and_where():
    anchors = np.zeros((5, 3), np.float32)
    rest = ({}, 10, ControlEncoding(), (Stop("rgb", 0.0),))
    with pytest.raises(ValueError, match=r"features has shape \(4, 16\), expected \(5, F\)"):
        AnchorModel(anchors, np.zeros((4, 16), np.float32), *rest)
    with pytest.raises(ValueError, match="features is float64, expected float32"):
        AnchorModel(anchors, np.zeros((5, 16)), *rest)
    anchors[3, 1] = np.nan
    with pytest.raises(ValueError, match=r"anchors has 1 NaN or Inf, first at \[3, 1\]"):
        AnchorModel(anchors, np.zeros((5, 16), np.float32), *rest)


# ---- Names.  A verb says what it does to what; a name is one thing in the whole product.

ROOT = Path(__file__).resolve().parents[2]
PRODUCT = (
    "app", "decomposition", "rasterizer", "renderer", "runtime_models", "scene", "shapeshift",
    "training", "vr",
)  # fmt: skip
# Classes whose name is there more than once -> why.
SHARED_NAMES = {
    "Options": "each command has one, which the command line finds by name",
    "Renderer": "the library's wraps the program's, for who imports shapeshift alone",
    "Scene": "the library's wraps the program's, for who imports shapeshift alone",
}
BARE_VERBS = {"take", "tell", "put", "let", "told"}  # anything can be taken, told or put


@cache
def definitions() -> list[tuple[str, ast.AST]]:
    """(file, node) of every class and function that the product defines, inner ones too."""
    kinds = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)
    return [
        (str(path.relative_to(ROOT)), node)
        for folder in PRODUCT
        for path in sorted((ROOT / folder).rglob("*.py"))
        for node in nodes_of(path)
        if isinstance(node, kinds)
    ]


def test_functions_and_parameters_have_the_verb_of_what_they_do():
    functions = [row for row in definitions() if not isinstance(row[1], ast.ClassDef)]
    names = [
        (f"{path}:{node.lineno}", name)
        for path, node in functions
        for name in [
            getattr(node, "name", ""),
            *(a.arg for a in [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]),
        ]
    ]
    assert len(functions) > 3000, "the walk has missed most of the product"
    assert not [(place, name) for place, name in names if name.strip("_") in BARE_VERBS]


def test_no_two_classes_have_one_name():
    places = defaultdict(list)
    for path, node in definitions():
        if isinstance(node, ast.ClassDef):
            places[node.name].append(path)
    shared = {name: paths for name, paths in places.items() if len(paths) > 1}
    assert shared.keys() == SHARED_NAMES.keys(), shared
    assert {path.split("/")[0] for path in shared["Options"]} == {"app"}
    for name in ("Renderer", "Scene"):
        assert sorted(path.startswith("shapeshift/api/") for path in shared[name]) == [False, True]


# ---- Tests use what anybody may use.

# What is left has no public way: device arrays of one pass, injected faults and clocks of drivers.
MOST_REACHES = 27
NOT_PRIVATE = {
    "_replace",
    "_asdict",
    "_fields",
    "_make",
    "_repr_png_",
    "_repr_html_",
    "_repr_mimebundle_",
    "_exit",
    "_state",
    "_getframe",
    "_obj",  # what ctypes.byref was given
}


def test_sentences_name_the_program_as_it_was_started():
    """Installed by pip it is `shapeshift` and there is no launch.py: program.py alone knows."""
    knows = {"runtime_models/program.py", "shapeshift/which_python.py"}  # the latter is launch.py's
    said = []
    for path in (path for folder in PRODUCT for path in sorted((ROOT / folder).rglob("*.py"))):
        kinds = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
        docs = {
            id(node.body[0].value)
            for node in nodes_of(path)
            if isinstance(node, kinds) and node.body and isinstance(node.body[0], ast.Expr)
        }
        said += [
            f"{file}:{node.lineno}"
            for node in nodes_of(path)
            if isinstance(node, ast.Constant) and isinstance(node.value, str)
            and "launch.py" in node.value and id(node) not in docs
            and (file := str(path.relative_to(ROOT))) not in knows
        ]  # fmt: skip
    assert not said, "f'{program()} ...' in place of 'launch.py ...'"


def private_reaches() -> list[str]:
    """Places of tests that name a private attribute of something that the file did not make."""
    found = []
    for path in sorted((ROOT / "tests").rglob("*.py")):
        text = path.read_text()
        if not re.search(r"""\._|["']_""", text):  # four files of five: parsing them takes seconds
            continue
        nodes = list(ast.walk(ast.parse(text)))
        own = {
            node.attr
            for node in nodes
            if isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "self"
        }
        for node in nodes:
            name = getattr(node, "attr", "")
            if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "setattr":
                last = getattr(node.args[1], "value", "") if len(node.args) > 1 else ""
                name = last if isinstance(last, str) else ""
            if name.startswith("_") and not name.endswith("__") and name not in own | NOT_PRIVATE:
                found.append(f"{path.relative_to(ROOT)}:{node.lineno} {name}")
    return found


def test_tests_reach_into_few_private_attributes():
    found = private_reaches()
    assert len(found) <= MOST_REACHES, "\n".join(found)
