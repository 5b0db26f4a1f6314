"""What is hostile without being a file at all: pipes, devices, links, folders, names, sizes."""

import os
from collections.abc import Callable
from pathlib import Path

from tests.support.hostile.hostile_files import case, put, scaffold

SPARSE = 5 << 30  # bytes that a file claims and does not take


@case
def pipe(folder: Path) -> Path:
    os.mkfifo(folder / "a.ply")
    return folder / "a.ply"


@case
def pipe_in_a_folder(folder: Path) -> Path:
    (folder / "a").mkdir()
    os.mkfifo(folder / "a/point_cloud.ply")
    return folder / "a"


@case
def pipes_in_a_run(folder: Path) -> Path:
    for name in ("point_cloud_color", "point_cloud_thermal"):
        (folder / f"a/{name}/iteration_1").mkdir(parents=True)
        os.mkfifo(folder / f"a/{name}/iteration_1/point_cloud.ply")
    return folder / "a"


@case
def pipe_as_a_manifest(folder: Path) -> Path:
    (folder / "a").mkdir()
    os.mkfifo(folder / "a/scene.json")
    return folder / "a"


@case
def pipe_as_levels(folder: Path) -> Path:
    (folder / "a").mkdir()
    os.mkfifo(folder / "a/lod-meta.json")
    return folder / "a"


@case
def pipe_as_a_network(folder: Path) -> Path:
    run = scaffold(folder)
    (run / "opacity_mlp.pt").unlink()
    os.mkfifo(run / "opacity_mlp.pt")
    return run


@case
def device(folder: Path) -> Path:
    return Path("/dev/zero")


@case
def link_to_a_device(folder: Path) -> Path:
    (folder / "a.ply").symlink_to("/dev/zero")
    return folder / "a.ply"


@case
def link_to_itself(folder: Path) -> Path:
    (folder / "a.ply").symlink_to(folder / "a.ply")
    return folder / "a.ply"


@case
def link_to_a_secret(folder: Path) -> Path:
    (folder / "a").mkdir()
    (folder / "a/point_cloud.ply").symlink_to("/etc/passwd")
    return folder / "a"


@case
def folder_named_as_a_file(folder: Path) -> Path:
    (folder / "a.ply").mkdir()
    return folder / "a.ply"


@case
def folders_named_as_layers(folder: Path) -> Path:
    (folder / "a/layer0.ply").mkdir(parents=True)
    return folder / "a"


@case
def name_with_a_line_break(folder: Path) -> Path:
    return put(folder / "a\nTraceback.ply", b"no PLY")


def sparse(ending: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = folder / f"a{ending}"
        with path.open("wb") as file:
            file.truncate(SPARSE + 1)
        return path

    make.__name__ = f"five sparse GB of {ending}"
    return make


def empty(ending: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        return put(folder / f"a{ending}", b"")

    make.__name__ = f"empty {ending}"
    return make


ENDINGS = (".ply", ".splat", ".ksplat", ".spz", ".sog", ".glb", ".gltf", ".shift", ".json", ".pth")
for each in ENDINGS:
    case(sparse(each))
    case(empty(each))
