"""pytest --changed [REVISION]: the tests that a change reaches, nearest first, within --minutes."""

import signal
import time
from collections.abc import Generator
from pathlib import Path

import pytest

from tests.support.selection.reaching import Reached, changed_files, reached_tests, used_files

# Of the minutes: later no file is loaded, no test is begun, and what still runs is broken off.
LOAD_WITHIN, BEGIN_WITHIN, END_WITHIN = 0.4, 0.7, 0.92
AT_LEAST = 0.2  # of the minutes that tests have once they are loaded, however slow a machine is
LOADED = 600  # tests a minute: of more the last would not begin, and loading them takes its time
SHOWN = 3  # changed files that the line names


def add_options(parser: pytest.Parser) -> None:
    parser.addoption(
        "--changed", nargs="?", const="HEAD", metavar="REVISION",
        help="run what reaches files that differ from a revision (default: HEAD), nearest first",
    )  # fmt: skip
    parser.addoption(
        "--minutes", type=float, default=1.0, metavar="N",
        help="with --changed: be done in about N minutes (default: 1), and say what is left out",
    )  # fmt: skip


class Changed:
    """Chooses the files of a run, and begins no test that would come too late."""

    def __init__(self, config: pytest.Config, root: Path, began: float) -> None:
        """began: when the program started, by time.monotonic().  Raises pytest.UsageError."""
        self.minutes = float(config.getoption("--minutes") or 0)
        if not self.minutes > 0:
            raise pytest.UsageError(f"--minutes is {self.minutes:g}; a number above 0 is wanted.")
        self.revision = str(config.getoption("--changed"))
        self.seconds = 60 * self.minutes
        self.load_until = began + LOAD_WITHIN * self.seconds
        self.until = began + BEGIN_WITHIN * self.seconds
        self.end = began + END_WITHIN * self.seconds
        self.running = False  # what a test does, not what is done about it
        self.left: list[pytest.Item] = []
        self.loaded = self.unread = 0  # tests, files
        try:
            self.changed = changed_files(root, self.revision)
            used = used_files(root, self.changed, root / ".pytest_cache" / "imports.json")
        except ValueError as why:
            raise pytest.UsageError(
                f"--changed {self.revision}: {why}  A revision is wanted; put words that are none "
                "before --changed."
            ) from None
        reached = reached_tests(used, self.changed)
        if config.args_source is pytest.Config.ArgsSource.ARGS:  # within what was asked for
            asked = [(config.invocation_params.dir / a.partition("::")[0]) for a in config.args]
            reached = [r for r in reached if any((root / r.test).is_relative_to(a) for a in asked)]
        reached = [each for each in reached if (root / each.test).is_file()]
        self.reached, self.windows = apart(reached)
        config.args[:] = [str(root / each.test) for each in self.reached]

    def pytest_collection(self, session: pytest.Session) -> None:
        session.config.get_terminal_writer().line(f"--changed: {self.sentence()}")

    def sentence(self) -> str:
        """What changed, what is run and why."""
        if not self.changed:
            return f"nothing differs from {self.revision}."
        names = ", ".join(self.changed[:SHOWN]) + ", ..." * (len(self.changed) > SHOWN)
        if not self.reached:
            return f"no import leads from a test to what changed ({names})."
        first, last = self.reached[0], self.reached[-1]
        way = " < ".join(reversed(first.way))
        return (
            f"{len(self.reached)} test files reach {names}, {first.distance} to {last.distance} "
            f"imports away; the nearest first: {way}"
        )

    def pytest_itemcollected(self) -> None:
        self.loaded += 1

    @pytest.hookimpl(tryfirst=True)
    def pytest_make_collect_report(self, collector) -> pytest.CollectReport | None:
        enough = self.loaded >= LOADED * self.minutes or time.monotonic() > self.load_until
        if not (isinstance(collector, pytest.Module) and enough and self.loaded):
            return None
        self.unread += 1
        return pytest.CollectReport(collector.nodeid, "passed", None, [])

    def pytest_collection_finish(self) -> None:
        now = time.monotonic()
        self.until = max(self.until, now + AT_LEAST * self.seconds)
        self.end = max(self.end, self.until)
        if hasattr(signal, "SIGALRM"):  # not on Windows
            signal.signal(signal.SIGALRM, self.break_off)
            signal.setitimer(signal.ITIMER_REAL, self.end - now)

    def break_off(self, *_: object) -> None:
        """Ends the test that runs, as one that is skipped."""
        if self.running:
            pytest.skip("--changed: its time was over")

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self) -> Generator[None, object, object]:
        return (yield from self.broken_off())

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self) -> Generator[None, object, object]:
        return (yield from self.broken_off())

    def broken_off(self) -> Generator[None, object, object]:
        self.running = True
        try:
            return (yield)
        finally:
            self.running = False

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> bool | None:
        if time.monotonic() <= self.until:
            return None
        self.left.append(item)
        return True

    def pytest_terminal_summary(self, terminalreporter) -> None:
        for sentence in (self.left_out(), self.windows_left_out()):
            if sentence:
                terminalreporter.write_line(sentence)

    def left_out(self) -> str:
        """What was not begun, and how it is run."""
        if not self.left and not self.unread:
            return ""
        files = self.unread + len({item.path for item in self.left})
        return (
            f"--changed: {files} of {len(self.reached)} files, the farthest ones, were left out, "
            f"or the end of them; --changed={self.revision} --minutes={10 * self.minutes:g} begins "
            "more."
        )

    def windows_left_out(self) -> str:
        if not self.windows:
            return ""
        return (
            f"--changed: {len(self.windows)} files that open a window were left out: they have to "
            f"come before all others, and are no nearer.  Run: pytest {self.windows[0].test}"
            + " ..."
            * (len(self.windows) > 1)
        )

    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        if hasattr(signal, "SIGALRM"):
            signal.setitimer(signal.ITIMER_REAL, 0)
        if exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED and not self.reached:
            session.exitstatus = pytest.ExitCode.OK


def apart(reached: list[Reached]) -> tuple[list[Reached], list[Reached]]:
    """Files to run, and those that open a window where others are nearer: see tests/conftest.py."""
    windows = [each for each in reached if each.test.rpartition("/")[2].startswith("test_desktop")]
    others = [each for each in reached if each not in windows]
    if not windows or not others or windows[0].distance < others[0].distance:
        return windows + others, []
    return others, windows
