"""Wrong versions of the files of the gate's doors: what each costs the process that reads it."""

import random
import re
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from shapeshift.runtime_models.gate import gate
from shapeshift.runtime_models.model import BadFile
from tests.support.hostile.fuzz_mutations import kind_of, mutate
from tests.support.hostile.gate_seeds import DoorSeed

MOST_S, MOST_BYTES = 2.0, 200 << 20  # beyond what a file may take: then the gate has not held
TICKS = 100  # of processor time a second in /proc
STEP = 1 << 16


@dataclass
class Outcome:
    """Of all mutations of a door."""

    door: str
    mutations: int = 0
    opened: int = 0
    refused: int = 0
    cut_off: int = 0  # of the refused: by a limit, or the package ended
    faults: list[str] = field(default_factory=list)  # other errors than a sentence
    seconds: float = 0.0  # the longest
    over_s: float = -1e9  # the most beyond its budget
    megabytes: float = 0.0  # the most that a process grew by that lived on
    over_mb: float = -1e9


def mutations(seed: DoorSeed, count: int, start: int) -> Iterator[bytes]:
    """The same ones for the same numbers."""
    for number in range(start, start + count):
        draw = random.Random(f"{seed.door} {seed.name} {number}")
        steps = [tuple(draw.randrange(STEP) for _ in range(3)) for _ in range(draw.randint(1, 3))]
        yield mutate(seed.data, steps, kind_of(seed.name))  # type: ignore[arg-type]


def fuzz(seed: DoorSeed, folder: Path, count: int, start: int, out: Outcome) -> None:
    """`count` wrong versions of a seed, from number `start` on."""
    path = folder / seed.name
    path.write_bytes(seed.data)
    seed.read(path)  # itself it opens
    for data in mutations(seed, count, start):
        path.write_bytes(data)
        out.mutations += 1
        with measured(out):
            try:
                seed.read(path)
                out.opened += 1
            except BadFile as refusal:
                said = str(refusal)
                out.refused += 1
                out.cut_off += bool(re.search(r"processor time|more memory than|ends on it", said))
                if "\n" in said or len(said) > 400:
                    out.faults.append(f"no sentence: {said!r:.200}")
            except Exception as error:
                out.faults.append(f"{type(error).__name__}: {error}"[:200])


@contextmanager
def measured(out: Outcome) -> Iterator[None]:
    """What the processes behind the gate take for each request, on Linux."""
    real = gate.Process.ask

    def ask(self, request, *more):
        process, dead = self.child.pid, children_s()
        before, begun = status(process), seconds_of(process)
        Path(f"/proc/{process}/clear_refs").write_text("5")  # its peak begins anew
        try:
            return real(self, request, *more)
        finally:
            if self.child.poll() is None:
                spent = seconds_of(process) - begun
                grown = (status(process).get("VmHWM", 0) - before.get("VmRSS", 0)) << 10
                out.megabytes = max(out.megabytes, grown / 1e6)
                out.over_mb = max(out.over_mb, (grown - request["memory"]) / 1e6)
            else:
                self.child.wait()
                spent = children_s() - dead - begun
            out.seconds = max(out.seconds, spent)
            out.over_s = max(out.over_s, spent - request["seconds"])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gate.Process, "ask", ask)
        yield


def children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def seconds_of(process: int) -> float:
    words = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / TICKS


def status(process: int) -> dict[str, int]:
    """kB of a process."""
    text = Path(f"/proc/{process}/status").read_text()
    return {name: int(number) for name, number in re.findall(r"(Vm\w+):\s+(\d+) kB", text)}
