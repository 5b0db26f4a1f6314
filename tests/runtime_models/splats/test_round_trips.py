"""What we write, read by us and by a third party: the same picture, and near the original.

The third party is gaussforge, a C++ converter with readers of its own for each format but glTF
(there pygltflib checks the numbers: test_gltf.py).  It hands over what it read as a plain PLY.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, Reading
from shapeshift.runtime_models.splats.write_plain import cut
from shapeshift.scene.cameras.framing import frame_points, orbit_path
from shapeshift.scene.metrics import psnr
from shapeshift.scene.scene import Scene, SceneObject
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
SIZE = (240, 160)


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


def rows(splats: PlainSplats, part: slice) -> PlainSplats:
    names = ("means", "scales", "wxyz", "opacity", "sh")
    return replace(splats, **{name: getattr(splats, name)[part].copy() for name in names}, extra={})


def drawn(renderer: Renderer, splats: PlainSplats, views: list) -> list[np.ndarray]:
    means = (splats.means + np.array(splats.origin)).astype(np.float32)
    arrays = (means, splats.scales, splats.wxyz, splats.opacity, splats.sh)
    model = SplatLayers(*arrays, np.zeros(len(means), np.int32), (Stop("only", 0.0),))
    renderer.update(Scene((SceneObject("splats", model),)))
    pictures = []
    for view in views:
        renderer.draw([view])
        pictures.append(renderer.resolved(0).copy())
    return pictures


def compare(renderer: Renderer, one: PlainSplats, other: PlainSplats) -> float:
    """The worst of three pictures from all around, dB."""
    views = orbit_path(3, *frame_points(one.means, one.opacity), SIZE)
    pairs = zip(drawn(renderer, one, views), drawn(renderer, other, views), strict=True)
    return min(psnr(a, b) for a, b in pairs)


def read_by_them(path: Path, ending: str, folder: Path) -> PlainSplats:
    """The file as gaussforge reads it."""
    gaussforge = pytest.importorskip("gaussforge")
    answer = gaussforge.GaussForge().convert(path.read_bytes(), THEIRS[ending], "ply")
    assert "data" in answer, answer["error"]
    (folder / "theirs.ply").write_bytes(answer["data"])
    up = "+Y" if ending == ".spz" else ""  # it leaves the axes as they are: right, up, back
    return read_plain(folder / "theirs.ply", Reading(up=up))


@pytest.mark.parametrize("degree", [0, 3])
@pytest.mark.parametrize("scene", ["leg", "extremes"])
@EACH_WRITER
def test_ours_and_theirs_see_the_same(renderer, tmp_path, request, writer, scene, degree):
    splats = cut(request.getfixturevalue(scene), degree)
    path = tmp_path / f"file{writer.ending}"
    writer.write(splats, path)
    ours = read_plain(path)
    assert len(ours.means) == len(splats.means)
    held = cut(splats, min(degree, writer.sh_degree))
    cost = compare(renderer, ours, held)
    print(f"{scene} {writer.ending} SH {degree}: {cost:.1f} dB to what was written")
    assert cost > COST[writer.ending], f"{cost:.1f} dB"
    if writer.ending in THEIRS:
        theirs = read_by_them(path, writer.ending, tmp_path)
        likeness = compare(renderer, ours, theirs)
        print(f"  {likeness:.1f} dB between ours and theirs")
        assert likeness >= ALIKE, f"{likeness:.1f} dB"
        assert np.abs(theirs.means).max() > 0 and theirs.sh.shape == ours.sh.shape
