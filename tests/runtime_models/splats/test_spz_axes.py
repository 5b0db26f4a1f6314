"""Which axes an .spz is in: by its extension, by what else tells, by its version, and what is said.

Files are made as the writers of either camp store them (tests/support/splats/spz_files.py).
"""

import gzip
import json
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.read_scene import describe, read_model
from shapeshift.runtime_models.rotation import covariance
from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, Reading
from shapeshift.runtime_models.splats.spz.spz_axes import NAMED_AXES
from shapeshift.runtime_models.splats.spz.write_spz import write_spz
from tests.support.splats.gltf_files import asset_of_spz, write_glb
from tests.support.splats.ply_files import some_splats
from tests.support.splats.spz_files import spz_of

TURNED = {"RDF": "-Y", "RUB": "+Y"}


def blob(count: int = 300, seed: int = 0) -> PlainSplats:
    """Splats about the origin, nearer to the right, the top and the back: nothing says its up."""
    made = some_splats(count, 4, seed, sizes=(0.02, 0.2), color=0.2)
    return replace(made, means=(made.means * 0.5 + [0.3, 0.2, 0.1]).astype(np.float32))


def ground(height: float = 0.0, up: float = 1.0) -> PlainSplats:
    """A round floor at a height, a pole that stands on it; up -1: hangs from it."""
    rng, count = np.random.default_rng(1), 2000
    angle, radius = rng.uniform(0, 2 * np.pi, count), np.sqrt(rng.uniform(0, 1, count))
    means = np.column_stack(
        [radius * np.cos(angle), np.full(count, height), radius * np.sin(angle)]
    )
    pole = rng.random(count) < 0.25
    means[pole] = [0.05, 0, 0.05] * means[pole]
    means[pole, 1] = height + up * rng.uniform(0, 1.2, pole.sum())
    made = some_splats(count, 1, 1, sizes=(0.02, 0.021))
    return replace(made, means=means.astype(np.float32))


def check_same(got: PlainSplats, want: PlainSplats) -> None:
    """Places, ellipsoids and colours, up to the codes of the format."""
    assert np.abs(got.means + np.array(got.origin) - want.means).max() <= 2.0**-13 * 1.01
    size = want.scales.max() ** 2  # scales are rounded by up to 3 %, rotations by 4 mrad
    shapes = [covariance(each.scales, each.wxyz) for each in (got, want)]
    assert np.abs(shapes[0] - shapes[1]).max() <= 0.08 * size
    assert np.abs(got.sh[:, 1:] - want.sh[:, 1:]).max() <= 1.01 / 128


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("axes", NAMED_AXES)
def test_the_extension_names_any_axes_and_all_are_the_same_scene(tmp_path, version, axes):
    """Half of the sixteen are mirrored: their places, rotations and harmonics are mirrored back."""
    want, path = blob(), tmp_path / "a.spz"
    path.write_bytes(spz_of(want, axes, version, NAMED_AXES.index(axes) + 1))
    got = read_plain(path)
    check_same(got, want)
    assert got.findings == () and got.axes.endswith("; its extension says so")


@pytest.mark.parametrize("version, axes, word", [(3, "RUB", "text"), (4, "RDF", "most writers")])
def test_without_any_evidence_the_version_decides_and_it_is_called_a_guess(
    tmp_path, version, axes, word
):
    want, path = blob(), tmp_path / "a.spz"
    for named in (None, 0, 17, 99):  # numbers that name nothing
        path.write_bytes(spz_of(want, axes, version, named))
        got = read_plain(path)
        check_same(got, want)
        (found,) = got.findings
        other = {"RUB": "-Y", "RDF": "+Y"}[axes]
        assert "a guess" in found.done and word in found.done and not found.repaired
        assert found.done.endswith(f"--up={other} turns it over")
    assert "a guess" in describe(read_model(path), path)["axes"]
    asked = read_plain(path, Reading(up=other, strict=True))
    assert asked.findings == (), "who says what is up needs no advice"
    np.testing.assert_allclose(asked.means, got.means * (1, -1, -1), atol=1e-6)


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("axes", ["RDF", "RUB"])
@pytest.mark.parametrize("height", [-0.7, 0.0, 3.0])
def test_a_floor_decides_whatever_the_version(tmp_path, version, axes, height):
    want, path = ground(height), tmp_path / "a.spz"
    path.write_bytes(spz_of(want, axes, version))
    got = read_plain(path)
    assert np.abs(got.means + np.array(got.origin) - want.means).max() < 1e-3
    assert "as its floor lies" in got.findings[0].done and "guess" not in got.findings[0].done


