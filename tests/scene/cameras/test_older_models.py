"""COLMAP models since 3.12, whose rigs and frames hold poses once more: read and replaced."""

import numpy as np
import pytest

from shapeshift.app import cli
from shapeshift.scene.cameras.read_cameras import read_camera_list
from shapeshift.scene.captures.colmap.rig_frames import frame_poses, refused_poses
from shapeshift.scene.captures.colmap_tables import read_tables
from tests.support.scene.camera_files import HALF
from tests.support.scene.colmap_texts import longer, well_formed

pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is not installed")
RIGS = {"rigs", "frames"}


@pytest.fixture(params=[".txt", ".bin"])
def model(tmp_path, request):
    """The folder of a model of rigs with two cameras, its ending, and what pycolmap says of it."""
    folder = tmp_path / "old/sparse/0"
    made = well_formed(folder)
    if request.param == ".bin":
        for path in folder.glob("*.txt"):
            path.unlink()
        made.write_binary(folder)
    return folder, request.param, made


def moved(folder, made, ending, images):
    """Other places for some images, in images.* alone, as scripts older than frames write them."""
    for number in images:
        made.images[number].frame.rig_from_world.translation = (7.0, 8.0, 9.0)
    old = {name: (folder / f"{name}{ending}").read_bytes() for name in RIGS}
    (made.write_text if ending == ".txt" else made.write_binary)(folder)
    for name, data in old.items():
        (folder / f"{name}{ending}").write_bytes(data)


def test_frames_say_what_pycolmap_says(model):
    folder, ending, made = model
    found = frame_poses(folder / f"rigs{ending}", folder / f"frames{ending}")
    assert found.keys() == set(made.images)
    for number, matrix in found.items():
        theirs = made.images[number].cam_from_world().matrix()
        np.testing.assert_allclose(matrix[:3], theirs, atol=1e-12)
    assert refused_poses(folder, ending, read_tables(folder, ending)[1]) == ()


def test_poses_that_frames_contradict_are_taken_and_said(model):
    folder, ending, made = model
    before = pycolmap.Reconstruction(folder)
    moved(folder, made, ending, [1])
    cameras = read_camera_list(folder)
    said, _ = cameras.notes  # the other is of its lenses
    assert said.startswith(f"2 of 6 images have another pose in images{ending} than in frames")
    assert made.images[1].name in said
    ours = cameras.views[0].pinhole()[0] @ HALF
    np.testing.assert_allclose(ours[:3], made.images[1].cam_from_world().matrix(), atol=1e-9)
    theirs = pycolmap.Reconstruction(folder).images[1].cam_from_world().matrix()
    np.testing.assert_allclose(theirs, before.images[1].cam_from_world().matrix())  # as it is said


def test_quaternions_of_another_length_are_no_other_poses(tmp_path):
    well_formed(tmp_path)
    path = tmp_path / "images.txt"
    path.write_bytes(longer(path.read_bytes(), -3.0))
    assert refused_poses(tmp_path, ".txt", read_tables(tmp_path, ".txt")[1]) == ()


@pytest.mark.parametrize("table", sorted(RIGS))
def test_frames_that_are_cut_are_not_needed(model, table):
    folder, ending, _ = model
    path = folder / f"{table}{ending}"
    whole, (_, posed) = path.read_bytes(), read_tables(folder, ending)
    for length in range(0, len(whole), 7):
        path.write_bytes(whole[:length])
        said = refused_poses(folder, ending, posed)
        assert len(said) <= 1 and all("\n" not in sentence for sentence in said)
    if ending == ".bin":
        path.write_bytes(b"\xff" * 8 + whole[8:])
        assert "claims" in refused_poses(folder, ending, posed)[0]


def cameras(*words) -> int:
    return cli.main(["cameras", *map(str, words)])


def other_views(folder):
    """Three cameras of our own at x = 51, 52, 53."""
    row = '{{"matrix": [[1,0,0,{}],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "fov_y": 1}}'
    path = folder / "new.json"
    path.write_text(f"[{', '.join(row.format(x) for x in (51, 52, 53))}]")
    return path


