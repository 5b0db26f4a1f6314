"""glTF files that lie: each is refused in one sentence, and nothing large is allocated."""

import json
import os
import struct
import tracemalloc

import numpy as np
import pytest

from shapeshift.runtime_models.files.memory import A_BYTE, FREE
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.gltf.gltf_files import MOST_MARKS, parse_asset
from shapeshift.runtime_models.splats.gltf.read_gltf import read_raw_gltf
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.spz.write_spz import write_spz
from tests.support.splats.gltf_files import (
    P,
    as_data_uri,
    glb,
    make_asset,
    plain_splats,
    splat_arrays,
    write_glb,
)

HUGE = 1 << 60
ATTRIBUTES = "meshes.0.primitives.0.attributes."


def raw(path):
    return read_raw_gltf(path, Reading())


def refused(path, words: str) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(BadFile, match=words) as caught:
            raw(path)
        most = A_BYTE * path.stat().st_size + FREE + (1 << 20)  # and some objects of Python
        assert tracemalloc.get_traced_memory()[1] < most
    finally:
        tracemalloc.stop()
    assert path.name in str(caught.value) and "\n" not in str(caught.value)


def change(asset: dict, place: str, value: object) -> dict:
    """The asset with the entry at a path like accessors.0.count set; None takes it away."""
    *way, last = [int(step) if step.isdigit() else step for step in place.split(".")]
    owner = asset
    for step in way:
        owner = owner[step]
    if value is None:
        del owner[last]
    else:
        owner[last] = value
    return asset


CHANGES = [
    ("asset.version", "1.0", "glTF 1.0; 2.0 is read"),
    ("asset", None, "without a version"),
    ("asset", 7, "'asset' is 7; an object"),
    ("extensionsRequired", ["KHR_draco_mesh_compression"], "needs the extension KHR_draco"),
    ("extensionsRequired", [["x"]], "needs the extension"),
    ("accessors.0.count", HUGE, "promises|of memory"),
    ("accessors.0.count", 6, "of splats|promises 6|6 rows|it is cut off"),
    ("accessors.1.count", 4, "ROTATION has 4 rows, POSITION has 5"),
    ("accessors.0.count", -1, "whole number from 0"),
    ("accessors.0.count", 2.5, "whole number"),
    ("accessors.0.count", True, "whole number"),
    ("accessors.0.byteOffset", HUGE, "cut off"),
    ("accessors.0.byteOffset", -4, "whole number"),
    ("accessors.0.type", "MAT4", "expected 3 numbers"),
    ("accessors.0.type", ["VEC3"], "expected 3 numbers"),
    ("accessors.0.componentType", 5130, "which is none"),
    ("accessors.0.componentType", [5126], "which is none"),
    ("accessors.0.sparse", {"count": 1}, "sparse"),
    ("accessors.0.bufferView", None, "sparse or an empty"),
    ("accessors.0.bufferView", 99, "there is none"),
    ("accessors.0.bufferView", -1, "there is none"),
    ("accessors.0.bufferView", "0", "there is none"),
    ("accessors.0.normalized", "yes", "true or false"),
    ("accessors.0", 5, "there is none"),
    ("accessors", {}, "a list is wanted"),
    ("bufferViews.0.byteLength", HUGE, "it is cut off"),
    ("bufferViews.0.byteLength", 59, "it is cut off"),
    ("bufferViews.0.byteOffset", 10**400, "whole number"),
    ("bufferViews.0.byteStride", 8, "stride of 8 bytes for 12"),
    ("bufferViews.0.byteStride", HUGE, "cut off"),
    ("bufferViews.0.buffer", 1, "there is none"),
    ("bufferViews.0.extensions", {"EXT_meshopt_compression": {}}, "meshopt"),
    ("buffers.0.byteLength", HUGE, "cut off"),
    ("buffers", [], "there is none"),
    ("meshes.0.primitives.0.attributes.POSITION", 77, "there is none"),
    ("meshes.0.primitives.0.attributes.POSITION", None, "no POSITION"),
    (ATTRIBUTES + P + "SCALE", None, "has no KHR.*:SCALE"),
    (ATTRIBUTES + P + "SH_DEGREE_0_COEF_0", None, "degree 1 or below"),
    (ATTRIBUTES + P + "SH_DEGREE_1_COEF_1", None, "degree 1 or below"),
    ("meshes.0.primitives.0.extensions", {}, "dropped KHR_gaussian_splatting"),
    ("meshes.0.primitives.0.extensions.KHR_gaussian_splatting", 3, "an object in braces is wanted"),
    ("meshes.0.primitives", [3], "that is no object"),
    ("meshes.0", None, "there is none"),
    ("nodes.0.mesh", 1.0, "there is none"),
    ("nodes.0.scale", [0, 0, 0], "to a plane or to nothing"),
    ("nodes.0.scale", [1, 1], "3 finite numbers"),
    ("nodes.0.translation", [1e39, 0, 0], "3 finite numbers"),
    ("nodes.0.rotation", ["a", 0, 0, 1], "4 finite numbers"),
    ("nodes.0.matrix", [0] * 15, "16 finite numbers"),
    ("nodes.0.children", [0], "on two nodes or on itself"),
    ("nodes.0.children", [[]], "there is none"),
    ("scenes.0.nodes", [5], "there is none"),
    ("scenes.0.nodes", [0, 0], "on two nodes"),
    ("scene", 9, "there is none"),
]  # fmt: skip


