"""Mutants: faults of one line in the program, and what notices them: docs/bench/mutants.csv.

    python3 tools/tests/mutants.py                     # all that have no row yet
    python3 tools/tests/mutants.py web/ "snap turn"    # some, by words of their names or files
    python3 tools/tests/mutants.py --all               # all of them anew

tools/tests/mutants.csv has them: the text of a line before and after, what that breaks in a word,
and the test files that are to notice.  Each is put into a copy of the checkout, where these files
run first, and where they notice nothing, the files that lie nearest by imports.  A row is written
as soon as it is known, so that an interrupted run goes on where it was.  A text is looked for with
any white space between its words, in its file or, where that is gone, in all of the same ending.
"""

import argparse
import csv
import io
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.terminal import print_text, say  # noqa: E402
from shapeshift.runtime_models.files.whole_file import write_whole  # noqa: E402
from tests.support.selection.reaching import (  # noqa: E402
    checkout_files,
    reached_tests,
    used_files,
)

LIST = Path(__file__).with_name("mutants.csv")
OUT = ROOT / "docs" / "bench" / "mutants.csv"
COMMAND = "# python3 tools/tests/mutants.py --all"
PATIENCE_S = 900.0  # of all tests of a mutant
FARTHER = 12  # files, the nearest by imports, that run where the named ones notice nothing
CAUGHT, MISSED, BROKEN = "caught", "missed", "broken"
FAILED = 1  # the exit code of pytest where a test failed
FAILURE = re.compile(r"^(?:FAILED|ERROR) (\S+?)(?:::| -|$)", re.M)
OF_THE_COPY = """from pathlib import Path

import shapeshift
import shapeshift.scene.pose


def test_it_is_of_the_copy():
    root = Path(__file__).parents[1]
    for module in (shapeshift, shapeshift.scene.pose):
        assert Path(module.__file__).is_relative_to(root), module.__file__
"""


@dataclass(frozen=True)
class Mutant:
    name: str
    file: str
    before: str
    after: str
    breaks: str
    tests: str  # files, with spaces between

    def holds(self, words: list[str]) -> bool:
        return not words or any(word in f"{self.name} {self.file}" for word in words)

    def applied(self, texts: dict[str, str]) -> tuple[str, str]:
        """The file that has the line now, and its text with the fault.  Raises ValueError."""
        line = re.compile(r"\s+".join(map(re.escape, self.before.split())))
        ending = Path(self.file).suffix
        files = [self.file] if self.file in texts else [f for f in texts if f.endswith(ending)]
        found = [(file, match) for file in files for match in line.finditer(texts[file])]
        if len(found) != 1:
            raise ValueError(f"'{self.name}': its line is there {len(found)} times, not once.")
        file, match = found[0]
        return file, texts[file][: match.start()] + self.after + texts[file][match.end() :]


@dataclass(frozen=True)
class Row:
    name: str
    file: str
    breaks: str
    result: str  # CAUGHT, MISSED or BROKEN
    by: str  # the first test that failed
    way: str  # named, or farther: by imports
    seconds: str


def read_mutants() -> list[Mutant]:
    with LIST.open(encoding="utf-8", newline="") as file:
        return [Mutant(**row) for row in csv.DictReader(file)]


def read_rows(path: Path) -> dict[str, Row]:
    if not path.is_file():
        return {}
    with path.open(encoding="utf-8", newline="") as file:
        lines = [line for line in file if not line.startswith("#")]
    return {row["name"]: Row(**row) for row in csv.DictReader(lines)}


def write_rows(rows: dict[str, Row], mutants: list[Mutant], path: Path) -> None:
    """In the order of the list; rows of mutants that are no more go."""
    held = io.StringIO()
    names = [field.name for field in fields(Row)]
    writer = csv.DictWriter(held, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(rows[m.name]) for m in mutants if m.name in rows)
    write_whole(path, f"{COMMAND}\n{held.getvalue()}".encode())


@contextmanager
def copied_checkout() -> Iterator[Path]:
    """A copy of what git has or would add, in a folder that goes; its .venv is this one's."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copy = Path(folder) / "checkout"
        for path in checkout_files(ROOT):
            if (ROOT / path).is_file():
                (copy / path).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / path, copy / path)
        (copy / ".venv").symlink_to(Path(sys.prefix))
        yield copy


def in_copy(copy: Path, words: list[str], seconds: float) -> tuple[int, str]:
    """Pytest in the copy, with nothing of the checkout in its paths: exit code, what it says."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    child = subprocess.Popen(
        [sys.executable, "-P", "-m", "pytest", "-n", "0", "-q", "-p", "no:cacheprovider", *words],
        cwd=copy, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8",
        errors="replace", env=kept | {"PYTHONDONTWRITEBYTECODE": "1"}, start_new_session=True,
    )  # fmt: skip
    try:
        said, _ = child.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:  # a loop without end is noticed, too
        return FAILED, "FAILED no-end"
    finally:
        with suppress(ProcessLookupError):  # servers and browsers of its own end with it
            os.killpg(child.pid, signal.SIGKILL)
        child.wait()
    return (FAILED, "FAILED crash") if child.returncode < 0 else (child.returncode, said)