@pytest.mark.parametrize("form", ["colmap-bin", "colmap-txt"])
def test_an_older_model_is_refused_or_wholly_replaced(model, form, tmp_path, capsys):
    """pycolmap read the older poses, out of frames or out of the other kind of tables."""
    folder, _, _ = model
    out, new = folder.parents[1], other_views(tmp_path)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert cameras(new, "--out", out, "--to", form) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert cameras(new, "--out", out, "--to", form, "--overwrite") == 0
    assert "Removed, as of an older model: " in capsys.readouterr().err
    theirs = pycolmap.Reconstruction(folder)
    places = [theirs.images[n].projection_center() for n in sorted(theirs.images)]
    np.testing.assert_allclose(places, [[51, 0, 0], [52, 0, 0], [53, 0, 0]], atol=1e-12)
    assert {path.stem for path in folder.iterdir()} == {"cameras", "images", "points3D"}
    assert {path.suffix for path in folder.iterdir()} == {f".{form[-3:]}"}
    ours = read_camera_list(out)
    assert [view.world_from_eye.position[0] for view in ours.views] == [51, 52, 53]
    assert not ours.notes


@pytest.mark.parametrize("stale", ["frames", "rigs"])
def test_frames_alone_are_an_older_model(tmp_path, capsys, stale):
    new, folder = other_views(tmp_path), tmp_path / "out/sparse/0"
    folder.mkdir(parents=True)
    (folder / f"{stale}.txt").write_text("")
    (folder / "project.ini").write_text("kept")  # how COLMAP was called: it contradicts nothing
    assert cameras(new, "--out", tmp_path / "out") == 2
    assert f"{stale}.txt is of another model" in capsys.readouterr().err
    assert cameras(new, "--out", tmp_path / "out", "--overwrite") == 0
    assert not (folder / f"{stale}.txt").exists() and (folder / "project.ini").exists()


@pytest.mark.parametrize("source", ["old", "old/sparse/0", "old/sparse/0/images{}"])
def test_what_is_read_is_never_removed(model, tmp_path, capsys, source):
    folder, ending, _ = model
    before = sorted(path.name for path in folder.iterdir())
    for form in ("colmap-bin", "colmap-txt"):
        words = ("--out", folder.parents[1], "--to", form, "--overwrite")
        assert cameras(tmp_path / source.format(ending), *words) == 2
        assert "belongs to what is read" in capsys.readouterr().err
    assert sorted(path.name for path in folder.iterdir()) == before


def test_text_beside_binary_tables_is_said_where_it_differs(tmp_path):
    """COLMAP's binary tables go before text, ours as well; the same in both is no word."""
    made = well_formed(tmp_path)
    made.write_binary(tmp_path)
    said = [note for note in read_camera_list(tmp_path).notes if "images.txt" in note]
    assert not said
    path = tmp_path / "images.txt"
    rows = path.read_text().splitlines()
    words = rows[4].split()
    rows[4] = " ".join([*words[:5], "9", "9", "9", *words[8:]])
    extra = f"99 {' '.join(words[1:9])} new.png"
    path.write_text("\n".join([*rows[:6], *rows[8:], extra]) + "\n\n")
    cameras = read_camera_list(tmp_path)
    (said,) = [note for note in cameras.notes if "images.txt" in note]
    assert "has 1 images more and 2 that are missing or have another pose" in said
    theirs = pycolmap.Reconstruction(tmp_path)
    ours = cameras.views[0].pinhole()[0] @ HALF
    np.testing.assert_allclose(ours[:3], theirs.images[1].cam_from_world().matrix(), atol=1e-9)
    path.write_text("no table")
    assert any("no table" not in n and "images.txt" in n for n in read_camera_list(tmp_path).notes)


def test_a_larger_model_beside_what_is_written_is_said(tmp_path, capsys):
    well_formed(tmp_path / "out/sparse/1")
    assert cameras(other_views(tmp_path), "--out", tmp_path / "out") == 0
    assert "sparse/1 has more images" in capsys.readouterr().err
    assert cameras(tmp_path / "out") == 0
    assert "Of 2 models that are not joined, sparse/1 with 6 images is used" in (
        capsys.readouterr().err
    )
