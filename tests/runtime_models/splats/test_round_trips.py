"""What we write, read by us and by a third party: the same picture, and near the original.

The third party is gaussforge, a C++ converter with readers of its own for each format but glTF
(there pygltflib checks the numbers: test_gltf.py).  It hands over what it read as a plain PLY.
"""

from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.write_plain import truncate_harmonics
from tests.support.splats.round_trips import compare, rows
from tests.support.splats.writers import EACH_WRITER

ALIKE = 50.0  # dB between our picture and theirs of one file
COST = {  # dB at least
    ".compressed.ply": 50,
    ".ply": 140,
    ".spz": 50,
    ".glb": 140,
    ".splat": 44,
    ".usdz": 140,
}
THEIRS = {".compressed.ply": "compressed.ply", ".ply": "ply", ".spz": "spz", ".splat": "splat"}


@pytest.fixture(scope="module")
def leg(data) -> PlainSplats:
    """Part of a real scene of degree 3, with the places and sizes that training leaves."""
    path = data / "anatomy_leg_ml3dgs" / "layer2.ply"
    return rows(read_plain(path), slice(None, None, 3))


@pytest.fixture(scope="module")
def extremes() -> PlainSplats:
    """Every field from one end of what scenes hold to the other, 513 splats: two blocks and one."""
    rng, count = np.random.default_rng(3), 513
    wxyz = rng.normal(size=(count, 4))
    wxyz[:8] = np.concatenate([np.eye(4), -np.eye(4)])
    scales = np.exp(rng.uniform(np.log(1e-4), np.log(0.5), (count, 3)))
    opacity = np.clip(rng.uniform(-0.2, 1.2, count), 0.004, 1)
    sh = rng.normal(size=(count, 16, 3)) * 0.15
    sh[:, 0] = rng.uniform(-1.7, 1.7, (count, 3))  # from black to white
    means = rng.normal(size=(count, 3)) * (2, 0.5, 1)
    means[::100] *= 3
    arrays = means, scales, wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True), opacity, sh
    return PlainSplats(*(array.astype(np.float32) for array in arrays))


def read_by_them(path: Path, ending: str, folder: Path) -> PlainSplats:
    """The file as gaussforge reads it."""
    gaussforge = pytest.importorskip("gaussforge")
    answer = gaussforge.GaussForge().convert(path.read_bytes(), THEIRS[ending], "ply")
    assert "data" in answer, answer["error"]
    (folder / "theirs.ply").write_bytes(answer["data"])
    return read_plain(folder / "theirs.ply")


@pytest.mark.parametrize("degree", [0, 3])
@pytest.mark.parametrize("scene", ["leg", "extremes"])
@EACH_WRITER
def test_ours_and_theirs_see_the_same(renderer, tmp_path, request, writer, scene, degree):
    splats = truncate_harmonics(request.getfixturevalue(scene), degree)
    path = tmp_path / f"file{writer.ending}"
    writer.write(splats, path)
    ours = read_plain(path)
    assert len(ours.means) == len(splats.means)
    held = truncate_harmonics(splats, min(degree, writer.sh_degree))
    cost = compare(renderer, ours, held)
    print(f"{scene} {writer.ending} SH {degree}: {cost:.1f} dB to what was written")
    assert cost > COST[writer.ending], f"{cost:.1f} dB"
    if writer.ending in THEIRS:
        theirs = read_by_them(path, writer.ending, tmp_path)
        likeness = compare(renderer, ours, theirs)
        print(f"  {likeness:.1f} dB between ours and theirs")
        assert likeness >= ALIKE, f"{likeness:.1f} dB"
        assert np.abs(theirs.means).max() > 0 and theirs.sh.shape == ours.sh.shape
