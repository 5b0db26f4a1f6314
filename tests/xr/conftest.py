"""A runtime for the tests of VR; those that need it skip, with the reason, where there is none."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from xr_stand import Program, Runtime, Stand, find_runtime, start_program


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

        def run(*arguments: object, **environment: str) -> Program:
            program = start_program(*arguments, **environment)
            ends.callback(program.close)
            return program

        yield run
