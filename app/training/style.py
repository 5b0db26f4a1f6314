"""launch.py style: a new stop in a finished scene, all others as they were; or one out of it."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.opening import open_model
from shapeshift.app.paths import full
from shapeshift.app.terminal import say
from shapeshift.app.training.style_looks import check_looks, views_and_size, with_named_style
from shapeshift.app.training.style_options import Options
from shapeshift.runtime_models.model import AnchorModel
from shapeshift.runtime_models.program import program

if TYPE_CHECKING:
    from shapeshift.training.styles.add_style import NewStyle

INTERRUPTED = 130  # exit code


def run(options: Options) -> int:
    from shapeshift.app.commands.exported import check_output
    from shapeshift.app.training.saving import check_writable
    from shapeshift.runtime_models.package.write_package import refuse_foreign
    from shapeshift.training.styles.add_style import refuse_plain

    check_options(options)
    options = with_named_style(options)
    check_output(options.out, [options.scene], options.overwrite)
    check_writable(options.out)
    refuse_foreign(options.out)
    model = refuse_plain(open_model(options.scene, options))
    try:
        if options.formula:
            return add_formula(options, model)
        return remove(options, model) if options.remove else add(options, model)
    except KeyboardInterrupt:
        say("Interrupted; nothing was written.  A style takes minutes at most and starts anew.")
        return INTERRUPTED


def check_options(options: Options) -> None:
    """Raises UsageError for what does not go together."""
    from shapeshift.app.errors import UsageError

    asked = {
        "--shape": options.shape, "--network": options.network, "--pictures": options.pictures,
        "--image": options.image, "--text": options.text, "--formula": options.formula,
    }  # fmt: skip
    given = [name for name, value in asked.items() if value]
    if options.remove and (given or options.name):
        raise UsageError(f"--remove takes a stop out; leave out {given[0] if given else '--name'}.")
    if options.remove:
        return
    if options.formula:
        check_formula_options(options, given)
        return
    for name in ("range", "unit", "palette"):
        if getattr(options, name):
            raise UsageError(f"--{name} is of values by --formula; add it, or leave --{name} out.")
    if not given:
        raise UsageError(f"a new stop needs one of {', '.join(asked)}; --help says what they do.")
    if options.network and options.pictures:
        raise UsageError("--network and --pictures both paint the stop; leave one of them out.")
    if options.pictures and not options.cameras:
        raise UsageError("--pictures needs --cameras, the file that says where each was taken.")
    check_looks(options)
    if options.weights and not options.network:
        raise UsageError("--weights are of a network's styles; add --network, or leave them out.")
    views, size = views_and_size(options)
    if not (1 <= views <= 500 and 32 <= size <= 640):
        raise UsageError(
            f"--views is {views} and --size {size}; 1 to 500 and 32 to 640 are wanted."
        )


def check_formula_options(options: Options, given: list[str]) -> None:
    """Raises UsageError for what does not go with --formula, and for a formula that is none."""
    from shapeshift.app.errors import UsageError
    from shapeshift.runtime_models.stop import refuse_palette, refuse_unit
    from shapeshift.runtime_models.stops.stop_formula import read_formula

    others = {"--from": options.from_, "--region": options.region, "--keep": options.keep}
    beside = [name for name in given if name != "--formula"]
    beside += [name for name, value in others.items() if value]
    if beside:
        raise UsageError(f"--formula gives the values of the whole stop; leave {beside[0]} out.")
    low, high = options.range or (0.0, 1.0)
    if not (abs(low) < float("inf") and abs(high) < float("inf") and low < high):
        raise UsageError(f"--range is {low:g} {high:g}; two numbers are wanted, the lower first.")
    try:
        read_formula(options.formula)
        refuse_palette(options.palette)
        refuse_unit(options.unit)
    except ValueError as error:
        raise UsageError(str(error)) from None


def remove(options: Options, model: "AnchorModel") -> int:
    """Takes a stop out of the scene."""
    from dataclasses import replace

    from shapeshift.runtime_models.stops.change_stops import remove_stop
    from shapeshift.training.styles.add_style import as_list

    word = options.remove.casefold()
    name = next((s.name for s in model.stops if s.name.casefold() == word), options.remove)
    made = remove_stop(model, name)
    notes = [note for note in as_list(model.provenance.get("styles")) if note != name]
    provenance = {k: v for k, v in model.provenance.items() if k != "styles"}
    made = replace(made, provenance=provenance | ({"styles": notes} if notes else {}))
    finish(options, model, made)
    return 0


def add(options: Options, model: "AnchorModel") -> int:
    """Puts a stop into the scene."""
    from shapeshift.app.opening import progress_after
    from shapeshift.app.training.style_looks import pictures_and_views, preview_of
    from shapeshift.app.training.style_options import anchors_inside
    from shapeshift.rasterizer.device import open_device
    from shapeshift.training.styles.add_style import add_style

    style = style_of(options, model)
    inside = anchors_inside(model, options.region, options.keep)
    pictures, views = pictures_and_views(options, model)
    preview = options.quality == "preview"
    device = open_device(options.device) if preview or pictures is not None else None
    with progress_after(0.0) as progress:
        recolor = preview_of(options, device, model, style.source, progress) if preview else None
        made = add_style(device, model, style, pictures, views, inside, progress, recolor)
    finish(options, model, made, style, inside)
    return 0


def add_formula(options: Options, model: "AnchorModel") -> int:
    """Puts a stop by formula of others into the scene."""
    made, style = with_formula(options, model)
    finish(options, model, made, style)
    return 0


def with_formula(options: Options, model: "AnchorModel") -> "tuple[AnchorModel, NewStyle]":
    """The model with the stop, and what it is called.  Raises BadFile, UsageError."""
    from shapeshift.app.errors import UsageError
    from shapeshift.runtime_models.model import Stop
    from shapeshift.runtime_models.stops.formula_stop import with_formula_stop
    from shapeshift.runtime_models.stops.stop_formula import read_formula, sources_of
    from shapeshift.training.styles.add_style import NewStyle

    names = {stop.name.casefold(): stop.name for stop in model.stops}
    if options.after and options.after.casefold() not in names:
        raise UsageError(
            f"--after is '{options.after}'; the stops are {', '.join(names.values())}."
        )
    after = names[options.after.casefold()] if options.after else None
    name = options.name or "Index"
    stop = Stop(
        name, 0.0, "values", options.palette, options.range, options.unit, "", options.formula
    )
    made = with_formula_stop(model, stop, after)
    sources = sources_of(read_formula(stop.formula), model.stops, name)
    return made, NewStyle(name, next(iter(sources.values())).name, after)


def style_of(options: Options, model: "AnchorModel") -> "NewStyle":
    """What the options say of the new stop.  Raises UsageError."""
    from shapeshift.app.errors import UsageError, as_typed
    from shapeshift.app.training.style_looks import usual_name
    from shapeshift.runtime_models.model import BadFile
    from shapeshift.runtime_models.stops.change_stops import insert_stop
    from shapeshift.training.styles.add_style import NewStyle

    names = {stop.name.casefold(): stop.name for stop in model.stops}
    for option, value in (("--from", options.from_), ("--after", options.after)):
        if value and value.casefold() not in names:
            raise UsageError(f"{option} is '{value}'; the stops are {', '.join(names.values())}.")
    name = options.name or usual_name(options)
    source = names[options.from_.casefold()] if options.from_ else model.stops[0].name
    after = names[options.after.casefold()] if options.after else None
    try:
        style = NewStyle(
            name, source, after, options.shape, options.strength, options.seed, options.steps
        )
        insert_stop(model, name, source, after)  # what cannot be put in is refused now
    except BadFile as error:
        raise UsageError(f"--name {name}: {error}") from None
    except ValueError as error:
        raise as_typed(error, NewStyle) from None
    return style


def finish(
    options: Options, before: "AnchorModel", made: "AnchorModel", style: "NewStyle | None" = None,
    inside: "np.ndarray | None" = None,
) -> None:  # fmt: skip
    """Measures the pace, writes the package, and says what there is and what moved."""
    from shapeshift.app.pace import with_every_pace
    from shapeshift.app.progress import working
    from shapeshift.rasterizer.device import open_device
    from shapeshift.runtime_models.package.feature_codes import EXACT
    from shapeshift.runtime_models.package.read_package import read_package
    from shapeshift.runtime_models.package.write_package import write_package
    from shapeshift.training.styles.add_style import drift_db

    if options.pace:
        made = with_every_pace(made)
    size = write_package(made, options.out, EXACT)
    written = read_package(options.out)
    with working("measuring what the other stops show"):
        drift = drift_db(open_device(options.device), before, written)
    for line in report(written, drift, style, inside):
        say(line)
    say(f"{full(options.out)}: {size:,} bytes.")
    if options.sheet is not None and style is not None:
        write_sheet(options.sheet, before, written, style, options.device)
        say(f"{full(options.sheet)}: {style.source} above {style.name}.")
    say(f"look: {program()} {full(options.out)}")


# What `style` says at the end: where the stops are, what moved, and a sheet of pictures.

SHEET_VIEWS, SHEET_SIZE = 4, (384, 288)
UNMOVED_DB = 90.0  # below that something is wrong: float rounding alone left 98.6 in the demo


def report(
    model: AnchorModel,
    drift: dict[str, float],
    style: "NewStyle | None",
    inside: np.ndarray | None,
) -> list[str]:
    """Lines: each stop with its x, and how exactly it shows what it showed."""
    lines = []
    for stop in model.stops:
        if stop.name in drift:
            moved = "" if drift[stop.name] >= UNMOVED_DB else ", MOVED: please report this scene"
            what = f"as it was, {drift[stop.name]:.0f} dB in the worst of 8 views{moved}"
        else:
            what = f"new, from {style.source}" if style is not None else "new"
            what = f"new, {stop.formula}" if stop.formula else what
        lines.append(f"x = {stop.x:.3f}  {stop.name}: {what}")
    if inside is not None:
        lines.append(f"It changes {int(inside.sum()):,} of {len(inside):,} anchors.")
    return lines


def write_sheet(
    path: Path, before: AnchorModel, after: AnchorModel, style: "NewStyle", device: str | None
) -> None:
    """A PNG: views of the source stop in the upper row, of the new stop below."""
    from shapeshift.app.drawing import save_png
    from shapeshift.rasterizer.device import open_device
    from shapeshift.scene.cameras.framing import default_background
    from shapeshift.training.evaluation.evaluate import ModelRenderer
    from shapeshift.training.styles.add_style import BEHIND
    from shapeshift.training.styles.train_stop import dome_views

    behind, opened = default_background(before, BEHIND), open_device(device)
    views = dome_views(before, SHEET_VIEWS, SHEET_SIZE)
    rows = []
    for model, name in ((before, style.source), (after, style.name)):
        renderer = ModelRenderer(opened, model)
        renderer.set_control(next(stop.x for stop in model.stops if stop.name == name))
        rows.append(np.concatenate([renderer.picture(view, behind) for view in views], axis=1))
    path.parent.mkdir(parents=True, exist_ok=True)
    save_png(np.concatenate(rows), path)
