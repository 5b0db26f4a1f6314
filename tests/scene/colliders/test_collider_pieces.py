"""Colliders in files: written, read back to the bit, and what a stranger's file may say."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh import creation

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.colliders.collider import (
    Collider,
    Making,
    collider_of_mesh,
    parts_volume,
)
from shapeshift.scene.colliders.collider_pieces import hull_faces, read_pieces, write_collider
from shapeshift.scene.colliders.collider_wrap import is_watertight, volume
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh
from shapeshift.scene.document.read_scene_file import read_scene_file
from tests.support.scene.collider_shapes import shapes, solid

ROOT = Path(__file__).resolve().parents[3]
EXAMPLES = ROOT / "examples"


def box(x: float, size=(0.1, 0.1, 0.1)) -> trimesh.Trimesh:
    mesh = creation.box(size)
    mesh.apply_translation((x, 0, 0))
    return mesh


def saved(path: Path, parts: dict[str, trimesh.Trimesh], node_names: bool = False) -> Path:
    """A .glb by trimesh's own writer; names on the meshes, or on their nodes alone."""
    scene = trimesh.Scene()
    for number, (name, mesh) in enumerate(parts.items()):
        geometry = f"Cube.{number:03}" if node_names else name
        scene.add_geometry(mesh, node_name=name, geom_name=geometry)
    path.write_bytes(scene.export(file_type="glb"))
    return path


def corners(collider: Collider) -> list[set]:
    return [set(map(tuple, hull.tolist())) for hull in collider.parts]


def test_a_collider_is_the_same_after_a_file(tmp_path):
    given = [TriangleMesh(np.float32(m.vertices), np.int32(m.faces)) for m in (box(0), box(0.3))]
    skin = trimesh.util.concatenate([box(0), box(0.3)])
    skin = TriangleMesh(np.float32(skin.vertices), np.int32(skin.faces))
    hulls = tuple(mesh.vertices for mesh in given)
    write_collider(hulls, skin, tmp_path / "a.glb")
    first = (tmp_path / "a.glb").read_bytes()
    write_collider(hulls, skin, tmp_path / "a.glb")
    assert (tmp_path / "a.glb").read_bytes() == first
    found = collider_of_mesh(tmp_path / "a.glb")
    assert corners(found) == corners(Collider(hulls, skin))
    assert solid(found).volume == pytest.approx(0.002, rel=1e-5)
    assert trimesh.load_scene(tmp_path / "a.glb").geometry.keys() == {
        "collider", "UCX_collider_00", "UCX_collider_01"}  # fmt: skip


@pytest.mark.parametrize("node_names", [True, False])
def test_pieces_of_game_engines_are_taken_as_they_are(tmp_path, node_names, monkeypatch):
    """A torus that somebody cut in two convex pieces: they are kept though they fill its hole."""
    monkeypatch.setattr("shapeshift.scene.colliders.collider.cut_into_parts", None)  # never called
    parts = {"Torus": shapes()["torus"], "UCX_Torus_00": box(-0.05), "ucx_Torus_01": box(0.05)}
    found = collider_of_mesh(saved(tmp_path / "a.glb", parts, node_names))
    assert sorted(hull[:, 0].mean().round(3) for hull in found.parts) == [-0.05, 0.05]
    torus = shapes()["torus"]
    assert volume(found.mesh.vertices, found.mesh.faces) == pytest.approx(torus.volume, rel=1e-4)


def test_without_a_closed_skin_the_pieces_are_the_mesh(tmp_path):
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    for parts in (
        {"UCX_a": box(0), "UCX_b": box(1)},
        {"a": sheet, "UCX_a": box(0), "UCX_b": box(1)},
    ):
        found = collider_of_mesh(saved(tmp_path / "a.glb", parts))
        assert is_watertight(found.mesh.faces) and len(found.parts) == 2
        assert volume(found.mesh.vertices, found.mesh.faces) == pytest.approx(0.002, rel=1e-5)


def test_a_background_is_met_as_its_skin(tmp_path):
    parts = {"room": box(0, (4, 3, 4)), "UCX_room": box(0, (4, 3, 4)), "UCX_chair": box(1)}
    found = collider_of_mesh(saved(tmp_path / "a.glb", parts), Making(hollow=True))
    assert len(found.mesh.faces) == 12 and len(found.parts) == 1


@pytest.mark.parametrize("count", [1, 16, 17, 400])
def test_more_pieces_than_an_engine_can_hold_are_refused(tmp_path, count):
    path = saved(tmp_path / "a.glb", {f"UCX_{i:03}": box(i * 0.2) for i in range(count)})
    if count <= 16:
        assert len(collider_of_mesh(path).parts) == count
        return
    with pytest.raises(BadFile, match=rf"a.glb has {count} convex pieces .* at most 16"):
        collider_of_mesh(path)


