"""Good files for the doors of the gate, and who reads each: for the fuzzer of tools/ and of tests/.

Made here, small; of a door whose package is not installed there is none.
"""

import importlib.util
import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from shapeshift.runtime_models.gate.doors import DOORS

RNG = np.random.default_rng


class DoorSeed(NamedTuple):
    door: str
    name: str  # of the file
    data: bytes
    read: Callable[[Path], object]


def seeds(folder: Path) -> Iterator[DoorSeed]:
    """Of every door whose package is here; `folder` is for making them."""
    for door, make in (
        ("thermal photo", thermal), ("points", points), ("mesh", mesh), ("USD", usd),
        ("rare photo", pictures), ("video", video), ("network", network),
    ):  # fmt: skip
        if importlib.util.find_spec(DOORS[door].imports[0].split(".")[0]) is not None:
            yield from make(folder)


def thermal(folder: Path) -> Iterator[DoorSeed]:
    from shapeshift.scene.captures.radiometric.number_photos import radiometric_celsius
    from tests.support.scene.flir_files import write_flir

    celsius = np.linspace(0, 60, 12 * 16).reshape(12, 16)
    for png in (False, True):
        path = write_flir(folder / f"{png}.jpg", celsius, (16, 12), png)
        yield DoorSeed("thermal photo", path.name, path.read_bytes(),
                       lambda path: radiometric_celsius(path, (16, 12)))  # fmt: skip


def points(folder: Path) -> Iterator[DoorSeed]:
    import laspy

    from shapeshift.scene.captures.point_clouds import read_las

    for ending in ("las", "laz"):
        file = laspy.LasData(laspy.LasHeader(point_format=3, version="1.2"))
        file.x, file.y, file.z = RNG(0).uniform(-2, 2, (3, 200))
        file.write(str(folder / f"a.{ending}"))
        yield DoorSeed("points", f"a.{ending}", (folder / f"a.{ending}").read_bytes(),
                       lambda path: read_las(path, 1000))  # fmt: skip


def mesh(folder: Path) -> Iterator[DoorSeed]:
    import trimesh

    from shapeshift.scene.colliders.read_mesh import read_mesh

    ball = trimesh.creation.icosphere(subdivisions=1)
    for ending, more in (("obj", {}), ("ply", {}), ("ply", {"encoding": "ascii"}), ("stl", {}),
                         ("stl_ascii", {})):  # fmt: skip
        data = ball.export(file_type=ending, **more)
        name = f"{len(more)}{ending}.{ending[:3]}"
        yield DoorSeed("mesh", name, data if isinstance(data, bytes) else data.encode(), read_mesh)


def usd(folder: Path) -> Iterator[DoorSeed]:
    from shapeshift.runtime_models.splats.plain_splats import Reading
    from shapeshift.runtime_models.splats.usd.read_usd import read_raw_usd
    from shapeshift.runtime_models.splats.usd.write_usd import write_usd
    from tests.support.splats.ply_files import some_splats

    for ending in ("usda", "usdc", "usdz"):
        path = folder / f"a.{ending}"
        write_usd(some_splats(8, 1), path)
        yield DoorSeed("USD", path.name, path.read_bytes(),
                       lambda path: read_raw_usd(path, Reading()))  # fmt: skip


def pictures(folder: Path) -> Iterator[DoorSeed]:
    from shapeshift.scene.captures.photo import decoded

    colours = RNG(1).integers(0, 255, (24, 32, 3)).astype(np.uint8)
    for ending in ("gif", "avif", "jp2", "tga", "pcx", "sgi", "dds", "ico", "qoi"):
        held = io.BytesIO()
        try:
            Image.fromarray(colours).save(held, format=Image.registered_extensions()[f".{ending}"])
        except (KeyError, OSError, ValueError):  # this Pillow was built without it
            continue
        yield DoorSeed("rare photo", f"a.{ending}", held.getvalue(),
                       lambda path: decoded(path, None))  # fmt: skip
    held = io.BytesIO()
    Image.fromarray(colours).save(held, format="TIFF", compression="jpeg")
    yield DoorSeed("rare photo", "a.tif", held.getvalue(), lambda path: decoded(path, None))


def video(folder: Path) -> Iterator[DoorSeed]:
    import av

    from shapeshift.decomposition.poses.video_frames import take_frames

    for ending, codec in (("mp4", "mpeg4"), ("mkv", "mpeg4"), ("avi", "mjpeg")):
        path = folder / f"a.{ending}"
        with av.open(str(path), "w") as container:
            stream = container.add_stream(codec, rate=10)
            stream.width, stream.height = 64, 48
            stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
            for i in range(4):
                picture = np.full((48, 64, 3), 40 * i, np.uint8)
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
            container.mux(stream.encode())
        yield DoorSeed("video", path.name, path.read_bytes(),
                       lambda path: take_frames(path, path.parent, 2, lambda *_: None))  # fmt: skip


def network(folder: Path) -> Iterator[DoorSeed]:
    from shapeshift.decomposition.masks.sam import Network
    from tests.support.decomposition.sam_stand_ins import write_sam

    write_sam(folder, "sam", 32)

    def run(path: Path) -> object:
        network = Network(path, 1)
        shapes = {name: [n or 1 for n in network.shape(name)] for name in network.inputs}
        if any(np.prod(shape) > 1 << 16 or len(shape) > 6 for shape in shapes.values()):
            return network
        return network.run({name: np.zeros(shape) for name, shape in shapes.items()})

    for name in ("a.encoder.onnx", "a.decoder.onnx"):
        yield DoorSeed("network", name, (folder / name).read_bytes(), run)
