"""Every case by name, and the table that a run writes: rows, resumed rows, pictures."""

import csv
import ctypes
import gc
import io
import os
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from shapeshift.app.drawing import save_png
from shapeshift.app.errors import UsageError
from shapeshift.app.stability_cases import eyes_and_shapes, moving, places
from shapeshift.app.stability_cases.case_context import (
    EMPTY,
    CaseContext,
    CaseFinding,
    Panel,
    Result,
    at_least,
    at_most,
    broken_pixels,
    clean,
    decibels,
    difference,
    not_here,
)
from shapeshift.app.stability_cases.places import ORACLE_DB
from shapeshift.app.stability_cases.scenes import alone, front, shell, small_model
from shapeshift.runtime_models.files.plain_text import one_line
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.model import HEADS, SIZE_PER_SPLAT, AnchorModel, Mlp
from shapeshift.scene.scene import Scene, SceneObject

# Cases of networks gone wrong: control values that no one trained, weights that are no numbers.

OUTSIDE = (-0.1, -1e-3, 1.001, 1.1, 1e30, np.inf, -np.inf, np.nan)  # of 0..1, both sides


def extrapolated(case: CaseContext) -> Result:
    """x outside [0, 1] is refused with a sentence, and what was drawn before is drawn again."""
    scene, view = case.scene(), case.view()
    before = case.draw(scene, view)
    taken, silent = 0, 0
    for x in OUTSIDE:
        try:
            case.renderer.update(case.scene(x=float(x)))
        except ValueError as refusal:
            silent += not is_sentence(str(refusal))
        else:
            taken += 1
    after = case.draw(scene, view)
    findings = [
        clean(before, after),
        at_most(
            f"of {len(OUTSIDE)} values outside 0..1 (NaN too) that were taken", taken, 0,
            "nothing was trained there: networks may answer anything; sliders clamp, the renderer "
            "refuses",
        ),
        at_most(
            "refusals that are no sentence", silent, 0, "a person reads them",
        ),
        at_most(
            "largest change of the scene afterwards", np.abs(after - before).max(), 1e-6,
            "a refused value leaves everything as it was",
        ),
    ]  # fmt: skip
    panels = [case.panel("after the refusals", after), case.panel("before", before)]
    return Result(findings, panels)


def is_sentence(text: str) -> bool:
    """One line of several words that ends like a sentence."""
    return len(text.split()) >= 4 and "\n" not in text.strip() and text.strip().endswith(".")


def broken_heads(case: CaseContext) -> Result:
    """NaN and Inf in the weights or biases of one head at a time."""
    only = case.subject.models[0] if not case.subject.file else None
    model = only if isinstance(only, AnchorModel) else small_model()
    view = case.view() if model is only else front(case.size)
    whole = case.draw(alone(model), view)
    images, broken_by_name = {}, {}
    for head in HEADS:
        for what, value in (("NaN", np.nan), ("Inf", np.inf), ("-Inf", -np.inf)):
            for where in ("all weights", "one bias"):
                broken = with_broken_head(model, head, value, where)
                name = f"{what} in {where} of {head}"
                images[name] = case.draw(alone(broken), view)
                broken_by_name[name] = broken_pixels(images[name])
    worst = max(broken_by_name, key=lambda name: broken_by_name[name])
    one = case.draw(alone(small_model()), front(case.size))
    partly, known = half_broken(case)
    findings = [
        at_most(
            f"broken pixels in {len(images)} pictures (worst: {worst})",
            sum(broken_by_name.values()), 0,
            "what is not finite is not drawn: one NaN fragment would poison its pixel for good",
        ),
        at_least(
            "NaN in one splat's opacity of each anchor, against float64 without it, dB", partly,
            known, "the other splats stay as they are (16 bits leave 78 dB and more)",
        ),
        clean(whole, one),
    ]  # fmt: skip
    panels = [
        case.panel(worst, images[worst]),
        case.panel("whole networks", whole),
        Panel("8 times the difference", difference(images[worst], whole)),
    ]
    return Result(findings, panels)


def half_broken(case: CaseContext) -> tuple[float, float]:
    """dB of a small model of which one opacity output is NaN, and the least it may be."""
    model, view = small_model(), front((160, 96))
    broken = with_broken_head(model, "opacity", np.nan, "one bias")
    image = case.draw(alone(broken), view)
    return decibels(image, case.reference(alone(broken), view)), ORACLE_DB


