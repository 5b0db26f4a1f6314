"""Opens whatever this program can show, recognised by content where the format allows."""

import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.blocks.block_model import FORMAT as BLOCKS_FORMAT
from shapeshift.runtime_models.blocks.block_model import BlockModel
from shapeshift.runtime_models.blocks.read_blocks import LIST as BLOCK_LIST
from shapeshift.runtime_models.blocks.read_blocks import has_block_list, read_blocks
from shapeshift.runtime_models.checkpoint.read_png_folder import is_png_folder
from shapeshift.runtime_models.files.memory import refuse_empty
from shapeshift.runtime_models.files.zip_files import member_names
from shapeshift.runtime_models.lod.level_files import (
    files_of_levels,
    is_levels,
    read_levels,
)
from shapeshift.runtime_models.model import (
    AnchorModel,
    BadFile,
    Mlp,
    Model,
    ScaffoldModel,
    SplatLayers,
    Stop,
)
from shapeshift.runtime_models.package.feature_codes import EXACT, encode_light
from shapeshift.runtime_models.package.lint_package import refuse_filling
from shapeshift.runtime_models.package.package_files import ANCHORS, MANIFEST, format_name
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.refit_encoding import encoding_findings
from shapeshift.runtime_models.parts import splat_labels
from shapeshift.runtime_models.program import program
from shapeshift.runtime_models.scaffold.read_scaffold import is_scaffold, read_scaffold
from shapeshift.runtime_models.splats.foreign_files import is_address, refusal
from shapeshift.runtime_models.splats.formats import format_of, head_of
from shapeshift.runtime_models.splats.layers.frames import frame_files, frame_stops
from shapeshift.runtime_models.splats.layers.layer_list import (
    LIST,
    has_layer_list,
    read_layer_list,
)
from shapeshift.runtime_models.splats.layers.read_layers import (
    layer_files,
    read_file,
    read_layers,
)
from shapeshift.runtime_models.splats.lcc.read_lcc import is_lcc, read_lcc
from shapeshift.runtime_models.splats.lcc.read_lcc2 import is_lcc2, read_lcc2
from shapeshift.runtime_models.splats.operations.decimate import left_whole, within_most_splats
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.read_output_folder import (
    CLOUD,
    in_run,
    newest_checkpoints,
    newest_cloud,
    read_checkpoints,
    read_pair,
    thermal_pair,
)
from shapeshift.runtime_models.splats.sog.read_sog import is_sog
from shapeshift.runtime_models.splats.sog.read_streamed import (
    TREE,
    is_streamed,
    read_sog_folder,
    read_streamed,
)
from shapeshift.runtime_models.splats.sog.sog_files import META
from shapeshift.runtime_models.splats.sog.streamed_leaves import open_leaves

PHOTOS = (".jpg", ".jpeg")  # a scene's own pictures are .png and .webp
KNOWN = (
    "a package (folder, .shift or .lod), a folder of blocks, a file of splats (.ply, .splat, "
    ".ksplat, .spz, .sog, .glb, .gltf, .usd, .lcc, .pt, .ckpt), a folder of .ply layers, or the "
    "folder of a 3DGS or Scaffold-GS run"
)


def read_model(path: str | Path, reading: Reading | None = None) -> Model:
    """The model in a file or folder, read as `reading` says.  Raises BadFile."""
    path, reading = Path(path), (reading or Reading()).begun()
    try:
        model = read_whole(path, reading)
    except MemoryError as error:
        raise BadFile(
            f"{path.name} does not fit this machine's memory ({error}); close other "
            "programs, or open fewer layers."
        ) from error
    if isinstance(model, AnchorModel):
        return left_whole(model, reading.most_splats, path.name)
    return within_most_splats(model, path, reading) if isinstance(model, SplatLayers) else model