@pytest.mark.parametrize("axes", ["RDF", "RUB"])
def test_a_model_that_was_stood_on_zero_stands(tmp_path, axes):
    """No floor, but all of it above y = 0, as models are made; floor against zero: neither."""
    want = blob(2000)
    y = np.random.default_rng(2).uniform(0, 1.8, 2000)
    want.means[:, 1] = y
    (tmp_path / "a.spz").write_bytes(spz_of(want, axes, 4))
    got = read_plain(tmp_path / "a.spz")
    assert np.abs(got.means - want.means).max() < 1e-3
    assert "stands on y = 0" in got.findings[0].done
    hung = ground(1.15, up=-1)  # a floor whose other end is at zero
    (tmp_path / "b.spz").write_bytes(spz_of(hung, axes, 4))
    assert "a guess" in read_plain(tmp_path / "b.spz").findings[0].done


def test_a_room_with_a_ceiling_like_its_floor_is_a_guess(tmp_path):
    low, high = ground(0.5), ground(2.5, up=-1)
    arrays = {
        name: np.concatenate([getattr(low, name), getattr(high, name)])
        for name in ("means", "scales", "wxyz", "opacity", "sh")
    }
    (tmp_path / "a.spz").write_bytes(spz_of(replace(low, **arrays), "RUB", 3))
    assert "a guess" in read_plain(tmp_path / "a.spz").findings[0].done


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("axes", ["RDF", "RUB"])
@pytest.mark.parametrize("form", ["cameras.json", "transforms.json"])
def test_cameras_beside_it_decide(tmp_path, version, axes, form):
    """They stand in the world of the PLY: three metres away, looking at the blob's side of it."""
    want = blob(600)
    want.means[:] = want.means * 0.2 + np.array([0, 2, 1], np.float32)
    in_ply = want.means * (1, -1, -1)
    eyes = in_ply.mean(axis=0) + np.array([[3, 0, 0], [0, 0, 3], [-3, 0.5, 0], [0, -0.5, -3]])
    rows = []
    for eye in eyes:
        ahead = (in_ply.mean(axis=0) - eye) / np.linalg.norm(in_ply.mean(axis=0) - eye)
        right = np.cross([0, -1.0, 0], ahead)
        right /= np.linalg.norm(right)
        frame = np.column_stack([right, np.cross(ahead, right), ahead])  # x right, y down, z ahead
        rows.append((eye, frame))
    if form == "cameras.json":
        data = [{"position": eye.tolist(), "rotation": frame.tolist()} for eye, frame in rows]
    else:
        data = {"frames": []}
        for eye, frame in rows:
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = frame * (1, -1, -1), eye
            data["frames"].append({"transform_matrix": pose.tolist()})
    (tmp_path / form).write_text(json.dumps(data))
    (tmp_path / "a.spz").write_bytes(spz_of(want, axes, version))
    got = read_plain(tmp_path / "a.spz")
    check_same(got, want)
    assert f"as the cameras of {form} see it" in got.findings[0].done


