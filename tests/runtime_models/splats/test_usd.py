"""USD scenes by usd-core itself: what is read, where prims stand, what is never opened."""

import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.gate import gate
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import describe, read_model
from shapeshift.runtime_models.rotation import covariance
from shapeshift.runtime_models.splats.formats import format_of, read_plain
from shapeshift.runtime_models.splats.operations.rotate_splats import ours_from_file, rotate_splats
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.usd import read_usd
from shapeshift.runtime_models.splats.usd.write_usd import write_usd
from shapeshift.runtime_models.splats.write_plain import writer_of
from tests.support.splats.ply_files import some_splats

pytest.importorskip("pxr", reason="usd-core is not installed (an optional extra)")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdVol, Vt

from tests.support.splats.usd_stages import add_field, stage_with

HUGE = Reading(allow_huge=True)
ENDINGS = ("usda", "usdc", "usd", "usdz")


def same(ours, theirs, atol: float = 1e-6) -> None:
    for name in ("means", "opacity", "sh"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), atol=atol)
    np.testing.assert_allclose(ours.scales, theirs.scales, rtol=1e-5)
    np.testing.assert_allclose(np.abs((ours.wxyz * theirs.wxyz).sum(1)), 1, atol=1e-6)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("coefficients", [1, 16])
def test_what_is_written_is_read(tmp_path, ending, coefficients):
    path, splats = tmp_path / f"a.{ending}", some_splats(30, coefficients)
    writer_of(path).write(splats, path)
    assert format_of(path).name == "USD"
    back = read_plain(path, HUGE)
    for name in ("means", "scales", "opacity", "sh"):
        np.testing.assert_array_equal(getattr(back, name), getattr(splats, name))
    same(back, splats)
    assert not back.findings and [p.name for p in tmp_path.iterdir()] == [path.name]
    assert describe(read_model(path, HUGE), path)["format"] == "USD"


def test_a_far_origin_is_kept(tmp_path):
    splats = replace(some_splats(30, 1), origin=(4e6, -1.5, 2.25e6))
    splats.scales[:] *= 0.01
    write_usd(splats, tmp_path / "a.usdc")
    back = read_plain(tmp_path / "a.usdc", HUGE)
    np.testing.assert_allclose(
        np.add(back.means, back.origin), np.add(splats.means, splats.origin), rtol=0, atol=1e-6
    )


