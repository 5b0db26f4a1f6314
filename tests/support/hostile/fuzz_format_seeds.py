"""Further seeds: meshes, scene files, object lists, checkpoints, LCC, files packed once more."""

import gzip
import io
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from tests.support.hostile.fuzz_run import Seed
from tests.support.splats.ply_files import names_of, random_rows, write_rows
from tests.support.touch_scene import TOUCH

Made = Callable[[int, int], PlainSplats]  # of a count and a number of coefficients


def format_seeds(folder: Path, some_splats: Made) -> list[Seed]:
    folder.mkdir(parents=True, exist_ok=True)
    return [
        *mesh_seeds(),
        *act_seeds(),
        *mask_seeds(folder),
        *text_ply_seeds(folder),
        *ksplat_seeds(),
        *lcc_seeds(folder, some_splats),
        *checkpoint_seeds(),
        *packed_seeds(folder, some_splats),
    ]


def mesh_seeds() -> list[Seed]:
    """A box in every form that a collider may have; by trimesh, as it writes them."""
    import trimesh

    from shapeshift.scene.colliders.read_mesh import read_mesh

    box = trimesh.creation.box((1.0, 2.0, 3.0))
    forms = {
        "obj": box.export(file_type="obj").encode(),
        "obj named": b"mtllib a.mtl\no W\xfcrfel\ng a\n" + box.export(file_type="obj").encode(),
        "ply": box.export(file_type="ply"),
        "ply ascii": box.export(file_type="ply", encoding="ascii"),
        "ply normals": box.export(file_type="ply", vertex_normal=True),
        "stl": box.export(file_type="stl"),
        "stl ascii": box.export(file_type="stl_ascii").encode(),
        "glb": box.export(file_type="glb"),
    }
    return [Seed(f"mesh {n}", {f"a.{n[:3]}": data}, read_mesh) for n, data in forms.items()]


def act_seeds() -> list[Seed]:
    """A scene file with all that it may say, and a script."""
    from shapeshift.scene.document.read_scene_file import read_scene_file

    items = read_scene_file(TOUCH).all_items
    script = {"a.jsonl": TOUCH.with_name("touch.jsonl").read_bytes()}
    return [
        Seed(
            "scene file",
            {"a.scene.json": TOUCH.read_bytes()},
            read_scene_file,
        ),
        Seed("script", script, partial(named_script, items=items)),
    ]


def mask_seeds(folder: Path) -> list[Seed]:
    """objects.json, a label map, and a mask of another program."""
    from shapeshift.decomposition.masks.label_maps import read_label_map, read_mask, write_label_map
    from shapeshift.decomposition.masks.specs import (
        ObjectSpec,
        ObjectSpecs,
        PhotoPrompt,
        read_specs,
    )
    from tests.support.decomposition.spec_files import write_specs

    prompts = (PhotoPrompt("rgb/1.png", (1, 2, 30.5, 40), ((3, 4),), ((5, 6),)),
               PhotoPrompt("rgb/2.png", mask="masks/2.png", mask_label=3))  # fmt: skip
    mug = ObjectSpec(1, "mug", prompts, "a mug", 0.3, False, None)
    write_specs(ObjectSpecs(folder, (mug, ObjectSpec(7, "can"))), folder / "objects.json")
    labels = np.zeros((12, 16), np.uint8)
    labels[3:6, 4:9], labels[0, 0] = 3, 255
    write_label_map(labels, folder / "labels.png")
    data = {name: (folder / name).read_bytes() for name in ("objects.json", "labels.png")}
    return [
        Seed("objects", {"objects.json": data["objects.json"]}, read_specs),
        Seed("label map", {"a.png": data["labels.png"]}, lambda p: read_label_map(p, (16, 12))),
        Seed("mask", {"a.png": data["labels.png"]}, lambda p: read_mask(p, (32, 24), 3)),
    ]


def named_script(path: Path, items: tuple) -> tuple:
    from shapeshift.scene.world.read_script import read_script

    return read_script(path, items)


