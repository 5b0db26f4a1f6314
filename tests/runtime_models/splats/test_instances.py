"""Scene graphs that place splats more than once, hide them or move them: glTF and USD."""

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.gltf.gltf_nodes import MOST_INSTANCES
from shapeshift.runtime_models.splats.gltf.read_gltf import read_raw_gltf
from shapeshift.runtime_models.splats.plain_splats import Reading
from tests.support.splats.gltf_files import make_asset, splat_arrays, write_glb
from tests.support.splats.ply_files import some_splats

HUGE = Reading(allow_huge=True)
SHIFTS = np.array([[10, 0, 0], [0, 20, 0], [0, 0, -30]], "<f4")
HALF = 0.5**0.5
TURNS = np.array([[0, 0, 0, 1], [0, 0, HALF, HALF], [1, 0, 0, 0]], "<f4")  # x y z w
SIZES = np.array([[1, 1, 1], [2, 2, 2], [0.5, 0.5, 0.5]], "<f4")


def wanted_places(means: np.ndarray) -> np.ndarray:
    """Each instance by hand: a quarter turn about z swaps x and y, half a turn about x flips."""
    x, y, z = means.T
    second = np.stack([-y, x, z], 1) * 2
    third = np.stack([x, -y, -z], 1) / 2
    return np.concatenate([means + SHIFTS[0], second + SHIFTS[1], third + SHIFTS[2]])


def instanced(count: int = 4, **parts: np.ndarray) -> tuple[dict, bytes]:
    """An asset whose node has instances with these attributes."""
    splats = splat_arrays(count, 1)
    asset, data = make_asset(splats | parts)
    places = {name: len(splats) + i for i, name in enumerate(parts)}
    attributes = asset["meshes"][0]["primitives"][0]["attributes"]
    for name in parts:
        del attributes[name]
    asset["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    asset["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": places}}
    return asset, data


def told(splats) -> list[tuple[str, str]]:
    return [(finding.what, finding.done) for finding in splats.findings]


def test_instances_of_a_gltf_node_stand_each_in_its_place(tmp_path):
    parts = {"TRANSLATION": SHIFTS, "ROTATION": TURNS, "SCALE": SIZES}
    path = write_glb(tmp_path / "a.glb", *instanced(**parts))
    splats, arrays = read_raw_gltf(path, Reading()), splat_arrays(4, 1)
    np.testing.assert_allclose(splats.means, wanted_places(arrays["POSITION"]), atol=1e-5)
    once = arrays["KHR_gaussian_splatting:SCALE"]
    np.testing.assert_allclose(splats.scales, np.concatenate([once, 2 * once, once / 2]), rtol=1e-6)
    assert not splats.findings


@pytest.mark.parametrize("count", [0, 1, 2])
def test_so_many_instances_as_there_are(tmp_path, count):
    path = write_glb(tmp_path / "a.glb", *instanced(TRANSLATION=SHIFTS[:count]))
    if not count:
        with pytest.raises(BadFile, match="hidden"):
            read_raw_gltf(path, Reading())
        return
    assert len(read_raw_gltf(path, Reading()).means) == 4 * count


def test_instances_without_a_size_are_left_out_and_said(tmp_path):
    sizes = SIZES * [[1], [0], [1]]
    path = write_glb(tmp_path / "a.glb", *instanced(SCALE=sizes.astype("<f4")))
    splats = read_raw_gltf(path, Reading())
    assert len(splats.means) == 8
    assert told(splats) == [("1 of 3 instances have no size", "left out")]


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"TRANSLATION": SHIFTS, "SCALE": SIZES[:2]}, r"\[2, 3\] numbers each"),
        ({"TRANSLATION": np.full((3, 3), np.inf, "<f4")}, "at infinity"),
        ({"SCALE": np.full((3, 3), np.nan, "<f4")}, "at infinity"),
        ({"SCALE": SIZES * np.float32(0)}, "all 3 instances of its splats have no size"),
        ({"TRANSLATION": np.zeros((MOST_INSTANCES + 1, 3), "<f4")}, "10,001 instances"),
    ],
)
def test_instances_that_are_none(tmp_path, parts, words):
    path = write_glb(tmp_path / "a.glb", *instanced(**parts))
    with pytest.raises(BadFile, match=words):
        read_raw_gltf(path, Reading())


def test_hidden_and_animated_gltf_nodes_are_said(tmp_path):
    """Node 1 hangs on the hidden node 0; node 2 moves, by a pointer; node 3 is plain."""
    asset, data = make_asset(splat_arrays(4))
    hide = {"extensions": {"KHR_node_visibility": {"visible": False}}}
    show = {"extensions": {"KHR_node_visibility": {"visible": True}}}
    asset["nodes"] = [hide | {"children": [1]}, show | {"mesh": 0}, show | {"mesh": 0}, {"mesh": 0}]
    asset["scenes"] = [{"nodes": [0, 2, 3]}]
    pointer = {"KHR_animation_pointer": {"pointer": "/nodes/2/translation"}}
    target = {"path": "pointer", "extensions": pointer}
    asset["animations"] = [{"channels": [{"sampler": 0, "target": target}], "samplers": []}]
    splats = read_raw_gltf(write_glb(tmp_path / "a.glb", asset, data), Reading())
    assert len(splats.means) == 8
    assert told(splats) == [
        ("1 of 3 nodes of splats hidden (KHR_node_visibility)", "left out"),
        ("1 of 3 nodes of splats moved by animations", "shown at rest"),
    ]
    asset["animations"][0]["channels"][0]["target"] = {"node": 0, "path": "translation"}
    assert len(told(read_raw_gltf(write_glb(tmp_path / "b.glb", asset, data), Reading()))) == 1
    asset["scenes"] = [{"nodes": [0]}]
    with pytest.raises(BadFile, match="on hidden nodes"):
        read_raw_gltf(write_glb(tmp_path / "c.glb", asset, data), Reading())


