"""What other programs make of a file of splats: who writes which axes, and what comes back.

    python3 tools/runtime_models/programs.py --out docs/bench/programs.csv [--keep FOLDER]

The programs themselves, in the versions below, are installed by npm and pip into a folder that goes
afterwards (--keep FOLDER: that stays, and is used again).  A scene of 2,000 splats of SH degree 3
that has a left, a top and a front of its own is written as a 3DGS PLY; each program makes of that
every format that it writes, and each reads what each has written.  A row is a file and a reader:
`seen` is how the scene stands for that reader, "upright" or the axis about which it is half a turn
off; `as_seen_db` the worst of four pictures against the scene itself, `turned_db` the same after
that half turn is undone: what the codes of the format cost.
"""

import argparse
import csv
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.runtime_models.model import BadFile, SplatLayers, Stop  # noqa: E402
from shapeshift.runtime_models.splats.formats import read_plain  # noqa: E402
from shapeshift.runtime_models.splats.operations.rotate_splats import rotate_splats  # noqa: E402
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, Reading  # noqa: E402
from shapeshift.runtime_models.splats.ply.write_ply import write_ply  # noqa: E402
from shapeshift.runtime_models.splats.spz.write_spz import write_spz  # noqa: E402
from shapeshift.runtime_models.splats.write_plain import writer_of  # noqa: E402
from shapeshift.scene.cameras.framing import frame_points, orbit_path  # noqa: E402
from shapeshift.scene.metrics import psnr  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402

NPM = {
    "splat-transform 3.7.0": "@playcanvas/splat-transform@3.7.0",
    "splat-transform 2.7.1": "@playcanvas/splat-transform@2.7.1",
    "@adobe/spz 0.2.3": "@adobe/spz@0.2.3",
}
PIP = ("gsply==0.4.6", "zstandard==0.25.0", "gaussforge==0.6.0")
COUNT, SIZE, VIEWS = 2000, (160, 120), 4
TURNS = {"upright": (1, 1, 1), "x": (1, -1, -1), "y": (-1, 1, -1), "z": (-1, -1, 1)}
COLUMNS = ("format", "writer", "bytes", "reader", "seen", "as_seen_db", "turned_db", "said")
SPZ = ("spz v2", "spz v3", "spz v4")
ENDINGS = {"sog": ".sog", "glb": ".glb", "splat": ".splat", "ksplat": ".ksplat", "ply": ".ply"}
BY_SPLAT_TRANSFORM = ("compressed.ply", "sog", "spz v3", "spz v4", "splat", "ksplat")
FOREIGN = """
import struct, sys
how, given, wanted, kind = sys.argv[1:]
if how == "gsply":
    import gsply
    read = gsply.read_spz if given.endswith(".spz") else gsply.plyread
    data = read(given)
    if kind.startswith("spz"):
        gsply.write_spz(wanted, data, version=int(kind[-1]))
    else:
        gsply.plywrite(wanted, data, compressed=kind == "compressed.ply")
else:
    from gaussforge import GaussForge
    name = given.rpartition("/")[2].partition(".")[2]
    more = {"spz_version": int(kind[-1])} if kind.startswith("spz") else {}
    made = GaussForge().convert(open(given, "rb").read(), name, kind.split()[0], **more)
    if "data" not in made:
        sys.exit(str(made))
    open(wanted, "wb").write(made["data"])
"""
ADOBE = """
import create from './node_modules/@adobe/spz/dist/spz.js';
import fs from 'fs';
const [how, given, wanted, axes, version] = process.argv.slice(2);
const spz = await create({ print: () => {}, printErr: (text) => console.error(text) });
const names = ['positions', 'scales', 'rotations', 'alphas', 'colors', 'sh'];
if (how === 'read') {
  const cloud = spz.loadSpzFromBuffer(new Uint8Array(fs.readFileSync(given)),
                                      { to: spz.CoordinateSystem[axes] });
  const made = { count: cloud.numPoints };
  for (const name of names) made[name] = Array.from(cloud[name]);
  fs.writeFileSync(wanted, JSON.stringify(made));
} else {
  const data = JSON.parse(fs.readFileSync(given));
  const cloud = { numPoints: data.count, shDegree: 3, antialiased: false, extensions: [] };
  for (const name of names) cloud[name] = new Float32Array(data[name]);
  const options = { version: Number(version), from: spz.CoordinateSystem[axes], sh1Bits: 8,
                    shRestBits: 8 };
  fs.writeFileSync(wanted, spz.saveSpzToBuffer(cloud, options));
}
"""


