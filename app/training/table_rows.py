"""Rows of a comparison of methods, shown in the form of the paper's Tables 1 and 2."""

from dataclasses import dataclass
from pathlib import Path

from shapeshift.app.terminal import open_console

MEAN = "mean"  # the modality of the row that sums a method up
NAMES = {
    "joint": "shape-shifting",
    "separate": "separate models",
    "splats": "3DGS splats",
    "spz": "the same as spz",
}

OTHERS = {"spz": "3DGS splats as spz"}  # where no line above says what is the same


@dataclass(frozen=True)
class TableRow:
    method: str
    modality: str  # MEAN: over all modalities, with the bytes and seconds of all files together
    psnr_db: float
    median_db: float  # of the photos' PSNR: one that nothing can explain does not move it
    ssim: float
    mb: float  # 1e6 bytes on disk of the file that shows this modality
    seconds: float  # that making this file used: of one core, where a processor computed
    start_s: float  # of these, before the first step
    steps: int
    splats: int  # that are there at this modality's stop
    photos: int  # held out


@dataclass(frozen=True)
class VggRow(TableRow):
    vgg_distance: float


def mean_row(rows: list[TableRow], runs: list) -> TableRow:
    """What a method gives on average, and what it takes in all."""
    from shapeshift.training.evaluation.evaluate import bytes_on_disk

    def mean(name: str, places: int) -> float:
        return round(sum(getattr(row, name) for row in rows) / len(rows), places)

    more = [mean("vgg_distance", 5)] if isinstance(rows[0], VggRow) else []
    return type(rows[0])(
        rows[0].method, MEAN, mean("psnr_db", 3), mean("median_db", 3), mean("ssim", 5),
        sum(bytes_on_disk(run.file) for run in runs) / 1e6,
        round(sum(round(run.seconds, 1) for run in runs), 1),  # of what the rows above say
        round(sum(round(run.start_s, 1) for run in runs), 1),
        sum(run.steps for run in runs),
        round(mean("splats", 1)), sum(row.photos for row in rows), *more,
    )  # fmt: skip


def finish(rows: list[TableRow], out: Path, head: list[str]) -> None:
    """table.md, and the same on standard error."""
    from rich.table import Table

    from shapeshift.app.charts.chart_rows import write_text

    columns, lines = cells(rows)
    shown = Table(*columns)
    for line in lines:
        shown.add_row(*line)
    console = open_console()
    console.print(shown)
    verdicts = compare(rows)
    for text in (*verdicts, head[2]):
        console.print(text, highlight=False, markup=False)
    page = [f"`{head[0]}`  ", f"{head[1]}  ", head[2], "", row_of(columns)]
    page += [row_of(["---"] * len(columns)), *map(row_of, lines), "", *verdicts]
    write_text(out / "table.md", "\n".join(page) + "\n")


def row_of(cells: list[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def cells(rows: list[TableRow]) -> tuple[list[str], list[list[str]]]:
    """Column names and lines as the paper has them: a method is named where its lines begin."""
    vgg = [] if not rows or not isinstance(rows[0], VggRow) else ["VGG distance"]
    columns = [
        "method",
        "modality",
        "PSNR dB",
        "median",
        "SSIM",
        *vgg,
        "splats",
        "MB",
        "steps",
        "seconds",
        "of these start",
    ]
    lines, before = [], ""
    for row in rows:
        more = [f"{row.vgg_distance:.4f}"] if isinstance(row, VggRow) else []
        name, before = NAMES[row.method] if row.method != before else "", row.method
        whole = row.method != "joint" or row.modality == MEAN  # one file for all: counted once
        size = [f"{row.mb:.2f}", f"{row.steps:,}", f"{row.seconds:.1f}", f"{row.start_s:.1f}"]
        size = size if whole else [""] * 4
        likeness = [f"{row.psnr_db:.2f}", f"{row.median_db:.2f}", f"{row.ssim:.4f}", *more]
        lines.append([name, row.modality, *likeness, f"{row.splats:,}", *size])
    return columns, lines


def compare(rows: list[TableRow]) -> list[str]:
    """What the one model gains and saves against each of the others, in a sentence."""
    means = {row.method: row for row in rows if row.modality == MEAN}
    if "joint" not in means:
        return []
    one, sentences = means["joint"], []
    for method in ("separate", "splats", "spz"):
        if method in means:
            other, name = means[method], OTHERS.get(method, NAMES[method])
            gain, time = one.psnr_db - other.psnr_db, one.seconds / max(other.seconds, 0.1)
            sentences.append(
                f"{NAMES['joint']} against {name}: {gain:+.2f} dB in the mean, "
                f"{one.mb / other.mb:.3f} of the bytes, {time:.2f} of the seconds."
            )
    return sentences