def test_a_gltf_without_its_extension_names_who_dropped_it(tmp_path):
    asset, data = make_asset(splat_arrays(4))
    del asset["meshes"][0]["primitives"][0]["extensions"]
    with pytest.raises(BadFile, match=r"gltf-transform, dropped KHR_gaussian_splatting"):
        read_raw_gltf(write_glb(tmp_path / "a.glb", asset, data), Reading())


@pytest.fixture
def usd(tmp_path):
    """(a stage with 4 splats at /World/A under an Xform, its splats, its path)."""
    pytest.importorskip("pxr", reason="usd-core is not installed (an optional extra)")
    from tests.support.splats.usd_stages import stage_with

    splats = some_splats(4, 4)
    return stage_with(tmp_path / "a.usda", splats), splats, tmp_path / "a.usda"


@pytest.mark.parametrize("at", ["/World", "/World/A"])
def test_a_usd_node_without_a_default_stands_at_its_first_time(usd, at):
    from pxr import Gf, UsdGeom

    stage, splats, path = usd
    op = UsdGeom.Xformable(stage.OverridePrim(at)).AddTranslateOp()
    UsdGeom.Xform.Define(stage, "/World")
    op.Set(Gf.Vec3d(5, 6, 7), 10)
    op.Set(Gf.Vec3d(50, 60, 70), 20)
    stage.Save()
    back = read_plain(path, HUGE)
    np.testing.assert_allclose(back.means, np.add(splats.means, (5, 6, 7)), atol=1e-5)
    assert told(back) == [("4 splats that move in time", "shown still, at their first time")]


@pytest.mark.parametrize("first", ["inherited", "invisible"])
def test_usd_visibility_is_that_of_the_first_time(usd, first):
    from pxr import UsdGeom

    from tests.support.splats.usd_stages import add_field

    stage, _, path = usd
    prim = add_field(stage, "/World/B", some_splats(3, 1))
    other = {"inherited": "invisible", "invisible": "inherited"}[first]
    visibility = UsdGeom.Imageable(prim).CreateVisibilityAttr()
    visibility.Set(first, 1)
    visibility.Set(other, 2)
    stage.Save()
    back = read_plain(path, HUGE)
    if first == "inherited":
        assert len(back.means) == 7 and told(back)[0][0] == "3 splats that move in time"
    else:
        assert len(back.means) == 4
        assert told(back) == [("1 of its fields of splats show later in time only", "left out")]


@pytest.mark.parametrize("mask", [False, True])
def test_a_point_instancer_places_its_splats(usd, mask):
    """Its prototype does not stand by itself; an instance by number is hidden."""
    from pxr import Gf, UsdGeom, Vt

    from tests.support.splats.usd_stages import add_field

    stage, splats, path = usd
    stage.RemovePrim("/World/A")
    instancer = UsdGeom.PointInstancer.Define(stage, "/World/I")
    instancer.AddTranslateOp().Set(Gf.Vec3d(100, 0, 0))
    add_field(stage, "/World/I/P/A", splats)
    instancer.CreatePrototypesRel().SetTargets(["/World/I/P"])
    instancer.CreateProtoIndicesAttr([0, 0, 0])
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(SHIFTS))
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(SIZES))
    instancer.CreateOrientationsAttr(
        Vt.QuathArray([Gf.Quath(*(float(n) for n in turn[[3, 0, 1, 2]])) for turn in TURNS])
    )
    if mask:
        instancer.CreateInvisibleIdsAttr([1])
    stage.Save()
    back = read_plain(path, HUGE)
    wanted = np.add(wanted_places(splats.means), (100, 0, 0))
    wanted = wanted[[*range(4), *range(8, 12)]] if mask else wanted
    places = np.add(back.means, back.origin)
    np.testing.assert_allclose(places, wanted, atol=2e-3)  # its turns are half floats
    assert not back.findings


def test_instancers_in_instancers_are_said(usd):
    from pxr import Gf, UsdGeom

    from tests.support.splats.usd_stages import add_field

    stage, splats, path = usd
    outer = UsdGeom.PointInstancer.Define(stage, "/World/O")
    inner = UsdGeom.PointInstancer.Define(stage, "/World/O/I")
    add_field(stage, "/World/O/I/A", splats)
    for each, target in ((outer, "/World/O/I"), (inner, "/World/O/I/A")):
        each.CreatePrototypesRel().SetTargets([target])
        each.CreateProtoIndicesAttr([0, 0])
        each.CreatePositionsAttr([Gf.Vec3f(0, 0, 0), Gf.Vec3f(1, 0, 0)])
    stage.Save()
    back = read_plain(path, HUGE)
    assert len(back.means) == 4
    assert told(back)[-1][0] == "2 instances of point instancers within point instancers"
