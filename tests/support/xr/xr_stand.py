"""Where a test of VR runs: Monado for it alone, and `launch.py vr` whose lines are read live."""

import hashlib
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from tests.support.touch_scene import TOUCH
from tests.support.xr.remote import Remote

ROOT = Path(__file__).resolve().parents[3]
NEEDED = "tests/xr/monado.sh makes one"
PATIENCE_S = 120.0  # for one thing to happen; the first run of a scene makes its colliders
REST_S = 0.005


@dataclass(frozen=True)
class Runtime:
    """Monado as tests/xr/monado.sh keeps it."""

    folder: Path

    def manifest(self, service: bool) -> Path:
        """Of the runtime that lives in the program's process, or of the one that serves it."""
        name = "openxr_monado_service.json" if service else "openxr_monado.json"
        return self.folder / "share" / "openxr" / "1" / name

    def program(self, name: str) -> Path:
        return self.folder / "bin" / name


def find_runtime() -> Runtime:
    """Where the script puts it; LookupError says why there is none."""
    if not sys.platform.startswith("linux"):
        raise LookupError("no OpenXR runtime for the tests: Monado is built on Linux alone")
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    named = os.environ.get("SHAPESHIFT_TEST_RUNTIME")
    runtime = Runtime(Path(named) if named else cache / "shapeshift" / "monado")
    stamp = runtime.folder / "built-from"
    if not stamp.is_file():
        raise LookupError(f"no OpenXR runtime for the tests in {runtime.folder}: {NEEDED}")
    script = hashlib.sha256((ROOT / "tests" / "xr" / "monado.sh").read_bytes()).hexdigest()
    if script not in stamp.read_text():
        raise LookupError(f"the OpenXR runtime in {runtime.folder} is an older one: {NEEDED}")
    return runtime


def free_port() -> int:
    with socket.socket() as asked:
        asked.bind(("127.0.0.1", 0))
        return asked.getsockname()[1]


class Stand:
    """A port and folders of its own, and what programs find in their environment."""

    def __init__(self, runtime: Runtime, folder: Path, service: bool = False) -> None:
        self.runtime, self.folder, self.port = runtime, folder, free_port()
        # A socket's path has room for 107 characters: the run folder lies under a short one.
        self._run = Path(subprocess.check_output(["mktemp", "-d"], text=True).strip())
        settings = {"active": "remote"}
        settings["remote"] = {"version": 0, "port": self.port, "view_count": 2}
        (folder / "config" / "monado").mkdir(parents=True)
        (folder / "config" / "monado" / "config_v0.json").write_text(json.dumps(settings))
        inherited = {name: value for name, value in os.environ.items() if not ours(name)}
        self.environment = inherited | {
            "XR_RUNTIME_JSON": str(runtime.manifest(service)),
            "XRT_COMPOSITOR_NULL": "1",  # shows nothing, at 20 Hz
            "P_OVERRIDE_ACTIVE_CONFIG": "remote",
            "XRT_NO_STDIN": "1",
            "XDG_RUNTIME_DIR": str(self._run),
            "XDG_CONFIG_HOME": str(folder / "config"),
        }
        self.service = self._serve() if service else None

    def _serve(self) -> subprocess.Popen:
        """monado-service, once programs can reach it."""
        with (self.folder / "service.log").open("wb") as log:
            made = subprocess.Popen(
                [self.runtime.program("monado-service")],
                env=self.environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
            )  # fmt: skip
        until = time.monotonic() + PATIENCE_S
        while not (self._run / "monado_comp_ipc").exists():
            told = (self.folder / "service.log").read_text(errors="replace")[-500:]
            assert made.poll() is None, f"monado-service ended: {told}"
            assert time.monotonic() < until, f"monado-service does not start: {told}"
            time.sleep(REST_S)
        return made

    def recentre(self) -> None:
        """What a long press of a headset's system button does."""
        self._control("-c")

    def switch_input(self) -> None:
        """Takes hands and buttons away from the first program, or gives them back."""
        self._control("-i", "1")

    def _control(self, *arguments: str) -> None:
        subprocess.run(
            [self.runtime.program("monado-ctl"), *arguments],
            env=self.environment, check=True, capture_output=True, timeout=PATIENCE_S,
        )  # fmt: skip

    def kill_runtime(self) -> None:
        self.service.kill()
        self.service.wait()

    def revive_runtime(self) -> None:
        """Another service in the place of the one that was killed."""
        (self._run / "monado_comp_ipc").unlink(missing_ok=True)
        self.service = self._serve()

    def tell(self, program: Path, *words: str) -> dict:
        """Runs a program of ours to its end: what its one line of JSON says."""
        done = subprocess.run(
            [sys.executable, program, *words],
            env=self.environment, capture_output=True, text=True, timeout=60,
            stdin=subprocess.DEVNULL,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-3000:]
        (line,) = [line for line in done.stdout.splitlines() if line.startswith('{"')]
        return json.loads(line)

    def close(self) -> None:
        if self.service is not None and self.service.poll() is None:
            self.kill_runtime()
        shutil.rmtree(self._run)