@pytest.mark.parametrize("kind", ["flat", "line", "many corners"])
def test_pieces_that_no_engine_can_hold_are_mended_or_refused(tmp_path, kind):
    if kind == "many corners":
        parts = {"UCX_a": creation.icosphere(4, 0.1)}
    else:
        size = (0.1, 0.1, 0.0) if kind == "flat" else (0.1, 0.0, 0.0)
        parts = {"skin": box(0), "UCX_a": box(0, size), "UCX_b": box(0)}
    path = saved(tmp_path / "a.glb", parts)
    try:
        found = collider_of_mesh(path)
    except BadFile as refused:
        assert "\n" not in str(refused)
        return
    assert all(4 <= len(hull) <= 64 for hull in found.parts) and parts_volume(found) > 0


def test_flat_pieces_without_a_skin_are_one_sentence(tmp_path):
    path = saved(tmp_path / "a.glb", {"UCX_a": box(0, (0.1, 0.1, 0.0))})
    with pytest.raises(BadFile, match="convex piece that is flat"):
        collider_of_mesh(path)


@pytest.mark.parametrize("name", [None, 7, ["UCX_"], "\ud800UCX_", "x" * 10**6])
def test_names_that_are_none(tmp_path, name):
    path = saved(tmp_path / "a.glb", {"UCX_a": box(0)})
    data = path.read_bytes()
    size = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + size])
    for row in (*tree["meshes"], *tree["nodes"]):
        row["name"] = name
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    head = data[:8] + (len(data) - size + len(text)).to_bytes(4, "little")
    path.write_bytes(
        head + len(text).to_bytes(4, "little") + data[16:20] + text + data[20 + size :]
    )
    assert read_pieces(path) is None
    assert len(collider_of_mesh(path, Making(kept=False)).parts) == 1


def test_faces_of_a_hull_look_outwards():
    points = np.random.default_rng(0).normal(size=(40, 3)).astype(np.float32)
    faces = hull_faces(points)
    assert is_watertight(faces)
    assert volume(points, faces) == pytest.approx(trimesh.Trimesh(points).convex_hull.volume)


def test_what_is_made_of_one_thing_is_made_once(monkeypatch, tmp_path):
    """One mesh file whatever the models, one model at one x; another x is another collider."""
    from shapeshift.scene.colliders import collider_files
    from shapeshift.scene.document.scene_file import HULLS, SceneFile, SceneItem

    made = []
    monkeypatch.setattr(
        collider_files, "one_collider", lambda file, item, *_: made.append(item.name) or item.name
    )
    model, other = object(), object()
    of_mesh = [SceneItem(name=f"mesh {i}", model=f"{i}.ply", collider="a.glb") for i in range(2)]
    of_hulls = [
        SceneItem(name=f"hulls {i}", model="0.ply", collider=HULLS, x=x)
        for i, x in enumerate((0.5, 0.5, 0.6))
    ]
    bare = SceneItem(name="bare", model="0.ply")
    file = SceneFile(folder=tmp_path, items=(*of_mesh, *of_hulls, bare))
    models = {item.name: model for item in file.items} | {"mesh 1": other}
    found = collider_files.colliders_of(file, models)
    assert made == ["mesh 0", "hulls 0", "hulls 2"]
    assert found == {
        "mesh 0": "mesh 0", "mesh 1": "mesh 0", "hulls 0": "hulls 0", "hulls 1": "hulls 0",
        "hulls 2": "hulls 2",
    }  # fmt: skip


# What is shipped


def test_the_touch_scene_needs_no_collider_to_be_made(monkeypatch):
    """Somebody who opens it for the first time waits for none: CoACD takes 40 s for the ring."""
    from shapeshift.scene.colliders.collider_files import one_collider
    from shapeshift.scene.document.scene_file import read_models

    monkeypatch.setattr("shapeshift.scene.colliders.convex_parts.run_coacd", None)
    monkeypatch.setattr("shapeshift.scene.colliders.collider.wrap", None)
    file = read_scene_file(EXAMPLES / "touch.scene.json")
    file, models = read_models(file)
    made = {i.name: one_collider(file, i, models[i.name], Making(kept=False))
            for i in file.all_items}  # fmt: skip
    assert {name: len(c.parts) for name, c in made.items()} == {
        "background": 1, "cube": 1, "ball": 1, "ring": 7, "plate": 1}  # fmt: skip


@pytest.mark.slow
def test_the_shipped_colliders_are_what_the_program_makes(tmp_path):
    from tools.synthetic.tabletop import write_colliders, write_example

    write_example(tmp_path)
    write_colliders(tmp_path)
    for name in ("ball", "ring"):
        made, kept = (collider_of_mesh(f / f"touch/{name}.glb") for f in (tmp_path, EXAMPLES))
        assert parts_volume(made) == pytest.approx(parts_volume(kept), rel=0.05)
        one, two = (solid(c) for c in (made, kept))
        assert one.volume == pytest.approx(two.volume, rel=0.01)
        np.testing.assert_allclose(one.center_mass, two.center_mass, atol=1e-4)
