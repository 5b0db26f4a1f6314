"""How fast files open, and in how much memory, beside reading their bytes and beside other readers.

    python tools/runtime_models/open.py --out docs/bench/open.csv [FILE ...]

Made here: 3DGS PLY of 100,000 and 1,000,000 splats (SH degree 0 and 3), and 100,000 splats of
degree 3 in every format that we write; FILE: others, as they are.  In one process, in turns, each
reader opens the file (warm: in the system's cache) beside path.read_bytes() of it; the ratios are
medians of those of each turn, "cpu" of the process with all its threads.  The peak is that of a
process of its own while it opens the file, over the bytes of the arrays that come out.
Readers: ours is read_scene.read_model, from the path to a checked scene in our axes and units.
plyfile with all columns copied into one float32 array, as 3DGS's own load_ply does; gsply (views
into the file's bytes, in its codes); gaussforge.  Who is not installed, or refuses the file, is
left out.
"""

import argparse
import csv
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

TURNS, MOST_S = 15, 15.0  # openings by each reader, fewer where they take longer
FIELDS = (
    "file", "format", "sh_degree", "splats", "bytes", "bytes_a_splat", "reader", "turns",
    "read_bytes_ms_p50", "open_ms_p50", "open_ms_p90", "open_cpu_ms_p50", "ratio_p50", "ratio_p90",
    "cpu_ratio_p50", "peak_over_arrays", "msplats_a_second",
)  # fmt: skip
SIZES = ((100_000, 0), (100_000, 3), (1_000_000, 0), (1_000_000, 3))  # splats, SH degree


def ours(path: Path) -> list[np.ndarray]:
    from shapeshift.runtime_models.model import SplatLayers
    from shapeshift.runtime_models.read_scene import read_model

    model = read_model(path)
    arrays = [value for value in vars(model).values() if isinstance(value, np.ndarray)]
    return arrays + (list(model.extra.values()) if isinstance(model, SplatLayers) else [])


def by_plyfile(path: Path) -> list[np.ndarray]:
    from plyfile import PlyData

    vertex = PlyData.read(path)["vertex"]
    names = [p.name for p in vertex.properties]
    return [np.stack([np.asarray(vertex[name], np.float32) for name in names], axis=1)]


def by_gsply(path: Path) -> list[np.ndarray]:
    import gsply

    data = gsply.plyread(path)
    return [data.means, data.scales, data.quats, data.opacities, data.sh0, data.shN]


def by_gaussforge(path: Path) -> list[np.ndarray]:
    from gaussforge import GaussForge

    kind = "compressed.ply" if path.name.endswith(".compressed.ply") else path.suffix[1:]
    read = GaussForge().read(path.read_bytes(), kind)
    if "data" not in read:
        raise ValueError(read.get("error"))
    blocks = [value for value in read["data"].values() if isinstance(value, bytes)]
    return [np.frombuffer(block, np.float32) for block in blocks]


READERS: dict[str, Callable[[Path], list[np.ndarray]]] = {
    "ours": ours, "plyfile": by_plyfile, "gsply": by_gsply, "gaussforge": by_gaussforge,
}  # fmt: skip
PEERS = {  # the endings that each reads
    "plyfile": (".ply",),
    "gsply": (".ply",),
    "gaussforge": (".ply", ".compressed.ply", ".splat", ".ksplat", ".spz", ".sog"),
}


def readers_for(path: Path) -> list[str]:
    """The readers that are installed and know the format by its name."""
    import importlib.util

    ending = ".compressed.ply" if path.name.endswith(".compressed.ply") else path.suffix
    return ["ours"] + [
        name for name, kinds in PEERS.items() if ending in kinds and importlib.util.find_spec(name)
    ]


def clock(work: Callable[[], object]) -> tuple[float, float]:
    """Seconds of wall and of this process; what came is gone when the clock has stopped."""
    wall, cpu = time.perf_counter(), time.process_time()
    came = work()
    took = time.perf_counter() - wall, time.process_time() - cpu
    del came
    return took


def reads(name: str, path: Path) -> bool:
    """Whether a reader opens the file; ours has to."""
    try:
        READERS[name](path)
    except (ValueError, RuntimeError) as error:
        if name == "ours":
            raise
        print(f"{name} refuses {path.name}: {error}", file=sys.stderr)  # noqa: T201
        return False
    return True