@dataclass(frozen=True)
class Program:
    name: str
    writes: tuple[str, ...]
    reads: tuple[str, ...]
    write: Callable[[Path, Path, str], None]  # (a PLY, the file, its format)
    read: Callable[[Path, Path], PlainSplats]  # (the file, an empty folder), in our axes


def run(*command: object, cwd: Path | None = None) -> str:
    """What a program says on standard error.  Raises RuntimeError where it fails."""
    done = subprocess.run(
        list(map(str, command)), cwd=cwd, capture_output=True, text=True, timeout=300, check=False
    )
    said = (done.stderr or done.stdout).strip().splitlines()
    if done.returncode:
        raise RuntimeError(said[-1][:100] if said else f"exit code {done.returncode}")
    return done.stderr


def as_ply(path: Path) -> PlainSplats:
    """What a program has written as a PLY, whose axes nobody doubts."""
    return read_plain(path, Reading(up="-Y", allow_huge=True))


def splat_transform(name: str, folder: Path) -> Program:
    if not (folder / "node_modules").is_dir():
        run("npm", "install", "--no-audit", "--no-fund", "--prefix", folder, NPM[name])
    tool = folder / "node_modules/.bin/splat-transform"

    def write(ply: Path, path: Path, kind: str) -> None:
        version = ("--spz-version", kind[-1]) if kind.startswith("spz") else ()
        run(tool, "-q", "-w", "-g", "cpu", *version, ply, path)

    def read(path: Path, empty: Path) -> PlainSplats:
        run(tool, "-q", "-w", path, empty / "a.ply")
        return as_ply(empty / "a.ply")

    writes = ("compressed.ply", "sog", "spz v3", "spz v4", "glb")
    return Program(name, writes, ("ply", *BY_SPLAT_TRANSFORM, "spz v2"), write, read)


def python_program(name: str, folder: Path) -> Program:
    python = folder / "bin/python"
    if not python.exists():
        run(sys.executable, "-m", "venv", folder)
        run(python, "-m", "pip", "-q", "install", *PIP)
    script = folder / "foreign.py"
    script.write_text(FOREIGN)
    how = name.split()[0]

    def write(ply: Path, path: Path, kind: str) -> None:
        run(python, script, how, ply, path, kind)

    def read(path: Path, empty: Path) -> PlainSplats:
        run(python, script, how, path, empty / "a.ply", "ply")
        return as_ply(empty / "a.ply")

    if how == "gsply":
        return Program(
            name, ("ply", "compressed.ply", *SPZ[1:]), ("ply", "compressed.ply", *SPZ), write, read
        )
    kinds = ("compressed.ply", "sog", *SPZ, "splat", "ksplat")
    return Program(name, kinds, ("ply", *kinds), write, read)


def adobe(name: str, folder: Path, axes: str) -> Program:
    """Niantic's own library; axes: what its user says, RDF as of a PLY, or UNSPECIFIED."""
    if not (folder / "node_modules").is_dir():
        run("npm", "install", "--no-audit", "--no-fund", "--prefix", folder, NPM[name])
    (folder / "adobe.mjs").write_text(ADOBE)

    def write(ply: Path, path: Path, kind: str) -> None:
        raw = raw_of(ply)
        data = {name: array.ravel().tolist() for name, array in raw.items()}
        (folder / "in.json").write_text(json.dumps({"count": len(raw["positions"])} | data))
        run("node", "adobe.mjs", "write", "in.json", path.resolve(), axes, kind[-1], cwd=folder)

    def read(path: Path, empty: Path) -> PlainSplats:
        made = (empty / "a.json").resolve()
        run("node", "adobe.mjs", "read", path.resolve(), made, axes, cwd=folder)
        return of_adobe(json.loads(made.read_text()), empty / "a.ply")

    asked = "as RDF" if axes == "RDF" else "axes not named"
    return Program(f"{name}, {asked}", SPZ, SPZ, write, read)


