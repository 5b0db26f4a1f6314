"""Small good files of every format that the program reads, cut out of real ones where possible."""

import gzip
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.scene.selectors.selector_texts import read_selector
from tests.support.hostile.fuzz_format_seeds import format_seeds
from tests.support.hostile.fuzz_run import Seed
from tests.support.models import make_random_model
from tests.support.splats.ply_files import some_splats as random_splats

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
COUNT = 300  # splats: more than one chunk of 256


def some_splats(count: int, coefficients: int, **kind) -> PlainSplats:
    """Of the real Leg where it lies here, else random."""
    real = DATA / "anatomy_leg_ml3dgs" / "layer2.ply"
    if real.is_file():
        leg = read_model(real)
        rows = slice(0, 40 * count, 40)
        arrays = (leg.means, leg.scales, leg.wxyz, leg.opacity, leg.sh[:, :coefficients])
        return PlainSplats(*(np.ascontiguousarray(a[rows]) for a in arrays), **kind)
    bounds = {"sizes": (0.005, 0.1), "opacities": (0.05, 0.95), "color": 0.4}
    return random_splats(count, coefficients, count, **bounds, **kind)


def files_of(folder: Path) -> dict[str, bytes]:
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    return {file.relative_to(folder).as_posix(): file.read_bytes() for file in files}


def splat_seeds(folder: Path) -> list[Seed]:
    """What our own writers write, one file each."""
    from shapeshift.runtime_models.splats.gltf.write_gltf import write_gltf
    from shapeshift.runtime_models.splats.ply.write_compressed_ply import write_compressed_ply
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply
    from shapeshift.runtime_models.splats.spz.write_spz import write_spz
    from shapeshift.runtime_models.splats.write_splat import write_splat

    def written(
        name: str, write: Callable, splats: PlainSplats, ending: str, kind: str = ""
    ) -> Seed:
        path = folder / f"{name.replace(' ', '_')}{ending}"
        write(splats, path)
        kinds = {path.name: kind} if kind else {}
        return Seed(name, {path.name: path.read_bytes()}, read_model, kinds)

    labelled = replace(
        some_splats(30, 1), labels=np.arange(30, dtype=np.int32) % 4,
        extra={"segment_score": np.linspace(0, 1, 30, dtype=np.float32)}, antialiased=True,
    )  # fmt: skip
    seeds = [
        written("ply degree 0", write_ply, some_splats(COUNT, 1), ".ply"),
        written("ply degree 3", write_ply, some_splats(40, 16), ".ply"),
        written("ply labels", write_ply, labelled, ".ply"),
        written("compressed ply", write_compressed_ply, some_splats(COUNT, 1), ".compressed.ply"),
        written("compressed ply SH", write_compressed_ply, some_splats(60, 9), ".compressed.ply"),
        written("splat", write_splat, some_splats(COUNT, 1), ".splat"),
        written("glb", write_gltf, some_splats(50, 1), ".glb"),
        written("glb degree 2", write_gltf, some_splats(20, 9), ".glb"),
    ]
    for version in (2, 3, 4):
        for coefficients in (1, 16):
            kind = "spz4" if version == 4 else "gzip"
            name = f"spz v{version} degree {round(coefficients**0.5) - 1}"
            write = lambda splats, path, v=version: write_spz(splats, path, v)  # noqa: E731
            seeds.append(written(name, write, some_splats(50, coefficients), ".spz", kind))
    return seeds


def real_seeds() -> list[Seed]:
    """Fixtures of other programs, as they are."""
    found = []
    for file in sorted((DATA / "splats_misc/splat-transform_fixtures/splat").glob("minimal*")):
        kind = {"minimal-v4": "spz4", "minimal-raw": ""}.get(file.stem, "gzip")
        kinds = {file.name: kind} if file.suffix == ".spz" else {}
        found.append(Seed(f"real {file.name}", {file.name: file.read_bytes()}, read_model, kinds))
    return found


