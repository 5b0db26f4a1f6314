"""Two halves of one capture are the same place: what `change` says of them, a row a pair.

    python tools/inspection/halves.py WORK --seconds 10 --out docs/bench/halves.csv

The demo's workshop is ray-traced from 40 places; every second photo makes one half, the rest the
other, in one world.  A half is made again with the can taken away, with the mug moved, at 1.6
times the light, in the opposite order, with a third of the first half's photos, and of one photo;
"elsewhere" is another place of the same size, and front and back are halves by time.  Each is
trained for --seconds of one core.  With --data FOLDER plush_snowmiku is split too.
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import shapeshift as ss  # noqa: E402
from shapeshift.runtime_models.files.whole_file import make_folders  # noqa: E402
from shapeshift.runtime_models.model import BadFile, Stop  # noqa: E402
from shapeshift.scene.captures.capture import Capture, Photo  # noqa: E402
from shapeshift.scene.captures.write_capture import write_capture  # noqa: E402
from shapeshift.training.synthetic.balls import save_png  # noqa: E402
from shapeshift.training.synthetic.tracer import Solid, photograph, surface_points  # noqa: E402
from shapeshift.training.synthetic.workshop import (  # noqa: E402
    GREY,
    dome,
    placed,
    radiance_of,
    things,
)
from tools.inspection.visits import MUG_MOVED, OIL_CAN  # noqa: E402

VIEWS, SIZE = 40, (160, 120)
STOP = Stop("RGB", 0.0, "rgb")
COLUMNS = "pair,how,shared,places,found,beside_cm,cpu_s"


def solids_of(change: str) -> list[Solid]:
    """Of the workshop: as it is, without its can, with the mug moved, or another place."""
    out = []
    for name, solids in things(opened=False):
        if change == "can gone" and name == "can":
            continue
        move = np.eye(4)
        if change == "mug moved" and name == "mug":
            move[:3, 3] = MUG_MOVED
        if change == "elsewhere":  # another place: a few things, each turned and set anew
            if name not in ("bench", "mug", "motor", "spanner"):
                continue
            move[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
            move[:3, 3] = (0.1, 0.05, 0.0)
        out += [replace(s, world_from_local=move @ s.world_from_local) for s in solids]
    return out


def photo_of(work: Path, row: int, change: str) -> np.ndarray:
    """(H, W, 3) display sRGB, traced once and kept."""
    path = work / "photos" / (change or "as it is") / f"{row:03}.png"
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        here, clearance = placed(solids_of(change))
        image, _ = photograph(dome(VIEWS, 0.0, SIZE)[row], radiance_of(here, clearance, False))
        save_png(path, image)
    with Image.open(path) as kept:
        return np.asarray(kept.convert("RGB"), np.float32) / 255


def make_half(
    work: Path, name: str, rows: list[int], change: str = "", exposure: float = 1.0
) -> Path:
    """Writes a capture of some of the VIEWS photos."""
    folder = work / name.replace(" ", "_")
    if (folder / "transforms.json").is_file():
        return folder
    make_folders(folder, "rgb")
    photos, views = [], dome(VIEWS, 0.0, SIZE)
    for row in rows:
        light = photo_of(work, row, change) ** 2.2 * exposure
        path = folder / "rgb" / f"{row:03}.png"
        save_png(path, np.clip(light, 0, 1) ** (1 / 2.2))
        photos.append(Photo(views[row], path, "RGB", None, "train"))
    points, _ = surface_points(placed(solids_of(""))[0], views[::2], 6000, 0.0015)
    grey = np.full((len(points), 3), 0.5, np.float32)
    capture = Capture(folder, (STOP,), tuple(photos), points.astype(np.float32), grey,
                      (GREY, GREY, GREY), {"source": "ray-traced: a half"})  # fmt: skip
    write_capture(capture)
    return folder


EVEN, ODD = list(range(0, VIEWS, 2)), list(range(1, VIEWS, 2))
HALVES = {
    "a": (EVEN, "", 1.0),
    "b": (ODD, "", 1.0),
    "front": (list(range(VIEWS // 2)), "", 1.0),
    "back": (list(range(VIEWS // 2, VIEWS)), "", 1.0),
    "can gone": (ODD, "can gone", 1.0),
    "mug moved": (ODD, "mug moved", 1.0),
    "brighter": (ODD, "", 1.6),
    "reversed": (ODD[::-1], "", 1.0),
    "a third shared": (EVEN[:7] + ODD[7:], "", 1.0),
    "one photo": (ODD[:1], "", 1.0),
    "elsewhere": (ODD, "elsewhere", 1.0),
}


def split(data: Path, work: Path) -> dict[str, Path]:
    """plush_snowmiku in halves: every second photo of its table of cameras."""
    table = json.loads((data / "cameras.json").read_text())
    made = {}
    for name, first in (("plush a", 0), ("plush b", 1)):
        folder = work / name.replace(" ", "_")
        folder.mkdir(exist_ok=True)
        for part in ("images", "points3d.npz"):
            if not (folder / part).exists():
                (folder / part).symlink_to((data / part).resolve())
        half = table | {"frames": table["frames"][first::2]}
        (folder / "cameras.json").write_text(json.dumps(half))
        made[name] = folder
    return made


def trained(capture: Path, seconds: float, *words: str) -> Path:
    """The package of a half; one that is there is used as it is."""
    package = capture.with_name(f"{capture.name}.shift")
    if not package.is_file():
        command = ["train", str(capture), "--out", str(package), "--seconds", f"{seconds:g}"]
        program = [sys.executable, "-P", str(ROOT / "shapeshift" / "__main__.py")]
        subprocess.run([*program, *command, *words], check=True)
    return package


def row_of(pair: tuple[str, str], first: Path, second: Path) -> str:
    begun = time.process_time()
    try:
        found = ss.change(first, second)
    except BadFile as why:
        cpu = time.process_time() - begun
        said = "".join(c if c.isalnum() or c in " %." else " " for c in str(why))
        return f"{pair[0]} to {pair[1]},refused,,,{said},,{cpu:.1f}"
    cpu = time.process_time() - begun
    kinds = " + ".join(place.kind for place in found.places) or "none"
    beside = ""
    if pair[1] == "can gone" and found.places:
        off = [np.linalg.norm(place.centre - OIL_CAN) for place in found.places]
        beside = f"{100 * min(off):.1f}"
    fit = found.registration
    return (f"{pair[0]} to {pair[1]},{fit.how},{fit.shared:.2f},{len(found.places)},{kinds},"
            f"{beside},{cpu:.1f}")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("work", type=Path)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--data", type=Path, help="plush_snowmiku")
    parser.add_argument("--only", nargs="*", default=list(HALVES))
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    packages: dict[str, Path] = {}
    for name in ("a", *[n for n in options.only if n != "a"]):
        packages[name] = trained(make_half(options.work, name, *HALVES[name]), options.seconds)
    pairs = [("a", name) for name in packages if name not in ("a", "front", "back")]
    if {"front", "back"} <= packages.keys():
        pairs.append(("front", "back"))
    if options.data:
        for name, folder in split(options.data, options.work).items():
            packages[name] = trained(folder, options.seconds, "--downscale", "4")
        pairs.append(("plush a", "plush b"))
    rows = []
    for pair in pairs:
        rows.append(row_of(pair, packages[pair[0]], packages[pair[1]]))
        sys.stdout.write(rows[-1] + "\n")
        sys.stdout.flush()
    if options.out:
        head = f"# python tools/inspection/halves.py WORK --seconds {options.seconds:g} --out "
        head += f"docs/bench/halves.csv\n# {VIEWS} photos of {SIZE[0]}x{SIZE[1]}, ray-traced\n"
        options.out.write_text(head + COLUMNS + "\n" + "\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
