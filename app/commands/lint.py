"""launch.py lint: what is wrong with a file of splats or a scene file, and what opening repairs."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from shapeshift.app.command_line import POSITIONAL
from shapeshift.app.opening import PATIENCE_S, ReadingOptions, progress_after
from shapeshift.app.scene_files import open_scene_file
from shapeshift.app.terminal import open_console, print_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.program import program


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Say what is wrong with a scene; nothing is drawn, nothing is written."""

    scene: Annotated[Path, POSITIONAL]
    """Anything that opens: a file of splats, a folder, a package, a scene file."""
    json: bool = False
    """JSON on standard output instead of a table."""


def run(options: Options) -> int:
    """0 where all is right or was repaired; a file that is refused is BadFile, exit code 2."""
    try:
        facts = examine(options)
    except BadFile as refusal:
        if options.json:
            why = {"file": str(options.scene), "refused": True, "why": str(refusal), "findings": []}
            print_json(why)
        raise
    if options.json:
        print_json(facts)
    else:
        print_report(facts)
    return 0


def examine(options: Options, progress: Callable[[str, float], None] | None = None) -> dict:
    """The findings of a scene and the numbers that they rest on; progress goes to stderr, or to
    `progress`.  Raises BadFile, UsageError.
    """
    from dataclasses import replace

    from shapeshift.scene.document.scene_file import is_scene_file

    if is_scene_file(options.scene):
        return examine_objects(options, progress)

    from shapeshift.runtime_models.lint.lint_whole import fill_ratio, sample_of
    from shapeshift.runtime_models.read_scene import describe, read_model

    with nullcontext(progress) if progress else progress_after(PATIENCE_S) as shown:
        model = read_model(options.scene, replace(options.reading(), progress=shown))
        moves = (*uneven(model, options.scene.name), *for_others(model, options.scene.name))
    facts = describe(model, options.scene)
    splats = splats_of(model)
    sample = sample_of(splats.means, splats.scales, splats.opacity)
    return {
        "file": str(options.scene),
        "refused": False,
        "format": facts["format"],
        "splats": facts["splats"],
        "sh_degree": facts["sh_degree"],
        **{key: facts[key] for key in ("sh_degree_in_file",) if key in facts},
        "bytes": facts["bytes"],
        "extent_m": extent_of(sample),
        "origin_m": [float(c) for c in getattr(model, "origin", (0, 0, 0))],
        "splats_over_a_pixel": round(fill_ratio(sample), 2),
        "findings": [asdict(finding) for finding in (*model.findings, *moves)],
    }


def for_others(model, file: str) -> tuple:
    """What other programs would make of plain splats that are right here."""
    from shapeshift.runtime_models.lint.lint import other_readers
    from shapeshift.runtime_models.model import SplatLayers

    return other_readers(model, file) if isinstance(model, SplatLayers) else ()


def uneven(model, file: str) -> tuple:
    """A finding where a package's slider jumps between two stops: measured on small pictures."""
    from shapeshift.renderer.pace import EVEN_ENOUGH, largest_step
    from shapeshift.runtime_models.model import AnchorModel, Finding

    if not isinstance(model, AnchorModel) or len(model.stops) < 2:
        return ()
    if not (step := largest_step(model)) > EVEN_ENOUGH:
        return ()
    what = (
        f"between two stops a step of the slider by 0.01 changes the picture {step:.1f} times as "
        f"much as an even one would, {EVEN_ENOUGH:g} times are smooth"
    )
    done = f"shown as it is; `{program()} export {file} --out NEW.shift` gives it an even pace"
    return (Finding(what, 0, done, file=file, repaired=False),)