def read_whole(path: Path, reading: Reading) -> Model:
    """The model with all its splats."""
    if not path.exists():
        if is_address(path):
            raise BadFile(f"{path} is an address of the web; download the file, then open that.")
        raise BadFile(f"{path} does not exist; wanted is {KNOWN}.")
    if not (path.is_file() or path.is_dir()):  # reading a pipe would wait for ever
        raise BadFile(f"{path} is neither a file nor a folder; wanted is {KNOWN}.")
    if path.is_file():
        refuse_empty(path)
    if path.name in (MANIFEST, LIST, BLOCK_LIST):
        path = path.parent
    if is_streamed(path):
        return open_leaves(path, reading) if reading.leaves else read_streamed(path, reading)
    if is_levels(path):
        return read_upright(path, reading, read_levels)
    if is_lcc(path):
        return read_lcc(path, reading)
    if is_lcc2(path):
        return read_lcc2(path, reading)
    if path.name == META and format_of(path):
        path = path.parent
    if path.is_dir():
        if (path / MANIFEST).exists():
            return read_upright(path, reading)
        if has_block_list(path):
            return read_upright(path, reading, read_blocks)
        if has_layer_list(path):
            return read_layer_list(path, reading)
        if is_sog(b"", path):
            return read_sog_folder(path, reading)
        if is_scaffold(path):
            return read_scaffold(path, reading)
        if (pair := thermal_pair(path)) is not None:
            return read_pair(pair, path, reading)
        if checkpoints := newest_checkpoints(path):
            return read_checkpoints(checkpoints, path, reading)
        if (cloud := newest_cloud(path)) is not None:
            whole = cloud.parent if cloud.name == CLOUD else cloud
            return in_run(read_model(whole, reading), path, cloud)
        if is_png_folder(path):
            return read_file(path, reading)
        layers = layer_files(path)
        if not layers:
            raise BadFile(nothing_to_show(path))
        if frames := frame_files(layers):
            in_time = replace(reading, mode=reading.mode or "exclusive")
            model = read_layers(frames, in_time, frame_stops(frames))
            return replace(model, provenance=model.provenance | {"frames": len(frames)})
        return read_layers(layers, reading) if len(layers) > 1 else read_file(layers[0], reading)
    if is_scaffold(path):
        return read_scaffold(path, reading)
    if is_package(path):
        return read_upright(path, reading)
    if format_of(path):
        return read_file(path, reading)
    raise BadFile(refusal(path, head_of(path), KNOWN))


def nothing_to_show(folder: Path) -> str:
    """What is said of a folder without a scene; one of photos can become a scene."""
    places = (folder, *(p for p in folder.iterdir() if p.is_dir()))
    if any(p.suffix.lower() in PHOTOS for place in places for p in place.iterdir()):
        command = f"{program()} {shlex.join(['train', str(folder), '--out', 'SCENE.shift'])}"
        return f"{folder} holds photos and no scene; make one of them with `{command}`."
    return f"{folder} holds nothing to show; wanted is {KNOWN}."


def read_upright(
    path: Path, reading: Reading, read: Callable[[Path, Reading], AnchorModel] = read_package
) -> AnchorModel:
    """A package, whose up is +Y and nothing else, however it is read.  Raises BadFile."""
    if reading.flip or reading.up not in ("", "+Y"):
        raise BadFile(
            f"{path.name} is a package, and +Y is up in all of them; leave out --up and --flip."
        )
    model = read(path, reading)
    for level in model.levels if not reading.allow_huge else ():
        refuse_filling(level, path.name)
    return replace(model, findings=(*model.findings, *encoding_findings(model, path.name)))


def is_package(path: Path) -> bool:
    """A zip with parts of one; whether it has them all is for the reader to say."""
    names = [name.rpartition("/")[2] for name in member_names(path)]
    if not names:  # cut off: only its name can tell
        return path.name.lower().endswith(".shift") and head_of(path)[:2] == b"PK"
    return any(name in (MANIFEST, ANCHORS) or name.endswith(".onnx") for name in names)


def describe_stop(stop: Stop) -> dict:
    """A stop, and what its values are where it has other ones than heat."""
    row: dict[str, object] = {"name": stop.name, "x": stop.x, "kind": stop.kind}
    if stop.kind == "values":
        ends = list(stop.value_range) if stop.value_range else None
        row |= {"value_range": ends, "unit": stop.unit, "palette": stop.palette}
    if stop.formula:
        row["formula"] = stop.formula
    return row


def describe(model: Model, path: str | Path) -> dict:
    """What `launch.py info --json` prints; `path` is where the model was read from."""
    file_format = model.provenance.get("format", "splats")
    facts: dict[str, object] = {
        "format": format_name(model) if isinstance(model, AnchorModel) else file_format,
        "anchors": 0 if isinstance(model, SplatLayers) else len(model.anchors),
        **({"made_of": plain_words(model)} if isinstance(model, SplatLayers) else {}),
        "splats": model.splat_count,
        "sh_degree": (
            round(model.sh.shape[1] ** 0.5) - 1 if isinstance(model, SplatLayers) else None
        ),
        "stops": [describe_stop(s) for s in model.stops],
        "bytes": sum(file.stat().st_size for file in files_of(model, Path(path))),
    }
    if "step" in model.provenance:  # of a training run
        facts["step"] = model.provenance["step"]
    if isinstance(model, SplatLayers):
        if "sh_degree" in model.provenance:  # bands that are zero in every splat were left out
            facts["sh_degree_in_file"] = model.provenance["sh_degree"]
        drawn: dict[str, object] = {"antialiased": True} if model.antialiased else {}
        if "axes" in model.provenance:  # where the format alone does not tell
            drawn["axes"] = model.provenance["axes"]
        if "level" in model.provenance:  # of a streamed scene; 0 is the finest
            drawn["level"] = model.provenance["level"]
            drawn["levels"] = dict(enumerate(model.provenance["level_splats"]))
            if model.leaves is not None:  # the model's own splats are the coarsest of each leaf
                facts["splats"] = int(model.leaves.levels.finest_counts.sum())
            if "leaves" in model.provenance:
                drawn["leaves"] = model.provenance["leaves"]
        return facts | {"mode": model.mode} | drawn | describe_labels(model)
    networks = {
        "splats_per_anchor": model.splats_per_anchor,
        "feature_width": model.features.shape[1],
        "heads": {name: describe_head(mlp) for name, mlp in model.networks.items()},
    }
    if isinstance(model, ScaffoldModel):
        return facts | networks | describe_octree(model)
    encoding = model.encoding
    return (
        facts
        | networks
        | {"encoding": {"d": encoding.d, "sigma": encoding.sigma, "spacing": encoding.spacing}}
        | {"between_stops": model.between_stops, "paced_pairs": len(model.pace)}
        | describe_blocks(model)
        | describe_levels(model)
        | describe_light(model)
        | describe_labels(model)
        | describe_findings(model)
    )


