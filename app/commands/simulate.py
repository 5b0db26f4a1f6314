"""launch.py simulate: a scene file in motion, driven by a script, written as JSON lines."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from shapeshift.app.command_line import CONTROL, EXPERT, POSITIONAL, SIZE
from shapeshift.app.paths import full
from shapeshift.app.terminal import say
from shapeshift.runtime_models.files.plain_text import UNSAFE, escaped

RESULT = "run.jsonl"
HZ = 90
AFTER_S = 2.0  # seconds that go on after the script's last line
LONGEST_S = 24 * 3600.0


@dataclass(frozen=True)
class Options:
    """Let hands and rays of a script act on a scene; poses, contacts, x and events come out."""

    scene: Annotated[Path, POSITIONAL]
    """A scene file, see docs/scene.md."""
    out: Path
    """Folder for run.jsonl and the pictures."""
    script: Path | None = None
    """JSON lines with times: hands, grabs, releases, rays.  Default: none, objects only fall."""
    x: Annotated[str, CONTROL] = ""
    """Where the sliders of all objects stand at the start: a stop or state by its name, or a number
    from 0 to 1.  Default: what the scene file says for each."""
    seconds: float | None = None
    """How long.  Default: two seconds more than the script."""
    rough: bool = False
    """Begin at once: what has no collider yet is touched as one hull, not cut into pieces."""
    pictures: int = 0
    """A picture every so many steps of 1/90 s; 0: none."""
    size: Annotated[str, SIZE] = "640x360"
    """WIDTHxHEIGHT of a picture."""
    drawing: Annotated[Literal["auto", "quads", "tiles"], EXPERT] = "auto"
    """What draws the splats: OpenGL quads, or OpenCL tiles, which need no GPU."""
    context: Annotated[Literal["auto", "egl", "surfaceless", "osmesa", "none"], EXPERT] = "auto"
    """Where the OpenGL context without a window comes from."""
    overwrite: bool = False
    """Replace what an earlier run has left in --out."""


def run(options: Options) -> int:
    from shapeshift.app.drawing import make_folder, parse_size
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.document.read_scene_file import read_scene_file
    from shapeshift.scene.world.read_script import read_script

    size = parse_size(options.size)
    if options.pictures < 0:
        raise UsageError(f"--pictures is {options.pictures}; steps, 0 or more, are wanted.")
    refuse_model(options.scene)
    file = read_scene_file(options.scene)
    acts = read_script(options.script, file.all_items) if options.script else ()
    seconds = options.seconds
    if seconds is None:
        seconds = (acts[-1].t if acts else 0.0) + AFTER_S
    if not 0 < seconds <= LONGEST_S:
        raise UsageError(f"--seconds is {seconds:g}; above 0 and at most a day is wanted.")
    steps = math.ceil(seconds * HZ - 1e-6)
    simulation = make_simulation(file, acts, options.x, options.rough)
    every = options.pictures
    paths = [options.out / f"{i:05d}.png" for i in range(0, steps + 1, every)] if every else []
    result = options.out / RESULT
    refuse_taken([result, *paths], options)
    make_folder(options.out)
    steps_done = shown(write_steps(simulation, steps, result, options), steps)
    if every:
        draw_run(steps_done, simulation, file, size, options)
    else:
        for _ in steps_done:
            pass
    pictures = f" and {len(paths)} pictures" if paths else ""
    say(f"{steps} steps, {steps / HZ:.2f} s: {RESULT}{pictures} in {full(options.out)}")
    return 0


def refuse_model(path: Path, command: str = "simulate moves the objects") -> None:
    """Raises UsageError for a scene that is no file of objects, and would be read as none."""
    from shapeshift.app.errors import UsageError

    if path.exists() and path.suffix.lower() != ".json":
        raise UsageError(
            f"{path} is no scene file: {command} of a NAME.scene.json (see "
            "docs/scene.md), which the viewer writes of a scene by Ctrl+S."
        )


def make_simulation(file, acts: tuple, x: str = "", rough: bool = False):
    """The scene with its models, bodies and physics.  Raises BadFile, UsageError."""
    from shapeshift.app.document import file_at
    from shapeshift.app.opening import PATIENCE_S, progress_after, sentence
    from shapeshift.app.scene_files import print_findings
    from shapeshift.runtime_models.splats.plain_splats import Reading
    from shapeshift.scene.colliders.collider_files import colliders_of
    from shapeshift.scene.document.scene_file import read_models
    from shapeshift.scene.world.settle import begin
    from shapeshift.scene.world.simulation import Simulation
    from shapeshift.scene.world.world import World

    with progress_after(PATIENCE_S) as shown:
        file, models = read_models(file, Reading(progress=shown))
        file = file_at(file, models, x) if x else file
        colliders = colliders_of(file, models, shown, rough)
    world = World(file, models, colliders, hz=HZ)
    begin(world)
    print_findings(models)
    for finding in world.findings:
        say(sentence(finding))
    return Simulation(world, acts)


def refuse_taken(paths: list[Path], options: Options) -> None:
    """Nothing is replaced unasked, and an input never."""
    from shapeshift.app.errors import UsageError

    inputs = [path.resolve() for path in (options.scene, options.script) if path]
    for path in paths:
        if path.resolve() in inputs:
            raise UsageError(f"{path} is read in this run; choose another --out.")
        if path.exists() and not options.overwrite:
            raise UsageError(f"{path} exists; choose another --out or add --overwrite.")


def write_steps(simulation, steps: int, path: Path, options: Options):
    """Steps and writes what is new; gives the number of steps done, 0 at first.

    Lines are whole at every moment: an interrupted run keeps what was written until then.
    """
    from shapeshift.runtime_models.files.whole_file import open_lines

    world = simulation.world
    with open_lines(path) as out:
        head = {"scene": options.scene.name, "hz": world.hz, "steps": steps}
        out.write(line({**head, "objects": list(world.objects)}))
        yield 0
        for number in range(1, steps + 1):
            record = simulation.step()
            if record.is_news:
                out.write(line(record.row()))
            yield number
        out.write(line({"end": steps, "hash": world.physics.hash()}))


def shown(steps_done, steps: int):
    """The same steps, with a bar of how many are done."""
    from shapeshift.app.progress import progress_bar

    with progress_bar() as bar:
        task = bar.add_task("simulating", total=steps)
        for number in steps_done:
            bar.update(task, completed=number)
            yield number


def line(row: dict) -> str:
    text = json.dumps(row, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return UNSAFE.sub(escaped, text) + "\n"


def draw_run(steps_done, simulation, file, size: tuple[int, int], options: Options) -> None:
    """A picture of the scene as it stands every --pictures steps."""
    from dataclasses import replace

    from shapeshift.app.document import Document
    from shapeshift.app.drawing import open_renderer, save_png
    from shapeshift.scene.document.scene_file import first_view

    drawn = simulation.world.drawn()
    view = first_view(file, drawn, size)
    with open_renderer(options.context, options.drawing) as (renderer, _):
        behind = Document(drawn, file).background
        renderer.settings = replace(renderer.settings, background=behind)
        for number in steps_done:
            if number % options.pictures == 0:
                renderer.update(simulation.world.drawn())
                renderer.draw([view])
                save_png(renderer.resolved(0), options.out / f"{number:05d}.png")