def text_ply_seeds(folder: Path) -> list[Seed]:
    """ASCII, columns with odd names, and splats that move in time."""
    moving = [
        "trbf_center", "trbf_scale", *(f"motion_{i}" for i in range(9)),
        *(f"omega_{i}" for i in range(4)),
    ]  # fmt: skip
    kinds = {
        "ply ascii": (names_of(4), "ascii"),
        "ply with a colon": ([*names_of(1), "user:label"], "binary_little_endian"),
        "ply big endian": (names_of(4), "binary_big_endian"),
        "ply moving": ([*names_of(1), *moving], "binary_little_endian"),
    }
    seeds = []
    for name, (columns, encoding) in kinds.items():
        path = write_rows(folder / f"{name}.ply", random_rows(30, columns), encoding=encoding)
        seeds.append(Seed(name, {"a.ply": path.read_bytes()}, read_model))
    return seeds


def ksplat_seeds() -> list[Seed]:
    from tests.support.splats.ksplat_files import HandSection, ksplat

    rng = np.random.default_rng(2)
    seeds = []
    for level in range(3):
        codes = [rng.integers(0, 65535, (n, 3)) for n in (4, 4, 3)]
        places = [rng.normal(size=(11, 3))] if level == 0 else codes
        centers = [] if level == 0 else [(0.0, 0.0, 1.0)] * 3
        data, _ = ksplat(level, [HandSection(places, centers, degree=level)])
        seeds.append(Seed(f"ksplat level {level}", {"a.ksplat": data}, read_model))
    return seeds


def lcc_seeds(folder: Path, some_splats: Made) -> list[Seed]:
    from shapeshift.runtime_models.splats.spz.write_spz import write_spz
    from tests.support.hostile.fuzz_seeds import files_of
    from tests.support.splats.lcc_files import write_lcc, write_lcc2

    chunks = {}
    for i, count in enumerate((20, 6)):
        write_spz(some_splats(count, 4), folder / "chunk.spz")
        chunks[f"{i}.spz"] = (folder / "chunk.spz").read_bytes()
    write_lcc(folder / "lcc")
    write_lcc(folder / "lcc portable", harmonics=False, environment=0)
    write_lcc2(folder / "lcc2", chunks, [[0], [1]], ending=".spz")
    return [
        Seed(name, files_of(folder / name), read_model) for name in ("lcc", "lcc portable", "lcc2")
    ]


def checkpoint_seeds() -> list[Seed]:
    """What torch.save has really written, and arrays of numpy."""
    rng, packed = np.random.default_rng(3), io.BytesIO()
    sides = {"means": 3, "scales": 3, "quats": 4, "sh0": 3}
    arrays = {name: rng.normal(size=(20, side)) for name, side in sides.items()}
    np.savez(packed, **arrays, opacities=rng.normal(size=20))
    arrays = Seed("checkpoint .npz", {"a.npz": packed.getvalue()}, read_model)
    fixtures = Path(__file__).parents[2] / "fixtures" / "torch_2_15"
    return [arrays] + [
        Seed(
            f"checkpoint {file.suffix}",
            {file.name: file.read_bytes()},
            read_model,
            {file.name: "zip"},
        )
        for name in ("ckpt_29999_rank0.pt", "step-000029999.ckpt")
        for file in [fixtures / name]
    ]


def packed_seeds(folder: Path, some_splats: Made) -> list[Seed]:
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply

    write_ply(some_splats(20, 4), folder / "a.ply")
    data, zipped = (folder / "a.ply").read_bytes(), io.BytesIO()
    with zipfile.ZipFile(zipped, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scene/a.ply", data)
        archive.writestr("scene/readme.txt", b"hello")
    return [
        Seed(
            "ply in gzip",
            {"a.ply.gz": gzip.compress(data, mtime=0)},
            read_model,
            {"a.ply.gz": "gzip"},
        ),
        Seed("ply in a zip", {"a.zip": zipped.getvalue()}, read_model, {"a.zip": "zip"}),
    ]