def with_broken_head(model: AnchorModel, head: str, value: float, where: str) -> AnchorModel:
    """The model with one head's numbers replaced; `where`: "all weights" or "one bias"."""
    mlp = model.networks[head]
    weights, biases = list(mlp.weights), list(mlp.biases)
    if where == "all weights":
        weights[-1] = np.full_like(weights[-1], value)
    else:
        biases[-1] = biases[-1].copy()
        biases[-1][: SIZE_PER_SPLAT[head]] = value  # of the first splat of every anchor
    broken: Mlp = replace(mlp, weights=tuple(weights), biases=tuple(biases))
    return replace(model, networks=model.networks | {head: broken})


# The case of contexts and scenes that come and go: memory must not grow with them.

STATUS = Path("/proc/self/statm")
SETTLED = 0.5  # of the rounds: by then libraries are loaded and pools have their size
GROWTH_MB = 0.5  # a round
LEAST_BYTES = 8  # of a splat: its key and its place in the order
SMALL = (96, 64)


def life(case: CaseContext) -> Result:
    """Scenes loaded and dropped; then a context and a renderer made, drawn with, and closed."""
    loads = loaded_and_dropped(case)  # first: the heap that contexts leave behind has holes
    view = front(SMALL)
    scene = Scene((SceneObject("shell", shell(300)), SceneObject("networks", small_model())))
    memory, images = [], []
    for _ in range(case.rounds):
        with case.reopen() as (renderer, _):
            renderer.update(scene)
            renderer.draw([view])
            images.append(np.array(renderer.image(0)))
        del renderer
        gc.collect()
        memory.append(resident_mb())
    case.make_current()
    change = max(float(np.abs(image - images[0]).max()) for image in images)
    findings = [
        clean(*images),
        at_most(
            f"largest difference of {case.rounds} pictures", change, 1e-6,
            "a new context draws what the one before it drew",
        ),
        growth(
            "a context", memory, GROWTH_MB,
            "a context with its programs holds several MB: a leak would show ten times this",
        ),
        growth(
            "a scene loaded and dropped", loads,
            max(GROWTH_MB, case.subject.scene.splat_count * LEAST_BYTES / 1e6),
            "what it holds is 150 bytes a splat and more: this is the least two columns of it",
        ),
    ]  # fmt: skip
    return Result(findings, [case.panel("the last of the pictures", images[-1])])


