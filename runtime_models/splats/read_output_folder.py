"""The folder that a training run leaves: its newest cloud, and two clouds of two modalities.

INRIA's 3DGS and what grew from it (2DGS, Mip-Splatting, Scaffold-GS, Gaussian Grouping) save
point_cloud/iteration_N/point_cloud.ply; ThermalGaussian's MSMG and MFTG save point_cloud_color
and point_cloud_thermal beside each other; gsplat saves ply/point_cloud_N.ply and
ckpts/ckpt_N_rankR.pt, one for each card; nerfstudio nerfstudio_models/step-N.ckpt, in
outputs/NAME/METHOD/TIME.
"""

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from shapeshift.runtime_models.checkpoint.read_checkpoint import GSPLAT_CLOUDS
from shapeshift.runtime_models.lint.lint import judge
from shapeshift.runtime_models.model import BadFile, Finding, Model, SplatLayers, Stop
from shapeshift.runtime_models.splats.formats import formats, read_plain, read_raw
from shapeshift.runtime_models.splats.layers.read_layers import join_layers, stops_of_pair
from shapeshift.runtime_models.splats.placed_splats import joined
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.stop_names import is_thermal_name

CLOUD = "point_cloud.ply"
ITERATIONS, STEPS = f"iteration_*/{CLOUD}", "point_cloud_*.ply"  # of INRIA's, of gsplat's
STEP = re.compile(
    r"iteration_([0-9]{1,18})|point_cloud_([0-9]{1,18})\.ply|"
    r"ckpt_([0-9]{1,18})_rank[0-9]+\.pt|step-([0-9]{1,18})\.ckpt",
    re.ASCII,
)
CHECKPOINTS = ("ckpts", "nerfstudio_models")  # folders of a run of gsplat and of nerfstudio
RUN_DEPTH = 3  # outputs/NAME/METHOD/TIME
PAIR = ("color", "thermal")
FEW = 5  # steps that a finding names
ModelOf = TypeVar("ModelOf", bound=Model)
NO_SPLATS = {"input.ply", "points3d.ply"}  # what a run started from: points


def newest_cloud(folder: Path) -> Path | None:
    """The cloud of the largest iteration in a run's folder, or in the folder of its clouds; None
    where it is no such folder."""
    for name in ("point_cloud", "point_cloud_color", "point_cloud_thermal", "."):
        if (cloud := newest_of((folder / name).glob(ITERATIONS))) is not None:
            return cloud
    clouds = folder if folder.name == GSPLAT_CLOUDS else folder / GSPLAT_CLOUDS
    return newest_of(clouds.glob(STEPS))


def newest_of(clouds: Iterable[Path]) -> Path | None:
    """The one of the last step."""
    by_step = {step_of(cloud): cloud for cloud in clouds if cloud.is_file()}
    by_step.pop(-1, None)
    return by_step[max(by_step)] if by_step else None


def step_of(file: Path) -> int:
    """By its own name or, of point_cloud.ply, by its folder's; -1 where they name none."""
    found = STEP.fullmatch(file.parent.name if file.name == CLOUD else file.name)
    return int(next(filter(None, found.groups()))) if found else -1


def steps_beside(file: Path) -> dict[int, list[Path]]:
    """step -> its files, of the run that a file of splats is of."""
    run = file.parent.parent
    places = [run.glob(ITERATIONS)] if file.name == CLOUD else [file.parent.glob("*")]
    if file.parent.name in (GSPLAT_CLOUDS, CHECKPOINTS[0]):
        places = [(run / GSPLAT_CLOUDS).glob(STEPS), (run / CHECKPOINTS[0]).glob("*")]
    found: dict[int, list[Path]] = {}
    for other in (other for place in places for other in sorted(place)):
        if (step := step_of(other)) >= 0 and other.is_file():
            found.setdefault(step, []).append(other)
    return found


def newest_checkpoints(folder: Path) -> list[Path]:
    """Those of the last step in a run's folder of gsplat, where it is later than any cloud of it,
    or of nerfstudio, which may lie up to three folders below.  [] without.  Raises BadFile.
    """
    for place in (folder, *(folder / name for name in CHECKPOINTS)):
        found: dict[int, list[Path]] = {}
        for file in sorted(place.glob("*")) if place.is_dir() else ():
            if file.suffix in (".pt", ".ckpt") and step_of(file) >= 0 and file.is_file():
                found.setdefault(step_of(file), []).append(file)
        if found:
            cloud = newest_of((folder / GSPLAT_CLOUDS).glob(STEPS))
            last = step_of(cloud) if cloud else -1
            return found[max(found)] if max(found) > last else []
    runs: list[Path] = []
    for depth in range(1, RUN_DEPTH + 1):
        runs += [run.parent for run in folder.glob("*/" * depth + CHECKPOINTS[1]) if run.is_dir()]
    if len(runs) > 1:
        names = ", ".join(str(run.relative_to(folder)) for run in sorted(runs)[-3:])
        raise BadFile(f"{folder} holds {len(runs)} runs of nerfstudio ({names}); name one of them.")
    return newest_checkpoints(runs[0]) if runs else []


