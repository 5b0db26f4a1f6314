"""glTF with KHR_gaussian_splatting: what is read, where nodes put it, what is written."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.colors.spherical_harmonics import C0, shade
from shapeshift.runtime_models.rotation import covariance
from shapeshift.runtime_models.splats.formats import format_of, read_plain
from shapeshift.runtime_models.splats.gltf.read_gltf import (
    OLD_SPZ,
    display_from_linear,
    read_raw_gltf,
)
from shapeshift.runtime_models.splats.gltf.write_gltf import write_gltf
from shapeshift.runtime_models.splats.operations.rotate_splats import HALF_TURN_Y, rotate_splats
from shapeshift.runtime_models.splats.plain_splats import Reading
from tests.support.splats.gltf_files import (
    P,
    as_data_uri,
    asset_of_spz,
    attributes_in,
    glb,
    make_asset,
    plain_splats,
    splat_arrays,
    write_glb,
)

SIZES = (1, 2, 255, 256, 257)


def raw(path):
    return read_raw_gltf(path, Reading())


@pytest.mark.parametrize("degree", range(4))
@pytest.mark.parametrize("count", SIZES)
def test_what_is_written_is_read(tmp_path, count, degree):
    splats = plain_splats(count, degree)
    write_gltf(splats, tmp_path / "a.glb")
    back = read_plain(tmp_path / "a.glb")
    for name in ("means", "scales", "opacity", "sh"):
        np.testing.assert_array_equal(getattr(back, name), getattr(splats, name))
    np.testing.assert_allclose(back.wxyz, splats.wxyz, atol=2e-7)
    assert back.format == "glTF" and not back.findings


def test_attributes_are_read_by_name_and_order(tmp_path):
    """Row by row by hand: xyzw to wxyz, coefficients by degree and order."""
    arrays = splat_arrays(7, 3)
    path = write_glb(tmp_path / "a.glb", *make_asset(dict(reversed(arrays.items()))))
    splats = raw(path)
    for i in range(7):
        x, y, z, w = arrays[P + "ROTATION"][i]
        assert splats.wxyz[i].tolist() == [w, x, y, z]
        assert splats.opacity[i] == arrays[P + "OPACITY"][i, 0]
        place = 0
        for band in range(4):
            for n in range(2 * band + 1):
                wanted = arrays[f"{P}SH_DEGREE_{band}_COEF_{n}"][i]
                assert splats.sh[i, place].tolist() == wanted.tolist()
                place += 1
    assert splats.up == "+Y" and not splats.log_scales and not splats.logits
    for array in (splats.means, splats.scales, splats.wxyz, splats.opacity, splats.sh):
        array += 1  # the reader's own: who judges them may write


@pytest.mark.parametrize("prefix", [P, "_"])
def test_degree_four_is_drawn_as_three_and_its_share_is_told(tmp_path, prefix):
    arrays = splat_arrays(7, 4)
    squares = {
        band: sum(float(np.square(a, dtype=float).sum()) for n, a in arrays.items() if band in n)
        for band in ("DEGREE_1", "DEGREE_2", "DEGREE_3", "DEGREE_4")
    }
    named = {name.replace(P + "SH", prefix + "SH"): array for name, array in arrays.items()}
    got = raw(write_glb(tmp_path / "a.glb", *make_asset(named)))
    assert got.sh.shape == (7, 16, 3)
    (found,) = got.findings
    share = f"{100 * squares['DEGREE_4'] / sum(squares.values()):.2g} %"
    assert "9 coefficients of SH degree 4" in found.what and share in found.done


@pytest.mark.parametrize("kind", ["i1", "<i2"])
def test_normalised_rotations_and_opacities(tmp_path, kind):
    arrays, most = splat_arrays(9), np.iinfo(kind).max
    codes = np.linspace(np.iinfo(kind).min, most, 36).astype(kind).reshape(9, 4)
    arrays[P + "ROTATION"] = codes
    unsigned = kind.replace("i", "u")
    ends = np.array([0, 1, 2, 3, 100, 150, 253, 254, 255]) * (1 if kind == "i1" else 257)
    arrays[P + "OPACITY"] = ends.astype(unsigned)[:, None]
    names = (P + "ROTATION", P + "OPACITY")
    splats = raw(write_glb(tmp_path / "a.glb", *make_asset(arrays, names)))
    wanted = np.maximum(codes.astype(float) / most, -1)[:, [3, 0, 1, 2]]
    np.testing.assert_allclose(splats.wxyz, wanted, rtol=1e-6)
    assert splats.wxyz.min() == -1 and splats.wxyz.max() == 1
    np.testing.assert_allclose(splats.opacity, ends / ends[-1], rtol=1e-6)
    assert splats.opacity[0] == 0 and splats.opacity[-1] == 1


def test_scales_may_be_whole_numbers(tmp_path):
    arrays = splat_arrays(4)
    arrays[P + "SCALE"] = np.arange(12, dtype="u1").reshape(4, 3)
    np.testing.assert_array_equal(
        raw(write_glb(tmp_path / "a.glb", *make_asset(arrays))).scales, arrays[P + "SCALE"]
    )


def test_rows_may_lie_apart(tmp_path):
    """One buffer view with a stride for all attributes, as interleaved exporters have it."""
    arrays = splat_arrays(6, 1)
    table = np.concatenate(list(arrays.values()), axis=1)
    asset, _ = make_asset(arrays)
    asset["bufferViews"] = [
        {"buffer": 0, "byteLength": table.nbytes, "byteStride": 4 * table.shape[1]}
    ]
    place = 0
    for accessor, array in zip(asset["accessors"], arrays.values(), strict=True):
        accessor |= {"bufferView": 0, "byteOffset": place}
        place += 4 * array.shape[1]
    asset["buffers"][0]["byteLength"] = table.nbytes
    together = raw(write_glb(tmp_path / "a.glb", asset, table.tobytes()))
    apart = raw(write_glb(tmp_path / "b.glb", *make_asset(arrays)))
    for name in ("means", "scales", "wxyz", "opacity", "sh"):
        np.testing.assert_array_equal(getattr(together, name), getattr(apart, name))


def test_buffers_beside_and_inside(tmp_path):
    asset, data = make_asset(splat_arrays(5, 1))
    wanted = raw(write_glb(tmp_path / "a.glb", asset, data))
    asset["buffers"][0]["uri"] = "daten%20%C3%A4.bin"
    (tmp_path / "daten ä.bin").write_bytes(data)
    (tmp_path / "b.gltf").write_text(json.dumps(asset))
    asset["buffers"][0]["uri"] = as_data_uri(data)
    (tmp_path / "c.gltf").write_text("\n " + json.dumps(asset))
    for name in ("b.gltf", "c.gltf"):
        assert format_of(tmp_path / name).name == "glTF"
        np.testing.assert_array_equal(raw(tmp_path / name).sh, wanted.sh)
    shutil.copy(tmp_path / "a.glb", tmp_path / "no ending")
    assert format_of(tmp_path / "no ending").name == "glTF"


# Nodes


def ellipsoids(splats) -> np.ndarray:
    return covariance(splats.scales.astype(float), splats.wxyz.astype(float))


def full(cov: np.ndarray) -> np.ndarray:
    """(N, 3, 3) of (N, 6)."""
    return cov[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)


@pytest.mark.parametrize(
    "node",
    [
        {"translation": [1, 2, 3]},
        {"rotation": [0.5, 0.5, -0.5, 0.5]},
        {"rotation": [0, 0.6, 0, 0.8], "scale": [2, 2, 2], "translation": [0, -1, 0]},
        {"rotation": [0.1, 0.7, 0.1, 0.7], "scale": [0.5, 2, 1]},
        {"scale": [-1, 1, 1]},
        {"matrix": [1, 0.5, 0, 0, 0, 1, 0, 0, 0.2, 0, 2, 0, 5, 6, 7, 1]},
    ],
    ids=["shift", "turn", "similar", "stretch", "mirror", "shear"],
)
def test_a_node_moves_places_shapes_and_colours(tmp_path, node):
    """By the extension's own formulas: M mu + t, M Sigma M^T, colours turned with the world."""
    asset, data = make_asset(splat_arrays(20, 3))
    before = raw(write_glb(tmp_path / "a.glb", asset, data))
    asset["nodes"][0] |= node
    after = raw(write_glb(tmp_path / "b.glb", asset, data))
    if "matrix" in node:
        matrix = np.array(node["matrix"], float).reshape(4, 4).T
    else:
        x, y, z, w = np.array(node.get("rotation", [0, 0, 0, 1]), float) / np.linalg.norm(
            node.get("rotation", [0, 0, 0, 1])
        )
        matrix = np.eye(4)
        turn = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        matrix[:3, :3] = np.array(turn) * node.get("scale", [1, 1, 1])
        matrix[:3, 3] = node.get("translation", [0, 0, 0])
    m = matrix[:3, :3]
    np.testing.assert_allclose(after.means, before.means @ m.T + matrix[:3, 3], atol=1e-6)
    wanted = m @ full(ellipsoids(before)) @ m.T
    np.testing.assert_allclose(full(ellipsoids(after)), wanted, atol=2e-6 * np.abs(wanted).max())
    left, _, right = np.linalg.svd(m)
    turn = left @ right
    directions = np.random.default_rng(1).normal(size=(20, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_allclose(
        shade(after.sh, directions @ turn.T), shade(before.sh, directions), atol=1e-5
    )


def test_nodes_hang_on_nodes_and_share_meshes(tmp_path):
    asset, data = make_asset(splat_arrays(3))
    asset["nodes"] = [
        {"children": [1, 2], "translation": [10, 0, 0]},
        {"mesh": 0, "translation": [0, 1, 0]},
        {"mesh": 0, "children": [3]},
        {"mesh": 0, "scale": [2, 2, 2]},
        {"mesh": 0, "translation": [99, 0, 0]},  # of no scene
    ]
    alone = raw(write_glb(tmp_path / "a.glb", *make_asset(splat_arrays(3))))
    splats = raw(write_glb(tmp_path / "b.glb", asset, data))
    m = alone.means
    np.testing.assert_allclose(
        splats.means,
        np.concatenate([np.add(m, (10, 1, 0)), np.add(m, (10, 0, 0)), np.add(m * 2, (10, 0, 0))]),
        atol=1e-6,
    )
    for key in ("scene", "scenes"):
        del asset[key]
    assert len(raw(write_glb(tmp_path / "c.glb", asset, data)).means) == 12  # all roots
    for key in ("nodes",):
        del asset[key]
    assert len(raw(write_glb(tmp_path / "d.glb", asset, data)).means) == 3


def test_primitives_of_other_degrees_and_other_kinds_are_merged(tmp_path):
    high, low = splat_arrays(4, 2), splat_arrays(3, 0, seed=1)
    asset, data = make_asset(high | {"q" + name: array for name, array in low.items()})
    (first,) = asset["meshes"][0]["primitives"]
    names = {name: first["attributes"]["q" + name] for name in low}
    first["attributes"] = {name: i for name, i in first["attributes"].items() if name[0] != "q"}
    triangles = {"attributes": {"POSITION": 0}, "mode": 4}
    asset["meshes"][0]["primitives"] += [triangles, first | {"attributes": names}]
    splats = raw(write_glb(tmp_path / "a.glb", asset, data))
    assert splats.sh.shape == (7, 9, 3) and not splats.sh[4:, 1:].any()
    np.testing.assert_array_equal(splats.means[4:], low["POSITION"])


@pytest.mark.parametrize(
    "draft, name", [(False, f"{P[:-1]}_compression_spz_2"), (True, f"{P[:-1]}_compression_spz_2"),
                    (True, f"{P[:-1]}_compression_spz"), (True, OLD_SPZ)],
)  # fmt: skip
def test_spz_within(tmp_path, draft, name):
    """The extension stores it half a turn about +Y away; drafts, without a colour space, do not."""
    from shapeshift.runtime_models.splats.spz.write_spz import write_spz

    splats = plain_splats(30, 2)
    write_spz(splats, tmp_path / "a.spz", version=2)
    alone = read_plain(tmp_path / "a.spz")
    asset, data = asset_of_spz((tmp_path / "a.spz").read_bytes(), 30, name)
    extension = asset["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]
    if draft:
        del extension["colorSpace"]
    if name == OLD_SPZ:
        asset["meshes"][0]["primitives"][0]["extensions"] = extension["extensions"]
    asset["nodes"][0]["translation"] = [0, 5, 0]
    within = read_plain(write_glb(tmp_path / "a.glb", asset, data))
    turned = (
        rotate_splats(alone, HALF_TURN_Y) if draft else alone
    )  # drafts are taken as they are stored
    np.testing.assert_allclose(within.means, np.add(turned.means, (0, 5, 0)), atol=1e-6)
    np.testing.assert_allclose(within.scales, turned.scales, rtol=1e-6)
    np.testing.assert_allclose(within.opacity, turned.opacity)
    np.testing.assert_allclose(within.sh, turned.sh, atol=1e-6)
    likeness = np.abs((within.wxyz * turned.wxyz).sum(1))
    np.testing.assert_allclose(likeness, 1, atol=1e-6)
    assert within.format == "glTF with spz v2"
    assert within.axes.startswith("of the spz within: right, down, forward; its extension says so")
    assert ("as drafts store it" in within.axes) is draft


# Colour spaces, other kernels


def test_linear_colours_become_display_colours(tmp_path):
    asset, data = make_asset(splat_arrays(6, 1))
    extension = asset["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]
    before = raw(write_glb(tmp_path / "a.glb", asset, data))
    extension["colorSpace"] = "lin_rec709_display"
    after = raw(write_glb(tmp_path / "b.glb", asset, data))
    for i in range(6):
        for c in range(3):
            linear = max(0.5 + C0 * before.sh[i, 0, c], 0)
            shown = 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055
            assert 0.5 + C0 * after.sh[i, 0, c] == pytest.approx(shown, abs=1e-6)
    (finding,) = after.findings
    assert "linear" in finding.what and finding.count == 6
    little = before.sh * [[[1], [0.01], [0.01], [0.01]]]  # then the slope is all there is
    up = np.tile([[0, 1.0, 0]], (6, 1))
    linear = shade(little, up)
    wanted = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(shade(display_from_linear(little), up), wanted, atol=1e-4)


@pytest.mark.parametrize(
    ("name", "value"), [("kernel", "customShape"), ("colorSpace", "lin_p3"), ("projection", "fish")]
)
def test_what_is_not_known_is_drawn_as_usual_and_told(tmp_path, name, value):
    asset, data = make_asset(splat_arrays(2))
    asset["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"][name] = value
    (finding,) = raw(write_glb(tmp_path / "a.glb", asset, data)).findings
    assert value in finding.what and finding.done.startswith("drawn as")


@pytest.mark.parametrize("prefix", ["_", P])
def test_drafts_have_colour_and_opacity_in_color_0(tmp_path, prefix):
    arrays = splat_arrays(9, 1)
    now = raw(write_glb(tmp_path / "a.glb", *make_asset(arrays)))
    color = 0.5 + C0 * arrays.pop(P + "SH_DEGREE_0_COEF_0")
    color = np.concatenate([color, arrays.pop(P + "OPACITY")], axis=1).astype("<f4")
    names = {name: name.replace(P, prefix) for name in arrays}
    draft = {names[name]: array for name, array in arrays.items()} | {"COLOR_0": color}
    then = raw(write_glb(tmp_path / "b.glb", *make_asset(draft)))
    for name in ("means", "scales", "wxyz", "opacity", "sh"):
        np.testing.assert_allclose(getattr(then, name), getattr(now, name), atol=1e-6)
    assert then.format == "glTF (draft)" and now.format == "glTF"


# Third parties


def test_a_third_party_finds_our_numbers(tmp_path):
    pygltflib = pytest.importorskip("pygltflib")
    splats = replace(plain_splats(37), origin=(4e6, -1.5, 2.25e6))
    write_gltf(splats, tmp_path / "a.glb")
    found = pygltflib.GLTF2().load(tmp_path / "a.glb")
    assert found.nodes[0].translation == [-4e6, -1.5, -2.25e6]
    arrays, turned = attributes_in(tmp_path / "a.glb"), rotate_splats(splats, HALF_TURN_Y)
    assert len(arrays) == 5 + 16
    np.testing.assert_array_equal(arrays["POSITION"], splats.means * [-1, 1, -1])
    np.testing.assert_array_equal(arrays[P + "ROTATION"], -turned.wxyz[:, [1, 2, 3, 0]])
    np.testing.assert_array_equal(arrays[P + "SCALE"], splats.scales)
    np.testing.assert_array_equal(arrays[P + "OPACITY"][:, 0], splats.opacity)
    np.testing.assert_array_equal(arrays[P + "SH_DEGREE_3_COEF_6"], turned.sh[:, 15])
    display = np.clip(0.5 + C0 * splats.sh[:, 0], 0, 1)
    linear = np.where(display > 0.04045, ((display + 0.055) / 1.055) ** 2.4, display / 12.92)
    assert np.abs(arrays["COLOR_0"][:, :3] / 255 - linear).max() < 0.0021
    places = raw(tmp_path / "a.glb").means  # float64: a far place keeps its micrometres
    np.testing.assert_allclose(
        places - turned.origin, turned.means, rtol=0, atol=1e-6
    )  # as they are filed


def test_a_glb_has_gltfs_axes_and_one_of_ours_before_0_5_had_ours(tmp_path):
    """glTF: +Y up, +Z forward, -X right (its 3.4); ours: +Y up, -Z forward, +X right."""
    splats = replace(plain_splats(3), means=np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9]], np.float32))
    write_gltf(splats, tmp_path / "a.glb")
    asset, data = gltf_of(tmp_path / "a.glb")
    np.testing.assert_array_equal(
        np.frombuffer(data, "<f4", 3), [-1, 2, -3]
    )  # POSITION is the first attribute
    np.testing.assert_allclose(read_plain(tmp_path / "a.glb").means, splats.means)
    asset["asset"]["generator"] = "Shapeshift"
    old = read_plain(write_glb(tmp_path / "old.glb", asset, data))
    np.testing.assert_allclose(
        old.means, rotate_splats(splats, HALF_TURN_Y).means
    )  # its numbers as they are


def gltf_of(path: Path) -> tuple[dict, bytes]:
    data = path.read_bytes()
    size = int.from_bytes(data[12:16], "little")
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def test_what_a_third_party_writes_is_read():
    """The file is splat-transform 2.7.1's, of our PLY: the same scene, facing the same way."""
    back = read_plain(Path(__file__).parents[2] / "fixtures" / "splat_transform.glb")
    ours = plain_splats(12, 1)
    np.testing.assert_allclose(back.means, ours.means, atol=1e-6)
    np.testing.assert_allclose(back.scales, ours.scales, rtol=1e-5)
    np.testing.assert_allclose(back.opacity, ours.opacity, atol=1e-6)
    np.testing.assert_allclose(back.sh, ours.sh, atol=1e-6)
    np.testing.assert_allclose(np.abs((back.wxyz * ours.wxyz).sum(1)), 1, atol=1e-6)


def test_whole_or_not_at_all(tmp_path):
    write_gltf(plain_splats(3), tmp_path / "a.glb")
    before = (tmp_path / "a.glb").read_bytes()
    with pytest.raises(AttributeError):
        write_gltf(None, tmp_path / "a.glb")
    assert (tmp_path / "a.glb").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["a.glb"]
    assert glb(b"{}")[:4] == before[:4] and len(before) % 4 == 0
