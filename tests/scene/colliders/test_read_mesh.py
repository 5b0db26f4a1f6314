"""Meshes from files: what is taken out of each format, and that damage is one sentence."""

import struct

import numpy as np
import pytest
import trimesh

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.colliders.read_mesh import read_mesh
from shapeshift.scene.colliders.triangle_mesh import joined, unique_rows

BOX = trimesh.creation.box((1.0, 2.0, 3.0))
ENDINGS = ("obj", "ply", "stl", "glb")
TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def exported(path, ending: str, **options):
    file = path / f"box.{ending}"
    file.write_bytes(as_bytes(BOX.export(file_type=ending, **options)))
    return file


def as_bytes(data: str | bytes) -> bytes:
    return data.encode() if isinstance(data, str) else data


@pytest.mark.parametrize(
    ("ending", "options"),
    [
        *((ending, {}) for ending in ENDINGS),
        ("stl_ascii", {}),
        ("ply", {"encoding": "ascii"}),
        ("ply", {"vertex_normal": True}),
    ],
)
def test_a_box_of_trimesh(tmp_path, ending, options):
    file = exported(tmp_path, ending, **options)
    file = file.rename(file.with_suffix(f".{ending[:3]}"))
    mesh = read_mesh(file)
    assert (len(mesh.vertices), len(mesh.faces)) == (8, 12)
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert solid.volume == pytest.approx(6, rel=1e-5) and solid.is_watertight


def test_equal_rows_are_joined_as_numpy_joins_them():
    """Its unique() of axis 0, and 0, 1, many rows; -0, denormals and 0 side by side."""
    draw = np.random.default_rng(0)
    for count in (0, 1, 400):
        rows = draw.choice(np.array([-2, -1e-45, 0, 1e-45, 3], np.float32), (count, 3))
        found, same = unique_rows(rows)
        wanted, rank = np.unique(rows, axis=0, return_inverse=True)
        np.testing.assert_array_equal(found, wanted, strict=True)
        np.testing.assert_array_equal(same, rank.reshape(-1))
    corners = np.array([(0, 0, 0), (-0.0, 0, 0), (1, 0, 0), (9, 9, 9), (0, 1, 0)], np.float32)
    mesh = joined(corners, np.array([(0, 2, 4), (1, 0, 2), (1, 4, 2)]), "a")
    assert mesh.vertices.tolist() == [[0, 0, 0], [0, 1, 0], [1, 0, 0]]  # none of no face
    assert mesh.faces.tolist() == [[0, 2, 1], [0, 1, 2]]


def test_glb_is_turned_as_its_splats_are(tmp_path):
    """glTF's axes are left, up, front; ours right, up, back."""
    mesh = trimesh.Trimesh([(1, 0, 0), (0, 2, 0), (0, 0, 3)], [(0, 1, 2)], process=False)
    (tmp_path / "a.glb").write_bytes(mesh.export(file_type="glb"))
    read = read_mesh(tmp_path / "a.glb")
    found = {tuple(row) for row in (read.vertices + 0.0).tolist()}
    assert found == {(-1, 0, 0), (0, 2, 0), (0, 0, -3)}


@pytest.mark.parametrize(
    "text",
    [
        b"# W\xfcrfel\ng W\xfcrfel\nusemtl \xff\xfe\n" + TRIANGLE,
        TRIANGLE.replace(b"\n", b"\r\n"),
        TRIANGLE.replace(b"\n", b"\r"),
        b"mtllib /etc/passwd\n" + TRIANGLE,
        TRIANGLE.replace(b"v 1 0 0", b"v 1 \\\n0 0"),
    ],
)
def test_letters_and_line_ends_of_an_obj(tmp_path, text):
    (tmp_path / "a.obj").write_bytes(text)
    assert len(read_mesh(tmp_path / "a.obj").faces) == 1


PLY = (
    b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    b"property float z\nelement face 1\n%s\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)
BROKEN = {
    "empty": ("a.obj", b"", "is empty"),
    "no line": ("a.obj", b"hello\n", "no line of an .obj"),
    "two numbers": ("a.obj", TRIANGLE.replace(b"v 1 0 0", b"v 0 0"), "mesh|vertices|damaged"),
    "two each": ("a.obj", b"v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", "vertices of 2 numbers"),
    "beyond": ("a.obj", TRIANGLE.replace(b"f 1 2 3", b"f 1 2 9"), "damaged"),
    "no property": ("a.ply", PLY % b"property", "damaged|cannot be read"),
    "odd list": ("a.ply", PLY % b"property list uchar", "damaged|cannot be read"),
    "no type": ("a.ply", PLY % b"property what vertex_indices", "damaged|cannot be read"),
    "no header": ("a.ply", b"ply\nformat ascii 1.0\n", "no PLY header"),
    "an empty STL": ("a.stl", bytes(84), "promises 0 triangles"),
    "a picture": ("a.stl", b"\x89PNG\r\n\x1a\n" + bytes(300), "promises 0 triangles"),
    "not one": ("a.fbx", b"Kaydara", "is no mesh that is read here"),
}


@pytest.mark.parametrize("how", BROKEN)
def test_broken_meshes_are_one_sentence(tmp_path, how):
    name, data, words = BROKEN[how]
    (tmp_path / name).write_bytes(data)
    with pytest.raises(BadFile, match=words) as failure:
        read_mesh(tmp_path / name)
    assert "\n" not in str(failure.value) and len(str(failure.value)) < 250


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_mesh_that_is_cut_off_is_one_sentence(tmp_path, ending):
    file = exported(tmp_path, ending)
    whole, refused = file.read_bytes(), 0
    for size in [*range(1, len(whole), max(len(whole) // 50, 1)), len(whole) - 1]:
        file.write_bytes(whole[:size])
        try:
            read_mesh(file)
        except BadFile as failure:
            refused += 1
            assert "\n" not in str(failure)
    assert refused > 25


def test_an_stl_that_is_a_byte_short_says_so(tmp_path):
    file = exported(tmp_path, "stl")
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(BadFile, match="promises 12 triangles and holds 11; it is cut off"):
        read_mesh(file)


def test_an_stl_may_have_any_header(tmp_path):
    """Binary ones that begin with `solid`, as some programs write them."""
    file = exported(tmp_path, "stl")
    file.write_bytes(b"solid box of \xfc".ljust(80, b"\0") + file.read_bytes()[80:])
    assert len(read_mesh(file).faces) == 12
    count = struct.unpack_from("<I", file.read_bytes(), 80)[0]
    assert count == 12 and np.isfinite(read_mesh(file).vertices).all()
