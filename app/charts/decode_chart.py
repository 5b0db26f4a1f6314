"""The paper's Figure 10 here: decode time against anchors, all five networks and colour alone."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np

from shapeshift.app.charts.chart_rows import RowsFile
from shapeshift.app.paths import DEMO, full
from shapeshift.app.terminal import say
from shapeshift.runtime_models.model import AnchorModel

ANCHORS = (1_000, 2_000, 5_000, 10_000, 20_000, 50_000, 100_000, 200_000)
MOST_RUNS, LEAST_RUNS = 9, 3
RUN_S = 2.0  # of one figure, unless LEAST_RUNS take longer
BACK_ENDS = ("onnxruntime", "OpenCL", "GL compute")
DRAWINGS = {"OpenCL": "tiles", "GL compute": "quads"}  # onnxruntime is a processor's in any case
CLOCKS = {True: "in processor time", False: "by the clock"}
LOOKS = {
    "onnxruntime": ("#d55e00", "o"), "OpenCL": ("#009e73", "^"), "GL compute": ("#0072b2", "s"),
}  # fmt: skip


@dataclass(frozen=True)
class DecodeRow:
    """One number of anchors with one back end; times until the splats lie in the arena."""

    back_end: str
    anchors: int
    splats: int
    all_ms: float  # median: offset, scale, rotation, opacity and colour, as after a change of x
    color_ms: float  # median: the colour network alone, as after a change of the view
    runs: int


def run_decode(folder: Path, context: str, command: str) -> int:
    """Writes decode.csv, decode.svg and decode.png; rows that are there are kept."""
    from shapeshift.app.drawing import open_renderer
    from shapeshift.app.measure import draws_on_cpu, machine_line
    from shapeshift.app.progress import tracked
    from shapeshift.runtime_models.read_scene import read_model

    model = read_model(DEMO)
    assert isinstance(model, AnchorModel)  # the bundled demo has networks
    with open_renderer(context, "auto") as (_, ctx):
        on_cpu = {name: name == "onnxruntime" or draws_on_cpu(DRAWINGS[name], ctx)
                  for name in BACK_ENDS if ctx or name != "GL compute"}  # fmt: skip
        clocks = ", ".join(f"{name} {CLOCKS[on]}" for name, on in on_cpu.items())
        networks = f"networks of {DEMO.name}: {network_words(model)}; {clocks}"
        head = (command, machine_line(ctx), networks)
        file = RowsFile(folder / "decode.csv", DecodeRow, head)
        known = {(row.back_end, row.anchors) for row in file.rows}
        wanted = [(name, n) for name in on_cpu for n in ANCHORS]
        missing = [job for job in wanted if job not in known]
        for name, anchors in tracked(missing, "decoding"):
            file.add(decode_row(name, ctx, with_anchors(model, anchors), on_cpu[name]))
    draw_decode(file.rows, folder)
    rows, picture = full(folder / "decode.csv"), full(folder / "decode.png")
    say(f"{len(file.rows)} rows in {rows}; {picture} shows them.")
    return 0


def network_words(model: AnchorModel) -> str:
    """Widths, as a reader needs them: the time follows them."""
    hidden = " ".join(str(len(bias)) for bias in model.networks["color"].biases[:-1])
    return (
        f"{model.features.shape[1]} features, {model.encoding.d} of Psi(x), hidden {hidden}, "
        f"{model.splats_per_anchor} splats an anchor"
    )


def with_anchors(model: AnchorModel, count: int) -> AnchorModel:
    """The same networks for `count` anchors: those of the model over and over."""
    return model.with_anchors(np.arange(count) % len(model.anchors))


def decode_row(back_end: str, ctx, model: AnchorModel, on_cpu: bool = True) -> DecodeRow:
    """Times one model; x and the eye change each time, so that nothing is found ready.

    on_cpu: by the processor time of all threads, which other programs do not lengthen.
    """
    with opened(back_end, ctx, model) as (geometry, colors, finish):
        counter = iter(range(1_000_000))

        def color(x: float = 0.5) -> None:
            colors(0, x, np.array([0.01 * next(counter), 0.0, 3.0]))
            finish()

        def everything() -> None:
            x = next(counter) / 1_000
            geometry(0, x)
            color(x)

        everything()  # first use compiles
        all_ms, color_ms = timed(everything, on_cpu), timed(color, on_cpu)
    return DecodeRow(back_end, len(model.anchors), model.splat_count,
                     _short(median(all_ms)), _short(median(color_ms)), len(all_ms))  # fmt: skip


@contextmanager
def opened(back_end: str, ctx, model: AnchorModel) -> Iterator[tuple[Callable, Callable, Callable]]:
    """(geometry, colour, finish) of one model in an arena of its own; finish waits for both."""
    if back_end != "GL compute":
        from shapeshift.renderer.colors.false_colors import Shade
        from shapeshift.renderer.tiles.tiles import TilesDrawing

        drawing = TilesDrawing(mlps=back_end.lower())
        drawing.allocate([model])

        def color(i: int, x: float, eye: np.ndarray) -> None:
            drawing.decode_color(i, Shade(x), eye)

        try:
            yield drawing.decode_geometry, color, drawing.device.queue.finish
        finally:
            drawing.close()
        return
    from shapeshift.renderer.gl.buffers import Arena
    from shapeshift.renderer.gl.decode import Decoder
    from shapeshift.renderer.gl.gpu import Gpu

    gpu = Gpu(ctx)
    arena = Arena(gpu, [model.splat_count])
    try:
        with Decoder(gpu, arena, [model], "gl") as decoder:
            yield decoder.geometry, decoder.color, ctx.finish
    finally:
        arena.release()
        gpu.release()


def timed(job: Callable[[], None], on_cpu: bool) -> list[float]:
    """ms of each of LEAST_RUNS to MOST_RUNS runs, RUN_S long together where that lies between."""
    times, clock = list[float](), time.process_time if on_cpu else time.perf_counter
    while len(times) < LEAST_RUNS or (len(times) < MOST_RUNS and sum(times) < RUN_S * 1e3):
        start = clock()
        job()
        times.append((clock() - start) * 1e3)
    return times


def _short(value: float) -> float:
    return float(f"{value:.4g}")


def draw_decode(rows: list[DecodeRow], folder: Path) -> None:
    """Both axes logarithmic: time grows as the anchors do, and the gap is the ratio."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, NullFormatter

    from shapeshift.app.charts.chart_picture import INK, PALE, WIDTH, save_figure

    figure = Figure((WIDTH, 4.2), layout="constrained", facecolor="white")
    axis = figure.subplots()
    for name, (color, marker) in LOOKS.items():
        mine = sorted((row for row in rows if row.back_end == name), key=lambda row: row.anchors)
        for field, style, what in (("all_ms", "-", "all five networks"),
                                   ("color_ms", "--", "colour alone")):  # fmt: skip
            if mine:
                axis.plot([row.anchors for row in mine], [getattr(row, field) for row in mine],
                          style, color=color, marker=marker, ms=4.5, lw=1.5,
                          label=f"{name}, {what}")  # fmt: skip
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xticks(ANCHORS, [f"{n // 1000}k" for n in ANCHORS])
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_xlabel("anchors", fontsize=9, color=INK)
    axis.set_ylabel("decode, ms (median)", fontsize=9, color=INK)
    splats = rows[0].splats // rows[0].anchors
    axis.set_title(f"A change of x and a change of the view, {splats} splats an anchor",
                   fontsize=10, color=INK)  # fmt: skip
    axis.tick_params(labelsize=8, colors=INK)
    axis.grid(color=PALE, lw=0.6, which="major")
    axis.set_axisbelow(True)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
    axis.legend(fontsize=8, frameon=True, edgecolor=PALE)
    save_figure(figure, folder / "decode")
