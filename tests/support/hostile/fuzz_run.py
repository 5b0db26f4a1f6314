"""The fuzzer's loop: hypothesis draws how a file is made wrong; what comes of it is checked."""

import os
import re
import shutil
import signal
import sys
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from shapeshift.runtime_models.model import BadFile
from tests.support.hostile.fuzz_mutations import kind_of, mutate

LONGEST_S = 5.0
MOST_MEMORY = 200 << 20  # bytes beyond twice the files' size
MOST_ADDRESSES = 4 << 30  # bytes of address space: an allocation from a lying header fails
LONGEST_SENTENCE = 400
EVERY = 8  # of the models that open is drawn: it takes some milliseconds
STEP = st.tuples(st.integers(0, 65535), st.integers(0, 65535), st.integers(0, 65535))
STEPS = st.tuples(st.integers(0, 65535), st.lists(STEP, min_size=1, max_size=3))


@dataclass(frozen=True)
class Seed:
    """A good file, or a folder of files, and who opens it."""

    name: str
    files: dict[str, bytes]  # by their path in the seed's folder
    open: Callable[[Path], object]  # takes the folder, or the file where there is only one
    kinds: dict[str, str] = field(default_factory=dict)  # how to look inside, where not by name
    sentence: type[Exception] = BadFile  # what a refusal is

    def path_in(self, folder: Path) -> Path:
        return folder / next(iter(self.files)) if len(self.files) == 1 else folder

    def put(self, folder: Path) -> None:
        for name, data in self.files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)


class Hung(BaseException):
    """Not an Exception: nobody's except clause may swallow it."""


@contextmanager
def watched(size: int) -> Iterator[None]:
    """Fails what takes longer or more memory than it may; on Linux, where both can be watched."""
    if not sys.platform.startswith("linux"):
        yield
        return
    import resource

    def ring(*_: object) -> None:
        raise Hung(f"over {LONGEST_S} s")

    before = status()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    limit = (before["VmSize"] << 10) + MOST_ADDRESSES
    resource.setrlimit(resource.RLIMIT_AS, (limit if hard < 0 else min(limit, hard), hard))
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
    before = status()
    previous = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, LONGEST_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, previous)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    grown = (status()["VmHWM"] - before["VmRSS"]) << 10
    assert grown <= 2 * size + MOST_MEMORY, f"{grown >> 20} MB for {size} bytes"


def status() -> dict[str, int]:
    """kB of this process's memory."""
    text = Path("/proc/self/status").read_text()
    return {name: int(number) for name, number in re.findall(r"(Vm\w+):\s+(\d+) kB", text)}


def check_sentence(text: str, folder: Path) -> None:
    """One sentence: no line breaks, not too long, ends as a sentence does."""
    said = text.replace(str(folder), "F")
    assert "\n" not in said and "\r" not in said, repr(said)
    assert 0 < len(said) <= LONGEST_SENTENCE, f"{len(said)} letters: {said!r}"
    assert said.endswith("."), repr(said)


def outcome(sown: Seed, folder: Path) -> object | None:
    """The model that the files in the folder make, or None after a refusal in one sentence."""
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    with watched(size), warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)  # numpy's would be lines beside the sentence
        try:
            return sown.open(sown.path_in(folder))
        except sown.sentence as refusal:
            check_sentence(str(refusal), folder)
    return None


def fuzz(
    sown: Seed, folder: Path, examples: int, then: Callable[[object, Path, bool], None]
) -> None:
    """`examples` wrong versions of a seed; `then` gets every model that opens, its path, and
    whether to draw it."""
    folder.mkdir(parents=True)
    sown.put(folder)
    good = outcome(sown, folder)
    assert good is not None, f"{sown.name} itself does not open"
    then(good, sown.path_in(folder), True)
    names = list(sown.files)

    @seed(zlib.crc32(sown.name.encode()) + int(os.environ.get("FUZZ_SEED", "0")))
    @settings(
        max_examples=examples, database=None, deadline=None, report_multiple_bugs=False,
        suppress_health_check=list(HealthCheck), phases=(Phase.generate, Phase.shrink),
    )  # fmt: skip
    @given(STEPS)
    def once(drawn: tuple[int, list]) -> None:
        which, steps = drawn
        name = names[which % len(names)]
        data = mutate(sown.files[name], steps, sown.kinds.get(name, kind_of(name)))
        (folder / name).write_bytes(data)
        try:
            model = outcome(sown, folder)
            if model is not None:
                then(model, sown.path_in(folder), which % EVERY == 0)
        except BaseException:
            keep(folder, sown)
            raise
        finally:
            (folder / name).write_bytes(sown.files[name])

    once()


def keep(folder: Path, sown: Seed) -> None:
    """The last failing files, for whoever looks into it: FUZZ_KEEP names a folder."""
    if wanted := os.environ.get("FUZZ_KEEP"):
        shutil.copytree(folder, Path(wanted) / sown.name.replace(" ", "_"), dirs_exist_ok=True)