def ours(name: str) -> bool:
    """Whether a variable would lead a program to a display, another runtime or another GLFW."""
    return name in ("DISPLAY", "WAYLAND_DISPLAY", "PYGLFW_LIBRARY") or name.startswith(
        ("XR_", "XRT_", "P_")
    )


@dataclass
class Program:
    """A `launch.py vr` that runs: the lines of its frames as they come, and its end."""

    process: subprocess.Popen
    folder: Path
    lines: list[dict] = field(default_factory=list)  # one a frame
    _taken: int = 0  # bytes of the file of lines

    def read(self) -> list[dict]:
        """The lines that have come since the last call."""
        path = self.folder / "lines.jsonl"
        if not path.exists():
            return []
        with path.open("rb") as file:
            file.seek(self._taken)
            whole = file.read().rpartition(b"\n")[0]
        self._taken += len(whole) + bool(whole)
        new = [json.loads(line) for line in whole.splitlines()]
        self.lines += new
        return new

    def headset(self, port: int) -> Remote:
        """The remote of its runtime; fails with what the program said where it ends before."""
        try:
            return Remote(port, PATIENCE_S, lambda: self.process.poll() is None)
        except ConnectionRefusedError:
            raise AssertionError(f"no runtime listens: {self.told()[-800:]}") from None

    def told(self) -> str:
        return (self.folder / "told.txt").read_text(errors="replace")

    def until(self, happens: Callable[[dict], bool], what: str, within_s=PATIENCE_S) -> dict:
        """The first line from now on for which it happens; fails where the program ends before."""
        stop = time.monotonic() + within_s
        while True:
            ended = self.process.poll() is not None  # asked first: nothing comes after
            for line in self.read():
                if happens(line):
                    return line
            last = self.lines[-1:] and json.dumps(self.lines[-1])
            assert not ended, f"ended before {what}: {last}\n{self.told()[-800:]}"
            assert time.monotonic() < stop, f"not {what}: {last}\n{self.told()[-800:]}"
            time.sleep(REST_S)

    def end(self, within_s: float = PATIENCE_S) -> dict:
        """Waits for the end; the report, with the exit code as "code"."""
        code = self.process.wait(within_s)
        self.read()
        report = self.folder / "report.json"
        assert report.exists(), f"no report, exit code {code}:\n{self.told()[-800:]}"
        return json.loads(report.read_text()) | {"code": code}

    def interrupt(self, within_s: float = PATIENCE_S) -> int:
        """Ctrl-C; the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(within_s)

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


def start_program(
    stand: Stand, *arguments: str, reports: bool = True, program: Path = ROOT / "launch.py",
    **environment: str,
) -> Program:  # fmt: skip
    """`launch.py vr`, or a program like it; its lines, output and report in the stand's folder."""
    if not any(Path(word).exists() for word in arguments):
        arguments = (str(TOUCH), *arguments)
    out = ["--lines", stand.folder / "lines.jsonl"]
    out += ["--report", stand.folder / "report.json"] if reports else []
    command = [sys.executable, program, "vr", *arguments, *out]
    with (stand.folder / "told.txt").open("wb") as told:
        process = subprocess.Popen(
            [str(part) for part in command],
            cwd=ROOT, env=stand.environment | environment,
            stdin=subprocess.DEVNULL, stdout=told, stderr=told,
        )  # fmt: skip
    return Program(process, stand.folder)