@pytest.mark.parametrize("up", ["Y", "Z"])
@pytest.mark.parametrize("metres", [1.0, 0.01, None])
def test_a_stage_says_its_up_and_its_units(tmp_path, up, metres):
    splats = some_splats(20, 4)
    stage_with(tmp_path / "a.usda", splats, up, metres)
    back, unit = read_plain(tmp_path / "a.usda", HUGE), metres or 0.01
    wanted = rotate_splats(splats, ours_from_file(f"+{up}"))
    np.testing.assert_allclose(back.means, wanted.means * unit, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(back.scales, wanted.scales * unit, rtol=1e-5)
    np.testing.assert_allclose(back.sh, wanted.sh, atol=1e-5)
    told = [finding.what for finding in back.findings]
    assert told == ([] if metres else ["it does not state metersPerUnit"])


@pytest.mark.parametrize("up", ["Y", "Z"])
def test_a_writer_that_leaves_axes_as_they_are_is_known_by_its_comment(tmp_path, up):
    """NVIDIA's gsplat2USD 0.1.5: a PLY's numbers under whatever upAxis it was asked for."""
    splats = some_splats(20, 4)
    stage = stage_with(tmp_path / "a.usda", splats, up)
    stage.GetRootLayer().comment = "Converted from PLY/SPZ to USD using gsplat2USD\nSource file: a"
    stage.Save()
    back = read_plain(tmp_path / "a.usda", HUGE)
    np.testing.assert_allclose(back.means, splats.means * (1, -1, -1), atol=1e-6)
    assert back.findings[0].done == f"read with -Y up; --up=+{up} reads it as it says"
    asked = read_plain(tmp_path / "a.usda", replace(HUGE, up=f"+{up}"))
    wanted = rotate_splats(splats, ours_from_file(f"+{up}"))
    np.testing.assert_allclose(asked.means, wanted.means, atol=1e-6)


def test_arrays_that_are_too_short_are_told_with_both_counts(tmp_path):
    splats = some_splats(200, 1)
    stage = stage_with(tmp_path / "a.usda", splats)
    prim = stage.GetPrimAtPath("/World/A")
    prim.GetAttribute("scales").Set(Vt.Vec3fArray.FromNumpy(splats.scales[:100].copy()))
    prim.RemoveProperty("radiance:sphericalHarmonicsDegree")
    stage.Save()
    told = [finding.what for finding in read_plain(tmp_path / "a.usda", HUGE).findings]
    assert "scales has 100 entries for 200 splats" in told
    assert any("has 200 entries; degree 3, which is meant" in what for what in told)
    assert any(what.endswith("wants 3,200") for what in told)


def full_covariance(scales, wxyz):
    return covariance(scales, wxyz)[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)


def test_prims_stand_where_their_parents_put_them(tmp_path):
    """Places by USD's own transform of each point; shapes by the same matrix about them."""
    splats = some_splats(15, 4)
    stage = stage_with(tmp_path / "a.usda", splats)
    world = UsdGeom.Xform(stage.GetPrimAtPath("/World"))
    world = UsdGeom.Xform.Define(stage, "/World") if not world else world
    world.AddTranslateOp().Set(Gf.Vec3d(1, 2, 3))
    world.AddRotateXYZOp().Set(Gf.Vec3f(30, 40, 50))
    world.AddScaleOp().Set(Gf.Vec3f(2, 2, 2))
    add_field(stage, "/World/B", some_splats(5, 1, seed=3))
    hidden = add_field(stage, "/World/C", some_splats(7, 1))
    UsdGeom.Imageable(hidden).MakeInvisible()
    stage.Save()
    back = read_plain(tmp_path / "a.usda", HUGE)
    assert len(back.means) == 15 + 5
    matrix = UsdGeom.XformCache().GetLocalToWorldTransform(stage.GetPrimAtPath("/World/A"))
    points = [matrix.Transform(Gf.Vec3d(*map(float, mean))) for mean in splats.means]
    np.testing.assert_allclose(back.means[:15], np.array(points), atol=1e-5)
    linear = np.array(matrix.ExtractRotationMatrix()).T
    shapes = linear @ full_covariance(splats.scales, splats.wxyz) @ linear.T
    got = full_covariance(back.scales[:15], back.wxyz[:15])
    np.testing.assert_allclose(got, shapes, atol=2e-5 * np.abs(shapes).max())


def test_half_floats_are_read_and_floats_come_first(tmp_path):
    splats = some_splats(9, 4)
    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usdc"))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    prim = add_field(stage, "/A", splats, half=True)
    stage.Save()
    back = read_plain(tmp_path / "a.usdc", HUGE)
    np.testing.assert_array_equal(back.means, splats.means.astype(np.float16).astype(np.float32))
    prim.GetAttribute("positions").Set(Vt.Vec3fArray.FromNumpy(splats.means))
    stage.Save()
    np.testing.assert_array_equal(read_plain(tmp_path / "a.usdc", HUGE).means, splats.means)


def test_what_is_not_there_is_as_the_schema_has_it(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    prim = UsdVol.ParticleField3DGaussianSplat.Define(stage, "/A").GetPrim()
    prim.GetAttribute("positions").Set(Vt.Vec3fArray([(0, 0, 0), (1, 2, 3)]))
    prim.GetAttribute("opacities").Set(Vt.FloatArray([0.25, 0.5, 0.75]))  # too long: cut
    stage.Save()
    back = read_plain(tmp_path / "a.usda", HUGE)
    np.testing.assert_array_equal(back.opacity, [0.25, 0.5])
    np.testing.assert_array_equal(back.scales, 1)
    np.testing.assert_array_equal(np.abs(back.wxyz), [[1, 0, 0, 0]] * 2)
    np.testing.assert_array_equal(back.sh, 0)  # 0.5 of every colour
    assert [f.done for f in back.findings] == ["shown in gray", *["each has the usual ones"] * 2]


def test_splats_that_move_are_shown_at_their_first_time(tmp_path):
    splats = some_splats(6, 1)
    stage = stage_with(tmp_path / "a.usda", splats)
    positions = stage.GetPrimAtPath("/World/A").GetAttribute("positions")
    positions.Clear()
    for time in (3, 7):
        positions.Set(Vt.Vec3fArray.FromNumpy(splats.means + np.float32(time)), time)
    stage.Save()
    back = read_plain(tmp_path / "a.usda", HUGE)
    np.testing.assert_allclose(back.means, splats.means + 3, atol=1e-6)
    assert back.findings[0].done == "shown still, at their first time"


def test_harmonics_of_degree_four_are_drawn_up_to_three(tmp_path):
    splats = replace(some_splats(6, 1), sh=np.random.default_rng(0).normal(size=(6, 25, 3)))
    stage_with(tmp_path / "a.usda", splats)
    back = read_plain(tmp_path / "a.usda", HUGE)
    np.testing.assert_allclose(back.sh, splats.sh[:, :16], atol=1e-6)
    assert "degree 4" in back.findings[0].what


# Scenes of several files


def test_layers_and_references_within_the_folder_are_followed(tmp_path):
    splats = some_splats(11, 1)
    (tmp_path / "in").mkdir()
    stage_with(tmp_path / "in" / "part.usdc", splats)
    root = Usd.Stage.CreateNew(str(tmp_path / "root.usda"))
    UsdGeom.SetStageMetersPerUnit(root, 1.0)
    root.DefinePrim("/One").GetReferences().AddReference("./in/part.usdc", "/World/A")
    root.DefinePrim("/Two").GetPayloads().AddPayload("in/part.usdc", "/World/A")
    root.Save()
    assert len(read_plain(tmp_path / "root.usda", HUGE).means) == 22


def hostile(path: Path, said: str, how: str) -> Path:
    """A scene that names another file."""
    stage_with(path, some_splats(3, 1))
    layer = Sdf.Layer.FindOrOpen(str(path))
    if how == "sublayer":
        layer.subLayerPaths.append(said)
    else:
        prim = Sdf.CreatePrimInLayer(layer, "/Other")
        kind = {"reference": Sdf.Reference, "payload": Sdf.Payload}[how]
        getattr(prim, f"{how}List").prependedItems.append(kind(said))
    layer.Save()
    return path


@pytest.mark.parametrize("how", ["sublayer", "reference", "payload"])
@pytest.mark.parametrize(
    "said", ["../secret.usda", "/secret/of/somebody.usda", "in/../../secret.usda",
             "https://example.org/a.usda", "secret.usda:SDF_FORMAT_ARGS:a=b"]
)  # fmt: skip
def test_nothing_outside_the_folder_is_opened(tmp_path, how, said):
    stage_with(tmp_path / "secret.usda", some_splats(5, 1))
    (tmp_path / "in").mkdir()
    path = hostile(tmp_path / "in" / "a.usda", said, how)
    with pytest.raises(BadFile, match=r"only files in its own folder are opened|is no USD"):
        read_model(path, HUGE)


def test_a_link_out_of_the_folder_is_outside(tmp_path):
    stage_with(tmp_path / "secret.usda", some_splats(5, 1))
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "link.usda").symlink_to(tmp_path / "secret.usda")
    path = hostile(tmp_path / "in" / "a.usda", "link.usda", "reference")
    with pytest.raises(BadFile, match="only files in its own folder"):
        read_model(path, HUGE)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("gone.usda", "which is not there"),
        ("a.obj", "is no USD"),
        ("broken.usda", "no USD that can be read|cannot be read"),
    ],
)
def test_a_part_that_cannot_be_read_is_told(tmp_path, said, words):
    (tmp_path / "a.obj").write_text("v 0 0 0")
    (tmp_path / "broken.usda").write_text("#usda 1.0\n(")
    with pytest.raises(BadFile, match=words):
        read_model(hostile(tmp_path / "root.usda", said, "reference"), HUGE)


