"""A headless Chromium over its debugging pipe: standard library alone, no driver, no port.

It draws with llvmpipe (--use-angle=gl-egl), which needs a fifth of SwiftShader's time.
"""

import base64
import json
import os
import select
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

FLAGS = (
    "--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--no-first-run", "--mute-audio",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--use-angle=gl-egl", "--ignore-gpu-blocklist", "--hide-scrollbars", "--disable-extensions",
    "--disable-dev-shm-usage", "--disable-field-trial-config", "--no-default-browser-check",
)  # fmt: skip
ANSWER_S = 120


def find_chromium() -> str | None:
    """The program, where there is one."""
    names = ("chromium", "chromium-browser", "google-chrome")
    return next((path for name in names if (path := shutil.which(name))), None)


class Chromium:
    """`with Chromium() as page: page.open(path); page.run("1 + 1")`; events land in page.events."""

    def __init__(self, size: tuple[int, int] = (640, 360), flags: tuple[str, ...] = ()) -> None:
        binary = find_chromium()
        assert binary, "whoever asks has looked for it"
        self._home = tempfile.mkdtemp(prefix="chromium-")
        reads, self._out = os.pipe()
        self._in, writes = os.pipe()

        def place() -> None:  # Chromium reads commands from 3 and writes answers to 4
            a, b = os.dup(reads), os.dup(writes)
            os.dup2(a, 3), os.dup2(b, 4)

        window = f"--window-size={size[0]},{size[1]}"
        args = [binary, *FLAGS, *flags, window, f"--user-data-dir={self._home}", "about:blank"]
        for fd in (reads, writes):
            os.set_inheritable(fd, True)
        self.process = subprocess.Popen(
            args, preexec_fn=place, close_fds=False, start_new_session=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(reads), os.close(writes)
        self._buffer, self._id, self._session = b"", 0, ""
        self.events: list[dict] = []
        targets = self.call("Target.getTargets")["targetInfos"]
        target = next(t for t in targets if t["type"] == "page")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)[
            "sessionId"
        ]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")
        self.resize(size)

    def resize(self, size: tuple[int, int], mobile: bool = False) -> None:
        """Another window, as a page sees it."""
        width, height = size
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height,
                  deviceScaleFactor=1, mobile=mobile)  # fmt: skip

    def call(self, method: str, timeout: float = ANSWER_S, **params) -> dict:
        """One command of the DevTools protocol and its answer."""
        self._id += 1
        message = {"id": self._id, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        until = time.monotonic() + timeout
        while True:
            answer = self._next(until - time.monotonic())
            if answer.get("id") == self._id:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]
            self.events.append(answer)

    def _next(self, seconds: float) -> dict:
        while b"\0" not in self._buffer:
            if seconds <= 0 or not select.select([self._in], [], [], seconds)[0]:
                raise TimeoutError("Chromium did not answer")
            part = os.read(self._in, 1 << 20)
            if not part:
                raise RuntimeError("Chromium ended")
            self._buffer += part
        line, self._buffer = self._buffer.split(b"\0", 1)
        return json.loads(line)

    def open(self, address: str | Path, ready: bool = True) -> None:
        """Loads a page; ready: and waits until it says that it is, or that it cannot be."""
        if isinstance(address, Path):
            address = address.resolve().as_uri()
        self.call("Page.navigate", url="about:blank")
        self.call("Page.navigate", url=address)
        if ready:
            self.until("document.documentElement?.dataset.ready")

    def run(self, script: str, timeout: float = ANSWER_S):
        """The value of an expression; a promise is awaited."""
        answer = self.call("Runtime.evaluate", timeout, expression=script, awaitPromise=True,
                           returnByValue=True)  # fmt: skip
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            said = details.get("exception", {}).get("description")
            raise RuntimeError(said or details["text"])
        return answer["result"].get("value")

    def until(self, script: str, seconds: float = ANSWER_S):
        """The first true value of an expression."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if found := self.run(script):
                return found
            time.sleep(0.02)
        raise TimeoutError(f"{script} stays false")

    def message(self) -> str:
        """The sentence that the page says."""
        return self.run("document.getElementById('message').textContent")

    def key(self, key: str, code: str, modifiers: int = 0) -> None:
        """A key down and up; modifiers: 1 Alt, 2 Ctrl, 8 Shift."""
        text = key if len(key) == 1 else ""
        names = {"ArrowLeft": 37, "ArrowRight": 39, "Tab": 9, "Escape": 27, "Home": 36}
        number = names.get(key, ord(key[0].upper()))
        for kind, typed in (("keyDown", text), ("keyUp", "")):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=code, text=typed,
                      modifiers=modifiers, windowsVirtualKeyCode=number)  # fmt: skip

    def mouse(self, kind: str, place: tuple[float, float], buttons: int = 0, **more) -> None:
        """kind: mousePressed, mouseMoved, mouseReleased or mouseWheel."""
        x, y = place
        button = "left" if kind != "mouseMoved" else "none"
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, buttons=buttons, button=button,
                  clickCount=1, **more)  # fmt: skip

    def touch(self, kind: str, *points: tuple[float, float]) -> None:
        """kind: touchStart, touchMove or touchEnd."""
        fingers = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)]
        self.call("Input.dispatchTouchEvent", type=kind, touchPoints=fingers)

    def screenshot(self, path: Path) -> None:
        data = self.call("Page.captureScreenshot", format="png")["data"]
        path.write_bytes(base64.b64decode(data))

    def complaints(self) -> list[str]:
        """What the console has to say: errors, exceptions, breaches of the policy."""
        return [
            json.dumps(event["params"])[:400]
            for event in self.events
            if event.get("method") in ("Log.entryAdded", "Runtime.exceptionThrown")
        ]

    def requests(self) -> list[str]:
        """Addresses that were asked for."""
        return [
            event["params"]["request"]["url"]
            for event in self.events
            if event.get("method") == "Network.requestWillBeSent"
        ]

    def _processes(self) -> list[list[str]]:
        """What the system tells of each of its processes, from the state on: proc(5), stat."""
        found = []
        for stat in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = stat.read_text().rsplit(")", 1)[1].split()
            except OSError:  # it has ended
                continue
            if int(fields[3]) == self.process.pid:  # the session that it leads
                found.append(fields)
        return found

    def cpu_seconds(self) -> float:
        """User and system time of all its processes so far."""
        ticks = sum(int(fields[11]) + int(fields[12]) for fields in self._processes())
        return ticks / os.sysconf("SC_CLK_TCK")

    def resident_mb(self) -> float:
        """Memory of all its processes; what they share counts for each."""
        return sum(int(f[21]) for f in self._processes()) * os.sysconf("SC_PAGE_SIZE") / 2**20

    def close(self) -> None:
        try:
            self._session = ""
            self.call("Browser.close", 5)
            self.process.wait(10)
        except (RuntimeError, TimeoutError, OSError, subprocess.TimeoutExpired):
            os.killpg(self.process.pid, signal.SIGKILL)  # a session of its own: its helpers, too
            self.process.wait(10)
        os.close(self._out), os.close(self._in)
        shutil.rmtree(self._home, ignore_errors=True)

    def __enter__(self) -> "Chromium":
        return self

    def __exit__(self, *failure) -> None:
        self.close()
