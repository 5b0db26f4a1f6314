"""Files that were made to do harm, each by a function that writes it into a folder."""

import gzip
import io
import json
import os
import pickle
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.package.write_package import package_files, zip_files
from tests.support.hostile.fuzz_mutations import DEEP
from tests.support.models import make_random_model

CASES: dict[str, Callable[[Path], Path]] = {}


def case(make: Callable[[Path], Path]) -> Callable[[Path], Path]:
    CASES[make.__name__.replace("_", " ")] = make
    return make


def put(path: Path, data: bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return path


def good_package() -> dict[str, bytes]:
    return package_files(make_random_model(anchors=3, k=1, features=4, hidden=(4,)), "float16")


class Runs:
    """What unpickling would call."""

    def __reduce__(self):
        return os.system, ("touch harmed",)


# Archives


@case
def zip_bomb(folder: Path) -> Path:
    with zipfile.ZipFile(folder / "a.shift", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, data in good_package().items():
            archive.writestr(name, bytes(64 << 20) if name == "anchors.npz" else data)
    return folder / "a.shift"


@case
def zip_with_a_huge_stated_size(folder: Path) -> Path:
    data = bytearray(zip_files(good_package()))
    for mark, at in ((b"PK\1\2", 24), (b"PK\3\4", 22)):
        place = data.find(mark)
        while place >= 0:
            data[place + at : place + at + 4] = struct.pack("<I", 0xFFFFFFF0)
            place = data.find(mark, place + 4)
    return put(folder / "a.shift", bytes(data))


def renamed(folder: Path, name: str, ending: str = "shift") -> Path:
    files = {f"{name}{key}": value for key, value in good_package().items()}
    return put(folder / f"a.{ending}", zip_files(files))


@case
def zip_slip(folder: Path) -> Path:
    return renamed(folder, "../../slipped/")


@case
def zip_with_absolute_names(folder: Path) -> Path:
    return renamed(folder, "/tmp/absolute/")


@case
def zip_with_windows_names(folder: Path) -> Path:
    return renamed(folder, "\\\\server\\share\\")


@case
def npz_that_unpickles(folder: Path) -> Path:
    arrays = io.BytesIO()
    np.savez(arrays, positions=np.array([Runs()], object), features=np.zeros((1, 4), np.float32))
    return put(folder / "a.shift", zip_files(good_package() | {"anchors.npz": arrays.getvalue()}))


@case
def npz_whose_header_is_a_program(folder: Path) -> Path:
    text = b"__import__('os').system('touch harmed')".ljust(117) + b"\n"
    inner = io.BytesIO()
    with zipfile.ZipFile(inner, "w") as archive:
        for name in ("positions", "features"):
            head = b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text
            archive.writestr(f"{name}.npy", head)
    return put(folder / "a.shift", zip_files(good_package() | {"anchors.npz": inner.getvalue()}))


@case
def npz_with_a_giant_shape(folder: Path) -> Path:
    text = "{'descr': '<f4', 'fortran_order': False, 'shape': (1000000000000, 3), }"
    header = text.encode().ljust(117) + b"\n"
    inner = io.BytesIO()
    with zipfile.ZipFile(inner, "w") as archive:
        for name in ("positions", "features"):
            archive.writestr(f"{name}.npy", b"\x93NUMPY\1\0" + struct.pack("<H", 118) + header)
    return put(folder / "a.shift", zip_files(good_package() | {"anchors.npz": inner.getvalue()}))


def scaffold(folder: Path) -> Path:
    from tests.support.splats.scaffold_scenes import random_raw, write_run

    return write_run(random_raw(6, 2, 4), folder / "run", "split")


@case
def pickle_in_a_network(folder: Path) -> Path:
    run = scaffold(folder)
    with zipfile.ZipFile(run / "opacity_mlp.pt", "w") as archive:
        archive.writestr("archive/data.pkl", pickle.dumps({"0.weight": Runs()}, 2))
    return run


@case
def plain_pickle_as_a_network(folder: Path) -> Path:
    run = scaffold(folder)
    put(run / "opacity_mlp.pt", pickle.dumps(Runs(), 2))
    return run


@case
def pickle_as_a_classifier(folder: Path) -> Path:
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply
    from tests.support.hostile.fuzz_seeds import some_splats

    extra = {f"obj_dc_{i}": np.zeros(4, np.float32) for i in range(16)}
    splats = some_splats(4, 1, extra=extra)
    write_ply(splats, folder / "point_cloud.ply")
    with zipfile.ZipFile(folder / "classifier.pth", "w") as archive:
        archive.writestr("archive/data.pkl", pickle.dumps({"weight": Runs()}, 2))
    return folder


# Networks


def with_network(folder: Path, change: Callable) -> Path:
    import onnx

    files = good_package()
    model = onnx.load_model_from_string(files["color.onnx"])
    change(model, onnx)
    return put(folder / "a.shift", zip_files(files | {"color.onnx": model.SerializeToString()}))


@case
def onnx_with_data_elsewhere(folder: Path) -> Path:
    def change(model, onnx) -> None:
        tensor = model.graph.initializer[0]
        tensor.ClearField("raw_data")
        tensor.ClearField("float_data")
        tensor.data_location = onnx.TensorProto.EXTERNAL
        entry = tensor.external_data.add()
        entry.key, entry.value = "location", "../../../../../../etc/passwd"

    return with_network(folder, change)


@case
def onnx_with_an_unknown_operator(folder: Path) -> Path:
    def change(model, onnx) -> None:
        model.graph.node[0].op_type, model.graph.node[0].domain = "RunCommand", "evil"

    return with_network(folder, change)


@case
def onnx_with_a_loop(folder: Path) -> Path:
    def change(model, onnx) -> None:
        model.graph.node[0].op_type = "Loop"

    return with_network(folder, change)


@case
def onnx_with_a_giant_tensor(folder: Path) -> Path:
    def change(model, onnx) -> None:
        del model.graph.initializer[0].dims[:]
        model.graph.initializer[0].dims.extend([1 << 40, 1 << 20])

    return with_network(folder, change)


@case
def onnx_that_is_none(folder: Path) -> Path:
    return put(folder / "a.shift", zip_files(good_package() | {"color.onnx": b"\x08" * 5000}))


# Text


def nested(dictionary: bool = False) -> bytes:
    deep = 100 * DEEP
    return (b'{"a":' * deep if dictionary else b"[" * deep) + b"0"


@case
def nested_manifest(folder: Path) -> Path:
    return put(folder / "a/scene.json", nested(True)).parent


@case
def nested_meta(folder: Path) -> Path:
    return put(folder / "a/meta.json", b'{"means":' + nested()).parent


@case
def nested_levels(folder: Path) -> Path:
    tree = '{"children":[' * 20000 + "{}" + "]}" * 20000
    text = f'{{"lodLevels": 1, "filenames": [], "tree": {tree}}}'
    return put(folder / "a/lod-meta.json", text.encode()).parent


@case
def nested_gltf(folder: Path) -> Path:
    return put(folder / "a.gltf", b'{"asset":{"version":"2.0"},"meshes":' + nested())


@case
def numbers_without_end(folder: Path) -> Path:
    digits = b"9" * 3_000_000
    text = b'{"lodLevels": ' + digits + b', "filenames": [], "tree": {}}'
    return put(folder / "a/lod-meta.json", text).parent


# Compressed streams and lying counts


def spz_header(count: int, version: int) -> bytes:
    return struct.pack("<4sIIBBBB", b"NGSP", version, count, 3, 12, 0, 0)


@case
def gzip_bomb(folder: Path) -> Path:
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)
    data = packer.compress(spz_header(2_000_000, 3))
    for _ in range(100):
        data += packer.compress(bytes(1 << 20))
    return put(folder / "a.spz", data + packer.flush())


@case
def gzip_of_little(folder: Path) -> Path:
    return put(folder / "a.spz", gzip.compress(spz_header(0xFFFFFFFF, 3), mtime=0))


@case
def zstd_bomb(folder: Path) -> Path:
    import zstandard

    packed = zstandard.ZstdCompressor(level=1).compress(bytes(256 << 20))
    head = struct.pack("<4sIIBBBBI12x", b"NGSP", 4, 100, 0, 12, 0, 5, 32)
    sizes = (900, 100, 300, 300, 400)
    table = b"".join(struct.pack("<QQ", len(packed) if i == 0 else 0, s)
                     for i, s in enumerate(sizes))  # fmt: skip
    return put(folder / "a.spz", head + table + packed)


@case
def ply_of_more_rows_than_bytes(folder: Path) -> Path:
    names = ["x", "y", "z", "opacity", *(f"scale_{i}" for i in range(3)),
             *(f"rot_{i}" for i in range(4)), *(f"f_dc_{i}" for i in range(3))]  # fmt: skip
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 4294967295\n"
    head += "".join(f"property float {name}\n" for name in names) + "end_header\n"
    return put(folder / "a.ply", head.encode() + bytes(56))


@case
def ply_with_an_endless_header(folder: Path) -> Path:
    return put(folder / "a.ply", b"ply\n" + b"comment x\n" * 1_000_000)


@case
def ply_with_a_list(folder: Path) -> Path:
    head = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty list uchar int x\n"
    return put(folder / "a.ply", head + b"end_header\n" + b"\xff" * 400)


@case
def ksplat_of_more_than_its_bytes(folder: Path) -> Path:
    return put(folder / "a.ksplat", b"\x00\x01" + b"\xff" * 5000)


@case
def glb_of_more_than_its_bytes(folder: Path) -> Path:
    accessor = {"componentType": 5126, "count": 1 << 40, "type": "VEC3", "bufferView": 0}
    attributes = {
        name: 0 for name in ("POSITION", *(f"KHR_gaussian_splatting:{n}" for n in
                                           ("ROTATION", "SCALE", "OPACITY", "SH_DEGREE_0_COEF_0")))
    }  # fmt: skip
    asset = {
        "asset": {"version": "2.0"}, "buffers": [{"byteLength": 1 << 40}],
        "bufferViews": [{"buffer": 0, "byteLength": 1 << 40}], "accessors": [accessor],
        "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "mode": 0,
                                    "extensions": {"KHR_gaussian_splatting": {}}}]}],
    }  # fmt: skip
    text = json.dumps(asset).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A)
    return put(folder / "a.glb", head + text)


