"""Options of the test run: --changed (what a change reaches), --slow (long ones too),
--slow-minutes (as many as there is time for), --regenerate (write the golden images anew)."""

import gc
import os
import shutil
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Generator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parents[1]
STARTED = time.monotonic()
BEGAN = pytest.StashKey[float]()  # by time.monotonic()

pytest.register_assert_rewrite("tests.support")  # asserts there tell their values, too


# Started as a background job whose parent ignores Ctrl-C, so would the programs that are tested.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


# A container often has PYTHONDONTWRITEBYTECODE; then each of hundreds of processes that tests start
# compiles all that it imports, and pytest rewrites every assert at every start, a minute of a core.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


# Before its first input in a process Hypothesis looks through our whole source for numbers, which
# on two busy cores takes longer than it finds right for an input.  Nor is an example timed.
settings.register_profile("shapeshift", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("shapeshift")


def pytest_addoption(parser: pytest.Parser) -> None:
    from tests.support.selection import changed  # not before asserts are rewritten there

    changed.add_options(parser)
    parser.addoption("--slow", action="store_true", help="run the tests marked slow, too")
    parser.addoption(
        "--slow-minutes", type=float, default=float("inf"), metavar="N",
        help="begin no test marked slow later than N minutes after the start",
    )  # fmt: skip
    parser.addoption("--regenerate", action="store_true", help="write tests/golden/*.png anew")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    # Mesa's GLX ends the process when EGL was up in it before; the other way round is fine.
    items.sort(key=lambda item: not item.path.name.startswith("test_desktop"))
    if config.getoption("--slow"):
        return
    skip = pytest.mark.skip(reason="slow; run with --slow")
    for item in items:
        if "slow" in item.keywords:
            item.add_marker(skip)


def pytest_configure(config: pytest.Config) -> None:
    config.stash[BEGAN] = time.monotonic()
    if config.getoption("--changed") is not None:
        from tests.support.selection import changed

        config.pluginmanager.register(changed.Changed(config, ROOT, STARTED))


def pytest_runtest_setup(item: pytest.Item) -> None:
    minutes = item.config.getoption("--slow-minutes")
    if "slow" in item.keywords and time.monotonic() - item.config.stash[BEGAN] > 60 * minutes:
        pytest.skip(f"slow, and {minutes:g} minutes are over; run with --slow alone")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Hardly anything of it is garbage, and all stays until the end: nobody looks through it."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


@pytest.fixture(scope="session", autouse=True)
def own_settings(tmp_path_factory):
    """Settings of the program that tests start go into a folder of the run, never into a home.

    Compiled kernels stay where the program keeps them, whatever cache a test takes for its own:
    compiling them takes 6 s of a core.
    """
    from shapeshift.runtime_models.files.user_cache import cache_folder

    folder = tmp_path_factory.mktemp("settings")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("POCL_CACHE_DIR", os.environ.get("POCL_CACHE_DIR", str(cache_folder("pocl"))))
        for name in ("XDG_CONFIG_HOME", "APPDATA", "XDG_DATA_HOME"):
            patch.setenv(name, str(folder))
        yield folder


@pytest.fixture(autouse=True)
def no_hurry():
    """A test that leaves this process in a realtime class starves all others, its children too."""
    yield
    if hasattr(os, "sched_getscheduler") and os.sched_getscheduler(0) != os.SCHED_OTHER:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        warnings.warn("this test left the process in a realtime class", stacklevel=1)


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder with real captures that lies beside the project; skips where it is absent."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no real captures beside the project ({folder.name} is absent)")
    return folder


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A module with RENDERERS has its tests of the fixture `renderer` once for each of them."""
    kinds = getattr(metafunc.module, "RENDERERS", None)
    if kinds and "renderer" in metafunc.fixturenames:
        metafunc.parametrize("renderer", kinds.values(), ids=kinds, indirect=True, scope="module")


@pytest.fixture(scope="module")
def renderer(request):
    """One that draws tiles, or as the module's RENDERERS say; for all tests of a module.

    Skips where there is no OpenCL device, or no OpenGL.
    """
    from shapeshift.rasterizer.device import NoDevice
    from shapeshift.renderer.renderer import Renderer

    keywords = dict(getattr(request, "param", {}))
    if not keywords:
        try:
            with Renderer(None) as made:
                yield made
        except NoDevice as reason:
            pytest.skip(str(reason))
        return
    pair = keywords.pop("pair", None)
    session_gpu = request.getfixturevalue("session_gpu")
    with session_gpu.ctx as ctx, Renderer(ctx, **keywords) as made:
        if pair and made.drawing.stereo_pair is None:
            pytest.skip("a GPU draws the views one after the other")
        if pair is False:
            made.drawing.stereo_pair = None
        yield made
        assert ctx.error == "GL_NO_ERROR", "a test of this module left a GL error"


@pytest.fixture(scope="module")
def device():
    """The OpenCL device that training is tested on."""
    from shapeshift.rasterizer.device import open_device

    return open_device("cpu")


@pytest.fixture(scope="session")
def session_gpu():
    """One context for all tests, so that every program is compiled once."""
    from shapeshift.renderer.gl.context import NoContext, open_context
    from shapeshift.renderer.gl.gpu import Gpu

    try:
        made = open_context()
    except NoContext as reason:
        pytest.skip(str(reason))
    with made, Gpu(made) as gpu:
        yield gpu


@pytest.fixture
def ctx(session_gpu):
    """The context, current; a test that leaves a GL error fails."""
    with session_gpu.ctx as made:
        assert made.error == "GL_NO_ERROR", "an earlier test left a GL error"
        yield made
        assert made.error == "GL_NO_ERROR"


@pytest.fixture
def gpu(ctx, session_gpu):
    return session_gpu


@pytest.fixture(scope="module")
def display():
    """The name of an X display without a screen, 1280x720."""
    if not shutil.which("Xvfb"):
        pytest.skip("Xvfb is not installed (apt install xvfb)")
    read_end, write_end = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write_end), "-screen", "0", "1280x720x24", "-nolisten", "tcp"],
        pass_fds=[write_end],
        stderr=subprocess.DEVNULL,
    )
    os.close(write_end)
    with os.fdopen(read_end) as pipe:
        number = pipe.readline().strip()
    if not number:
        pytest.skip("Xvfb did not start")
    yield f":{number}"
    server.terminate()
    server.wait()
