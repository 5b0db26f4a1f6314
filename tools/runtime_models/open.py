"""How fast files open, and in how much memory, beside reading their bytes and beside other readers.

    python tools/runtime_models/open.py --out docs/bench/open.csv [--before FOLDER] [FILE ...]

Made here: 3DGS PLY of 100,000 and 1,000,000 splats (SH degree 0 and 3), 100,000 splats of degree 3
in every format that we write, and .spz (versions 3 and 4) and .sog of 1,000,000 of degree 1; FILE:
others, as they are.  In turns, each reader, in a process of its own, opens the file (warm: in the
system's cache) beside path.read_bytes() of it; the ratios are medians of those of each turn, "cpu"
of the process with all its threads.  The peak is that of another process while it opens the file
for the second time, over the bytes of the arrays that come out.
Readers: ours is read_scene.read_model, from the path to a checked scene in our axes and units;
before the same of the checkout FOLDER.  plyfile with all columns copied into one float32 array, as
3DGS's own load_ply does; gsply (of a PLY views into the file's bytes, in its codes); gaussforge.
Who is not installed, or refuses the file, is left out.
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
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
# A reader's process may be that of another checkout.
sys.path[:0] = [sys.argv[sys.argv.index("--root") + 1] if "--root" in sys.argv else str(ROOT)]

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
    from plyfile import PlyData  # pyright: ignore[reportMissingImports]  # a peer

    vertex = PlyData.read(path)["vertex"]
    names = [p.name for p in vertex.properties]
    return [np.stack([np.asarray(vertex[name], np.float32) for name in names], axis=1)]


def by_gsply(path: Path) -> list[np.ndarray]:
    import gsply  # pyright: ignore[reportMissingImports]  # a peer
    from gsply.sog_reader import sogread  # pyright: ignore[reportMissingImports]

    read = {".spz": gsply.read_spz, ".sog": sogread}.get(path.suffix, gsply.plyread)
    data = read(str(path))
    arrays = data.means, data.scales, data.quats, data.opacities, data.sh0, data.shN
    return [array for array in arrays if array is not None]  # None: one colour from all sides


def by_gaussforge(path: Path) -> list[np.ndarray]:
    from gaussforge import GaussForge

    kind = "compressed.ply" if path.name.endswith(".compressed.ply") else path.suffix[1:]
    read = GaussForge().read(path.read_bytes(), kind)
    if "data" not in read:
        raise ValueError(read.get("error"))
    blocks = [value for value in read["data"].values() if isinstance(value, bytes)]
    return [np.frombuffer(block, np.float32) for block in blocks]


READERS: dict[str, Callable[[Path], list[np.ndarray]]] = {
    "ours": ours, "before": ours, "plyfile": by_plyfile, "gsply": by_gsply,
    "gaussforge": by_gaussforge,
}  # fmt: skip
PEERS = {  # the endings that each reads
    "plyfile": (".ply",),
    "gsply": (".ply", ".spz", ".sog"),
    "gaussforge": (".ply", ".compressed.ply", ".splat", ".ksplat", ".spz", ".sog"),
}


def readers_for(path: Path) -> list[str]:
    """The readers that are installed and know the format by its name."""
    import importlib.util

    ending = ".compressed.ply" if path.name.endswith(".compressed.ply") else path.suffix
    return [
        name for name, kinds in PEERS.items() if ending in kinds and importlib.util.find_spec(name)
    ]


def clock(work: Callable[[], object]) -> tuple[float, float]:
    """Seconds of wall and of this process; what came is gone when the clock has stopped."""
    wall, cpu = time.perf_counter(), time.process_time()
    came = work()
    took = time.perf_counter() - wall, time.process_time() - cpu
    del came
    return took


def serve(name: str, path: Path) -> None:
    """In a process of its own: a line of JSON for each line that comes, which names a figure."""
    reader = READERS[name]
    say = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # peers print, too
    try:
        reader(path)  # imports, pools
    except (ValueError, RuntimeError, ImportError) as error:
        if name in ("ours", "before"):
            raise
        print(f"{name} refuses {path.name}: {error}", file=sys.stderr)  # noqa: T201
        return
    for line in sys.stdin:
        figure = (
            [*clock(path.read_bytes), *clock(lambda: reader(path))]
            if line.strip() == "turn"
            else peak_of(path, reader)
        )
        print(json.dumps(figure), file=say, flush=True)


class ReaderProcess:
    """A reader of one file, which opens it whenever it is asked to."""

    def __init__(self, name: str, path: Path, root: Path) -> None:
        command = [sys.executable, "-P", __file__, "--serve", name, "--root", str(root), str(path)]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def ask(self, figure: str) -> Any:
        """[bytes wall, bytes cpu, wall, cpu] of a "turn", or the "peak"; None: it refuses."""
        assert self._process.stdin and self._process.stdout
        try:
            self._process.stdin.write(figure + "\n")
            self._process.stdin.flush()
            return json.loads(self._process.stdout.readline() or "null")
        except BrokenPipeError:
            return None

    def end(self) -> None:
        self._process.communicate()


def take_turns(path: Path, before: Path | None) -> dict[str, tuple[list, float]]:
    """The turns of each reader of a file, and its peak."""
    roots = {"ours": ROOT} | ({"before": before} if before else {})
    roots |= dict.fromkeys(readers_for(path), ROOT)
    readers = {name: ReaderProcess(name, path, root) for name, root in roots.items()}
    found: dict[str, list] = {name: [] for name in readers}
    began = time.monotonic()
    for turn in range(TURNS):
        for name, reader in readers.items():
            if (took := reader.ask("turn")) is not None:
                found[name].append(took)
        if turn > 2 and time.monotonic() - began > MOST_S:
            break
    for reader in readers.values():
        reader.end()
    peaks = {name: peak for name, turns in found.items() if turns
             and (peak := ReaderProcess(name, path, roots[name]).ask("peak"))}  # fmt: skip
    return {name: (found[name], peak) for name, peak in peaks.items()}


def peak_of(path: Path, reader: Callable[[Path], list[np.ndarray]]) -> float:
    """Most memory that opening took over the bytes of the arrays; Linux alone tells."""
    try:
        Path("/proc/self/clear_refs").write_text("5")  # the mark goes down to what is there now
    except OSError:
        return float("nan")
    before = memory("VmRSS")
    arrays = reader(path)
    return (memory("VmHWM") - before) / sum(array.nbytes for array in arrays)


def memory(what: str) -> int:
    status = Path("/proc/self/status").read_text().splitlines()
    (line,) = [line for line in status if line.startswith(what + ":")]
    return int(line.split()[1]) * 1024


def measure(path: Path, before: Path | None) -> list[dict]:
    """The rows of one file."""
    from shapeshift.runtime_models.read_scene import describe, read_model

    facts = describe(read_model(path), path)
    size, splats, rows = path.stat().st_size, facts["splats"], []
    for name, (turns, peak) in take_turns(path, before).items():
        read, _, wall, _ = times = np.array(turns).T
        ratio, cpu_ratio = wall / read, times[3] / times[1]
        row = (
            path.name, facts["format"], facts["sh_degree"], splats, size, f"{size / splats:.1f}",
            name, len(turns), *(f"{1e3 * np.median(x):.1f}" for x in (read, wall)),
            f"{1e3 * np.percentile(wall, 90):.1f}", f"{1e3 * np.median(times[3]):.1f}",
            f"{np.median(ratio):.2f}", f"{np.percentile(ratio, 90):.2f}",
            f"{np.median(cpu_ratio):.2f}", f"{peak:.2f}", f"{splats / np.median(wall) / 1e6:.2f}",
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


def write_spz(splats, path: Path, version: int) -> None:
    from shapeshift.runtime_models.splats.spz.write_spz import write_spz

    write_spz(splats, path, version)


def write_sog(splats, path: Path) -> None:
    from shapeshift.runtime_models.splats.sog.write_sog import write_sog

    with tempfile.TemporaryDirectory() as folder:
        write_sog(splats, Path(folder), "open.py")
        with zipfile.ZipFile(path, "w") as packed:  # stored: WebP is packed already
            for part in Path(folder).iterdir():
                packed.write(part, part.name)


LARGE = {  # of a million splats
    "1000k_sh1_v3.spz": lambda splats, path: write_spz(splats, path, 3),
    "1000k_sh1_v4.spz": lambda splats, path: write_spz(splats, path, 4),
    "1000k_sh1.sog": write_sog,
}


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
    splats = splats_of(1_000_000, 1)
    for name, write in LARGE.items():
        path = folder / name
        write(splats, path)
        yield path
        path.unlink()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--before", type=Path, help="a checkout whose reader takes turns, too")
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    parser.add_argument("--root", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve(options.serve, options.files[0])
        return
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for path in made_files(Path(folder)):
            rows += measure(path, options.before)
    for path in options.files:
        rows += measure(path, options.before)
    if options.out:
        names = " ".join(path.name for path in options.files)
        with options.out.open("w", newline="") as file:
            program = "tools/runtime_models/open.py"
            before = "--before FOLDER " if options.before else ""
            file.write(f"# python {program} --out docs/bench/{options.out.name} {before}{names}\n")
            load = f"load average {os.getloadavg()[0]:.1f} at the end" if os.name != "nt" else ""
            file.write(f"# {platform.machine()}, {os.cpu_count()} units; {load}\n")
            writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
