"""launch.py lint: what is wrong with a file of splats, and what opening it would repair."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import tyro

from app.opening import PATIENCE_S, ReadingOptions, progress_after
from runtime_models.model import BadFile


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Say what is wrong with a scene; nothing is drawn, nothing is written."""

    scene: Annotated[Path, tyro.conf.Positional]
    """Anything that opens: a file of splats, a folder, a package."""
    json: bool = False
    """JSON on standard output instead of a table."""


def run(options: Options) -> int:
    """0 where all is right or was repaired; a file that is refused is BadFile, exit code 2."""
    try:
        facts = examine(options)
    except BadFile as refusal:
        if options.json:
            why = {"file": str(options.scene), "refused": True, "why": str(refusal), "findings": []}
            print(json.dumps(why, indent=1, ensure_ascii=False))
        raise
    if options.json:
        print(json.dumps(facts, indent=1, ensure_ascii=False))
    else:
        print_report(facts)
    return 0


def examine(options: Options) -> dict:
    """The findings of a scene and the numbers that they rest on.  Raises BadFile."""
    from dataclasses import replace

    from runtime_models.lint_whole import fill_ratio, sample_of
    from runtime_models.read_scene import describe, read_model

    with progress_after(PATIENCE_S) as told:
        model = read_model(options.scene, replace(options.reading(), told=told))
    facts = describe(model, options.scene)
    splats = splats_of(model)
    sample = sample_of(splats.means, splats.scales, splats.opacity)
    return {
        "file": str(options.scene),
        "refused": False,
        "format": facts["format"],
        "splats": facts["splats"],
        "sh_degree": facts["sh_degree"],
        "bytes": facts["bytes"],
        "extent_m": [round(float(side), 4) + 0.0 for side in sample.high - sample.low],
        "origin_m": [float(c) for c in getattr(model, "origin", (0, 0, 0))],
        "splats_over_a_pixel": round(fill_ratio(sample), 2),
        "findings": [asdict(finding) for finding in model.findings],
    }


def splats_of(model):
    """What the model shows at its first stop, seen from where a viewer would start."""
    from runtime_models.evaluate import evaluate
    from scene.framing import default_view

    eye = default_view(model, (640, 360)).world_from_eye.position
    return evaluate(model, model.stops[0].x, eye)


def print_report(facts: dict) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    extent = " x ".join(f"{side:,.3g}" for side in facts["extent_m"])
    degree = "" if facts["sh_degree"] is None else f", SH degree {facts['sh_degree']}"
    console.print(
        f"{facts['file']}: {facts['format']}, {facts['splats']:,} splats{degree}, "
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