def plain_words(model: SplatLayers) -> str:
    """What stands in place of anchors in a scene without networks."""
    if model.motion is not None:
        return "plain splats that move with x"
    if model.leaves is not None or "level" in model.provenance:
        return "plain splats in levels of detail"
    layers = len(model.stops)
    return "plain splats" if layers == 1 else f"plain splats in {layers} layers"


def describe_blocks(model: AnchorModel) -> dict:
    """Of a scene in blocks, how many there are and their anchors."""
    if not isinstance(model, BlockModel):
        return {}
    counts = np.bincount(model.block, minlength=len(model.networks_of_blocks))
    return {
        "format": BLOCKS_FORMAT, "blocks": len(counts), "anchors_of_blocks": counts.tolist()
    }  # fmt: skip


def describe_levels(model: AnchorModel) -> dict:
    """Levels of detail of a package, where it has such."""
    if not model.coarser:
        return {}
    coarser = [
        {"anchors": len(one.anchors), "splats": len(one.anchors) * model.splats_per_anchor,
         "from_pixels": one.from_pixels, "error_db": one.error_db}
        for one in model.coarser
    ]  # fmt: skip
    return {"coarser_levels": coarser}


def describe_light(model: AnchorModel) -> dict:
    """Bytes of anchors' light by direction before they are deflated, where they have such."""
    if model.light is None:
        return {}
    stored = encode_light(model.light, EXACT)
    size = sum(array.nbytes for array in stored.values())
    return {"light_by_direction_bytes": size}


def describe_findings(model: Model) -> dict:
    """What is worth knowing of a package, where there is anything."""
    sentences = [f"{finding.what}: {finding.done}" for finding in model.findings]
    return {"findings": sentences} if sentences else {}


def describe_labels(model: Model) -> dict:
    """Splats of each label and the names of objects, where there are such."""
    if (of_splats := splat_labels(model)) is None:
        return {}
    labels, counts = np.unique(of_splats, return_counts=True)
    there = {int(label): int(n) for label, n in zip(labels, counts, strict=True)}
    if not isinstance(model, AnchorModel):
        return {"labels": {str(label): n for label, n in there.items()}}
    known = dict.fromkeys((o.label for o in model.objects), 0) | there
    names = {str(o.label): o.name for o in model.objects}
    return {"labels": {str(label): known[label] for label in sorted(known)}, "label_names": names}


def describe_octree(model: ScaffoldModel) -> dict:
    """What a Scaffold-GS model says besides its networks."""
    facts = {"appearance": model.provenance.get("appearance")}
    if (octree := model.octree) is not None:
        levels, counts = np.unique(octree.level, return_counts=True)
        facts["levels"] = {f"{level:g}": int(n) for level, n in zip(levels, counts, strict=True)}
        facts["level_rule"] = octree.rule
    return facts


def describe_head(mlp: Mlp) -> dict:
    return {
        "layers": [mlp.width_in, *(len(w) for w in mlp.weights)],
        "inputs": list(mlp.inputs),
        "activation": mlp.head,
    }


def files_of(model: Model, path: Path) -> list[Path]:
    """What of `path` belongs to the model: a folder may hold other things, too."""
    if is_levels(path):
        return files_of_levels(path)
    in_folder = (
        path.name in (MANIFEST, META, TREE, LIST, BLOCK_LIST) or is_lcc(path) or is_lcc2(path)
    )
    if in_folder and not path.is_dir():
        path = path.parent
    if isinstance(model, ScaffoldModel) and not path.is_dir():
        path = path.parent
    if not path.is_dir():
        return [path]
    if isinstance(model, AnchorModel) and not isinstance(model, BlockModel):
        return [path / MANIFEST, path / ANCHORS, *path.glob("*.onnx")]
    return [path / name for name in model.provenance.get("files", ())]
