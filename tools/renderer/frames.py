"""Frame times beside image errors of the demo and of two scenes of others: frames.csv.

    python3 tools/renderer/frames.py anatomy_leg_ml3dgs plant.splat --out docs/bench/frames.csv

Each row is a run of `launch.py bench` in a process of its own, which alternates nothing: compare
within a run (stereo_over_mono, draw_pass_ratio), or rows of the same scene.  The demo and the first
scene are drawn with quads and tiles, the second, splats with SH degree 0, with tiles alone.
"""

import argparse
import csv
import io
import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from shapeshift.app.measure import processor  # noqa: E402

FRAMES, SWEEP = 20, 20
SIZES = ("1280x720", "640x360")
PASSES = ("decode", "project", "sort", "bin", "splat")
COLUMNS = (
    "scene", "size", "drawing", "x", "frame_p50_ms", "frame_p95_ms", "frame_p99_ms", "psnr_db",
    "stereo_over_mono", "sweep_worst_ms", "draw_pass_ratio", "splats", "drawn",
    *(f"{name}_ms" for name in PASSES),
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("layers", type=Path, help="a folder of layers, drawn at x 1")
    parser.add_argument("splats", type=Path, help="a file of plain splats")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    jobs = [
        (ROOT / "assets" / "workshop.shift", 0.0, SWEEP, ("quads", "tiles")),
        (options.layers, 1.0, 10, ("quads", "tiles")),
        (options.splats, 0.0, 2, ("tiles",)),
    ]
    results = [
        bench(scene, x, size, drawing, sweep)
        for scene, x, sweep, drawings in jobs
        for size in SIZES
        for drawing in drawings
    ]
    options.out.write_text(table(results, options))


def bench(scene: Path, x: float, size: str, drawing: str, sweep: int) -> dict:
    """The JSON of one run, with x."""
    words = ["bench", scene, "--x", x, "--size", size, "--drawing", drawing, "--frames", FRAMES,
             "--sweep", sweep, "--json"]  # fmt: skip
    program = [sys.executable, ROOT / "launch.py", *map(str, words)]
    done = subprocess.run(program, check=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout) | {"x": x}


def table(results: list[dict], options: argparse.Namespace) -> str:
    text = io.StringIO()
    names = f"{options.layers.name} {options.splats.name}"
    text.write(f"# python3 tools/renderer/frames.py {names} --out docs/bench/frames.csv\n")
    gl = next(r["gl_renderer"] for r in results if r["gl_renderer"])
    text.write(
        f"# {processor()}, {gl}; psnr_db is the worst of several "
        "pictures against the float64 reference\n"
    )
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    for result in results:
        frame, passes = result["frame_ms"], result["passes"]
        ratio = result["draw_pass_ratio"]
        rows.writerow(
            [
                result["scene"],
                result["size"],
                result["backends"]["drawing"],
                result["x"],
                *(f"{frame[p]:.1f}" for p in ("p50", "p95", "p99")),
                f"{result['psnr_db']:.1f}",
                f"{result['stereo_over_mono']:.2f}",
                f"{result['sweep_worst_ms']:.1f}",
                "" if ratio is None else f"{ratio:.2f}",
                result["splats"],
                result["drawn"],
                *(f"{passes[p]['p50']:.1f}" if p in passes else "" for p in PASSES),
            ]
        )
    return text.getvalue()


if __name__ == "__main__":
    main()
