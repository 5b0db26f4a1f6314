"""How commands open a scene file: its models with progress and findings."""

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from shapeshift.app.opening import (
    PATIENCE_S,
    ReadingOptions,
    progress_after,
    say_levels,
    sentence,
)
from shapeshift.app.terminal import say

if TYPE_CHECKING:
    from shapeshift.runtime_models.model import Model
    from shapeshift.scene.document.scene_file import SceneFile
    from shapeshift.scene.scene import Scene

OF_MODELS = ("step", "axes")  # what `info` says of an object's model where it is not plain
OF_OBJECTS = ("mode", "up", "flip")  # options that the file has for each object of its own


def open_scene_file(
    path: Path, options: ReadingOptions, show_findings: bool = True,
    progress: Callable[[str, float], None] | None = None,
) -> tuple["SceneFile", dict[str, "Model"], "Scene"]:  # fmt: skip
    """What the file says, the model of each object, and what is drawn.

    Progress goes to stderr, or to `progress`; findings, too, unless `show_findings` is false.
    Raises BadFile, and UsageError for options that an object has in the file.
    """
    from dataclasses import replace

    from shapeshift.app.errors import UsageError
    from shapeshift.scene.document.read_scene_file import read_scene_file
    from shapeshift.scene.document.scene_file import read_models, scene_of

    for name in OF_OBJECTS:
        if getattr(options, name):
            raise UsageError(f"--{name} is for one model; in {path.name} each object has its own.")
    file = read_scene_file(path)
    with nullcontext(progress) if progress else progress_after(PATIENCE_S) as shown:
        file, models = read_models(file, replace(options.reading(), progress=shown))
    if show_findings:
        print_findings(models)
        say_levels(models.values(), path, options)
    return file, models, scene_of(file, models)


def print_findings(models: dict[str, "Model"]) -> None:
    """What is wrong with the models, once however many objects have one or parts of it."""
    for finding in dict.fromkeys(f for model in models.values() for f in model.findings):
        say(sentence(finding))


def describe_scene(file: "SceneFile", models: dict[str, "Model"], path: Path) -> dict:
    """What `launch.py info` prints of a scene file."""
    from shapeshift.runtime_models.files.json_fields import control_row
    from shapeshift.scene.document.scene_file import FORMAT

    return {
        "format": FORMAT,
        "splats": sum(models[item.name].splat_count for item in file.all_items),
        "floor_y": file.floor_y,
        "gravity_m_s2": file.gravity_m_s2,
        "bytes": path.stat().st_size,
        "objects": [
            {
                "name": item.name,
                "model": item.model,
                "part": item.part,
                "splats": models[item.name].splat_count,
                "x": control_row(item.x),
                "position": list(item.position),
                "collider": item.collider,
                "static": item.static,
                "reactions": len(item.reactions),
                **said_of(models[item.name]),
            }
            for item in file.all_items
        ],
    }


def said_of(model: "Model") -> dict:
    """Those of OF_MODELS that it says."""
    return {key: model.provenance[key] for key in OF_MODELS if key in model.provenance}
