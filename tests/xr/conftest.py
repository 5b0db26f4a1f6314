"""A runtime for the tests of VR; those that need it skip, with the reason, where there is none."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from shapeshift.vr.frame import SIDES
from tests.support.xr.person import Person
from tests.support.xr.validation import complaints, switched_on
from tests.support.xr.xr_stand import Program, Runtime, Stand, find_runtime, start_program

INTERRUPTED = 130  # exit code after Ctrl-C


@pytest.fixture(scope="session")
def runtime() -> Runtime:
    pytest.importorskip("xr", reason="pyopenxr is not installed", exc_type=ImportError)
    try:
        return find_runtime()
    except LookupError as reason:
        pytest.skip(str(reason))


@pytest.fixture
def stand(runtime: Runtime, tmp_path: Path) -> Iterator[Stand]:
    """The runtime in the program's own process, as most tests want it."""
    made = Stand(runtime, tmp_path)
    yield made
    made.close()


@pytest.fixture
def served(runtime: Runtime, tmp_path: Path) -> Iterator[Stand]:
    """The runtime as a process of its own, that can be told to recentre, and killed."""
    made = Stand(runtime, tmp_path, service=True)
    yield made
    made.close()


@pytest.fixture
def start() -> Iterator[Callable[..., Program]]:
    """start(stand, *arguments): a `launch.py vr` that is ended with the test."""
    with ExitStack() as ends:

        def run(*arguments: object, **settings: object) -> Program:
            program = start_program(*arguments, **settings)
            ends.callback(program.close)
            return program

        yield run


@contextmanager
def dressed(stand: Stand, start: Callable[..., Program], *options: str) -> Iterator[Person]:
    """Somebody before the three things on the table; at the end all must have been in order."""
    program = start(stand, "--quality", "best", *options, **switched_on(stand.folder))
    with program.headset(stand.port) as remote:
        made = Person(program, remote)
        made.until(lambda line: line["focused"], "focused")
        yield made
        if program.process.poll() is None:
            assert program.interrupt() == INTERRUPTED, program.told()[-800:]
    assert not complaints(stand.folder)
    assert "Traceback" not in program.told()


@pytest.fixture
def person(stand: Stand, start: Callable[..., Program]) -> Iterator[Person]:
    with dressed(stand, start) as made:
        yield made


@pytest.fixture
def quick_person(stand: Stand, start: Callable[..., Program]) -> Iterator[Person]:
    """Without depth for the compositor, which on a processor takes as long as the picture again."""
    with dressed(stand, start, "--no-depth") as made:
        yield made


@pytest.fixture
def served_person(served: Stand, start: Callable[..., Program]) -> Iterator[Person]:
    """The same, with a runtime that can be told things."""
    with dressed(served, start) as made:
        yield made


@pytest.fixture
def bare(request, stand: Stand, start: Callable[..., Program]) -> Iterator[Person]:
    """Somebody whose hands are seen: controllers lie aside, or (True) are not asked for."""
    unasked = getattr(request, "param", False)
    with dressed(stand, start, *(["--no-controllers"] if unasked else [])) as made:
        for side in SIDES:
            hand = made.controller(side)
            hand.there, hand.follows = unasked, True
        made.until(lambda line: all(line["hands"][s]["bare"] for s in SIDES), "bare hands")
        yield made