def raw_of(ply: Path) -> dict[str, np.ndarray]:
    """The numbers of a PLY as they are in it, by the names that @adobe/spz gives them."""
    from shapeshift.runtime_models.splats.ply.read_ply import read_raw_ply

    raw = read_raw_ply(ply, Reading())
    return {
        "positions": raw.means, "scales": raw.scales, "rotations": raw.wxyz[:, [1, 2, 3, 0]],
        "alphas": raw.opacity, "colors": raw.sh[:, 0], "sh": raw.sh[:, 1:],
    }  # fmt: skip


def of_adobe(data: dict, ply: Path) -> PlainSplats:
    """The splats that @adobe/spz gives, taken for a PLY's numbers."""
    count = data["count"]
    arrays = {
        name: np.array([np.inf if v is None else v for v in data[name]], np.float32)
        for name in ("positions", "scales", "rotations", "alphas", "colors", "sh")
    }  # JSON has no infinity: null
    names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"]
    names += [f"f_rest_{i}" for i in range(45)] + ["opacity"]
    names += [f"scale_{i}" for i in range(3)] + [f"rot_{i}" for i in range(4)]
    rest = arrays["sh"].reshape(count, -1, 3).transpose(0, 2, 1).reshape(count, -1)
    table = np.column_stack(
        [arrays["positions"].reshape(count, 3), arrays["colors"].reshape(count, 3), rest,
         arrays["alphas"], arrays["scales"].reshape(count, 3),
         arrays["rotations"].reshape(count, 4)[:, [3, 0, 1, 2]]]
    )  # fmt: skip
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    lines += [f"property float {name}" for name in names] + ["end_header", ""]
    ply.write_bytes("\n".join(lines).encode() + table.astype("<f4").tobytes())
    return as_ply(ply)


def ours(axes: str = "") -> Program:
    """This program; axes: those of --spz-axes, of which a row of its own tells."""

    def write(ply: Path, path: Path, kind: str) -> None:
        splats = as_ply(ply)
        if kind.startswith("spz"):
            write_spz(splats, path, int(kind[-1]), axes or "ply")
        else:
            writer_of(path).write(splats, path)

    def read(path: Path, empty: Path) -> PlainSplats:
        return read_plain(path, Reading(allow_huge=True))

    if axes:
        return Program(f"Shapeshift, --spz-axes {axes}", SPZ, (), write, read)
    kinds = ("ply", "compressed.ply", *SPZ, "glb", "splat")
    return Program("Shapeshift", kinds, (*kinds, "sog", "ksplat"), write, read)


def programs(folder: Path) -> list[Program]:
    npm = {name: folder / spec.replace("/", "-") for name, spec in NPM.items()}
    found = [splat_transform(name, npm[name]) for name in NPM if name.startswith("splat")]
    found += [python_program(f"{n} {v}", folder / "pip") for n, v in
              (("gsply", "0.4.6"), ("gaussforge", "0.6.0"))]  # fmt: skip
    found += [adobe("@adobe/spz 0.2.3", npm["@adobe/spz 0.2.3"], axes)
              for axes in ("RDF", "UNSPECIFIED")]  # fmt: skip
    return [ours(), ours("rub"), *found]