def point_seeds() -> list[Seed]:
    """Points with colours, in letters and in bytes."""
    rows = [f"{x} {x * 2} {x * 3} 200 100 {x}" for x in range(20)]
    header = ["ply", "format ascii 1.0", "element vertex 20"]
    header += [f"property float {axis}" for axis in "xyz"]
    header += [f"property uchar {name}" for name in ("red", "green", "blue")] + ["end_header"]
    packed = np.zeros(20, [("xyz", "<f4", 3), ("rgb", "u1", 3)])
    packed["xyz"] = np.random.default_rng(0).normal(size=(20, 3))
    binary = "\n".join(header).replace("ascii", "binary_little_endian") + "\n"
    return [
        Seed("points in letters", {"a.ply": "\n".join(header + rows).encode() + b"\n"}, read_model),
        Seed("points", {"a.ply": binary.encode() + packed.tobytes()}, read_model),
    ]


def forgiving(path: Path) -> object:
    """For seeds that may be refused themselves: a refusal in a sentence is as good as a model."""
    from shapeshift.runtime_models.model import BadFile
    from tests.support.hostile.fuzz_run import check_sentence

    try:
        return read_model(path)
    except BadFile as refusal:
        check_sentence(str(refusal), path.parent)
        return "refused"


def archive_seeds(folder: Path) -> list[Seed]:
    """SOG, streamed SOG, packages, Scaffold-GS and Gaussian Grouping: zips and folders."""
    from shapeshift.runtime_models.model import ObjectLabel
    from shapeshift.runtime_models.package.write_package import write_package
    from tests.support.splats.sog_scenes import random_sog, write_folder, write_zip

    model = make_random_model(anchors=6, k=2, features=4, hidden=(4,))
    write_package(model, folder / "package.shift")
    labels, mug = np.array([0, 1, 0, 1, 1, 0], np.uint8), ObjectLabel(1, "mug")
    write_package(replace(model, labels=labels, objects=(mug,)), folder / "package")
    write_package(model, folder / "bytes.shift", "uint8")
    seeds = [
        Seed("package zip", {"package.shift": (folder / "package.shift").read_bytes()}, read_model),
        Seed("package folder", files_of(folder / "package"), read_model),
        Seed(
            "package of bytes",
            {"bytes.shift": (folder / "bytes.shift").read_bytes()},
            read_model,
        ),
    ]
    for version, bands in ((1, 1), (2, 0), (2, 2)):
        meta, pictures = random_sog(40, version, bands)
        name = f"sog v{version} bands {bands}"
        file = write_zip(folder / f"v{version}b{bands}.sog", meta, pictures)
        seeds.append(Seed(name, {file.name: file.read_bytes()}, read_model))
        seeds.append(
            Seed(
                f"{name} folder", files_of(write_folder(folder / name, meta, pictures)), read_model
            )
        )
    streamed = folder / "streamed"
    for i, count in enumerate((40, 10)):
        write_folder(streamed / f"{i}_0", *random_sog(count, seed=i))
    leaf = {str(i): {"file": i, "offset": 0, "count": c} for i, c in enumerate((40, 10))}
    tree = {"bound": {"min": [0, 0, 0], "max": [1, 1, 1]}, "children": [{"lods": leaf}]}
    meta = {
        "lodLevels": 2, "environment": None, "tree": tree,
        "filenames": ["0_0/meta.json", "1_0/meta.json"],
    }  # fmt: skip
    (streamed / "lod-meta.json").write_text(json.dumps(meta))
    seeds.append(Seed("package levels", files_of(write_some_levels(folder)), read_model))
    return [*seeds, Seed("streamed sog", files_of(streamed), read_model), *torch_seeds(folder)]


def write_some_levels(folder: Path) -> Path:
    """The package above with one coarser level."""
    from shapeshift.runtime_models.lod.average_anchors import average_anchors, cell_for
    from shapeshift.runtime_models.lod.level_files import level_table, read_level, write_levels

    model = read_model(folder / "package.shift")
    table = level_table(average_anchors(model, cell_for(model, 0.5)))
    level = replace(read_level(table, model, "level"), cell_m=1.0, from_pixels=50.0)
    package = (folder / "package.shift").read_bytes()
    write_levels(folder / "levels.lod", package, model.with_coarser((level,)), [table])
    return folder / "levels.lod"


