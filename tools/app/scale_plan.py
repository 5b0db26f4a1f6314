"""What captures past one machine need, reckoned from measured rows: workers, hours, storage.

    python3 tools/app/scale_plan.py [--photos N --splats N]

Prints the tables of docs/scale.md, which a test compares; with --photos and --splats those of
another capture.  All figures come from rows of docs/bench, from the arrays of a training step
(tools/app/step_memory.py) and from limits in the code; what is assumed stands in `Assumed`.
"""

import argparse
import csv
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.runtime_models.splats.sog.read_streamed import LARGEST_TREE  # noqa: E402
from shapeshift.scene.document.read_scene_file import MOST_OBJECTS  # noqa: E402
from shapeshift.training.settings import TrainSettings  # noqa: E402
from tools.app.step_memory import StepMemory, step_memory  # noqa: E402

BENCH = ROOT / "docs" / "bench"
PLUSH_PIXELS = (989 // 4) * (742 // 4)  # of a photo in step_cost.csv, --downscale 4
LEAF_BYTES = LARGEST_TREE / 100_000  # of the tree, as read_streamed.py has it: 7 levels
PLAIN_BYTES = 4 * 14  # of a splat of one colour in memory: mean, sizes, axes, opacity, colour
BY_ANCHOR = ("heads_ms", "activate_ms", "project_ms", "project_backward_ms", "density_ms",
             "heads_backward_ms", "adam_ms")  # fmt: skip
BY_PIXEL = ("bin_ms", "rasterize_ms", "loss_ms", "rasterize_backward_ms")
GB, HOUR = 1e9, 3600.0


@dataclass(frozen=True)
class Case:
    """A capture."""

    name: str
    photos: int
    splats: int


CASES = (
    Case("campus", 5_000, 5_000_000), Case("district", 100_000, 100_000_000),
    Case("city", 1_000_000, 1_000_000_000),
)  # fmt: skip


@dataclass(frozen=True)
class Assumed:
    """What no row says."""

    splats_a_photo: int = 1_000  # of the city; a leg has 258, a hall 312
    photo_mb: float = 4.0  # of a photo as the camera wrote it
    pixels: int = 640 * 480  # of a photo in training
    block_anchors: int = 60_000  # of a block
    blocks_a_photo: float = 1.6  # that it shows enough of
    looks: int = 60  # at each photo in a block
    coarse_steps: int = 4_000  # of the run before the blocks
    slots: int = 4  # tiles that a splat which is seen reaches
    window_gb: float = 1.0  # --photo-mb
    cores: int = 8  # of a worker
    deadline_h: float = 24.0
    memory_gb: float = 64.0  # of a machine
    budget: int = 2_000_000  # splats that a viewer draws
    fresh_s: float = 10.0  # of walking, after which all that is drawn was loaded anew


@dataclass(frozen=True)
class Measured:
    """Out of committed rows."""

    anchor_ms: float  # processor time of a step, an anchor
    pixel_ms: float  # and a pixel
    anchor_bytes: float  # of a package
    store_mb: float  # of a photo in training size on disk
    read_ms: float  # a photo, the first time
    lod_s: float  # processor seconds a million splats
    streamed_bytes: float  # a splat of any level; all levels have twice the finest's
    poses_s: float  # processor seconds a photo, of 33
    poses_photos: int
    step: StepMemory


def read_rows(name: str) -> list[dict[str, str]]:
    """A committed table, by its columns."""
    lines = (BENCH / name).read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def step_row() -> dict[str, str]:
    """A step with all anchors, pass by pass, of the code that the table ends with."""
    return [r for r in read_rows("step_cost.csv") if r["run"] == "all" and r["adam_ms"]][-1]


def measure() -> Measured:
    """What the committed rows say."""
    cost = step_row()
    grown = next(r for r in read_rows("growth.csv") if r["way"] == "default")
    store = {(r["photos"], r["way"]): r for r in read_rows("photo_store.csv")}
    levels = [r for r in read_rows("lod.csv") if (r["sh_degree"], r["level"]) == ("0", "0")]
    largest = max(levels, key=lambda row: int(row["splats"]))
    anchors = int(cost["anchors"])
    layout = TrainSettings().layout(2)
    return Measured(
        sum(float(cost[name]) for name in BY_ANCHOR) / anchors,
        sum(float(cost[name]) for name in BY_PIXEL) / PLUSH_PIXELS,
        int(grown["package_bytes"]) / int(grown["anchors"]),
        float(store["5000", "store"]["disk_mb"]) / 5000,
        1000 * float(store["5000", "memory"]["first_step_s"]) / 5000,
        float(largest["cpu_s_a_million"]), float(largest["bytes_a_splat"]),
        1.9, 33,  # docs/training.md, "Find the poses"
        step_memory(layout),
    )  # fmt: skip


@dataclass(frozen=True)
class Plan:
    """What a case needs."""

    blocks: int
    photos_a_block: int
    steps_a_block: int
    step_ms: float  # of one core
    block_h: float  # core hours
    core_h: float  # of all blocks and the run before them
    workers: int
    chain_h: float  # by the clock: what no number of workers shortens
    worker_gb: float
    photos_tb: float
    store_gb: float
    read_h: float  # core hours
    packages_gb: float
    streamed_gb: float  # all levels
    lod_h: float  # core hours
    first_mb: float  # until all of a budget is there
    walk_mbit: float  # a second
    pairs: int  # of photos that are matched for their poses


def plan(case: Case, measured: Measured, assumed: Assumed = Assumed()) -> Plan:
    """Core hours are of processor cores: no GPU was measured."""
    anchors = ceil(case.splats / TrainSettings().splats_per_anchor)
    blocks = ceil(anchors / assumed.block_anchors)
    of_block = ceil(anchors / blocks)
    per_block = ceil(min(assumed.blocks_a_photo, blocks) * case.photos / blocks)
    steps = assumed.looks * per_block
    step_ms = of_block * measured.anchor_ms + assumed.pixels * measured.pixel_ms
    block_h = steps * step_ms / 1000 / HOUR
    coarse_h = assumed.coarse_steps * step_ms / 1000 / HOUR
    core_h = coarse_h + blocks * block_h
    slots = assumed.slots * TrainSettings().splats_per_anchor * of_block
    memory = measured.step.total(of_block, slots, assumed.pixels) / GB
    return Plan(
        blocks, per_block, steps, step_ms, block_h, core_h,
        ceil(core_h / assumed.cores / assumed.deadline_h),
        (coarse_h + block_h) / assumed.cores, memory + assumed.window_gb,
        case.photos * assumed.photo_mb / 1e6, case.photos * measured.store_mb / 1e3,
        case.photos * measured.read_ms / 1000 / HOUR, anchors * measured.anchor_bytes / GB,
        2 * case.splats * measured.streamed_bytes / GB, case.splats / 1e6 * measured.lod_s / HOUR,
        min(assumed.budget, case.splats) * measured.streamed_bytes / 1e6,
        min(assumed.budget, case.splats) * measured.streamed_bytes * 8 / 1e6 / assumed.fresh_s,
        case.photos * (case.photos - 1) // 2,
    )  # fmt: skip


def limits(case: Case, needed: Plan, measured: Measured, assumed: Assumed = Assumed()):
    """(how often it is exceeded, what it is), the worst first: over 1 it breaks."""
    pairs = measured.poses_photos * (measured.poses_photos - 1) / 2
    pair_s = measured.poses_s * measured.poses_photos / pairs  # at most: as if all were matching
    match_h = needed.pairs * pair_s / HOUR / assumed.cores
    leaves = case.splats / 4096
    rows = [
        (match_h / assumed.deadline_h,
         "`poses` matches every photo with every other one: in a day, on one worker, by at most "
         f"{pair_s * 1000:.0f} ms a pair"),
        (case.photos / assumed.coarse_steps,
         f"the coarse run looks at one photo a step, and has {assumed.coarse_steps:,} steps"),
        (needed.blocks / MOST_OBJECTS, f"a scene file holds {MOST_OBJECTS:,} objects, or blocks"),
        (leaves * LEAF_BYTES / LARGEST_TREE,
         f"a tree of levels has {LARGEST_TREE >> 20} MB, at `--leaf 4096`"),
        (case.splats * PLAIN_BYTES / GB / assumed.memory_gb,
         f"`lod` holds all splats at once, at least {PLAIN_BYTES} bytes each, in "
         f"{assumed.memory_gb:g} GB"),
        (needed.lod_h / assumed.deadline_h, "`lod` works on one core: in a day"),
    ]  # fmt: skip
    return sorted(rows, key=lambda row: -row[0])


ROWS = (
    ("blocks of 60,000 anchors", "blocks", ",d", ""),
    ("photos that a block sees", "photos_a_block", ",d", ""),
    ("steps of a block", "steps_a_block", ",d", ""),
    ("a step, one core", "step_ms", ",.0f", " ms"),
    ("a block, core hours", "block_h", ",.1f", ""),
    ("all training, core hours", "core_h", ",.0f", ""),
    ("workers of 8 cores, done in a day", "workers", ",d", ""),
    ("hours that no worker more shortens", "chain_h", ",.1f", ""),
    ("memory of a worker", "worker_gb", ",.1f", " GB"),
    ("photos as taken, 4 MB each", "photos_tb", ",.2f", " TB"),
    ("photos in training size, on disk", "store_gb", ",.0f", " GB"),
    ("reading them once, core hours", "read_h", ",.2f", ""),
    ("packages of all blocks", "packages_gb", ",.2f", " GB"),
    ("levels of detail as streamed SOG", "streamed_gb", ",.2f", " GB"),
    ("making those, core hours", "lod_h", ",.2f", ""),
    ("until 2 million splats are loaded", "first_mb", ",.0f", " MB"),
    ("walking, all of them new in 10 s", "walk_mbit", ",.0f", " Mbit/s"),
    ("pairs of photos for poses", "pairs", ",d", ""),
)


def lines(cases: Sequence[Case], measured: Measured, assumed: Assumed = Assumed()) -> list[str]:
    """The tables as they stand in docs/scale.md."""
    plans = [plan(case, measured, assumed) for case in cases]
    told = [
        "| measured | value |", "|---|---|",
        f"| a step, an anchor | {measured.anchor_ms * 1e6:.0f} ns of a core (step_cost.csv) |",
        f"| a step, a pixel | {measured.pixel_ms * 1e6:.0f} ns of a core (step_cost.csv) |",
        f"| a step's memory | {measured.step.anchor:,} bytes an anchor, {measured.step.slot} a "
        f"slot, {measured.step.pixel} a pixel (tools/app/step_memory.py) |",
        f"| a package | {measured.anchor_bytes:.1f} bytes an anchor (growth.csv) |",
        f"| a photo, 640x480 | {measured.store_mb:.2f} MB on disk, read in "
        f"{measured.read_ms:.1f} ms (photo_store.csv) |",
        f"| levels of detail | {measured.lod_s:.1f} core seconds a million splats, "
        f"{measured.streamed_bytes:.1f} bytes a splat (lod.csv) |",
        f"| poses | {measured.poses_s} core seconds a photo of {measured.poses_photos} "
        "(docs/training.md) |",
        "",
    ]  # fmt: skip
    names = [f"{c.name}: {c.photos:,} photos, {c.splats:,} splats" for c in cases]
    told += [f"| | {' | '.join(names)} |", "|---" * (len(cases) + 1) + "|"]
    for words, name, form, unit in ROWS:
        values = [f"{getattr(each, name):{form}}{unit}" for each in plans]
        told.append(f"| {words} | {' | '.join(values)} |")
    broken: dict[str, list[str]] = {}  # what: how often too much, a case
    for number, (case, needed) in enumerate(zip(cases, plans, strict=True)):
        for times, what in limits(case, needed, measured, assumed):
            broken.setdefault(what, ["no"] * len(cases))
            broken[what][number] = f"{times:,.1f} times" if times > 1 else "no"
    told += ["", f"| breaks, too much by | {' | '.join(c.name for c in cases)} |"]
    told.append("|---" * (len(cases) + 1) + "|")
    told += [f"| {what} | {' | '.join(values)} |" for what, values in broken.items()
             if set(values) != {"no"}]  # fmt: skip
    return told


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--photos", type=int, default=0, help="of another capture")
    parser.add_argument("--splats", type=int, default=0, help="of its scene")
    asked = parser.parse_args()
    if asked.photos < 0 or asked.splats < 0 or bool(asked.photos) != bool(asked.splats):
        parser.error("--photos and --splats belong together, each 1 or more")
    cases = CASES if not asked.photos else (Case("yours", asked.photos, asked.splats),)
    sys.stdout.write("\n".join(lines(cases, measure())) + "\n")


if __name__ == "__main__":
    main()
