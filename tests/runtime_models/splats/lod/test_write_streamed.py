"""Streamed SOG that is written: read back level by level, its tree, what its codes lose."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from shapeshift.runtime_models.files import memory
from shapeshift.runtime_models.model import BadFile, SplatLayers
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.operations.decimate import decimate
from shapeshift.runtime_models.splats.operations.moment_matching import shown_area
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, Reading
from shapeshift.runtime_models.splats.sog import write_sog as sog_module
from shapeshift.runtime_models.splats.sog import write_streamed as module
from shapeshift.runtime_models.splats.sog import write_streamed as module_levels
from shapeshift.runtime_models.splats.sog.read_streamed import levels, read_level, read_tree
from shapeshift.runtime_models.splats.sog.write_sog import (
    CODES,
    LEAST_WEIGHT,
    codebook,
    coded,
    make_palette,
    shortest,
    write_sog,
)  # fmt: skip
from shapeshift.runtime_models.splats.sog.write_streamed import write_streamed
from tests.support.splat_scenes import shell
from tests.support.splats.ply_files import some_splats


def plain(layers: SplatLayers) -> PlainSplats:
    return PlainSplats(layers.means, layers.scales, layers.wxyz, layers.opacity, layers.sh)


def written(splats: PlainSplats, folder: Path, leaf: int = 200):
    folder.mkdir()
    return write_streamed(splats, folder, leaf, "test", lambda part: None)


@pytest.mark.parametrize("count", [1, 2, 15, 16, 17, 300])
def test_a_sog_is_read_back_within_its_codes(tmp_path, count):
    """Up to 256 different numbers a codebook is exact to float32; else within its widest gap."""
    splats = some_splats(count, 1, sizes=(1e-3, 0.5))
    write_sog(splats, tmp_path, "test")
    back = read_model(tmp_path, Reading(up="+Y"))  # as it lies in the file
    span = np.ptp(np.sign(splats.means) * np.log1p(np.abs(splats.means)), axis=0)
    reach = 1 + np.abs(splats.means)  # what a step of the logarithm is worth in metres
    step = np.abs(back.means - splats.means) / reach
    assert (step <= 0.6 * span / 65535 + 1e-6).all()
    book = codebook(np.log(splats.scales))
    assert np.abs(np.log(back.scales / splats.scales)).max() <= np.diff(book).max() / 2 + 1e-5
    book = codebook(splats.sh[:, 0])
    assert np.abs(back.sh - splats.sh).max() <= np.diff(book).max() / 2 + 1e-5
    assert np.abs(back.opacity - splats.opacity).max() <= 0.5 / 255 + 1e-6
    # Three entries off by half a code of sqrt(2) / 255 each, the fourth by no more than they.
    turned = np.abs((back.wxyz * splats.wxyz).sum(axis=1)).clip(0, 1)
    assert (2 * np.arccos(turned)).max() < 2 * 3 * 0.5 * 2**0.5 / 255


def test_a_codebook_has_the_ends_and_the_nearest_code_is_taken():
    values = np.random.default_rng(0).lognormal(0, 2, (5000, 3)).astype(np.float32)
    book, codes = coded(values)
    assert len(book) == CODES and (np.diff(book) >= 0).all()
    assert (book[0], book[-1]) == (values.min(), values.max())
    best = np.abs(values.reshape(-1, 1) - book).min(axis=1).reshape(values.shape)
    np.testing.assert_allclose(np.abs(book[codes] - values), best, atol=1e-5)
    alike, zeros = coded(np.full((3, 3), 7.0, np.float32))
    assert (alike[zeros] == 7).all()


@pytest.mark.parametrize(("splats", "leaf"), [(1, 200), (200, 200), (20_000, 500)])
def test_progress_rises_from_0_to_1_without_standing_still(tmp_path, monkeypatch, splats, leaf):
    """In steps of no more than writing a whole level, where that is one file: here a tenth is."""
    monkeypatch.setattr(module, "MOST_OF_A_FILE", 2000)
    told: list[float] = []
    write_streamed(plain(shell(splats)), tmp_path, leaf, "test", told.append)
    assert told == sorted(told) and told[0] == 0 and told[-1] == 1
    if splats > leaf:
        # The longest piece that says nothing: the moments and errors of level 1.
        assert max(np.diff(told)) < (1 - module_levels.PAIRING) * 0.5
        assert len(told) > 30


@pytest.mark.parametrize("coefficients", [1, 16])
def test_progress_is_of_the_time_that_each_piece_takes(coefficients):
    """Against the sum written out: cut, write, merge, write, merge, write."""
    told: list[float] = []
    merged, written_part = module.parts_of(3, coefficients, told.append)
    for level in range(3):
        merged(level, 1.0)
        written_part(level, 0.5)
    file = module.WRITING + module.HARMONICS * (coefficients - 1)
    cut, pair = module.CUTTING, module.MERGING
    ends = [cut, cut + file / 2, cut + file + pair, cut + file + pair + file / 4]
    ends += [cut + 1.5 * file + 1.5 * pair, cut + 1.625 * file + 1.5 * pair]
    np.testing.assert_allclose(told, np.array(ends) / (cut + 1.75 * file + 1.5 * pair))


def test_numbers_of_a_codebook_are_short_and_exact():
    book = np.array([-1e30, -0.1, -0.0, 1e-38, 1 / 3, 0.1, 1.0, 16777217, 3.4e38], np.float32)
    book = np.concatenate([book, np.random.default_rng(0).normal(size=2000).astype(np.float32)])
    text = json.dumps(shortest(book))
    assert np.float32(json.loads(text)).tobytes() == book.tobytes()
    assert len(text) < 0.6 * len(json.dumps(book.tolist()))


@pytest.mark.parametrize("coefficients", [4, 9, 16])
@pytest.mark.parametrize("count", [1, 2, 255, 256, 257, 2000])
def test_harmonics_come_back_as_the_mean_of_their_set(tmp_path, count, coefficients):
    splats = some_splats(count, coefficients)
    shown = shown_area(splats.scales, splats.opacity).astype(np.float64)
    sets, labels = make_palette(splats.sh[:, 1:], shown)
    assert len(sets) == 1 << max(int(np.log2(count / 4)), 0) and labels.max() < len(sets)
    weight = shown / shown.mean() + LEAST_WEIGHT
    for number in np.unique(labels)[::17]:
        mine = labels == number
        mean = np.average(splats.sh[mine, 1:], axis=0, weights=weight[mine])
        np.testing.assert_allclose(sets[number], mean, atol=1e-5)
    write_sog(splats, tmp_path, "test")
    back = read_model(tmp_path, Reading(up="+Y"))
    step = np.diff(codebook(sets)).max() / 2
    assert np.abs(back.sh[:, 1:] - sets[labels]).max() <= step + 1e-5


def test_sets_of_harmonics_are_of_those_that_are_alike():
    """Sixteen kinds of splats, many of each: a set of each kind, to the last bits."""
    kinds = np.random.default_rng(0).normal(size=(16, 15, 3)).astype(np.float32)
    which = np.random.default_rng(1).permutation(np.arange(1024) % 16)
    sets, labels = make_palette(kinds[which], np.ones(1024))
    np.testing.assert_allclose(sets[labels], kinds[which], atol=1e-5)


def lost(rest: np.ndarray, weight: np.ndarray, sets: np.ndarray, labels: np.ndarray) -> float:
    away = ((sets[labels] - rest) ** 2).sum(axis=(1, 2))
    return float((weight * away).sum() / weight.sum())


@pytest.mark.parametrize("coefficients", [4, 16])
def test_what_shows_most_loses_least(monkeypatch, coefficients):
    """Weights as spread as areas are: half of the error of sets that know none; and each round
    takes some, as Lloyd's algorithm never gives any.
    """
    rng = np.random.default_rng(2)
    rest = rng.normal(size=(3000, coefficients - 1, 3)).astype(np.float32)
    weight = rng.lognormal(0, 2, 3000)
    even = lost(rest, weight, *make_palette(rest, np.ones(3000)))
    before = np.inf
    for rounds in range(4):
        monkeypatch.setattr(sog_module, "PALETTE_ROUNDS", rounds)
        now = lost(rest, weight, *make_palette(rest, weight))
        assert now < before
        before = now
    assert now < 0.6 * even


@pytest.mark.parametrize("weight", [np.zeros(64), np.r_[np.zeros(63), 1e30], np.full(64, 1e-30)])
def test_weights_of_nothing_and_of_one_alone(weight):
    rest = np.random.default_rng(3).normal(size=(64, 3, 3)).astype(np.float32)
    sets, labels = make_palette(rest, weight)
    assert np.isfinite(sets).all() and sets.shape == (16, 3, 3) and labels.max() < 16
    if weight.max() > 1:
        np.testing.assert_allclose(sets[labels[63]], rest[63], atol=1e-4)


def test_antialiased_and_far_scenes_come_back(tmp_path):
    splats = replace(some_splats(20, 1), antialiased=True, origin=(1000.0, -20.0, 0.0))
    write_sog(splats, tmp_path, "test")
    back = read_model(tmp_path, Reading(up="+Y"))
    assert back.antialiased
    far = back.means + np.array(back.origin) - splats.means - splats.origin
    assert np.abs(far).max() < 1001 * np.log1p(1004) / 65535


def test_levels_are_those_that_were_made(tmp_path):
    """Read back by our reader: so many splats at each level, at level 0 each where it was; and the
    tree: boxes hold what lies in them, errors rise.
    """
    splats = plain(shell(3000))
    sizes = written(splats, tmp_path / "a", 200)
    tree = read_tree(tmp_path / "a")
    assert tree.counts == sizes.levels and sizes.levels[:3] == (3000, 1500, 750)
    assert all(len(runs) == sizes.leaves for runs in tree.levels)
    whole = read_level(tree, 0, Reading())
    away, nearest = cKDTree(splats.means).query(whole.means)
    assert away.max() < 1e-4 and len(set(nearest)) == 3000
    np.testing.assert_allclose(whole.opacity, splats.opacity[nearest], atol=0.5 / 255 + 1e-6)
    for level in levels(tmp_path / "a", Reading()):
        assert level.findings == () or "is read" in level.findings[-1].done
    meta = json.loads((tmp_path / "a" / "lod-meta.json").read_text())
    assert meta["version"] == 1 and meta["lodErrors"] and meta["lodLevels"] == len(sizes.levels)
    nodes = [meta["tree"]]
    seen = 0
    while nodes:
        node = nodes.pop()
        low, high = (np.array(node["bound"][end]) for end in ("min", "max"))
        for child in node.get("children", ()):
            assert (low <= child["bound"]["min"]).all() and (high >= child["bound"]["max"]).all()
        nodes += node.get("children", ())
        if "lods" not in node:
            continue
        seen += 1
        assert node["errors"][0] == 0 and node["errors"] == sorted(node["errors"])
        assert len(node["errors"]) == len(node["lods"]) == meta["lodLevels"]
        for number, run in node["lods"].items():
            file = read_model(tmp_path / "a" / f"{number}_0", Reading(up="+Y"))
            part = file.with_rows(slice(run["offset"], run["offset"] + run["count"]))
            assert ((part.means >= low) & (part.means <= high)).all()
    assert seen == sizes.leaves


def test_files_hold_whole_leaves_and_no_more_than_they_may(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "MOST_OF_A_FILE", 250)
    sizes = written(plain(shell(1000)), tmp_path / "a")
    tree = read_tree(tmp_path / "a")
    ends: dict[int, int] = {}
    for runs in tree.levels:
        for run in runs:
            assert run.first == ends.get(run.file, 0)
            ends[run.file] = run.first + run.count
    assert max(ends.values()) == 250 and len(ends) == len(tree.files) > len(sizes.levels)
    assert read_model(tmp_path / "a").splat_count == 1000


def test_merging_is_not_refused_by_the_size_of_a_small_file(tmp_path, monkeypatch):
    """lod-meta.json and meta.json are few bytes; the splats lie in other files."""
    written(plain(shell(40_000)), tmp_path / "a", 1 << 16)
    monkeypatch.setattr(memory, "FREE", 1 << 20)
    for file, count in (("lod-meta.json", 10), ("0_0/meta.json", 39_999)):
        assert read_model(tmp_path / "a" / file, Reading(most_splats=count)).splat_count == count
    *_, last = levels(tmp_path / "a" / "lod-meta.json", Reading(most_splats=10))
    assert last.splat_count == 10


@pytest.mark.parametrize("count", [1, 2, 64, 65])
def test_few_splats_have_few_levels(tmp_path, count):
    sizes = written(some_splats(count, 1), tmp_path / "a")
    assert sizes.levels[0] == count == read_model(tmp_path / "a").splat_count


def test_a_tree_that_no_reader_takes_is_not_written(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "LARGEST_TREE", 4000)
    with pytest.raises(BadFile, match=r"64 leaves make a lod-meta\.json of .* --leaf 256"):
        written(plain(shell(4000)), tmp_path / "a", 64)
    written(plain(shell(1000)), tmp_path / "b", 256)
    assert (tmp_path / "b" / "lod-meta.json").stat().st_size <= 4000


def test_the_same_scene_gives_the_same_bytes(tmp_path):
    for name in "ab":
        written(plain(shell(500)), tmp_path / name)
    files = [file.relative_to(tmp_path / "a") for file in (tmp_path / "a").rglob("*.*")]
    assert len(files) > 6
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_others_read_a_file_as_we_do(tmp_path):
    """The format's own splat-transform, where it is on the PATH."""
    if not shutil.which("splat-transform"):
        pytest.skip("splat-transform is not installed (npm install @playcanvas/splat-transform)")
    written(plain(shell(500, 9)), tmp_path / "a")
    command = ["splat-transform", "-q", "-g", "cpu", str(tmp_path / "a/1_0/meta.json")]
    subprocess.run([*command, str(tmp_path / "b.ply")], check=True, timeout=120)
    ours, theirs = read_model(tmp_path / "a/1_0"), read_model(tmp_path / "b.ply")
    for name in ("means", "scales", "opacity", "sh"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), atol=2e-6)


@pytest.mark.slow
def test_real_levels_are_as_good_as_merging_without_leaves(tmp_path, data):
    """Each level of `biker` within 1 dB of --max-splats to as many (0.4 were measured)."""
    from shapeshift.renderer.renderer import Renderer
    from shapeshift.scene.cameras.framing import default_view
    from shapeshift.scene.scene import Scene, SceneObject
    from tests.support.splat_scenes import psnr_db

    model = read_model(data / "splats_playcanvas" / "biker.compressed.ply")
    sizes = written(plain(model), tmp_path / "a", 4096)
    tree = read_tree(tmp_path / "a")
    with Renderer(None, "tiles") as renderer:

        def picture(part: SplatLayers) -> np.ndarray:
            renderer.update(Scene((SceneObject("a", part),)))
            renderer.draw([default_view(model, (320, 180))])
            return renderer.resolved(0)[..., :3]

        whole = picture(model)
        assert psnr_db(picture(read_level(tree, 0, Reading())), whole) > 55
        for number in (1, 2, 4):
            merged = psnr_db(picture(decimate(model, sizes.levels[number])), whole)
            assert psnr_db(picture(read_level(tree, number, Reading())), whole) > merged - 1