def torch_seeds(folder: Path) -> list[Seed]:
    from shapeshift.runtime_models.splats.formats import read_classifier
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply
    from tests.support.splats.scaffold_scenes import random_raw, write_run
    from tests.support.splats.torch_files import write_tensors

    seeds = []
    for name, how, kind in (
        ("scaffold", "unite", {}), ("octree", "split", {"levels": 3}),
        ("scaffold onnx", "onnx", {"appearance": 3}),
    ):  # fmt: skip
        run = write_run(random_raw(12, 2, 4, **kind), folder / name.replace(" ", "_"), how)
        seeds.append(Seed(name, files_of(run), read_model))
    rng = np.random.default_rng(1)
    grouped = folder / "grouped"
    grouped.mkdir()
    features = {f"obj_dc_{i}": rng.normal(size=30).astype(np.float32) for i in range(16)}
    write_ply(replace(some_splats(30, 1), extra=features), grouped / "point_cloud.ply")
    weights = {"weight": rng.normal(size=(5, 16, 1, 1)), "bias": rng.normal(size=5)}
    write_tensors(grouped / "classifier.pth", weights)
    classifier = {"classifier.pth": (grouped / "classifier.pth").read_bytes()}
    return [
        *seeds,
        Seed("gaussian grouping", files_of(grouped), read_model),
        Seed("classifier", classifier, read_classifier),
    ]


def thermal_seeds(folder: Path) -> list[Seed]:
    """A pair, a list of stops, and ThermalGaussian's two sets of harmonics in one PLY."""
    from shapeshift.runtime_models.model import Stop
    from shapeshift.runtime_models.splats.layers.layer_list import write_layer_list
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply
    from tests.support.splats.layer_folders import with_thermal_harmonics

    (folder / "pair").mkdir()
    for name in ("rgb", "thermal"):
        write_ply(some_splats(20, 1), folder / f"pair/{name}.ply")
    with_thermal_harmonics(folder / "ommg.ply", 20)
    heat = Stop("heat", 1.0, "thermal", "ironbow", (10.0, 60.0), "K")
    layers = [(stop, some_splats(20, 4)) for stop in (Stop("RGB", 0.0), heat)]
    write_layer_list(layers, folder / "listed")
    return [
        Seed("thermal pair", files_of(folder / "pair"), read_model),
        Seed("list of stops", files_of(folder / "listed"), read_model),
        Seed("thermal harmonics", {"a.ply": (folder / "ommg.ply").read_bytes()}, read_model),
    ]


def picture_seeds() -> list[Seed]:
    """Photographs and what compare takes."""
    import io

    from PIL import Image

    from shapeshift.scene.captures.photo import read_pixels

    rng = np.random.default_rng(0)
    seeds = []
    for form, mode in (
        ("PNG", "RGB"), ("PNG", "RGBA"), ("PNG", "P"), ("PNG", "I;16"), ("JPEG", "RGB"),
        ("WEBP", "RGBA"), ("TIFF", "RGB"), ("BMP", "RGB"),
    ):  # fmt: skip
        pixels = rng.integers(0, 256, (12, 16, 4), dtype=np.uint8)
        image = Image.fromarray(pixels)
        if mode == "I;16":
            image = Image.fromarray(pixels[..., 0].astype(np.uint16) * 200)
        else:
            image = image.convert("RGB").convert(mode) if mode != "RGBA" else image
        out = io.BytesIO()
        image.save(out, form)
        name = f"a.{form.lower()}"
        seeds.append(Seed(f"picture {form} {mode}", {name: out.getvalue()}, read_pixels))
    return seeds