def take_turns(path: Path) -> dict[str, list]:
    """(bytes wall, bytes cpu, wall, cpu) of each turn of each reader."""
    names, found = [name for name in readers_for(path) if reads(name, path)], {}
    began = time.monotonic()
    for turn in range(TURNS):
        for name in names:
            read = clock(path.read_bytes)
            opened = clock(lambda reader=READERS[name]: reader(path))
            found.setdefault(name, []).append((*read, *opened))
        if turn > 2 and time.monotonic() - began > MOST_S:
            break
    return found


def peak_of(path: Path, name: str) -> float:
    """Most memory that opening took over the bytes of the arrays; Linux alone tells."""
    READERS[name](path)  # imports, pools
    try:
        Path("/proc/self/clear_refs").write_text("5")  # the mark goes down to what is there now
    except OSError:
        return float("nan")
    before = memory("VmRSS")
    arrays = READERS[name](path)
    return (memory("VmHWM") - before) / sum(array.nbytes for array in arrays)


def memory(what: str) -> int:
    status = Path("/proc/self/status").read_text().splitlines()
    (line,) = [line for line in status if line.startswith(what + ":")]
    return int(line.split()[1]) * 1024


def child(*arguments: object) -> object:
    """What this program says in a process of its own."""
    command = [sys.executable, __file__, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}\n{done.stderr}")
    sys.stderr.write(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])  # peers print, too


def measure(path: Path) -> list[dict]:
    """The rows of one file."""
    from shapeshift.runtime_models.read_scene import describe, read_model

    facts = describe(read_model(path), path)
    size, splats, rows = path.stat().st_size, facts["splats"], []
    for name, turns in child("--turns-of", path).items():
        read, _, wall, _ = times = np.array(turns).T
        ratio, cpu_ratio = wall / read, times[3] / times[1]
        row = (
            path.name, facts["format"], facts["sh_degree"], splats, size, f"{size / splats:.1f}",
            name, len(turns), *(f"{1e3 * np.median(x):.1f}" for x in (read, wall)),
            f"{1e3 * np.percentile(wall, 90):.1f}", f"{1e3 * np.median(times[3]):.1f}",
            f"{np.median(ratio):.2f}", f"{np.percentile(ratio, 90):.2f}",
            f"{np.median(cpu_ratio):.2f}", f"{child('--peak-of', path, '--reader', name):.2f}",
            f"{splats / np.median(wall) / 1e6:.2f}",
        )  # fmt: skip
        rows.append(dict(zip(FIELDS, row, strict=True)))
        print(*row)  # noqa: T201
    return rows


def splats_of(count: int, degree: int):
    """Splats of any kind: what they show does not matter here."""
    from shapeshift.runtime_models.splats.plain_splats import PlainSplats

    rng, wide = np.random.default_rng(0), (degree + 1) ** 2
    wxyz = rng.standard_normal((count, 4), np.float32)
    return PlainSplats(
        rng.standard_normal((count, 3), np.float32) * 2,
        np.exp(rng.standard_normal((count, 3), np.float32) * 0.7 - 5),
        wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True),
        rng.random(count, np.float32),
        rng.standard_normal((count, wide, 3), np.float32) * 0.2,
    )


def made_files(folder: Path):
    """Writes one file after the other; each is gone before the next."""
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply
    from shapeshift.runtime_models.splats.write_plain import WRITERS

    for count, degree in SIZES:
        path = folder / f"{count // 1000}k_sh{degree}.ply"
        write_ply(splats_of(count, degree), path)
        yield path
        path.unlink()
    for writer in WRITERS:
        if writer.ending != ".ply":
            degree = min(3, writer.sh_degree)
            path = folder / f"100k_sh{degree}{writer.ending}"
            writer.write(splats_of(100_000, degree), path)
            yield path
            path.unlink()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--turns-of", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--peak-of", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--reader", default="ours", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.turns_of or options.peak_of:
        say = (
            take_turns(options.turns_of)
            if options.turns_of
            else peak_of(options.peak_of, options.reader)
        )
        print(json.dumps(say))  # noqa: T201
        return
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for path in made_files(Path(folder)):
            rows += measure(path)
    for path in options.files:
        rows += measure(path)
    if options.out:
        names = " ".join(path.name for path in options.files)
        with options.out.open("w", newline="") as file:
            program = "tools/runtime_models/open.py"
            file.write(f"# python {program} --out docs/bench/{options.out.name} {names}\n")
            load = f"load average {os.getloadavg()[0]:.1f} at the end" if os.name != "nt" else ""
            file.write(f"# {platform.machine()}, {os.cpu_count()} units; {load}\n")
            writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