@pytest.mark.parametrize(("place", "value", "words"), CHANGES)
def test_an_entry_that_lies(tmp_path, place, value, words):
    asset, data = make_asset(splat_arrays(5, 1))
    refused(write_glb(tmp_path / "lie.glb", change(asset, place, value), data), words)


@pytest.mark.parametrize(
    "uri",
    [
        "../outside.bin", "/etc/hostname", "%2e%2e/outside.bin", "http://example.org/a.bin",
        "file:///etc/hostname", "C:\\a.bin", "..\\outside.bin", "below/../../outside.bin", "", "\0",
        "a" * 5000, "link.bin", "folder", "missing.bin", "\ud800.bin", "\n",
    ],
)  # fmt: skip
def test_nothing_outside_the_folder_is_opened(tmp_path, uri):
    inside = tmp_path / "inside"
    (inside / "folder").mkdir(parents=True)
    asset, data = make_asset(splat_arrays(5))
    (tmp_path / "outside.bin").write_bytes(data)
    os.symlink(tmp_path / "outside.bin", inside / "link.bin")
    asset["buffers"][0]["uri"] = uri
    path = inside / "a.gltf"
    path.write_text(json.dumps(asset))
    refused(path, "only files in the same folder|not beside it")


@pytest.mark.parametrize(
    ("uri", "words"),
    [
        ("data:application/octet-stream;base64,AAAA", "has 3 bytes of"),
        ("data:application/octet-stream;base64,A*AA", "damaged"),
        ("data:application/octet-stream;base64,ä", "damaged"),
        ("data:text/plain,hello", "not in base64"),
        ("data:", "not in base64"),
    ],
)
def test_data_uris_that_lie(tmp_path, uri, words):
    asset, _ = make_asset(splat_arrays(5))
    asset["buffers"][0]["uri"] = uri
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(asset))
    refused(path, words)


def test_json_that_is_none_or_too_much(tmp_path):
    deep = b'{"asset":' + b"[" * 100_000 + b"]" * 100_000 + b"}"
    cases = {
        "deep": (deep, "nested too deep|entries"),
        "deeper": (b"[" * 5000 + b"]" * 5000, "nested too deep"),
        "many": (b'{"a":[' + b"[]," * MOST_MARKS + b"1]}", "more than"),
        "digits": (b'{"asset":{"version":' + b"9" * 10_000 + b"}}", "is not JSON|without|glTF 9"),
        "broken": (b'{"asset":', "is not JSON"),
        "bytes": (b'{"asset":"\xff\xfe"}', "is not JSON"),
        "list": (b"[]", "no glTF asset"),
        "text": (b'"x"', "no glTF asset"),
    }
    for name, (text, words) in cases.items():
        refused(write_glb(tmp_path / f"{name}.glb", text), words)
        with pytest.raises(BadFile):
            parse_asset(np.frombuffer(text, np.uint8), name)
            raw(tmp_path / f"{name}.glb")