@case
def gltf_with_a_file_elsewhere(folder: Path) -> Path:
    path = glb_of_more_than_its_bytes(folder)
    asset = json.loads(path.read_bytes()[20:])
    path.unlink()
    asset["buffers"][0]["uri"] = "file:///etc/passwd"
    return put(folder / "a.gltf", json.dumps(asset).encode())


@case
def sog_with_names_elsewhere(folder: Path) -> Path:
    from tests.support.splats.sog_scenes import random_sog, write_folder

    path = write_folder(folder / "sog", *random_sog(4))
    meta = json.loads((path / "meta.json").read_text())
    meta["sh0"]["files"] = ["../../../../etc/passwd"]
    put(path / "meta.json", json.dumps(meta).encode())
    return path


@case
def sog_that_lacks_a_part(folder: Path) -> Path:
    from tests.support.splats.sog_scenes import random_sog, write_folder

    path = write_folder(folder / "sog", *random_sog(4, version=1))
    meta = json.loads((path / "meta.json").read_text())
    del meta["scales"]
    put(path / "meta.json", json.dumps(meta).encode())
    return path


@case
def sog_with_a_picture_bomb(folder: Path) -> Path:
    from tests.support.splats.sog_scenes import random_sog, write_folder

    path = write_folder(folder / "sog", *random_sog(4))
    data = bytearray((path / "sh0.webp").read_bytes())
    if data[12:16] == b"VP8L":
        data[21:25] = struct.pack("<I", 16383 | 16383 << 14)
    put(path / "sh0.webp", bytes(data))
    return path