def scene() -> PlainSplats:
    """Splats all over an egg that leans to one side and is coloured by side: no two turns of it
    are alike, and no floor or zero tells which way is up."""
    rng = np.random.default_rng(3)
    normal = rng.normal(size=(COUNT, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    means = normal * (1.0, 0.6, 0.8) + np.array([0.15, 0.1, 0.05]) * normal[:, :1]
    sh = 0.08 * np.sin(3 * normal[:, None, :] + np.arange(16)[:, None])
    sh[:, 0] = 1.2 * np.sin(2 * normal + (0.5, 1.5, 2.5))
    wxyz = rng.normal(size=(COUNT, 4))
    arrays = (
        means, rng.uniform(0.01, 0.05, (COUNT, 3)),
        wxyz / np.linalg.norm(wxyz, axis=1)[:, None], rng.uniform(0.3, 0.95, COUNT), sh,
    )  # fmt: skip
    means, scales, wxyz, opacity, sh = (array.astype(np.float32) for array in arrays)
    return PlainSplats(means, scales, wxyz, opacity, sh)


class Likeness:
    """Pictures of the scene, and how like them others are."""

    def __init__(self, renderer: Renderer, wanted: PlainSplats) -> None:
        self._renderer = renderer
        self._views = orbit_path(VIEWS, *frame_points(wanted.means, wanted.opacity), SIZE)
        self._wanted = self._drawn(wanted)

    def _drawn(self, splats: PlainSplats) -> list[np.ndarray]:
        means = (splats.means + np.array(splats.origin)).astype(np.float32)
        arrays = (means, splats.scales, splats.wxyz, splats.opacity, splats.sh)
        model = SplatLayers(*arrays, np.zeros(len(means), np.int32), (Stop("only", 0.0),))
        self._renderer.update(Scene((SceneObject("splats", model),)))
        pictures = []
        for view in self._views:
            self._renderer.draw([view])
            pictures.append(self._renderer.resolved(0).copy())
        return pictures

    def db(self, splats: PlainSplats) -> float:
        pairs = zip(self._drawn(splats), self._wanted, strict=True)
        return min(psnr(a, b) for a, b in pairs)


def measure(found: list[Program], likeness: Likeness, ply: Path, folder: Path) -> Iterator[dict]:
    """A row for each file and each of its readers."""
    for writer in found:
        for kind in writer.writes:
            ending = f".{kind}" if kind.endswith("ply") else ENDINGS.get(kind, ".spz")
            path = folder / f"made{ending}"
            path.unlink(missing_ok=True)
            try:
                writer.write(ply, path, kind)
            except RuntimeError as error:
                print(f"{writer.name} does not write {kind}: {error}", file=sys.stderr)  # noqa: T201
                continue
            for reader in found:
                if kind in reader.reads:
                    yield one_row(writer.name, reader, kind, path, likeness)


def one_row(writer: str, reader: Program, kind: str, path: Path, likeness: Likeness) -> dict:
    """How one program reads one file."""
    row = {"format": kind, "writer": writer, "bytes": path.stat().st_size, "reader": reader.name}
    with tempfile.TemporaryDirectory() as empty:
        try:
            splats = reader.read(path, Path(empty))
        except (RuntimeError, BadFile, subprocess.TimeoutExpired) as error:
            return row | {"seen": "refused", "said": str(error)[:120]}
    dbs = {
        name: likeness.db(rotate_splats(replace(splats, findings=()), np.diag(signs).astype(float)))
        for name, signs in TURNS.items()
    }
    seen = max(dbs, key=dbs.__getitem__)
    said = "; ".join(finding.done for finding in splats.findings if reader.name == "Shapeshift")
    return row | {
        "seen": seen if seen == "upright" else f"half a turn about {seen}",
        "as_seen_db": f"{dbs['upright']:.1f}", "turned_db": f"{dbs[seen]:.1f}", "said": said,
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        tools = options.keep or folder
        tools.mkdir(parents=True, exist_ok=True)
        found, ply, wanted = programs(tools.resolve()), folder / "scene.ply", scene()
        write_ply(wanted, ply)
        with Renderer(None) as renderer, options.out.open("w", newline="") as file:
            file.write("# python3 tools/runtime_models/programs.py --out docs/bench/programs.csv\n")
            rows = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            rows.writeheader()
            for row in measure(found, Likeness(renderer, wanted), ply, folder):
                rows.writerow(row)
                file.flush()


if __name__ == "__main__":
    main()