def read_checkpoints(files: list[Path], folder: Path, reading: Reading) -> SplatLayers:
    """Checkpoints of one step, one for each card that trained, as one stop of the run's name."""
    parts = [read_raw(file, reading) for file in files]
    plain = judge(joined(parts, folder.name) if len(parts) > 1 else parts[0], reading)
    names = [str(file.relative_to(folder)) for file in files]
    stops = (Stop(folder.resolve().name or files[0].stem, 0.0, "layer"),)
    return with_steps(join_layers([plain], stops, reading.mode, names), files[:1])


def thermal_pair(folder: Path) -> tuple[Path, Path] | None:
    """(colour, thermal) files of a folder that holds one of each, by their names; else None.

    Two clouds of a ThermalGaussian run, two files, or two folders with a run or one file each.
    """
    color, thermal = (
        newest_of(folder.glob(f"point_cloud_{name}/iteration_*/{CLOUD}")) for name in PAIR
    )
    if color is not None and thermal is not None:
        return color, thermal
    names = [ending for form in formats() for ending in form.endings]
    endings = tuple(name for name in names if name.startswith("."))
    files = {file.name: file for file in splat_files(folder, endings)}
    inner = [sub for sub in folder.iterdir() if sub.is_dir()]
    if not any(is_thermal_name(sub.name) for sub in inner):
        inner = []
    folders = {sub.name: file for sub in inner if (file := only_cloud(sub, endings)) is not None}
    for named in (files, folders):
        hot = [name for name in named if is_thermal_name(name)]
        if len(named) == 2 and len(hot) == 1:
            other = next(name for name in named if name != hot[0])
            return named[other], named[hot[0]]
    return None


def splat_files(folder: Path, endings: tuple[str, ...]) -> list[Path]:
    """Files that have the ending of a format of splats, by name."""
    found = (f for f in folder.iterdir() if f.name.lower().endswith(endings) and f.is_file())
    return sorted(file for file in found if file.name.lower() not in NO_SPLATS)


def only_cloud(folder: Path, endings: tuple[str, ...]) -> Path | None:
    """The newest cloud of a run, or the one file of splats that a folder holds."""
    files = splat_files(folder, endings)
    return newest_cloud(folder) or (files[0] if len(files) == 1 else None)


def read_pair(pair: tuple[Path, Path], folder: Path, reading: Reading) -> SplatLayers:
    """RGB at x = 0 and Thermal at x = 1, each alone at its stop unless the mode says otherwise."""
    parts = [read_plain(path, reading) for path in pair]
    files = [str(path.relative_to(folder)) for path in pair]
    model = join_layers(parts, stops_of_pair(), reading.mode or "exclusive", files)
    return with_steps(model, list(pair))


def in_run(model: Model, folder: Path, cloud: Path) -> Model:
    """The model of a run's newest cloud, its files named from the run's folder."""
    inside = cloud.parent.relative_to(folder)
    files = [str(inside / name) for name in model.provenance.get("files", ())]
    model = replace(model, provenance=model.provenance | {"files": files})
    if isinstance(model, SplatLayers) and len(model.stops) == 1:
        name = folder.resolve().name or model.stops[0].name
        model = replace(model, stops=(replace(model.stops[0], name=name),))
    return with_steps(model, [cloud])


def with_steps(model: ModelOf, files: list[Path]) -> ModelOf:
    """The same with the step that it is of, one a file; a finding where the run has others, too,
    where the files are of different ones, and where another step has more files, as of more cards.
    """
    files = [file for file in files if step_of(file) >= 0]
    steps = [step_of(file) for file in files]
    if not steps:
        return model
    said = {"step": " and ".join(dict.fromkeys(map(str, steps)))}
    found = []
    for file, step in zip(files, steps, strict=True):
        run = steps_beside(file)
        others = [str(other) for other in sorted(run) if other != step]
        if others:
            more = f"{len(others) - FEW} more and " if len(others) > FEW else ""
            what = f"its run has splats of step{'s' * (len(others) > 1)} {more}"
            found.append((file, what + f"{', '.join(others[-FEW:])} as well", f"{step} is read"))
        parts = {n: sum(part.suffix == file.suffix for part in rows) for n, rows in run.items()}
        if parts[step] < max(parts.values()):
            what = f"step {step} has {parts[step]} of {max(parts.values())} files of another step"
            found.append((file, what, "read without the others"))
    if len(set(steps)) > 1:
        found.append(
            (files[0], f"its two clouds are of steps {said['step']}", "shown as one scene")
        )
    told = tuple(
        Finding(what, 0, done, file=file.name, repaired=False) for file, what, done in found
    )
    provenance = model.provenance | said
    return replace(model, provenance=provenance, findings=(*model.findings, *told))
