"""Where training fails, and what it says then: a row a case, decibels beside the untouched capture.

    python3 tools/training/training_stability.py --out docs/bench/training-stability.csv
        [--tankard FOLDER] [--fern FOLDER] [--iterations 600] [--size 100] [--cases NAME ...]

Each case is `launch.py train` on a capture of which something is wrong (training_cases.py).  What
is drawn is compared with the held-out photos of the untouched capture.  Lines with # in --out
below that of the machine are kept: the reading of the rows.
"""

import argparse
import contextlib
import csv
import io
import shlex
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL import Image

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE)]

from training_cases import CASES, Case, Outcome  # noqa: E402

from shapeshift.app.cli import main as launch  # noqa: E402
from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.captures.capture import Capture  # noqa: E402
from shapeshift.scene.captures.photo import load_photo  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.scene.captures.write_capture import write_capture  # noqa: E402
from shapeshift.training.evaluation.evaluate import ModelRenderer, stop_for  # noqa: E402
from shapeshift.training.evaluation.metrics import psnr  # noqa: E402
from shapeshift.training.photos import BLACK, load_photos  # noqa: E402
from shapeshift.training.supervision.backgrounds import choose_background  # noqa: E402
from shapeshift.training.synthetic.balls import make_balls  # noqa: E402

HEAD = ("case", "what was done", "dB", "untouched", "what the program said", "verdict")
ANCHORS = ("--max-anchors", "2000")
MOST_SAID = 5  # sentences a row
USUAL = (
    " held out; ",
    " done after ",
    "PoCL",
    "look: ",
    " steps are few: ",
)  # in every run's lines


