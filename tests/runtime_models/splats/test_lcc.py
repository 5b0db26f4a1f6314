"""XGrids' LCC and LCC2: every number by hand, and as splat-transform reads them."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import describe, read_model
from shapeshift.runtime_models.rotation import covariance
from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.lcc.read_lcc import INDEX, find_meta, read_level, read_meta
from shapeshift.runtime_models.splats.lcc.read_lcc2 import read_meta as read_meta2
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.spz.write_spz import write_spz
from tests.support.hostile.fuzz_seeds import some_splats
from tests.support.splats.lcc_files import RANGES, put, random_rows, write_lcc, write_lcc2
from tests.support.splats.sog_scenes import random_sog, write_zip

HUGE = Reading(allow_huge=True)


def by_hand(splat: bytes, rest: bytes, prefix: str = "") -> dict:
    """One splat, in the file's axes, byte by byte."""
    low, high = RANGES[f"{prefix}scale"]
    shares = [int.from_bytes(splat[16 + 2 * i : 18 + 2 * i], "little") / 65535 for i in range(3)]
    packed = int.from_bytes(splat[22:26], "little")
    largest = packed >> 30
    small = [((packed >> shift & 1023) / 1023 - 0.5) * 2**0.5 for shift in (0, 10, 20)]
    xyzw = [*small[:largest], max(0, 1 - sum(n * n for n in small)) ** 0.5, *small[largest:]]
    sh = np.zeros((16, 3))
    sh[0] = [(c / 255 - 0.5) / C0 for c in splat[12:15]]
    ends = RANGES[f"{prefix}shcoef"]
    for j in range(15):
        word = int.from_bytes(rest[4 * j : 4 * j + 4], "little")
        codes = ((word & 2047) / 2047, (word >> 11 & 1023) / 1023, (word >> 21) / 2047)
        sh[1 + j] = [(1 - s) * ends[0][c] + s * ends[1][c] for c, s in enumerate(codes)]
    return {
        "means": np.frombuffer(splat[:12], "<f4"), "opacity": splat[15] / 255,
        "scales": [(1 - s) * a + s * b for s, a, b in zip(shares, low, high, strict=True)],
        "wxyz": [xyzw[3], *xyzw[:3]], "sh": sh,
    }  # fmt: skip


@pytest.mark.parametrize("level", [0, 1])
def test_every_splat_is_what_it_is_by_hand(tmp_path, level):
    cells = ((5, 2), (0, 0), (7, 3))
    file = write_lcc(tmp_path, cells)
    reading = Reading().within(tmp_path)
    raw = read_level(read_meta(file, reading.memory), level, reading)
    rows = [random_rows(cell[level], 10 * i + level) for i, cell in enumerate(cells)]
    splats = b"".join(row[0] for row in rows)
    rest = b"".join(row[1] for row in rows)
    assert len(raw.means) == sum(cell[level] for cell in cells) and raw.up == "+Z"
    for i in range(len(raw.means)):
        wanted = by_hand(splats[32 * i : 32 * i + 32], rest[64 * i : 64 * i + 64])
        for name, value in wanted.items():
            np.testing.assert_allclose(getattr(raw, name)[i], value, atol=2e-6, err_msg=name)


def test_a_scene_has_its_finest_level_and_what_lies_around_it(tmp_path):
    file = write_lcc(tmp_path / "town")
    whole = read_model(tmp_path / "town", HUGE)
    assert whole.splat_count == 12 + 3 and whole.stops[0].name == "town"
    assert not whole.findings and whole.provenance["level"] == 0
    facts = describe(whole, file)
    assert facts["levels"] == {0: 12, 1: 5} and facts["format"] == "LCC" and facts["bytes"] > 1000
    coarse = read_model(file, replace(HUGE, most_splats=9))
    assert coarse.splat_count == 5 + 3 and coarse.provenance["level"] == 1
    assert "level 1 with 5" in coarse.findings[0].done
    flat = read_model(write_lcc(tmp_path / "flat", harmonics=False, environment=0), HUGE)
    assert flat.splat_count == 12 and flat.sh.shape[1] == 1
    far = by_hand(*(row[:64] for row in random_rows(3, 99)), "env")
    # +Z is up: x stays, z becomes y, y goes to the back
    x, y, z = far["means"]
    np.testing.assert_allclose(whole.means[12], (x, z, -y), atol=1e-6)
    np.testing.assert_allclose(whole.scales[12], far["scales"], rtol=1e-5)