def check_copy(copy: Path) -> None:
    """Raises ValueError where the tests would look at another program than the copy's."""
    test = copy / "tests" / "test_of_the_copy.py"
    test.write_text(OF_THE_COPY)
    code, said = in_copy(copy, [str(test)], PATIENCE_S)
    test.unlink()
    if code:
        raise ValueError(f"the tests of the copy look at another program: {said.strip()[-300:]}")


def check_tests_pass(mutants: list[Mutant], copy: Path) -> None:
    """Raises ValueError where a named test fails without any fault, twice."""
    tests = sorted({test for mutant in mutants for test in mutant.tests.split()})
    code, said = in_copy(copy, tests, len(tests) * PATIENCE_S)
    for test in sorted(set(FAILURE.findall(said))) if code else ():
        again, _ = in_copy(copy, [test], PATIENCE_S)
        if again:
            raise ValueError(f"without a fault {test} ends with {again}.")
    if code not in (0, FAILED):
        raise ValueError(f"without a fault the tests end with {code}: {said.strip()[-300:]}")


def judge(mutant: Mutant, copy: Path, texts: dict[str, str], farther: list[str]) -> Row:
    """Runs the tests of one mutant; the copy is afterwards as it was."""
    began = time.monotonic()
    file, text = mutant.applied(texts)
    result, by, way = MISSED, "", "farther"
    try:
        (copy / file).write_text(text, "utf-8")
        for way, tests in (("named", mutant.tests.split()), ("farther", farther)):  # noqa: B007
            code, said = in_copy(copy, ["-x", *tests], PATIENCE_S) if tests else (0, "")
            if code:
                failed = FAILURE.search(said)
                result = CAUGHT if code == FAILED else BROKEN
                by = failed[1] if failed else said.strip()[-200:]
                break
    finally:
        (copy / file).write_text(texts[file], "utf-8")
    seconds = f"{time.monotonic() - began:.0f}"
    return Row(mutant.name, file, mutant.breaks, result, by, way, seconds)


def run(mutants: list[Mutant], everything: list[Mutant], rows: dict[str, Row], out: Path) -> None:
    used = used_files(ROOT, (), ROOT / ".pytest_cache" / "imports.json")
    with copied_checkout() as copy:
        check_copy(copy)
        check_tests_pass(mutants, copy)
        texts = {
            path: (copy / path).read_text("utf-8")
            for path in checkout_files(ROOT)
            if not path.startswith(("tests/", "tools/", "docs/")) and is_code(path)
        }
        for mutant in mutants:
            file = mutant.applied(texts)[0]
            near = [each.test for each in reached_tests(used, [file])]
            named = set(mutant.tests.split())
            farther = [t for t in near if t not in named and "/slow/" not in t and "/xr/" not in t]
            row = judge(mutant, copy, texts, farther[:FARTHER])
            rows[mutant.name] = row
            write_rows(rows, everything, out)
            print_text(f"{row.result:7} {row.seconds:>4} s  {row.name}  {row.by}")


def is_code(path: str) -> bool:
    return path.endswith((".py", ".js", ".cl", ".glsl", ".comp", ".vert", ".frag"))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="words of a name or of a file")
    parser.add_argument("--all", action="store_true", help="all of them anew, their rows go")
    parser.add_argument("--out", type=Path, default=OUT, help="default: docs/bench/mutants.csv")
    options = parser.parse_args()
    everything = read_mutants()
    rows = {} if options.all else read_rows(options.out)
    chosen = [m for m in everything if m.holds(options.names)]
    if not options.names:
        chosen = [m for m in chosen if m.name not in rows]
    try:
        if chosen:
            run(chosen, everything, rows, options.out)
    except ValueError as why:
        say(str(why))
        return 2
    except KeyboardInterrupt:
        say("interrupted; started again it goes on with the next")
        return 130
    results = [row.result for row in rows.values()]
    tried = f"{len(results)} of {len(everything)} were tried"
    print_text(f"{results.count(CAUGHT)} are caught, {tried}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
