"""Mutants: faults of one line in the program, and what notices them: docs/bench/mutants.csv.

    python3 tools/tests/mutants.py                             # all that have no row yet
    python3 tools/tests/mutants.py web/ "snap turn" --again    # by words of their names or files
    python3 tools/tests/mutants.py --all                       # all of them anew

tools/tests/mutants.csv has them: the text of a line before and after, what that breaks in a word,
and the test files that are to notice.  Each is put into a copy of the checkout, where these files
run first; where they notice nothing, the files that lie nearest by imports; then what is slow in
those that are named.  A row is written as soon as it is known, so that an interrupted run goes on
where it was.  A text is looked for with any white space between its words, in its file or, where
that is gone, in all of the same ending.
"""

import argparse
import csv
import io
import os
import platform
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.terminal import print_text, say  # noqa: E402
from shapeshift.runtime_models.files.whole_file import write_whole  # noqa: E402
from tests.support.selection.reaching import (  # noqa: E402
    UsedFiles,
    checkout_files,
    reached_tests,
    used_files,
)

LIST = Path(__file__).with_name("mutants.csv")
OUT = ROOT / "docs" / "bench" / "mutants.csv"
COMMAND = "# python3 tools/tests/mutants.py --all"
PATIENCE_S = 900.0  # of all tests of a mutant
NAMED, FARTHER, SLOW = WAYS = "named", "farther", "slow"
MOST_FARTHER = 8  # files, the nearest by imports, that run where the named ones notice nothing
LONG = ("tests/slow/", "tests/xr/")
CAUGHT, MISSED, BROKEN, GONE = "caught", "missed", "broken", "gone"
FAILED, NOTHING_FAILED = 1, (0, 5)  # exit codes of pytest; 5: no test was chosen
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
        found = [(self.file, match) for match in line.finditer(texts.get(self.file, ""))]
        if not found:  # the line went to another file, whether or not its own is still there
            rest = [file for file in texts if file.endswith(ending)]
            found = [(file, match) for file in rest for match in line.finditer(texts[file])]
        if len(found) != 1:
            raise ValueError(f"'{self.name}': its line is there {len(found)} times, not once.")
        file, match = found[0]
        return file, texts[file][: match.start()] + self.after + texts[file][match.end() :]


@dataclass(frozen=True)
class Row:
    name: str
    file: str
    breaks: str
    result: str  # CAUGHT; MISSED; BROKEN: the tests end otherwise; GONE: there is no such line
    by: str  # the first test that failed
    way: str  # NAMED tests, FARTHER ones by imports, or those that are named with --slow
    cpu_s: str

    @property
    def is_open(self) -> bool:
        """Whether more tests may notice it than have run."""
        return self.result == MISSED and self.way != WAYS[-1]


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
    machine = f"# {platform.machine()}, {os.cpu_count()} cores"
    write_whole(path, f"{COMMAND}\n{machine}\n{held.getvalue()}".encode())


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


def judge(mutant: Mutant, copy: Path, texts: dict[str, str], way: str, tests: list[str]) -> Row:
    """Runs tests of one mutant; the copy is afterwards as it was."""
    began = spent_s()
    file, text = mutant.applied(texts)
    try:
        (copy / file).write_text(text, "utf-8")
        code, said = in_copy(copy, ["-x", *tests], PATIENCE_S) if tests else (0, "")
    finally:
        (copy / file).write_text(texts[file], "utf-8")
    failed = FAILURE.search(said)
    result = {FAILED: CAUGHT, **dict.fromkeys(NOTHING_FAILED, MISSED)}.get(code, BROKEN)
    by = "" if result == MISSED else failed[1] if failed else said.strip()[-200:]
    return Row(mutant.name, file, mutant.breaks, result, by, way, f"{spent_s() - began:.0f}")


def spent_s() -> float:
    """Processor seconds of the processes that have ended."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def run(
    mutants: list[Mutant], everything: list[Mutant], rows: dict[str, Row], out: Path, checked: bool
) -> None:
    """The named tests of all mutants, then what is farther off of those that these have missed.

    checked: the named tests are tried without a fault first.
    """
    used = used_files(ROOT, (), ROOT / ".pytest_cache" / "imports.json")
    with copied_checkout() as copy:
        check_copy(copy)
        if checked:
            check_tests_pass(mutants, copy)
        texts = {
            path: (copy / path).read_text("utf-8")
            for path in checkout_files(ROOT)
            if is_code(path) and (copy / path).is_file()
        }
        for way, mutant in ((way, mutant) for way in WAYS for mutant in mutants):
            row = rows.get(mutant.name)
            if row and (row.result != MISSED or WAYS.index(row.way) >= WAYS.index(way)):
                continue
            named = mutant.tests.split()
            try:
                file = mutant.applied(texts)[0]
                tests = farther_tests(used, file, named) if way == FARTHER else named
                slow = ["--slow", "-m", "slow"] if way == SLOW else []
                row = judge(mutant, copy, texts, way, [*slow, *tests])
            except ValueError as why:
                row = Row(mutant.name, mutant.file, mutant.breaks, GONE, str(why), way, "")
            rows[mutant.name] = row
            write_rows(rows, everything, out)
            print_text(f"{row.result:7} {row.cpu_s:>4} s  {row.name}  {row.by}")


def farther_tests(used: UsedFiles, file: str, named: list[str]) -> list[str]:
    """The nearest by imports that are not named; none of those that take long."""
    near = [each.test for each in reached_tests(used, [file])]
    return [t for t in near if t not in named and not t.startswith(LONG)][:MOST_FARTHER]


def is_code(path: str) -> bool:
    """Of the program."""
    if path.startswith(("tests/", "tools/", "docs/", "findings/", "examples/")):
        return False
    return path.endswith((".py", ".js", ".cl", ".glsl", ".comp", ".vert", ".frag"))


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="words of a name or of a file")
    parser.add_argument("--all", action="store_true", help="all of them anew, their rows go")
    parser.add_argument("--again", action="store_true", help="those that are named anew")
    parser.add_argument(
        "--unchecked", action="store_true", help="the named tests are known to pass without a fault"
    )
    parser.add_argument("--out", type=Path, default=OUT, help="default: docs/bench/mutants.csv")
    options = parser.parse_args()
    everything = read_mutants()
    known = {} if options.all else read_rows(options.out)
    rows = {m.name: known[m.name] for m in everything if m.name in known}
    chosen = [m for m in everything if m.holds(options.names)]
    if options.names and options.again:
        rows = {name: row for name, row in rows.items() if name not in {m.name for m in chosen}}
    chosen = [m for m in chosen if m.name not in rows or rows[m.name].is_open]
    try:
        if chosen:
            run(chosen, everything, rows, options.out, not options.unchecked)
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