def test_the_axes_are_those_of_splat_transform(tmp_path):
    """Whose engine has x left, y up, z front: half a turn about y from ours."""
    file = write_lcc(tmp_path, environment=0)
    for number, most in ((0, 0), (1, 6)):
        theirs = by_splat_transform(file, tmp_path / "a.ply", number)
        same_scene(read_model(file, replace(HUGE, most_splats=most)), theirs)


def by_splat_transform(given: Path, wanted: Path, level: int):
    if not shutil.which("splat-transform"):
        pytest.skip("splat-transform is not installed (npm install @playcanvas/splat-transform)")
    wanted.unlink(missing_ok=True)
    command = ["splat-transform", "-q", str(given), "--lod-select", str(level), str(wanted)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return read_plain(wanted, HUGE)


def same_scene(ours, theirs) -> None:
    np.testing.assert_allclose(ours.means, theirs.means, atol=1e-6)
    np.testing.assert_allclose(ours.opacity, theirs.opacity, atol=2e-6)
    np.testing.assert_allclose(ours.sh, theirs.sh, atol=1e-6)
    np.testing.assert_allclose(
        covariance(ours.scales, ours.wxyz), covariance(theirs.scales, theirs.wxyz), atol=1e-5
    )


def chunks(folder: Path, ending: str) -> dict[str, bytes]:
    out = {}
    for i, count in enumerate((40, 20, 10, 6)):
        if ending == ".sog":
            file = write_zip(folder / f"{i}.sog", *random_sog(count, seed=i))
        else:
            file = folder / f"{i}.spz"
            write_spz(some_splats(count, 4), file, 3, ("rub", "ply")[i % 2])  # said in each
        out[f"parts/{i}{ending}"] = file.read_bytes()
    return out


@pytest.mark.parametrize(
    ("ending", "old"), [(".sog", False), (".sog", True), (".spz", False)]
)  # old: names of fields before they changed, commas left behind, children by number
def test_lcc2_is_the_splats_of_its_level_s_files(tmp_path, ending, old):
    files = chunks(tmp_path, ending)
    path = write_lcc2(tmp_path / "b", files, [[0, 1], [2]], far=3, old=old, ending=ending)
    model = read_model(path.parent, HUGE)
    assert model.splat_count == 40 + 20 + 6 and model.provenance["level_splats"] == [60, 10]
    coarse = read_model(path, replace(HUGE, most_splats=20))
    assert coarse.splat_count == 10 + 6 and "level 1" in coarse.findings[-1].done
    up = "+Z" if ending == ".sog" else "-Z"
    alone = read_plain(tmp_path / f"0{ending}", replace(HUGE, up=up))
    np.testing.assert_allclose(model.means[:40], alone.means, atol=1e-6)
    np.testing.assert_allclose(model.sh[:40], alone.sh, atol=1e-6)
    assert describe(model, path)["bytes"] == path.stat().st_size + sum(
        len(data) for name, data in files.items() if "/2" not in name
    )


@pytest.mark.parametrize("ending", [".sog", ".spz"])
def test_splat_transform_shows_the_same_of_lcc2(tmp_path, ending):
    path = write_lcc2(tmp_path / "b", chunks(tmp_path, ending), [[0, 1], [2]], ending=ending)
    for level, most in ((0, 0), (1, 10)):
        theirs = by_splat_transform(path, tmp_path / "a.ply", level)
        same_scene(read_model(path, replace(HUGE, most_splats=most)), theirs)


def test_a_name_without_its_folder_will_do(tmp_path):
    """As files are that were dragged out of theirs."""
    path = write_lcc2(tmp_path / "b", chunks(tmp_path, ".sog"), [[0]])
    (tmp_path / "b" / "parts" / "0.sog").rename(tmp_path / "b" / "0.sog")
    assert read_model(path, HUGE).splat_count == 40


def edited(path: Path, **entries) -> Path:
    said = json.loads(path.read_text()) | entries
    return put(path, json.dumps({k: v for k, v in said.items() if v is not None}).encode())


def cut(name: str, size: int):
    def change(path: Path) -> None:
        file = path.with_name(name)
        file.write_bytes(file.read_bytes()[:size])

    return change


BROKEN = {
    "no levels": (lambda p: edited(p, totalLevel=None), "'totalLevel' is missing; export"),
    "too many levels": (lambda p: edited(p, totalLevel=65), "'totalLevel' is 65; a whole number"),
    "other levels": (lambda p: edited(p, totalLevel=3), "expected a multiple of 52 for 3"),
    "no ranges": (lambda p: edited(p, attributes=None), "'attributes' has no 'scale'; export"),
    "ranges of text": (lambda p: edited(p, attributes=[{"name": "scale", "min": "a", "max": 1}]),
                       "attribute 1: 'min' is .a.; a list of 3"),
    "no index": (lambda p: p.with_name(INDEX).unlink(), "lacks index.bin"),
    "no data": (lambda p: p.with_name("data.bin").unlink(), "lacks data.bin"),
    "no harmonics": (lambda p: p.with_name("shcoef.bin").unlink(), "shcoef.bin has 0 bytes"),
    "cut data": (cut("data.bin", 200), "names splats beyond the end of data.bin"),
    "cut harmonics": (cut("shcoef.bin", 200), "shcoef.bin has 200 bytes"),
    "cut index": (cut(INDEX, 50), "it is cut off"),
    "empty index": (cut(INDEX, 0), "has 0 bytes"),
    "cut environment": (cut("environment.bin", 100), "no multiple of 96"),
    "no JSON": (lambda p: put(p, b"{"), "is not JSON"),
    "nothing": (lambda p: p.with_name(INDEX).write_bytes(bytes(36)), "names no splats"),
    "negative": (lambda p: p.with_name(INDEX).write_bytes(bytes(4) + b"\xff" * 16 + bytes(16)),
                 "beyond the end"),
}  # fmt: skip


@pytest.mark.parametrize("how", BROKEN)
def test_broken_lcc_is_one_sentence(tmp_path, how):
    change, words = BROKEN[how]
    path = write_lcc(tmp_path)
    change(path)
    with pytest.raises(BadFile, match=words) as refusal:
        read_model(path, HUGE)
    assert "\n" not in str(refusal.value) and len(str(refusal.value)) < 300


BROKEN_2 = {
    "no levels": ({"totalLevels": 0}, "'totalLevels' is 0; a whole number from 1 to 64"),
    "no root": ({"root": None}, "'root' is missing; export"),
    "unknown kind": ({"splatType": ".ply"}, "'splatType' is .\\.ply.; '.sog' or"),
    "outside": ({"root": {"splatFiles": ["../a.sog"], "child": [{"data": {"3dgs": {"name": 0}}}]}},
                "none of its own"),
    "not there": ({"root": {"splatFiles": ["a.sog"], "child": [{"data": {"3dgs": {"name": 0}}}]}},
                  "lacks 'a.sog'"),
    "beyond the list": ({"root": {"splatFiles": [], "child": [{"data": {"3dgs": {"name": 0}}}]}},
                        "names file 0, it lists 0"),
    "no node": ({"root": {"splatFiles": [], "child": [3]}}, "a node that is none"),
    "no splats": ({"root": {"splatFiles": [], "child": []}}, "names no splats"),
}  # fmt: skip


@pytest.mark.parametrize("how", BROKEN_2)
def test_broken_lcc2_is_one_sentence(tmp_path, how):
    entries, words = BROKEN_2[how]
    path = write_lcc2(tmp_path / "b", chunks(tmp_path, ".sog"), [[0]])
    with pytest.raises(BadFile, match=words):
        read_model(edited(path, **entries), HUGE)


def test_a_tree_of_three_hundred_levels_is_no_recursion(tmp_path):
    node = "{}"
    for _ in range(300):
        node = f'{{"child": [{node}]}}'
    text = f'{{"totalLevels": 2, "root": {{"splatFiles": [], "child": [{node}]}}}}'
    with pytest.raises(BadFile, match="names no splats"):
        read_meta2(put(tmp_path / "meta.lcc2", text.encode()), Memory().of(tmp_path))


def test_two_scenes_in_a_folder_have_to_be_named(tmp_path):
    write_lcc(tmp_path)
    (tmp_path / "other.lcc").write_bytes((tmp_path / "meta.lcc").read_bytes())
    assert find_meta(tmp_path, ".lcc") is None
    assert read_model(tmp_path / "other.lcc", HUGE).stops[0].name == "other"
