"""launch.py info: what is in a scene, or in a capture."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from shapeshift.app.command_line import POSITIONAL
from shapeshift.app.opening import ReadingOptions, open_model
from shapeshift.app.terminal import open_console, print_json


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Say what is in a scene, or what was found in a capture."""

    scene: Annotated[Path, POSITIONAL]
    """A package, splats of any known format, a folder of layers, a scene file (docs/scene.md), or
    posed photos (docs/capture.md)."""
    json: bool = False
    """JSON on standard output instead of a table."""


def run(options: Options) -> int:
    from shapeshift.app.inspection.capture_facts import capture_facts, print_capture
    from shapeshift.app.scene_files import describe_scene, open_scene_file
    from shapeshift.runtime_models.model import BadFile
    from shapeshift.runtime_models.read_scene import describe
    from shapeshift.scene.document.scene_file import is_scene_file

    if is_scene_file(options.scene):
        file, models, _ = open_scene_file(options.scene, options)
        facts = describe_scene(file, models, options.scene)
    else:
        try:
            facts = describe(open_model(options.scene, options), options.scene)
        except BadFile:
            if (capture := capture_facts(options.scene)) is None:
                raise
            print_json(capture) if options.json else print_capture(capture)
            return 0
    if options.json:
        print_json(facts)
    else:
        print_table(facts)
    return 0


def print_table(facts: dict) -> None:
    from rich.table import Table
    from rich.text import Text

    table = Table(show_header=False)
    for key, value in facts.items():
        if value is None or (key == "anchors" and value == 0):  # made_of says what is there instead
            continue
        if key == "stops":
            value = "\n".join(map(stop_line, value))
        elif key == "heads":
            value = "\n".join(
                f"{name}: {' to '.join(map(str, head['layers']))}, {head['activation']}"
                for name, head in value.items()
            )
        elif key == "coarser_levels":
            value = "\n".join(map(level_line, value))
        elif key == "findings":
            value = "\n".join(value)
        elif key == "objects":
            value = "\n".join(map(object_line, value))
        elif key == "labels":
            names = {"0": "background"} | facts.get("label_names", {})
            value = "\n".join(
                f"{label}{f' {names[label]}' if label in names else ''}: {count:,} splats"
                for label, count in value.items()
            )
        elif key == "label_names":
            continue  # told with the labels
        elif isinstance(value, dict):
            value = ", ".join(f"{name} {each}" for name, each in value.items())
        elif isinstance(value, list | tuple):
            value = ", ".join(map(str, value))
        elif isinstance(value, int) and not isinstance(value, bool):
            value = f"{value:,}"
        table.add_row(key.replace("_", " "), Text(str(value)))  # names may hold brackets
    open_console(stderr=False).print(table)


def stop_line(stop: dict) -> str:
    """One stop."""
    words = [stop["kind"]]
    if ends := stop.get("value_range"):
        words.append(f"{ends[0]:g} to {ends[1]:g} {stop['unit']}".rstrip())
    words += [stop[key] for key in ("palette", "formula") if stop.get(key)]
    return f"{stop['x']:.3f}  {stop['name']} ({', '.join(words)})"


def level_line(level: dict) -> str:
    """One coarser level of a package."""
    where = {"stops": "at stops", "between": "between them"}
    errors = ", ".join(f"{db:.1f} dB {where[name]}" for name, db in level["error_db"].items())
    text = f"{level['anchors']:,} anchors, up to {level['from_pixels']:.0f} pixels"
    return f"{text}: {errors}" if errors else text


def object_line(item: dict) -> str:
    """One object of a scene file."""
    body = "not to be touched" if item["collider"] is None else item["collider"]
    part = [] if item["part"] is None else [f"part {item['part']}"]
    words = [item["model"], *part, f"{item['splats']:,} splats", f"x {item['x']:g}", body]
    words += ["static"] if item["static"] else []
    words += [f"{item['reactions']} reactions"] if item["reactions"] else []
    words += [f"{key} {item[key]}" for key in ("step", "axes") if key in item]
    return f"{item['name']}: " + ", ".join(words)