def examine_objects(options: Options, progress: Callable[[str, float], None] | None) -> dict:
    """The same of a scene file and all that it names: models, collider meshes, reactions."""
    from shapeshift.runtime_models.lint.lint_whole import fill_ratio
    from shapeshift.runtime_models.read_scene import files_of
    from shapeshift.scene.colliders.read_mesh import read_mesh
    from shapeshift.scene.document.scene_file import FORMAT, HULLS, machine_of

    file, models, scene = open_scene_file(options.scene, options, False, progress)
    meshes = {item.collider: item for item in file.all_items if item.collider not in (None, HULLS)}
    for name, item in meshes.items():
        try:
            read_mesh(file.path(name))
        except BadFile as error:
            raise BadFile(f"object '{item.name}': 'collider': {error}") from None
    for item in file.all_items:
        machine_of(item, models[item.name])
    paths = {id(models[item.name]): file.path(item.model) for item in file.all_items}
    each = {id(model): model for model in models.values()}
    used = {path for key, model in each.items() for path in files_of(model, paths[key])}
    used |= {file.path(name) for name in meshes}
    sample = sample_of_scene(scene)
    return {
        "file": str(options.scene),
        "refused": False,
        "format": FORMAT,
        "objects": len(scene.objects),
        "splats": scene.splat_count,
        "sh_degree": None,
        "bytes": sum(path.stat().st_size for path in {options.scene, *used}),
        "extent_m": extent_of(sample),
        "origin_m": [0.0, 0.0, 0.0],
        "splats_over_a_pixel": round(fill_ratio(sample), 2) if sample else 0.0,
        "findings": [
            asdict(finding)
            for key, model in each.items()
            for finding in (*model.findings, *uneven(model, paths[key].name))
        ],
    }


def sample_of_scene(scene):
    """A Sample of what shows, where it stands, each object at its x; None where nothing does."""
    import numpy as np

    from shapeshift.runtime_models.evaluate import evaluate
    from shapeshift.runtime_models.lint.lint_whole import sample_of
    from shapeshift.scene.cameras.framing import default_view
    from shapeshift.scene.control import control_of

    parts = []
    for obj in scene.objects:
        if not (obj.visible and obj.model.splat_count):
            continue
        eye = default_view(obj.model, (640, 360)).world_from_eye.position
        splats = evaluate(obj.model, control_of(obj), eye)
        world = obj.world_from_object.matrix()
        means = splats.means @ world[:3, :3].T + world[:3, 3]
        parts.append((means, splats.scales, splats.opacity))
    return sample_of(*map(np.concatenate, zip(*parts, strict=True))) if parts else None


def extent_of(sample) -> list[float]:
    """The sides of the box of the 1st to 99th percentile, metres."""
    if sample is None:
        return [0.0, 0.0, 0.0]
    return [round(float(side), 4) + 0.0 for side in sample.high - sample.low]


def splats_of(model):
    """What the model shows at its first stop, seen from where a viewer would start."""
    from shapeshift.runtime_models.evaluate import evaluate
    from shapeshift.scene.cameras.framing import default_view

    eye = default_view(model, (640, 360)).world_from_eye.position
    return evaluate(model, model.stops[0].x, eye)


def print_report(facts: dict) -> None:
    from rich.table import Table
    from rich.text import Text

    console = open_console(stderr=False)
    extent = " x ".join(f"{side:,.3g}" for side in facts["extent_m"])
    objects = f"{facts['objects']} objects, " if "objects" in facts else ""
    degree = "" if facts["sh_degree"] is None else f", SH degree {facts['sh_degree']}"
    if "sh_degree_in_file" in facts:
        degree += f" ({facts['sh_degree_in_file']} in the file, zero in every splat)"
    console.print(
        f"{facts['file']}: {facts['format']}, {objects}{facts['splats']:,} splats{degree}, "
        f"{facts['bytes']:,} bytes; {extent} m (1st to 99th percentile), "
        f"{facts['splats_over_a_pixel']:,.3g} splats over a pixel.",
        markup=False, highlight=False, soft_wrap=True,
    )  # fmt: skip
    if any(facts["origin_m"]):
        place = ", ".join(f"{c:,.0f}" for c in facts["origin_m"])
        console.print(f"It lies about {place} m.", markup=False, highlight=False)
    findings = facts["findings"]
    if not findings:
        console.print("Nothing is wrong.")
        return
    table = Table("file", "what", "first rows", "done")
    for found in findings:
        rows = ", ".join(map(str, found["rows"]))
        table.add_row(*(Text(text) for text in (found["file"], found["what"], rows, found["done"])))
    console.print(table)
    repaired = sum(found["repaired"] for found in findings)
    console.print(summary(len(findings), repaired))


def summary(count: int, repaired: int) -> str:
    """The last line of the report."""
    findings, legal = f"{count} finding{'s' * (count > 1)}", count - repaired
    if not legal:
        return f"{findings}, all repaired on opening."
    if not repaired:
        return f"{findings}, only worth knowing."
    return f"{findings}: {repaired} repaired on opening, {legal} only worth knowing."