def loaded_and_dropped(case: CaseContext) -> list[float | None]:
    """MB after each time that the scene came into the renderer and left it."""
    memory, view = [], case.view()
    for _ in range(max(case.rounds // 3, 12)):
        case.draw(case.scene(), view)
        case.draw(EMPTY, view)
        gc.collect()
        memory.append(resident_mb())
    return memory


def growth(what: str, memory: list[float | None], most: float, reason: str) -> CaseFinding:
    """MB a round by which the process grew once it had settled."""
    figure = f"growth of resident memory, MB {what}, {len(memory)} times"
    known = [mb for mb in memory if mb is not None]
    if len(known) < len(memory):
        return not_here(figure, "this system does not say how much memory a process holds")
    settled = known[int(SETTLED * len(known)) :]
    # The median of the slopes of all pairs (Theil and Sen): one late pool does not count as a leak.
    pairs = combinations(enumerate(settled), 2)
    slopes = [(after - before) / (j - i) for (i, before), (j, after) in pairs]
    return at_most(figure, float(np.median(slopes or [0.0])), most, reason)


def resident_mb() -> float | None:
    """MB of this process that lie in memory; None where the system does not tell.

    What has been freed and is merely kept for later goes back first: in a long process holes of
    the heap fill up slowly, which looks like a leak.
    """
    if not STATUS.exists():
        return None
    give_back = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc's
    if give_back is not None:
        give_back(0)
    return int(STATUS.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


CASES = {
    "sweep": moving.sweep,
    "stale-orbit": moving.stale_orbit,
    "stale-yaw": moving.stale_yaw,
    "popping": moving.popping,
    "disparity": eyes_and_shapes.disparity,
    "canted": eyes_and_shapes.canted,
    "stereo": eyes_and_shapes.stereo,
    "far-origin": places.far_origin,
    "depth-range": places.depth_range,
    "inside": places.inside,
    "lenses": places.lenses,
    "random-eyes": places.random_eyes,
    "needles": eyes_and_shapes.needles,
    "faint-layers": eyes_and_shapes.faint,
    "limits": eyes_and_shapes.limits,
    "counts": eyes_and_shapes.counts,
    "crowd": eyes_and_shapes.crowd,
    "extrapolated-x": extrapolated,
    "broken-heads": broken_heads,
    "life": life,
}
COLUMNS = ("case", "figure", "measured", "bound", "verdict", "reason")
NAME = "stability.csv"
LONGEST_HEAD = 10_000  # letters of a line that says what was run
CAPTION = 18  # pixels
LEAST_PANEL = 320  # pixels across; smaller pictures are enlarged by whole numbers


@dataclass
class Table:
    """stability.csv in a folder: the command, what it was run on, then one row a figure."""

    folder: Path
    command: str
    subject: str  # scene, size, drawing: rows of another are not mixed with these
    rows: dict[str, list[tuple]]  # by case, in the order in which they were run

    @property
    def path(self) -> Path:
        return self.folder / NAME

    def add(self, case: str, findings: list[CaseFinding]) -> None:
        """Takes the rows of a case and writes the file anew, all or nothing."""
        self.rows[case] = [
            (case, f.figure, f"{f.measured:.5g}" if f.bound else "", f.bound, f.verdict, f.reason)
            for f in findings
        ]
        self.write()

    def failed(self, case: str) -> bool:
        return any(row[4] == "FAILS" for row in self.rows[case])

    def write(self) -> None:
        text = io.StringIO()
        print(f"# {self.command}", f"# {self.subject}", sep="\n", file=text)
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(COLUMNS)
        for case in CASES:
            rows.writerows(self.rows.get(case, []))
        write_whole(self.path, text.getvalue().encode("utf-8", "backslashreplace"))


def open_table(folder: Path, command: str, subject: str, overwrite: bool) -> Table:
    """The table of a folder with the rows of an earlier run on the same subject that held."""
    command, subject = (one_line(text, LONGEST_HEAD) for text in (command, subject))
    table = Table(folder, command, subject, {})
    if not table.path.exists() or overwrite:
        return table
    lines = table.path.read_text(encoding="utf-8", errors="replace").splitlines()
    if lines[1:2] != [f"# {subject}"] or lines[2:3] != [",".join(COLUMNS)]:
        raise UsageError(
            f"{table.path} is of another run ({lines[1].lstrip('# ') if lines[1:] else 'empty'}); "
            "choose another --out or add --overwrite."
        )
    for row in csv.reader(lines[3:]):
        if len(row) == len(COLUMNS) and row[0] in CASES:
            table.rows.setdefault(row[0], []).append(tuple(row))
    for case in [case for case in table.rows if table.failed(case)]:
        del table.rows[case]
    return table


def save_panels(panels: list[Panel], path: Path) -> None:
    """The panels side by side, each under its caption."""
    if panels:
        tallest = max(enlarged(panel.image).shape[0] for panel in panels)
        parts = [captioned(panel, tallest) for panel in panels]
        gap = np.full((len(parts[0]), 4, 3), 0.25)
        joined = [piece for part in parts for piece in (part, gap)][:-1]
        save_png(np.concatenate(joined, axis=1), path)


def enlarged(image: np.ndarray) -> np.ndarray:
    times = -(-LEAST_PANEL // image.shape[1])
    return np.repeat(np.repeat(image, times, axis=0), times, axis=1)


def captioned(panel: Panel, height: int) -> np.ndarray:
    """(height + CAPTION, W, 3) with broken pixels in magenta, which no palette holds."""
    from PIL import Image, ImageDraw

    image = np.array(enlarged(panel.image)[..., :3], np.float64)
    image[~np.isfinite(image).all(axis=2)] = (1, 0, 1)
    canvas = np.zeros((height + CAPTION, image.shape[1], 3))
    canvas[CAPTION : CAPTION + len(image)] = image
    strip = Image.new("RGB", (image.shape[1], CAPTION), (40, 40, 40))
    ImageDraw.Draw(strip).text((4, 3), one_line(panel.caption), fill=(235, 235, 235))
    canvas[:CAPTION] = np.asarray(strip) / 255
    return canvas