def test_containers_that_lie(tmp_path):
    good = glb(*make_asset(splat_arrays(5)))
    text = struct.unpack("<I", good[12:16])[0]
    cases = {
        "head": (good[:11], "cut off"),
        "version": (good[:4] + struct.pack("<I", 1) + good[8:], "binary glTF 1"),
        "length": (good[:8] + struct.pack("<I", len(good) + 1) + good[12:], "header says"),
        "chunk": (good[:12] + struct.pack("<I", 0xFFFFFFFF) + good[16:], "beyond its end"),
        "no json": (good[:16] + b"XXXX" + good[20:], "no JSON chunk"),
        "no binary": (glb(good[20 : 20 + text].strip()), "cut off"),
        "tail": (good[:-200], "header says"),
    }
    for name, (data, words) in cases.items():
        path = tmp_path / f"{name}.glb"
        path.write_bytes(data)
        refused(path, words)


def with_nodes(tmp_path) -> dict[str, bytes]:
    """Files with all that is followed: nodes of several kinds, spz within, a data: URI."""
    nodes = [
        {"children": [1, 2], "rotation": [0.5, 0.5, 0.5, 0.5]},
        {"mesh": 0, "scale": [1, 2, 3]},
        {"mesh": 0, "matrix": np.eye(4).ravel().tolist()},
    ]
    asset, data = make_asset(splat_arrays(2))
    asset["nodes"] = nodes
    files = {"a.glb": glb(asset, data)}
    asset["buffers"][0]["uri"] = as_data_uri(data)
    files["b.gltf"] = json.dumps(asset).encode()
    write_spz(plain_splats(5, 1), tmp_path / "c.spz", version=2)
    packed = (tmp_path / "c.spz").read_bytes()
    asset["bufferViews"] = [{"buffer": 0, "byteLength": len(packed)}]
    asset["buffers"] = [{"byteLength": len(packed)}]
    extension = asset["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]
    extension["extensions"] = {"KHR_gaussian_splatting_compression_spz_2": {"bufferView": 0}}
    extension["colorSpace"] = "lin_rec709_display"
    return files | {"c.glb": glb(asset, packed)}


@pytest.mark.filterwarnings("error")
def test_every_cut_and_every_flipped_byte_is_a_scene_or_a_sentence(tmp_path):
    opened, rng = 0, np.random.default_rng(0)
    for name, good in with_nodes(tmp_path).items():
        path = tmp_path / name
        for step in range(500):
            data = bytearray(good)
            if step % 3 == 0:
                data = data[: rng.integers(0, len(data))]
            for place in rng.integers(0, len(data), 1 + step % 4 if len(data) else 0):
                data[place] = rng.integers(32, 127) if step % 2 else rng.integers(0, 256)
            path.write_bytes(bytes(data))
            try:
                splats = raw(path)
            except BadFile as refusal:
                assert str(refusal)
            else:
                opened += 1
                assert len(splats.means) == len(splats.sh) <= 100
    assert opened > 20


def test_few_bytes_do_not_become_many_splats(tmp_path):
    """A mesh of 2,000 splats on 2,000 nodes would be a gigabyte."""
    asset, data = make_asset(splat_arrays(2000, 3))
    asset["nodes"] = [{"mesh": 0}] * 2000
    asset["scenes"] = [{"nodes": list(range(2000))}]
    refused(write_glb(tmp_path / "many.glb", asset, data), "of memory")
    small, more = make_asset(splat_arrays(3))
    for accessor in small["accessors"]:
        accessor |= {"count": 1 << 40}
    refused(write_glb(tmp_path / "count.glb", small, more), "of memory|cut off")
