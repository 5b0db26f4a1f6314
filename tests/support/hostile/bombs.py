"""Files of a few bytes that ask for gigabytes, each by a function that writes one into a folder.

BOMBS: what it is -> (who writes it, who reads it).  bomb_run.py reads them and says what they took.
"""

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.package.write_package import package_files
from tests.support.models import make_random_model

BOMBS: dict[str, tuple[Callable[[Path], Path], str]] = {}
PIECE = 1 << 20  # zeros that are packed once


def bomb(reader: str = "model") -> Callable:
    def keep(make: Callable[[Path], Path]) -> Callable:
        BOMBS[make.__name__.replace("_", " ")] = make, reader
        return make

    return keep


def put(path: Path, data: bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return path


def deflated(files: dict[str, bytes], level: int = 9) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=level) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return out.getvalue()


def packed_zeros(count: int, head: bytes = b"") -> bytes:
    """Deflate of a head and zeros after it: one piece of them, packed once, again and again."""
    out = b""
    for data, end in ((head, zlib.Z_FULL_FLUSH), (bytes(PIECE), zlib.Z_FULL_FLUSH),
                      (bytes(count % PIECE), zlib.Z_FINISH)):  # fmt: skip
        packer = zlib.compressobj(9, zlib.DEFLATED, -15)
        packed = packer.compress(data) + packer.flush(end)
        out += packed * (count // PIECE if len(data) == PIECE else 1)
    return out


@cache
def check_of_zeros(check: Callable[[bytes, int], int], count: int, head: bytes) -> int:
    """zlib's crc32 or adler32 of a head and zeros after it."""
    value, zeros = check(head, 1 if check is zlib.adler32 else 0), bytes(PIECE)
    for _ in range(count // PIECE):
        value = check(zeros, value)
    return check(bytes(count % PIECE), value)


def gzip_of_zeros(count: int, head: bytes = b"") -> bytes:
    end = struct.pack("<2L", check_of_zeros(zlib.crc32, count, head), len(head) + count)
    return b"\x1f\x8b\x08" + bytes(6) + b"\xff" + packed_zeros(count, head) + end


def npz_of_zeros(**shapes: tuple[tuple[int, ...], str]) -> bytes:
    """An .npz of arrays of zeros: none of them is ever whole in memory, nor packed as a whole."""
    out, table = b"", b""
    for name, (shape, kind) in shapes.items():
        text = io.BytesIO()
        header = {"descr": kind, "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(text, header)
        count, head = int(np.prod(shape)) * np.dtype(kind).itemsize, text.getvalue()
        packed, named = packed_zeros(count, head), f"{name}.npy".encode()
        check = check_of_zeros(zlib.crc32, count, head)
        entry = struct.pack("<5H3L2H", 20, 0, zipfile.ZIP_DEFLATED, 0, 33, check, len(packed),
                            len(head) + count, len(named), 0)  # fmt: skip
        table += (
            b"PK\1\2" + struct.pack("<H", 20) + entry + struct.pack("<3H2L", 0, 0, 0, 0, len(out))
        )
        table += named
        out += b"PK\3\4" + entry + named + packed
    count = len(shapes)
    return (
        out + table + b"PK\5\6" + struct.pack("<4H2LH", 0, 0, count, count, len(table), len(out), 0)
    )


def package(folder: Path, k: int = 1, features: int = 16, **changed: bytes) -> Path:
    model = make_random_model(anchors=3, k=k, features=features, hidden=(4,))
    files = package_files(model, "float32") | {
        name.replace("_", "."): data for name, data in changed.items()
    }
    return put(folder / "a.shift", deflated(files))


# Packages


@bomb()
def package_of_600_000_anchors_of_1000_bytes(folder: Path) -> Path:
    """A zip in a zip: 55 kB that took 10 GB."""
    ends = {"feature_range": ((2, 1000), "<f4")}
    npz = npz_of_zeros(positions=((600_000, 3), "<f4"), features=((600_000, 1000), "|u1"), **ends)
    return package(folder, features=1000, anchors_npz=npz)


@bomb()
def package_of_45_million_anchors(folder: Path) -> Path:
    npz = npz_of_zeros(positions=((45_000_000, 3), "<f4"), features=((45_000_000, 1), "<f2"))
    return package(folder, features=1, anchors_npz=npz)


@bomb()
def package_of_a_billion_splats(folder: Path) -> Path:
    """Few anchors of 4096 splats each: what would be drawn counts, too."""
    npz = npz_of_zeros(positions=((250_000, 3), "<f4"), features=((250_000, 1), "<f4"))
    return package(folder, k=4096, features=1, anchors_npz=npz)


@bomb()
def manifest_of_empty_lists(folder: Path) -> Path:
    return package(folder, scene_json=b"[" + b"[]," * ((15 << 20) // 3) + b"0]")


@bomb()
def network_of_empty_nodes(folder: Path) -> Path:
    graph = b"\x0a\x00" * 8_000_000
    size, length = len(graph), b""
    while size:
        length, size = length + bytes([size & 127 | (128 if size > 127 else 0)]), size >> 7
    return package(folder, color_onnx=b"\x3a" + length + graph)


@bomb()
def network_of_one_matrix_ten_thousand_times(folder: Path) -> Path:
    import onnx
    from onnx import TensorProto, helper

    side, count = 1000, 3000
    matrix = TensorProto(dims=[side, side], data_type=1, raw_data=bytes(4 * side * side), name="m")
    nodes, last = [], "in"
    for i in range(count):
        nodes += [
            helper.make_node("MatMul", [last, "m"], [f"a{i}"]),
            helper.make_node("Relu", [f"a{i}"], [f"b{i}"]),
        ]
        last = f"b{i}"
    value = [helper.make_tensor_value_info(n, TensorProto.FLOAT, None) for n in ("in", last)]
    graph = helper.make_graph(nodes, "g", value[:1], value[1:], [matrix])
    return package(folder, color_onnx=onnx.helper.make_model(graph).SerializeToString())


@bomb()
def npz_of_half_a_million_members(folder: Path) -> Path:
    """The list of a zip's members in a zip: each of its 47 bytes packs to none."""
    entry = struct.pack("<4s4B4HL2L5H2L", b"PK\1\2", *[20, 0, 20, 0], *[0] * 4, 0, 0, 0, 1,
                        *[0] * 4, 0, 0) + b"a"  # fmt: skip
    count = 500_000
    end = struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 0xFFFF, 0xFFFF, count * len(entry), 0, 0)
    return package(folder, anchors_npz=entry * count + end)


@bomb()
def package_packed_twice_as_well_as_deflate_can(folder: Path) -> Path:
    path, files = folder / "a.shift", package_files(make_random_model(3, 1, 0, 16, (4,)), "float32")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_BZIP2) as archive:
        for name, data in files.items():
            archive.writestr(name, bytes(160 << 20) if name == "anchors.npz" else data)
    return path


# Files of splats


def spz_zeros(version: int, count: int, degree: int) -> bytes:
    widths = (9, 1, 3, 3, 3 if version < 3 else 4, 3 * (0, 3, 8, 15)[degree])
    head = struct.pack("<4sIIBBBB", b"NGSP", version, count, degree, 12, 0, 0)
    if version < 4:
        return gzip_of_zeros(sum(widths) * count, head)
    import zstandard

    packed = []
    for width in filter(None, widths):
        packer = zstandard.ZstdCompressor(level=3).compressobj()
        data, left = b"", width * count
        while left:
            part = min(left, 1 << 20)
            data, left = data + packer.compress(bytes(part)), left - part
        packed.append((data + packer.flush(), width * count))
    table = b"".join(struct.pack("<QQ", len(data), size) for data, size in packed)
    head = struct.pack("<4sIIBBBBI12x", b"NGSP", 4, count, degree, 12, 0, len(packed), 32)
    return head + table + b"".join(data for data, _ in packed)


@bomb()
def spz_of_zeros_in_gzip(folder: Path) -> Path:
    return put(folder / "a.spz", spz_zeros(3, 12_000_000, 3))


@bomb()
def spz_of_zeros_in_zstd(folder: Path) -> Path:
    return put(folder / "a.spz", spz_zeros(4, 12_000_000, 3))


@bomb()
def spz_whose_stream_looks_back_on_128_mb(folder: Path) -> Path:
    """A frame's header may ask for any window, whatever comes."""
    count, sizes = 4, (36, 4, 12, 12, 16)
    frames = [b"\x28\xb5\x2f\xfd\x00\x88" + b"\x01\x00\x00" for _ in sizes]  # 2^27, no blocks
    table = b"".join(struct.pack("<QQ", len(f), s) for f, s in zip(frames, sizes, strict=True))
    head = struct.pack("<4sIIBBBBI12x", b"NGSP", 4, count, 0, 12, 0, len(sizes), 32)
    return put(folder / "a.spz", head + table + b"".join(frames))


def solid_webp(side: int) -> bytes:
    from PIL import Image

    out = io.BytesIO()
    Image.new("RGBA", (side, side), (128, 128, 128, 255)).save(out, "WEBP", lossless=True)
    return out.getvalue()


@bomb()
def sog_of_16_million_splats_in_one_colour(folder: Path) -> Path:
    from tests.support.splats.sog_scenes import random_sog

    meta, pictures = random_sog(20)
    packed = solid_webp(4096)
    files = {name: packed for name in pictures}
    meta["count"] = 1 << 24
    return put(folder / "a.sog", deflated({"meta.json": json.dumps(meta).encode(), **files}))


@bomb()
def sog_whose_meta_is_empty_lists(folder: Path) -> Path:
    text = b'{"means": {}, "a": [' + b"[]," * ((4 << 20) // 3 - 20) + b"0]}"
    return put(folder / "a.sog", deflated({"meta.json": text}))


@bomb()
def glb_of_one_mesh_on_forty_thousand_nodes(folder: Path) -> Path:
    from tests.support.splats.gltf_files import make_asset, splat_arrays, write_glb

    asset, data = make_asset(splat_arrays(400, 3))
    asset["nodes"] = [{"mesh": 0}] * 40_000
    asset["scenes"] = [{"nodes": list(range(40_000))}]
    return write_glb(folder / "a.glb", asset, data)


@bomb()
def glb_with_spz_of_zeros(folder: Path) -> Path:
    from tests.support.splats.gltf_files import write_glb

    data = spz_zeros(2, 8_000_000, 3)
    spz = {"KHR_gaussian_splatting_compression_spz_2": {"bufferView": 0}}
    primitive = {"attributes": {}, "extensions": {"KHR_gaussian_splatting": {"extensions": spz}}}
    asset = {
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}], "buffers": [{"byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteLength": len(data)}],
    }  # fmt: skip
    return write_glb(folder / "a.glb", asset, data)


@bomb()
def scaffold_of_one_layer_ten_thousand_times(folder: Path) -> Path:
    import tests.support.splats.torch_files as torch_files
    from tests.support.splats.scaffold_scenes import random_raw, write_run

    run = write_run(random_raw(6, 2, 4), folder / "run", "split")
    side, count = 600, 1500
    body = {
        f"{2 * i}.{what}": torch_files.tensor("0", side * side, size, stride)
        for i in range(count)
        for what, size, stride in (("weight", (side, side), (side, 1)), ("bias", (side,), (1,)))
    }
    index = torch_files.program(torch_files.dictionary(body))
    numbers = bytes(4 * side * side)
    put(run / "opacity_mlp.pt", torch_files.archive(index, {"0": numbers}))
    return run


# What comes with captures


@bomb("points")
def points_of_30_million(folder: Path) -> Path:
    return put(folder / "points.npz", npz_of_zeros(xyz=((30_000_000, 3), "<f4")))


@bomb("capture")
def frames_that_each_repeat_what_is_said_for_all(folder: Path) -> Path:
    """60,000 frames of nothing under 60,000 keys: each frame would have had them all."""
    keys = ",".join(f'"k{i}":0' for i in range(60_000))
    frames = ",".join(["{}"] * 60_000)
    return put(folder / "transforms.json", f'{{{keys},"frames":[{frames}]}}'.encode()).parent


def png_of_one_colour(side: int, gray: bool = False) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    count = side * (1 + side * (2 if gray else 3))
    check = struct.pack(">L", check_of_zeros(zlib.adler32, count, b""))
    rows = b"\x78\xda" + packed_zeros(count) + check
    head = struct.pack(">IIBBBBB", side, side, 16 if gray else 8, 0 if gray else 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


@bomb("photo")
def photo_of_one_colour(folder: Path) -> Path:
    """11,000 x 11,000 pixels in 350 kB; the largest that is taken on trust is 8.4 million."""
    return put(folder / "a.png", png_of_one_colour(11_000))


@bomb("photo")
def photo_as_large_as_one_may_be_whatever_its_bytes(folder: Path) -> Path:
    return put(folder / "a.png", png_of_one_colour(2896))


@bomb("trained")
def training_photo_of_one_colour(folder: Path) -> Path:
    put(folder / "a.png", png_of_one_colour(11_000))
    return put(folder / "photo.json", b"{}")


@bomb("trained")
def training_photo_as_large_as_one_may_be(folder: Path) -> Path:
    put(folder / "a.png", png_of_one_colour(2896))
    return put(folder / "photo.json", b"{}")


@bomb("trained")
def mask_of_one_colour(folder: Path) -> Path:
    """Of a photo of 64 pixels; a mask may have as many as its photo, however few its bytes."""
    put(folder / "a.png", png_of_one_colour(8))
    put(folder / "mask.png", png_of_one_colour(11_000))
    return put(folder / "photo.json", b"{}")


@bomb("trained")
def lens_that_makes_much_of_a_small_photo(folder: Path) -> Path:
    """5.8 million pixels of one colour become 15.8 million straight ones."""
    put(folder / "a.png", png_of_one_colour(2400))
    params = [2400 / 2.1, 2400 / 2.1, 1200.0, 1200.0, 0.0, 0.0, 0.0, 0.0]
    return put(folder / "photo.json", json.dumps({"fisheye": params}).encode())


@bomb("depth")
def depth_photo_of_one_distance(folder: Path) -> Path:
    return put(folder / "a.png", png_of_one_colour(11_000, gray=True))


@bomb("mesh")
def mesh_of_twenty_thousand_materials(folder: Path) -> Path:
    """A reader of materials takes a minute and a half over these 440 kB."""
    text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n" + b"".join(
        b"usemtl a%d\nf 1 2 3\n" % i for i in range(20_000)
    )
    return put(folder / "a.obj", text)


@bomb("mesh")
def mesh_of_ascii_faces(folder: Path) -> Path:
    head = b"ply\nformat ascii 1.0\nelement vertex 3\n" + b"".join(
        b"property float %c\n" % axis for axis in b"xyz"
    )
    head += b"element face 2000000\nproperty list uchar int vertex_indices\nend_header\n"
    return put(folder / "a.ply", head + b"0 0 0\n1 0 0\n0 1 0\n" + b"3 0 1 2\n" * 2_000_000)


@bomb("scene")
def scene_file_of_empty_lists(folder: Path) -> Path:
    text = b'{"objects": [], "a": [' + b"[]," * 3_000_000 + b"0]}"
    return put(folder / "a.scene.json", text)


@bomb("cameras")
def cameras_of_empty_lists(folder: Path) -> Path:
    return put(folder / "cameras.json", b"[" + b"[]," * 3_000_000 + b"0]")


@bomb()
def points_ply_of_bytes(folder: Path) -> Path:
    count = 8_000_000
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n"
    head += "".join(f"property uchar {axis}\n" for axis in "xyz") + "end_header\n"
    return put(folder / "a.ply", head.encode() + bytes(3 * count))
