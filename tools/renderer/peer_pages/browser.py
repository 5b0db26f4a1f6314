"""Chromium under Xvfb with one page of ours in it; the page draws and tells, this listens."""

import base64
import io
import json
import os
import shutil
import subprocess
import tempfile
import threading
from dataclasses import dataclass
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np

from shapeshift.app.page.page_file import MODULES

PAGES = Path(__file__).resolve().parent
ROOT = PAGES.parents[2]
NPM_PACKAGES = (
    "three@0.180.0", "@mkkellogg/gaussian-splats-3d@0.4.7", "@sparkjsdev/spark@2.2.0",
    "playcanvas@2.23.3",
)  # fmt: skip
NAMES = {
    "kellogg": "@mkkellogg/gaussian-splats-3d",
    "spark": "@sparkjsdev/spark",
    "playcanvas": "playcanvas",
}
PAGES_OF_OURS = {"page": "ours, the page", "direct": "ours, the page, blended in 8 bits"}
TICKS = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100
PATIENCE_S = 600.0


class CannotRun(Exception):
    """A peer is not to be had here; the text says why."""


@dataclass
class Answer:
    """What a page has answered so far."""

    name: str
    version: str
    wall_ms: list[float]
    cpu_s: float  # of the process tree over all measured frames
    picture: np.ndarray | None  # (H, W, 3)
    failed: str = ""


def tree_cpu_s(root: int) -> float:
    """CPU seconds of a process and all its descendants, dead children that were waited for too."""
    parents, used = {}, {}
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit():
            continue
        try:
            fields = (folder / "stat").read_text().rsplit(")", 1)[1].split()
        except OSError:  # it ended while we looked
            continue
        parents[int(folder.name)] = int(fields[1])
        used[int(folder.name)] = sum(int(fields[i]) for i in (11, 12, 13, 14))
    total = 0
    for pid, ticks in used.items():
        at = pid
        while at in parents and at != root:
            at = parents[at]
        total += ticks if at == root else 0
    return total / TICKS


class Listener(SimpleHTTPRequestHandler):
    """Serves the work folder and the pages, takes what the page tells."""

    answer: Answer
    done: threading.Event
    browser: list  # of its one process, once it runs

    def translate_path(self, path: str) -> str:
        plain = path.split("?", 1)[0].lstrip("/")
        if plain in {f"web/{module}.js" for module in MODULES}:
            return str(ROOT / plain)
        ours = PAGES / plain
        return str(ours) if ours.is_file() else super().translate_path(path)

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        answer, cpu = self.answer, tree_cpu_s(self.browser[0].pid)
        if self.path == "/picture":
            from PIL import Image

            image = Image.open(io.BytesIO(base64.b64decode(body))).convert("RGB")
            answer.picture = np.asarray(image, np.float32) / 255
        elif self.path == "/start":
            answer.cpu_s = -cpu
        elif self.path == "/end":
            answer.cpu_s += cpu
            answer.wall_ms = json.loads(body)
            self.done.set()
        elif self.path == "/failed":
            answer.failed = body.decode(errors="replace").strip()
            self.done.set()
        self.send_response(204)
        self.end_headers()

    def log_message(self, *words) -> None:
        pass


def browser_frames(peer: str, folder: Path) -> Answer:
    """Runs a peer's page over folder/job.json and splats.ply."""
    programs = [shutil.which(name) for name in ("chromium", "Xvfb")]
    if not all(programs):
        raise CannotRun("Chromium and Xvfb are needed (Debian: apt-get install chromium xvfb)")
    name, version = PAGES_OF_OURS.get(peer, ""), ""
    if peer in NAMES:
        name = NAMES[peer]
        package = (folder / "node_modules" / name / "package.json").read_text()
        version = json.loads(package)["version"]
    answer = Answer(name, version, [], 0.0, None)
    done, browser = threading.Event(), []
    handler = type("Here", (Listener,), {"answer": answer, "done": done, "browser": browser})
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(handler, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    address = f"http://127.0.0.1:{server.server_address[1]}/page.html?peer={peer}"
    with tempfile.TemporaryDirectory() as profile, Display() as display:
        browser.append(start_chromium(str(programs[0]), profile, display, address))
        in_time = done.wait(PATIENCE_S)
        browser[0].kill()
        browser[0].wait()
        server.shutdown()
    if not in_time or answer.failed:
        raise CannotRun(answer.failed.splitlines()[0] if answer.failed else "no answer in time")
    return answer


def start_chromium(program: str, profile: str, display: str, address: str) -> subprocess.Popen:
    """The system's GL under ANGLE: SwiftShader, its own software GL, is nine times slower."""
    flags = [
        "--no-sandbox", "--no-first-run", "--use-gl=angle", "--use-angle=gl",
        "--ignore-gpu-blocklist", "--disable-extensions", "--window-size=1400,900",
        "--disable-background-timer-throttling", f"--user-data-dir={profile}",
    ]  # fmt: skip
    none = subprocess.DEVNULL
    environment = os.environ | {"DISPLAY": display}
    return subprocess.Popen(
        [program, *flags, address], env=environment, stderr=none, stdin=none, stdout=none
    )


class Display:
    """An X server without a screen, for as long as the body runs."""

    def __enter__(self) -> str:
        reader, writer = os.pipe()
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(writer), "-screen", "0", "1600x1000x24"],
            pass_fds=(writer,), stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(writer)
        with os.fdopen(reader) as lines:
            return f":{lines.readline().strip()}"

    def __exit__(self, *failure) -> None:
        self.server.kill()
        self.server.wait()
