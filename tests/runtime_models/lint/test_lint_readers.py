"""What lint says of other programs, and export of formats that would spoil a scene silently."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app import cli
from shapeshift.runtime_models.lint.lint import HALF_LEAST, HALF_MOST, other_readers
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.write_compressed_ply import write_compressed_ply
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.runtime_models.splats.spz.write_spz import write_spz
from shapeshift.runtime_models.splats.write_plain import describe_losses, writer_of
from tests.support.splats.ply_files import some_splats

HUGE = Reading(allow_huge=True)


def told(tmp_path, splats, name: str = "a.ply") -> list[str]:
    write = write_spz if name.endswith(".spz") else write_ply
    write(splats, tmp_path / name)
    model = read_model(tmp_path / name, HUGE)
    return [f"{found.what}: {found.done}" for found in other_readers(model, name)]


def test_a_usual_scene_is_nothing_to_others(tmp_path):
    assert told(tmp_path, some_splats(50)) == [] == told(tmp_path, some_splats(50), "a.spz")


@pytest.mark.parametrize(
    "place, hit", [(2047.9, False), (-2047.9, False), (2048.0, True), (-2048.0, True), (1e5, True)]
)
def test_places_beyond_the_reach_of_other_spz_writers(tmp_path, place, hit):
    """Theirs come back 4096 m off: 3000 m becomes -1096 m."""
    splats = some_splats(50, 1)
    splats.means[7, 1] = place
    words = told(tmp_path, splats)
    assert [("1 splats lie 2,048 m" in each and "4,096 m off" in each) for each in words] == [
        True
    ] * hit


def test_a_far_origin_counts(tmp_path):
    words = told(tmp_path, replace(some_splats(50, 1), origin=(5e5, 0.0, 0.0)))
    assert "50 splats lie 2,048 m" in words[0]


def test_certain_opacities_of_an_spz(tmp_path):
    splats = some_splats(50, 1)
    splats.opacity[3:5] = 0, 1
    (word,) = told(tmp_path, splats, "a.spz")
    assert "2 splats have an opacity of exactly 0 or 1" in word and "infinite logits" in word
    assert told(tmp_path, splats) == []


@pytest.mark.parametrize(
    "size, hit",
    [(HALF_LEAST * 0.99, True), (HALF_LEAST * 1.01, False), (HALF_MOST * 1.01, True),
     (HALF_MOST * 0.99, False), (0.0, False)],
)  # fmt: skip
def test_sizes_that_half_floats_lose(tmp_path, size, hit):
    """The bounds by numpy's own half floats: a covariance of 0, or infinite."""
    with np.errstate(over="ignore"):
        lost = np.float16(size * size) in (0, np.inf) and size > 0
    assert lost == hit
    splats = some_splats(50, 1)
    splats.scales[3] = size
    assert [("1 splats are smaller" in word) for word in told(tmp_path, splats)] == [True] * hit


def test_infinite_places_spoil_others_sog(tmp_path):
    splats = some_splats(50, 1)
    splats.means[3, 0] = np.inf
    assert any("SOG" in word for word in told(tmp_path, splats))


def test_lint_shows_it_and_passes(tmp_path, capsys):
    splats = some_splats(50, 1)
    splats.means[7, 1] = 3000
    write_ply(splats, tmp_path / "a.ply")
    assert cli.main(["lint", str(tmp_path / "a.ply"), "--allow-huge", "--json"]) == 0
    assert "4,096 m off" in capsys.readouterr().out


def test_a_far_splat_in_a_compressed_ply_is_told_with_what_it_moves(tmp_path):
    """One of 1,024 at a kilometre: the finding counts at least all that really move so far."""
    splats = some_splats(1024, 1, sizes=(0.01, 0.02))
    splats.means[:] *= 2
    assert describe_losses(splats, writer_of(tmp_path / "a.compressed.ply")) == ()
    splats.means[5] = [1000, 0, 0]
    (found,) = describe_losses(splats, writer_of(tmp_path / "a.compressed.ply"))
    write_compressed_ply(splats, tmp_path / "a.compressed.ply")
    got = read_plain(tmp_path / "a.compressed.ply", HUGE).means
    apart = np.abs(got[:, None] - splats.means[None]).max(axis=2).min(axis=0)
    moved = apart > splats.scales.max(axis=1)
    assert 100 < moved.sum() <= found.count <= 256 and "--only" in found.done
    assert "by up to 0.25 m" in found.what  # half of a 2047th of 1,005 m
    assert apart.max() <= 1000 / 2047 / 2 * 1.02
    assert describe_losses(splats, writer_of(tmp_path / "a.spz")) == ()


@pytest.mark.parametrize(
    "name, size, harmonic, said",
    [("a.spz", 400.0, 0.1, "larger than 379 m"), ("a.spz", 370.0, 0.1, ""),
     ("a.spz", 4e-5, 0.1, "smaller than 4.5e-05 m"), ("a.spz", 0.0, 0.1, ""),
     ("a.spz", 0.1, 1.1, "harmonics beyond 1"), ("a.compressed.ply", 0.1, 1.1, ""),
     ("a.compressed.ply", 0.1, -4.1, "harmonics beyond 4"), ("a.ply", 400.0, 9.0, "")],
)  # fmt: skip
def test_what_a_format_holds_at_its_ends_is_told(tmp_path, name, size, harmonic, said):
    splats = some_splats(30, 4, sizes=(0.05, 0.1), color=0.05)
    splats.scales[4] = size
    splats.sh[4, 2, 1] = harmonic
    found = describe_losses(splats, writer_of(tmp_path / name))
    assert [said in each.what and each.count == 1 for each in found] == [True] * bool(said)