def capture_seeds(folder: Path) -> list[Seed]:
    """Captures with their photos and points, as training and eval read them, and parts of them."""
    from shapeshift.scene.captures.point_clouds import read_points
    from shapeshift.scene.captures.read_capture import read_capture
    from tests.support.scene.captures import simple, whole, write_transforms

    seeds = []
    for name, make in (("simple", simple), ("whole", whole)):
        capture = folder / f"capture_{name}"
        frames, more = make(capture)
        write_transforms(capture, frames, **more)
        seeds.append(Seed(f"capture {name}", files_of(capture), read_capture))
        table = {"transforms.json": seeds[-1].files["transforms.json"]}
        photos = {name: data for name, data in seeds[-1].files.items() if name not in table}
        seeds.append(Seed(f"capture {name} table", table, with_photos(photos, read_capture)))
    packed = (folder / "capture_whole/points.npz").read_bytes()
    seeds.append(Seed("capture points", {"points.npz": packed}, read_points))
    cloud = next(seed for seed in point_seeds() if seed.name == "points").files["a.ply"]
    return [*seeds, Seed("capture cloud", {"a.ply": cloud}, read_points)]


def with_photos(photos: dict[str, bytes], read: Callable) -> Callable:
    """Opens a table alone: its photos, which stay as they are, are put beside it first."""

    def open_table(path: Path) -> object:
        if not (path.parent / next(iter(photos))).is_file():
            Seed("", photos, read).put(path.parent)
        return read(path)

    return open_table


def recent_seed() -> Seed:
    """The list of recent files: a broken one counts as empty."""
    from shapeshift.app.editor.state.user.recent import RecentFiles

    recent = json.dumps({"recent": ["/a/b.ply", "C:\\c d\\\u00e9.splat"]}).encode()
    return Seed("recent files", {"recent.json": recent}, lambda path: RecentFiles.read(path.parent))


def camera_seeds(folder: Path) -> list[Seed]:
    """Every form of cameras that we write."""
    from shapeshift.scene.cameras.camera_list import CameraList
    from shapeshift.scene.cameras.framing import orbit_path
    from shapeshift.scene.cameras.read_cameras import read_camera_list
    from shapeshift.scene.cameras.write_cameras import FORMS, write_cameras

    views = tuple(orbit_path(3, np.zeros(3), 1.0, (64, 48)))
    seeds = []
    for form in FORMS:
        cameras = CameraList(views[:1] if form == "floor" else views, ("a", "b", "c")[: len(views)],
                             "", fps=0.0)  # fmt: skip
        place = folder / f"cameras_{form}"
        place.mkdir()
        path = place if form.startswith("colmap") else place / "cameras.json"
        written = write_cameras(cameras, path, form)
        names = {file.relative_to(place).as_posix(): file.read_bytes() for file in written}
        seeds.append(Seed(f"cameras {form}", names, read_camera_list))
    return seeds


def text_seeds() -> list[Seed]:
    """Selectors, as they stand on the command line."""
    stops = make_random_model(anchors=1, k=1).stops

    def read(path: Path) -> object:
        return read_selector(path.read_bytes().decode("utf-8", "replace"), stops)

    texts = ("sphere:0,1,-2.5:0.5:Thermal:0.1", "box:0,0,0:1,2,3:0.25", "half:0,0,0:0,1,0:RGB:0.2",
             "lens:20:Thermal")  # fmt: skip
    return [
        Seed(f"selector {text.split(':')[0]}", {"s.txt": text.encode()}, read, sentence=ValueError)
        for text in texts
    ]


def all_seeds(folder: Path) -> list[Seed]:
    folder.mkdir(parents=True, exist_ok=True)
    seeds = splat_seeds(folder) + real_seeds() + point_seeds() + archive_seeds(folder)
    legacy = gzip.compress(b"NGSP" + bytes([1, 0, 0, 0, 2, 0, 0, 0, 0, 12, 0, 0]) + bytes(2 * 17))
    seeds.append(Seed("spz v1", {"v1.spz": legacy}, forgiving, {"v1.spz": "gzip"}))
    seeds += [*thermal_seeds(folder), *picture_seeds(), *capture_seeds(folder), recent_seed()]
    seeds += [*camera_seeds(folder), *text_seeds()]
    return seeds + format_seeds(folder / "further", some_splats)
