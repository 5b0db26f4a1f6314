"""Plain splat files: exact round trips, our axes, real captures, and a sentence for broken ones."""

from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.colors.spherical_harmonics import shade
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import describe, read_model
from shapeshift.runtime_models.rotation import covariance
from shapeshift.runtime_models.splats.formats import read_plain as read_ply
from shapeshift.runtime_models.splats.layers.read_layers import read_layers
from shapeshift.runtime_models.splats.operations.rotate_splats import rotate_half_turn
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.runtime_models.splats.read_splat import ROW
from tests.support.splats.ply_files import some_splats

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"


@pytest.mark.parametrize("coefficients", [1, 4, 9, 16])
@pytest.mark.parametrize("count", [1, 20])
def test_ply_round_trip(tmp_path, count, coefficients):
    splats = some_splats(count, coefficients)
    write_ply(splats, tmp_path / "a.ply")
    back = read_ply(tmp_path / "a.ply")
    np.testing.assert_array_equal(back.means, splats.means)
    np.testing.assert_array_equal(back.sh, splats.sh)
    np.testing.assert_allclose(back.scales, splats.scales, rtol=1e-6)
    np.testing.assert_allclose(back.opacity, splats.opacity, rtol=1e-5)
    assert (np.abs((back.wxyz * splats.wxyz).sum(1)) > 1 - 1e-6).all()