def test_times_in_other_files_are_refused(tmp_path):
    path = tmp_path / "a.usda"
    stage = stage_with(path, some_splats(3, 1))
    Usd.ClipsAPI(stage.GetPrimAtPath("/World/A")).SetClipAssetPaths(["/etc/passwd"])
    stage.Save()
    with pytest.raises(BadFile, match="value clips, which are not read"):
        read_model(path, HUGE)


def test_instances_of_instances_end(tmp_path):
    """Ten levels of ten: 10^10 prims, a hundred thousand are looked at."""
    lines = ["#usda 1.0", 'def Xform "P0"\n{\n}']
    for level in range(1, 11):
        head = f"instanceable = true\nprepend references = </P{level - 1}>"
        below = "\n".join(f'def Xform "i{i}" (\n{head}\n)\n{{\n}}' for i in range(10))
        lines.append(f'def Xform "P{level}"\n{{\n{below}\n}}')
    (tmp_path / "a.usda").write_text("\n".join(lines))
    with pytest.raises(BadFile, match="over 100,000 prims"):
        read_model(tmp_path / "a.usda", HUGE)


# Broken ones


@pytest.mark.parametrize("ending", ["usda", "usdc", "usdz"])
def test_cut_off_and_damaged_scenes_are_one_sentence(tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    write_usd(some_splats(30, 4), path)
    whole, rng = path.read_bytes(), np.random.default_rng(1)
    cuts = [whole[:size] for size in (9, len(whole) - 5)]
    for _ in range(3):
        data = bytearray(whole)
        for at in rng.integers(8, len(data), 4):
            data[at] = rng.integers(0, 256)
        cuts.append(bytes(data))
    opened = 0
    for data in cuts:
        path.write_bytes(data)
        try:
            opened += len(read_model(path, HUGE).means) > 0
        except BadFile as refusal:
            assert "\n" not in str(refusal) and len(str(refusal)) < 400
    assert opened < len(cuts)


def test_a_scene_of_something_else_says_what_it_has(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    UsdGeom.Sphere.Define(stage, "/Ball")
    stage.Save()
    with pytest.raises(BadFile, match=r"no visible ParticleField3DGaussianSplat \(it has Sphere\)"):
        read_model(tmp_path / "a.usda")


def test_arrays_of_zeros_count_for_the_file(tmp_path):
    """USD packs equal numbers: 30 million splats in some kilobytes are a bomb."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usdc"))
    prim = UsdVol.ParticleField3DGaussianSplat.Define(stage, "/A").GetPrim()
    prim.GetAttribute("opacities").Set(Vt.FloatArray(8_000_000, 0.0))
    prim.GetAttribute("positions").Set(Vt.Vec3fArray(8_000_000, (0, 0, 0)))
    stage.Save()
    data = (tmp_path / "a.usdc").read_bytes()
    import gzip

    (tmp_path / "a.usdc.gz").write_bytes(gzip.compress(data, 9))
    with pytest.raises(BadFile, match="memory"):
        read_model(tmp_path / "a.usdc.gz", HUGE)


def test_plugins_of_the_environment_are_not_loaded(tmp_path, monkeypatch):
    """A plugInfo.json may name a library that is loaded with USD."""
    write_usd(some_splats(3, 1), tmp_path / "a.usda")
    plugin = tmp_path / "plugin"
    plugin.mkdir()
    (plugin / "plugInfo.json").write_text("broken")
    for name in ("PXR_PLUGINPATH_NAME", "PXR_AR_DEFAULT_SEARCH_PATH"):
        monkeypatch.setenv(name, str(plugin))
    seen = {}
    real = subprocess.Popen

    def start(command, **more):
        seen.update(more["env"])
        return real(command, **more)

    gate.end_all()
    monkeypatch.setattr(gate.subprocess, "Popen", start)
    assert len(read_plain(tmp_path / "a.usda", HUGE).means) == 3
    assert seen
    assert not [name for name in seen if name.startswith("PXR_") and "THREAD" not in name]


def test_without_the_package_it_is_asked_for(tmp_path, monkeypatch):
    write_usd(some_splats(3, 1), tmp_path / "a.usda")
    monkeypatch.setattr(read_usd.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(BadFile, match=r"package usd-core: .*launch\.py extras usd` installs"):
        read_model(tmp_path / "a.usda")
    with pytest.raises(BadFile, match=r"launch\.py extras usd`"):
        writer_of(tmp_path / "b.usdz")


# Third parties


def test_usd_s_own_checker_finds_nothing_wrong_with_ours(tmp_path):
    path = tmp_path / "a.usdz"
    write_usd(some_splats(30, 4), path)
    from pxr import UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    context = UsdValidation.ValidationContext(validators)
    stage = Usd.Stage.Open(str(path))
    assert [error.GetMessage() for error in context.Validate(stage)] == []


def test_what_nvidia_s_converter_writes_is_our_ply(tmp_path):
    """usd-convert-gsplat leaves a PLY's axes as they are, under +Y: it has to be said."""
    if not (program := shutil.which("usd-convert-gsplat")):
        pytest.skip("usd-convert-gsplat is not installed (pip install usd-convert-gsplat[usd])")
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply

    splats = some_splats(40, 16)
    write_ply(splats, tmp_path / "a.ply")
    for ending in ("usda", "usdc", "usdz"):
        out = tmp_path / f"a.{ending}"
        done = subprocess.run(
            [program, "-i", str(tmp_path / "a.ply"), "-o", str(out)], capture_output=True,
            env={k: v for k, v in os.environ.items() if k != "PYTHONPATH"},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        same(read_plain(out, replace(HUGE, up="-Y")), read_plain(tmp_path / "a.ply", HUGE))
