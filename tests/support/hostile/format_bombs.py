"""Further BOMBS (bombs.py): packed files in packed files, checkpoints, and what LCC repeats."""

import gzip
import json
import struct
import zipfile
from pathlib import Path

import numpy as np

import tests.support.splats.torch_files as torch_files
from tests.support.hostile.bombs import (
    bomb,
    deflated,
    gzip_of_zeros,
    npz_of_zeros,
    package,
    put,
    spz_zeros,
)
from tests.support.splats.lcc_files import write_lcc, write_lcc2

NAMES = ("x", "y", "z", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2",
         "rot_3", "f_dc_0", "f_dc_1", "f_dc_2")  # fmt: skip


@bomb()
def package_of_150_bytes_for_each_of_its_own(folder: Path) -> Path:
    """Between what a real scene takes and the bombs above: a limit of 256 would let it in."""
    noise = np.random.default_rng(0).integers(0, 256, 3_000_000, np.uint8).tobytes()
    npz = npz_of_zeros(positions=((3_000_000, 3), "<f4"), features=((3_000_000, 16), "<f2"))
    return package(folder, anchors_npz=npz, notes_bin=noise)


def gzip_of_a_ply(count: int = 4_000_000) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    lines += [f"property float {name}" for name in NAMES]
    return gzip_of_zeros(4 * len(NAMES) * count, "\n".join([*lines, "end_header", ""]).encode())


@bomb()
def ply_of_zeros_in_gzip(folder: Path) -> Path:
    return put(folder / "a.ply.gz", gzip_of_a_ply())


@bomb()
def spz_of_zeros_in_a_zip(folder: Path) -> Path:
    """gzip of gzip of zeros: 200 bytes of a zip for 770 MB."""
    return put(folder / "a.zip", deflated({"a.spz": spz_zeros(3, 12_000_000, 3)}))


@bomb()
def gzip_in_gzip_in_gzip(folder: Path) -> Path:
    return put(folder / "a.gz", gzip.compress(gzip.compress(gzip_of_a_ply(), 9), 9))


@bomb()
def npz_of_30_million_splats(folder: Path) -> Path:
    count = 30_000_000
    shapes = {"means": 3, "scales": 3, "quats": 4, "sh0": 3}
    arrays = {name: ((count, wide), "<f4") for name, wide in shapes.items()}
    return put(folder / "a.npz", npz_of_zeros(**arrays, opacities=((count,), "<f4")))


@bomb()
def checkpoint_of_storages_of_zeros(folder: Path) -> Path:
    """torch stores, others may deflate: 100 MB a storage."""
    count, body, files = 8_000_000, {}, {}
    for i, (name, wide) in enumerate((("means", 3), ("scales", 3), ("quats", 4), ("sh0", 3))):
        body[name] = torch_files.tensor(str(i), count * wide, (count, wide), (wide, 1))
        files[f"a/data/{i}"] = bytes(4 * count * wide)
    body["opacities"] = torch_files.tensor("9", count, (count,), (1,))
    files |= {"a/data/9": bytes(4 * count), "a/version": b"3\n"}
    files["a/data.pkl"] = torch_files.program(torch_files.dictionary(body))
    return put(folder / "a.pt", deflated(files, 1))


@bomb()
def checkpoint_of_one_number_a_billion_times(folder: Path) -> Path:
    """Views may repeat what they show: a stride of 0."""
    count = 100_000_000
    body = {
        name: torch_files.tensor("0", 8, (count, wide), (0, 1))
        for name, wide in (("means", 3), ("scales", 3), ("quats", 4), ("sh0", 3))
    }
    body["opacities"] = torch_files.tensor("0", 8, (count,), (0,))
    index = torch_files.program(torch_files.dictionary(body))
    return put(folder / "a.pt", torch_files.archive(index, {"0": bytes(32)}))


@bomb()
def lcc_whose_cells_are_all_the_same(folder: Path) -> Path:
    meta = write_lcc(folder / "scene", ((400, 1),), environment=0)
    cell = struct.pack("<2h", 0, 0) + struct.pack("<iqi", 400, 96, 12800) * 2
    put(meta.with_name("index.bin"), cell * 20_000)
    return meta.parent


@bomb()
def lcc2_that_names_one_file_ten_thousand_times(folder: Path) -> Path:
    data = spz_zeros(3, 100_000, 0)
    meta = write_lcc2(folder / "scene", {"0.spz": data}, [[0]], ending=".spz")
    said = json.loads(meta.read_bytes())
    root = said["root"]
    root[next(n for n in ("splatFiles", "files") if n in root)] = ["0.spz"] * 10_000
    nodes = [{"data": {"3dgs": {"name": i}}} for i in range(10_000)]
    root["child"] = nodes
    put(meta, json.dumps(said).encode())
    return meta.parent


@bomb()
def zip_of_sixty_thousand_names(folder: Path) -> Path:
    with zipfile.ZipFile(folder / "a.zip", "w") as archive:
        for i in range(60_000):
            archive.writestr(zipfile.ZipInfo(f"{i}.txt"), b"")
    return folder / "a.zip"