@pytest.mark.parametrize(
    "text", ["", "[", "[]", "[1]", "{}", '{"frames": 3}', '[{"position": [1, 2], "rotation": 1}]',
             '[{"position": [1e999, 0, 0], "rotation": [[0,0,0],[0,0,0],[0,0,0]]}]', "[" * 100_000],
)  # fmt: skip
def test_broken_cameras_beside_it_do_not_matter(tmp_path, text):
    (tmp_path / "cameras.json").write_text(text)
    (tmp_path / "a.spz").write_bytes(spz_of(blob(), "RDF", 4))
    assert "a guess" in read_plain(tmp_path / "a.spz").findings[0].done


def test_the_biker_stands(data):
    """A real file of version 4 in the text's axes, without any word: it was stood on y = 0."""
    got = read_plain(data / "splats_playcanvas" / "biker.spz")
    assert "stands on y = 0" in got.findings[0].done
    low, high = np.percentile(got.means[:, 1], (1, 99))
    assert 0 <= low < 0.1 and high > 3


@pytest.mark.parametrize("version", [2, 3, 4])
@pytest.mark.parametrize("axes", ["ply", "rub"])
def test_what_we_write_says_its_axes(tmp_path, version, axes):
    want = blob()
    write_spz(want, tmp_path / "a.spz", version, axes)
    got = read_plain(tmp_path / "a.spz")
    assert got.findings == () and got.axes.endswith("its extension says so")
    assert got.axes.startswith({"ply": "right, down", "rub": "right, up"}[axes])
    assert np.abs(got.means - want.means).max() < 1e-4


@pytest.mark.parametrize("version", [2, 3, 4])
@pytest.mark.parametrize("packed", ["a.spz.gz", "a.zip"])
def test_a_packed_file_is_read_as_the_plain_one_with_what_lies_beside(tmp_path, version, packed):
    """Version 4 in gzip, too; cameras count that lie beside what it is packed in."""
    data, path = spz_of(blob(), "RDF", version, 0), tmp_path / packed
    if packed.endswith(".gz"):
        path.write_bytes(gzip.compress(data))
    else:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("in/a.spz", data)
    assert "a guess" in describe(read_model(path), path)["axes"]
    rows = [{"position": [0, 0, -4], "rotation": np.eye(3).tolist()}]
    for flipped in (False, True):
        if flipped:
            rows = [{"position": [0, 0, 4], "rotation": np.diag([1, -1, -1]).tolist()}]
        (tmp_path / "cameras.json").write_text(json.dumps(rows))
        plain = tmp_path / "plain.spz"
        plain.write_bytes(data)
        said = describe(read_model(plain), plain)["axes"]
        assert describe(read_model(path), path)["axes"] == said


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("axes, named", [("RUB", False), ("RUB", True), ("RDF", True)])
def test_within_a_gltf_it_is_the_same_scene_and_info_says_its_axes(tmp_path, axes, named, version):
    want, path = ground(0.5), tmp_path / "a.glb"
    data = spz_of(want, axes, version, NAMED_AXES.index(axes) + 1 if named else None)
    write_glb(path, *asset_of_spz(data, len(want.means)))
    got = read_plain(path)
    assert np.abs(got.means + np.array(got.origin) - want.means).max() < 1e-3
    reason = "its extension says so" if named else "as what it lies in says"
    said = describe(read_model(path), path)["axes"]
    assert said.startswith("of the spz within: right, ") and said.endswith(reason)
    assert got.findings == ()


@pytest.mark.parametrize("version", [3, 4])
def test_within_a_gltf_one_that_stands_on_its_head_is_said(tmp_path, version):
    """glTF says +Y is up; who packs a PLY's axes as they are says another thing."""
    want, path = ground(0.5), tmp_path / "a.glb"
    write_glb(path, *asset_of_spz(spz_of(want, "RDF", version), len(want.means)))
    (found,) = read_plain(path).findings
    assert found.what == "upside down, as its floor lies" and "--up=-Y" in found.done
    for asked in (Reading(up="-Y"), Reading(flip=True)):
        got = read_plain(path, asked)
        assert got.findings == ()
        assert (got.means + got.origin)[:, 1].min() == pytest.approx(0.5, abs=1e-3)