def test_turning_turns_places_shapes_and_colours_together():
    splats, turn = some_splats(), np.diag([1.0, -1, -1])
    turned = rotate_half_turn(splats)
    np.testing.assert_allclose(turned.means, splats.means @ turn.T, atol=1e-6)
    c, t = covariance(splats.scales, splats.wxyz), covariance(turned.scales, turned.wxyz)
    np.testing.assert_allclose(t, c * [1, -1, -1, 1, 1, 1], atol=1e-5)  # xy, xz change sign
    d = np.random.default_rng(3).normal(size=(20, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    np.testing.assert_allclose(shade(turned.sh, d @ turn.T), shade(splats.sh, d), atol=1e-5)


def test_unknown_columns_are_ignored_and_broken_rows_dropped(tmp_path):
    splats = some_splats(4, 1)
    splats.means[1, 0] = np.nan
    splats.sh[2, 0, 1] = np.inf
    write_ply(splats, tmp_path / "a.ply")
    data = (tmp_path / "a.ply").read_bytes()
    assert b"property float nx" in data  # not one that the reader needs
    back = read_ply(tmp_path / "a.ply")
    assert (len(back.means), back.dropped) == (2, 2)
    np.testing.assert_array_equal(back.means, splats.means[[0, 3]])
    assert read_layers([tmp_path / "a.ply"]).provenance["dropped_rows"] == 2


def test_infinite_logit_is_opaque_and_infinitely_small_scale_stays(tmp_path):
    write_ply(some_splats(3, 1), tmp_path / "a.ply")
    data = bytearray((tmp_path / "a.ply").read_bytes())
    start = data.index(b"end_header\n") + 11
    table = np.frombuffer(data, "<f4", offset=start).reshape(3, -1).copy()
    table[0, 9], table[1, 10] = np.inf, -np.inf  # opacity, scale_0
    (tmp_path / "a.ply").write_bytes(bytes(data[:start]) + table.tobytes())
    back = read_ply(tmp_path / "a.ply")
    assert back.dropped == 0 and back.opacity[0] == 1 and back.scales[1, 0] == 0


def test_header_lines_may_end_as_windows_ends_them_and_hold_comments(tmp_path):
    write_ply(some_splats(5, 4), tmp_path / "a.ply")
    want = read_ply(tmp_path / "a.ply")
    head, body = (tmp_path / "a.ply").read_bytes().split(b"end_header\n", 1)
    head = head.replace(b"element", b"comment element property\nelement").replace(b"\n", b"\r\n")
    (tmp_path / "a.ply").write_bytes(head + b"end_header\r\n" + body)
    np.testing.assert_array_equal(read_ply(tmp_path / "a.ply").sh, want.sh)


def test_columns_of_several_types_in_another_order(tmp_path):
    """Written by hand, row by row: the slow twin of the reader."""
    splats, rng = some_splats(6, 4), np.random.default_rng(5)
    back = rotate_half_turn(splats)  # twice half a turn is none
    names = [*"xyz", "red", "opacity", "f_dc_2", "f_dc_1", "f_dc_0"]
    names += [f"f_rest_{i}" for i in range(9)] + [f"rot_{i}" for i in range(4)]
    names += [f"scale_{i}" for i in range(3)]
    names = [names[i] for i in rng.permutation(len(names))]
    kinds = {"red": "uchar", "x": "double", "opacity": "double", "f_rest_4": "double"}
    row = np.dtype([(n, {"uchar": "u1", "double": "<f8"}.get(kinds.get(n), "<f4")) for n in names])
    table = np.zeros(6, row)
    for i in range(6):
        for a in range(3):
            table["xyz"[a]][i] = back.means[i, a]
            table[f"scale_{a}"][i] = np.log(back.scales[i, a])
            table[f"f_dc_{a}"][i] = back.sh[i, 0, a]
            for j in range(3):
                table[f"f_rest_{3 * a + j}"][i] = back.sh[i, 1 + j, a]
        for a in range(4):
            table[f"rot_{a}"][i] = 2.5 * back.wxyz[i, a]  # of any length
        table["opacity"][i] = np.log(back.opacity[i] / (1 - back.opacity[i]))
    head = ["ply", "format binary_little_endian 1.0", "element vertex 6"]
    head += [f"property {kinds.get(n, 'float')} {n}" for n in names] + ["end_header", ""]
    (tmp_path / "a.ply").write_bytes("\n".join(head).encode() + table.tobytes() + b"tail")
    read = read_ply(tmp_path / "a.ply")
    np.testing.assert_array_equal(read.sh, splats.sh)
    np.testing.assert_array_equal(read.means, splats.means)
    np.testing.assert_allclose(read.scales, splats.scales, rtol=1e-5)
    np.testing.assert_allclose(read.opacity, splats.opacity, rtol=1e-5)
    assert (np.abs((read.wxyz * splats.wxyz).sum(1)) > 1 - 1e-6).all()


def change_header(old, new):
    return lambda data: data.replace(old, new, 1)


BROKEN = {
    "cut off": (lambda d: d[:-1], "promises 20 splats of 68 bytes, the file holds 19"),
    "lying count": (change_header(b"vertex 20", b"vertex 99999999"), "promises 99999999"),
    "no end": (lambda d: d[:40], "header is missing or never ends"),
    "unknown": (change_header(b"binary_little_endian", b"binary_middle"), "none of PLY's formats"),
    "ascii": (change_header(b"binary_little_endian", b"ascii"), "an ASCII PLY and has words"),
    "point cloud": (change_header(b"opacity", b"opacitx"), "has no opacity: a point cloud"),
    "odd f_rest": (change_header(b" nx", b" f_rest_0"), "has 1 f_rest columns"),
    "twice": (change_header(b"float ny", b"float nx"), "names a property twice"),
    "lists": (change_header(b"float nx", b"list uchar"), "a property of a type"),
    "no splats": (change_header(b"vertex 20", b"vertex 0"), "holds no splats"),
    "no number": (change_header(b"vertex 20", b"vertex -2"), "does not say how many"),
    "no elements": (change_header(b"element", b"comment"), "a property before any element"),
    "long number": (
        change_header(b"vertex 20", b"vertex " + b"9" * 5000),
        "does not say how many",
    ),
    "no properties": (lambda d: d[: d.index(b"property")] + b"end_header\n", "has no x:"),
    "another element": (change_header(b"vertex 20", b"points 20"), "has the elements .'points'"),
    "lists before": (
        change_header(b"element", b"element face 2\nproperty list uchar int i\nelement"),
        "elements .'face', 'vertex'.*before any with lists",
    ),
}


@pytest.mark.parametrize("how", BROKEN)
def test_broken_ply_is_one_sentence(tmp_path, how):
    write_ply(some_splats(20, 1), tmp_path / "a.ply")
    damage, words = BROKEN[how]
    (tmp_path / "a.ply").write_bytes(damage((tmp_path / "a.ply").read_bytes()))
    with pytest.raises(BadFile, match=words) as failure:
        read_model(tmp_path / "a.ply")
    assert "\n" not in str(failure.value)


def test_harmonics_with_a_gap_are_refused(tmp_path):
    write_ply(some_splats(5, 4), tmp_path / "a.ply")
    data = (tmp_path / "a.ply").read_bytes()
    (tmp_path / "a.ply").write_bytes(data.replace(b"f_rest_3\n", b"f_rest_9\n"))
    with pytest.raises(BadFile, match="its 9 f_rest columns are not numbered from 0 on"):
        read_ply(tmp_path / "a.ply")


def test_splat_rows_by_hand(tmp_path):
    row = np.zeros(2, ROW)
    row["mean"], row["scale"] = [1, 2, 3], [0.1, 0.2, 0.3]
    row["rgba"], row["wxyz"] = [255, 0, 128, 51], [255, 128, 128, 128]
    row.tofile(tmp_path / "a.splat")
    splats = read_ply(tmp_path / "a.splat")
    np.testing.assert_allclose(splats.means[0], [1, -2, -3])
    np.testing.assert_allclose(splats.opacity, 0.2)
    color = shade(splats.sh, np.eye(3, dtype=np.float32)[:2])
    np.testing.assert_allclose(color[0], [1, 0, 128 / 255], atol=1e-6)
    np.testing.assert_allclose(splats.wxyz[0], [0, 1, 0, 0], atol=1e-6)  # the half turn alone


@pytest.mark.parametrize("size", [1, 31, 33])
def test_splat_of_a_wrong_size_is_one_sentence(tmp_path, size):
    (tmp_path / "a.splat").write_bytes(b"\1" * size)
    with pytest.raises(BadFile, match=f"has {size} bytes, expected a multiple of 32"):
        read_model(tmp_path / "a.splat")


WRONG = {
    "a.txt": "no known format; wanted is a package",
    "a.ply": "does not begin with 'ply', as a .ply does",
    "a.shift": "does not begin with a zip's mark, as a .shift does",
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_no_scene_is_one_sentence(tmp_path, name):
    (tmp_path / name).write_text("hello")
    with pytest.raises(BadFile, match=WRONG[name]):
        read_model(tmp_path / name)


def test_an_empty_file_says_so(tmp_path):
    (tmp_path / "a.splat").touch()
    with pytest.raises(BadFile, match="is empty: it has 0 bytes"):
        read_model(tmp_path / "a.splat")


def test_empty_folder_is_one_sentence(tmp_path):
    with pytest.raises(BadFile, match="holds nothing to show"):
        read_model(tmp_path)


def test_layers_of_a_folder_are_counted_as_people_count(tmp_path):
    for name in ("layer10.ply", "layer2.ply", "layer1.ply", "other.ply"):
        write_ply(some_splats(2, 1), tmp_path / name)
    (tmp_path / "notes.txt").write_text("not a part of the scene")
    model = read_model(tmp_path)
    assert [s.name for s in model.stops] == ["layer1", "layer2", "layer10"]
    assert [s.x for s in model.stops] == [0, 0.5, 1] and {s.kind for s in model.stops} == {"layer"}
    sizes = [p.stat().st_size for p in tmp_path.glob("layer*.ply")]
    assert describe(model, tmp_path)["bytes"] == sum(sizes)
    (tmp_path / "layer2.ply").write_bytes(b"ply")
    with pytest.raises(BadFile, match=r"layer2\.ply is no PLY file"):
        read_model(tmp_path)


def test_files_of_several_degrees_and_kinds_make_one_scene(tmp_path):
    write_ply(some_splats(3, 16, seed=1), tmp_path / "a.ply")
    write_ply(some_splats(4, 4, seed=2), tmp_path / "b.ply")
    np.zeros(5, ROW).tofile(tmp_path / "c.splat")
    files = [tmp_path / name for name in ("a.ply", "b.ply", "c.splat")]
    both = {mode: read_layers(files, Reading(mode)) for mode in ("cumulative", "exclusive")}
    layers = both["cumulative"]
    assert layers.sh.shape == (12, 16, 3) and layers.layer.tolist() == [0] * 3 + [1] * 4 + [2] * 5
    assert (layers.sh[3:7, 4:] == 0).all() and (layers.sh[7:, 1:] == 0).all()
    np.testing.assert_array_equal(layers.sh[3:7, :4], read_ply(files[1]).sh)
    assert describe(layers, files[0])["format"] == "ply + splat"
    for mode, shown in (("cumulative", [1, 1, 0]), ("exclusive", [0, 1, 0])):
        want = np.repeat(shown, [3, 4, 5]) * layers.opacity
        np.testing.assert_allclose(Evaluator(both[mode]).geometry(0.5)[3], want, atol=1e-7)


def test_a_mode_of_no_meaning_and_no_files_are_one_sentence(tmp_path):
    with pytest.raises(BadFile, match="layer mode is 'sideways', expected one of"):
        read_layers([tmp_path / "a.ply"], Reading("sideways"))
    with pytest.raises(BadFile, match="no files were given"):
        read_layers([])


def test_writing_a_ply_leaves_nothing_beside_it(tmp_path):
    for count in (3, 5):
        write_ply(some_splats(count, 1), tmp_path / "a.ply")
    assert [p.name for p in tmp_path.iterdir()] == ["a.ply"]
    assert len(read_ply(tmp_path / "a.ply").means) == 5
    assert (tmp_path / "a.ply").stat().st_mode & 0o777 == 0o644


@pytest.mark.skipif(not DATA.exists(), reason="no shared data beside the project")
def test_the_leg_is_three_layers_with_a_stop_each():
    path = DATA / "anatomy_leg_ml3dgs"
    leg = read_model(path)
    facts = describe(leg, path)
    assert (facts["format"], facts["splats"], facts["sh_degree"]) == ("ply", 136605, 3)
    assert [s["x"] for s in facts["stops"]] == [0, 0.5, 1]
    np.testing.assert_array_equal(np.bincount(leg.layer), [57454, 64690, 14461])
    alive = [(Evaluator(leg).geometry(x)[3] > 0).sum() for x in (0.0, 0.5, 1.0)]
    np.testing.assert_array_equal(alive, np.cumsum([57454, 64690, 14461]))


@pytest.mark.skipif(not DATA.exists(), reason="no shared data beside the project")
def test_the_plant_stands_upright():
    """Leaves above, the light pot below: the top half is greener."""
    plant = read_model(DATA / "splats_marcelpadilla/plant/plant.splat")
    color = Evaluator(plant).color(0.0, np.zeros(3))
    green = color[:, 1] - color[:, [0, 2]].mean(1)
    top = plant.means[:, 1] > np.median(plant.means[:, 1])
    assert green[top].mean() > green[~top].mean() + 0.05
