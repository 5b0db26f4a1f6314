"""One shape-shifting model beside separate models and plain splats: dB against seconds and bytes.

    python3 tools/training/baselines.py CAPTURE [CAPTURE ...] --seconds 60 240 900 \
        --sizes 0.1 0.3 1 --out WORK --csv docs/bench/baselines.csv [--seeds 0 1] \
        [--methods joint] [--vgg FILE]

CAPTURE is a folder of posed photos, or `balls`, `workshop` or `one_shape`, which are made on the
spot.  Each budget of `--seconds` is a `launch.py table` of all methods at full size; then, with the
last budget, the shape-shifting model and plain splats once more at each of `--sizes`: that share of
the splats to start with and of both caps; all of it with each of `--seeds`.  Tables lie in
WORK/CAPTURE/...; what is there is not run again, so an interrupted run goes on where it was.
"""

import argparse
import sys
from dataclasses import asdict
from itertools import product
from pathlib import Path
from typing import Any, cast

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE)]

from ways import add_cluster, write_rows  # noqa: E402

from shapeshift.app.charts.chart_rows import RowsFile, write_text  # noqa: E402
from shapeshift.app.training.table import Options, run  # noqa: E402
from shapeshift.app.training.table_parts import TableRow, VggRow  # noqa: E402
from shapeshift.training.baselines.plain_settings import PlainSettings  # noqa: E402
from shapeshift.training.settings import TrainSettings  # noqa: E402

KNOWN = ("balls", "workshop", "one_shape")
METHODS = ("joint", "separate", "splats", "spz")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", nargs="+")
    parser.add_argument("--seconds", type=float, nargs="+", required=True)
    parser.add_argument("--sizes", type=float, nargs="*", default=[])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS)
    parser.add_argument("--max-anchors", type=int, default=TrainSettings().max_anchors)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--csv", type=Path, required=True)
    parser.add_argument("--vgg", type=Path)
    parser.add_argument("--downscale", type=int)
    add_cluster(parser)
    asked = parser.parse_args()
    rows, head = [], [command_of(asked)]
    for name in asked.captures:
        folder = made(name, asked.out)
        plans = plan(asked.seconds, asked.sizes, asked.methods)
        for seed, (seconds, size, methods) in product(asked.seeds, plans):
            named = f"{seconds:g} s size {size:g}" + (f" seed {seed}" if seed else "")
            out = asked.out / folder.name / named
            out.mkdir(parents=True, exist_ok=True)
            asked_of, of_splats = caps(size, asked)
            asked_of |= {"seed": seed} if seed else {}
            lines = out / "settings.toml"
            write_text(lines, "".join(f"{key} = {value}\n" for key, value in of_splats.items()))
            options = Options(
                folder, out, asked_of, seconds=seconds, methods=cast(Any, methods), vgg=asked.vgg,
                settings=lines, cluster=asked.cluster, certificates=asked.certificates,
                gpus=asked.gpus,
            )  # fmt: skip
            if code := run(options):
                return code
            found, machine = read_table(out / "table.csv", asked.vgg is not None)
            head = [*head[:1], machine]
            about = {"capture": folder.name, "budget_s": seconds, "size": size, "seed": seed}
            rows += [about | asdict(row) for row in found]
            write_rows(asked.csv, head, tuple(rows[0]), rows)
    return 0


def plan(
    seconds: list[float], sizes: list[float], methods: list[str]
) -> list[tuple[float, float, tuple[str, ...]]]:
    """(seconds, size, methods) of every table."""
    asked = tuple(method for method in METHODS if method in methods)
    whole = [(budget, 1.0, asked) for budget in sorted(seconds)]
    sized = tuple(method for method in asked if method != "separate")
    rest = [(max(seconds), size, sized) for size in sorted(sizes) if size != 1]
    return [*whole, *rest]


def caps(size: float, asked: argparse.Namespace) -> tuple[dict[str, int], dict[str, int]]:
    """What is asked of anchors and of plain splats: caps at a share of the usual ones.

    Of the whole size nothing is asked, unless --max-anchors is: captures of one modality then have
    anchors of their own kind.
    """
    most, most_splats = (
        max(round(size * number), 1) for number in (asked.max_anchors, PlainSettings().max_splats)
    )
    smaller = {"downscale": asked.downscale} if asked.downscale else {}
    usual = most == TrainSettings().max_anchors
    return ({} if usual else {"max_anchors": most}) | smaller, {"max_splats": most_splats}


def made(name: str, work: Path) -> Path:
    """The folder of a capture; those that can be made are made where they are not there yet."""
    if name not in KNOWN:
        return Path(name)
    folder = work / "captures" / name
    if not (folder / "transforms.json").is_file():
        if name == "balls":
            from shapeshift.training.synthetic.balls import make_balls

            make_balls(folder)
        elif name == "one_shape":
            from tools.synthetic.one_shape import make_one_shape

            make_one_shape(folder)
        else:
            from shapeshift.training.synthetic.workshop import make_workshop

            make_workshop(folder)
    return folder


def read_table(path: Path, with_vgg: bool) -> tuple[list[TableRow], str]:
    """The rows of a table and the line that names its machine."""
    lines = [line[2:] for line in path.read_text().splitlines() if line.startswith("# ")]
    return RowsFile(path, VggRow if with_vgg else TableRow, lines).rows, lines[1]


def command_of(asked: argparse.Namespace) -> str:
    names = " ".join(Path(name).name for name in asked.captures)
    words = [f"python3 tools/training/baselines.py {names}"]
    words += [f"--seconds {' '.join(f'{s:g}' for s in asked.seconds)}"]
    words += [f"--sizes {' '.join(f'{s:g}' for s in asked.sizes)}"] if asked.sizes else []
    words += [f"--seeds {' '.join(map(str, asked.seeds))}"] if asked.seeds != [0] else []
    words += [f"--methods {' '.join(asked.methods)}"] if asked.methods != METHODS else []
    usual = TrainSettings()
    caps_differ = asked.max_anchors != usual.max_anchors
    words += [f"--max-anchors {asked.max_anchors}"] if caps_differ else []
    words += [f"--downscale {asked.downscale}"] if asked.downscale else []
    words += [f"--vgg {asked.vgg.name}"] if asked.vgg else []
    return " ".join([*words, "--out WORK --csv FILE"])


if __name__ == "__main__":
    sys.exit(main())