def smaller(capture: Capture, folder: Path, side: int) -> Capture:
    """The capture written into `folder`, no photo larger than `side` pixels."""
    photos = []
    for number, photo in enumerate(capture.photos):
        factor = -(-max(photo.view.size) // side)
        rgb, mask, _ = load_photo(photo, factor)
        paths = [folder / kind / f"{number:03}.png" for kind in ("photos", "masks")]
        for path, pixels in zip(paths, (rgb, mask), strict=True):
            if pixels is not None:
                path.parent.mkdir(parents=True, exist_ok=True)
                Image.fromarray(pixels).save(path)
        kept = paths[1] if photo.mask is not None else None
        view = photo.view.divided(factor)
        photos.append(replace(photo, view=view, path=paths[0], mask=kept, lens=None))
    out = replace(capture, folder=folder, photos=tuple(photos))
    write_capture(out)
    return out


@dataclass
class Bench:
    """The captures, made once, and what the untouched ones reach."""

    folder: Path
    given: dict[str, Path | None]  # real captures by name
    iterations: int
    size: int
    captures: dict[str, Capture]
    untouched: dict[tuple, tuple[list[str], dict[str, float]]]

    def capture(self, name: str) -> Capture | str:
        """The untouched capture, or in words why it is not there."""
        if name not in self.captures:
            there, folder = self.given.get(name), self.folder / name
            if name == "balls":
                make_balls(folder, self.size, views=40, test_views=8)
                self.captures[name] = read_capture(folder)
            elif there is None or not there.is_dir():
                return f"skipped: the capture {name} is not here"
            else:
                self.captures[name] = smaller(read_capture(there), folder, self.size)
        return self.captures[name]

    def run(self, case: Case, capture: Path, out: Path) -> tuple[int, list[str]]:
        """`launch.py train` of a changed capture: (exit code, what it said)."""
        steps = round(case.share * self.iterations)
        words = ["train", str(capture), "--out", str(out), "--iterations", str(steps)]
        start = [*words, *ANCHORS, *case.options]
        if case.settings:
            file = self.folder / "train.toml"
            file.write_text(case.settings + "\n", encoding="utf-8")
            start += ["--settings", str(file)]
        said = io.StringIO()
        with contextlib.redirect_stderr(said):
            with case.fault(steps):
                code = launch(start)
            if case.resumed:
                code = launch([*words, "--resume"])
        return code, list(sentences(said.getvalue(), self.folder))

    def fits(self, out: Path, capture: Capture) -> dict[str, float] | None:
        """Mean PSNR of each modality on the held-out photos, inside their masks where they have
        some; None where nothing was written."""
        if not out.exists():
            return None
        painter, found = ModelRenderer(open_device(), read_model(out)), {}
        behind = choose_background("auto", capture.background) or BLACK
        photos = load_photos(capture, "test", 1, "valid")
        for stop in capture.stops:
            painter.set_control(stop_for(painter.evaluator.model, stop).x)
            found[stop.name] = float(np.mean([
                psnr(painter.picture(p.view, behind), p.over(behind), p.weight)
                for p in photos if p.modality == stop.name
            ]))  # fmt: skip
        return found

    def reference(self, case: Case, capture: Capture) -> tuple[list[str], dict[str, float]]:
        """What as long a training of the untouched capture says and reaches."""
        key = (case.capture, case.share)
        if key not in self.untouched:
            out = self.folder / f"untouched-{len(self.untouched)}.shift"
            plain = Case("untouched", case.capture, "", share=case.share)
            _, said = self.run(plain, capture.folder, out)
            reached = self.fits(out, capture)
            assert reached is not None
            self.untouched[key] = said, reached
        return self.untouched[key]

    def row(self, case: Case) -> list[str]:
        whole = self.capture(case.capture)
        if isinstance(whole, str):
            return [case.name, case.done, "", "", "", whole]
        said, before = self.reference(case, whole)
        if case.nothing_done:
            return cells(case, Outcome(0, said, before, before, [], whole.folder))
        place = self.folder / "out" / case.name
        place.mkdir(parents=True)
        (place / "points.npz").write_bytes(b"")
        changed, wrong = case.change(whole, case.name)
        started = time.perf_counter()
        code, said = self.run(case, changed, place / case.out)
        outcome = Outcome(code, said, self.fits(place / case.out, whole), before, wrong,
                          place / case.out)  # fmt: skip
        print_line(f"{case.name}: {time.perf_counter() - started:.0f} s, exit code {code}")
        return cells(case, outcome)


def cells(case: Case, outcome: Outcome) -> list[str]:
    more = len(outcome.said) - MOST_SAID
    shown = [*outcome.said[:MOST_SAID], *([f"... {more} more"] if more > 0 else [])]
    said = "\n".join(shown) or "nothing"
    db = [decibels(outcome.db), decibels(outcome.before)]
    return [case.name, case.done, *db, said, case.judge(outcome)]


def decibels(found: dict[str, float] | None) -> str:
    if found is None:
        return "no scene"
    return ", ".join(f"{name} {value:.2f}" for name, value in found.items())


def sentences(text: str, folder: Path) -> Iterator[str]:
    """What was said beyond the device, the photos and the result, without this machine's places."""
    text = text.replace(f"{folder}/", "").replace(f"{tempfile.gettempdir()}/", "TEMP/")
    for line in text.replace("\r", "\n").splitlines():
        words = " ".join(line.split())
        if words and not any(usual in words for usual in USUAL):
            yield words


def print_line(text: str) -> None:
    print(text, file=sys.stderr, flush=True)  # noqa: T201


def before(path: Path) -> tuple[str, dict[str, list[str]]]:
    """Of an older file: what a person wrote below the machine; rows by case."""
    if not path.exists():
        return "", {}
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    notes = [line for line in lines if line.startswith("#")]
    rows = list(csv.reader(lines[len(notes) :]))
    return "".join(notes[2:]), {row[0]: row for row in rows[1:]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--tankard", type=Path, help="the capture maryrose_tankard")
    parser.add_argument("--fern", type=Path, help="the capture fern_llff")
    parser.add_argument("--iterations", type=int, default=600)
    parser.add_argument("--size", type=int, default=100, help="pixels a side of photos at most")
    parser.add_argument(
        "--cases", nargs="+", choices=[c.name for c in CASES],
        help="only these; the rows of the others stay",
    )  # fmt: skip
    options = parser.parse_args()
    given = {"tankard": options.tankard, "fern": options.fern}
    words = [Path(word).name if Path(word).is_dir() else word for word in without_cases()]
    device = open_device()
    head = f"# python3 tools/training/training_stability.py {shlex.join(words)}\n"
    head += f"# {device.name}, {device.platform}\n"
    read, rows = before(options.out)
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder), given, options.iterations, options.size, {}, {})
        for case in CASES:
            if options.cases is None or case.name in options.cases:
                rows[case.name] = bench.row(case)
                text = io.StringIO(newline="")
                writer = csv.writer(text, lineterminator="\n")
                writer.writerows([HEAD, *(rows[c.name] for c in CASES if c.name in rows)])
                options.out.write_text(head + read + text.getvalue(), encoding="utf-8")


def without_cases() -> list[str]:
    """The words of the command but --cases and its names: that of the whole table."""
    words, kept, skipping = sys.argv[1:], [], False
    for word in words:
        skipping = word == "--cases" or (skipping and not word.startswith("--"))
        kept += [] if skipping else [word]
    return kept


if __name__ == "__main__":
    main()
