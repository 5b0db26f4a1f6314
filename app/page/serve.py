"""launch.py serve: a scene as a page on this computer, shown anew when its file changes."""

import errno
import http.server
import os
import secrets
import sys
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal
from urllib.parse import urlsplit

from shapeshift.app.command_line import CONTROL, EXPERT, POSITIONAL, arguments_of
from shapeshift.app.errors import UsageError
from shapeshift.app.opening import PATIENCE_S, ReadingOptions, progress_after
from shapeshift.app.paths import TOUCH, plain
from shapeshift.app.terminal import say

if TYPE_CHECKING:
    from webbrowser import BaseBrowser

    from shapeshift.app.document import Document
    from shapeshift.app.editor.options import Options as ViewOptions

ALONE = "Only this computer reaches it, and only with this address.  Ctrl-C ends it."
PORTS = 20  # that are tried before any that is free
LOOK_S = 0.5  # how often the file is looked at


# A page for the browsers of this computer alone: 127.0.0.1, and a token in the address.
#
# Another page in the same browser does not know the token, and a name of its own that it lets lead
# to 127.0.0.1 (DNS rebinding) is not answered.

HERE = "127.0.0.1"
KINDS = {".html": "text/html; charset=utf-8", ".bin": "application/octet-stream"}
VERSION = "version"  # what a page asks for to know whether it is the latest
PAGE = "index.html"
HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": "frame-ancestors 'none'",
}


class PageServer:
    """`with PageServer(8000) as server: server.files = ...` answers until the block ends."""

    def __init__(self, port: int) -> None:
        """Takes the port; 0: any that is free.  Raises UsageError."""
        self._token = secrets.token_urlsafe(16)
        self._version = 0
        self._files: dict[str, bytes] = {}
        self._server = bound(port)
        self._server.page_server = self  # type: ignore[attr-defined]
        self.port = int(self._server.server_address[1])
        self.address = f"http://{HERE}:{self.port}/{self._token}/"
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)

    @property
    def files(self) -> dict[str, bytes]:
        """name -> bytes, of which PAGE is the page."""
        return self._files

    @files.setter
    def files(self, files: dict[str, bytes]) -> None:
        """Pages that are open load themselves anew."""
        page = files[PAGE].replace(b"<html", b'<html data-served="%d"' % (self._version + 1), 1)
        whole = files | {PAGE: page, VERSION: str(self._version + 1).encode()}
        self._files, self._version = whole, self._version + 1

    def found(self, path: str, host: str) -> tuple[str, bytes] | None:
        """Name and bytes of what is asked for; None: nothing, or nothing for who asks."""
        if host not in (f"{HERE}:{self.port}", f"localhost:{self.port}"):
            return None
        try:
            asked = urlsplit(path).path
        except ValueError:  # no address at all
            return None
        token, _, name = asked.removeprefix("/").partition("/")
        if not secrets.compare_digest(token.encode(), self._token.encode()):
            return None
        name = name or PAGE
        return (name, self._files[name]) if name in self._files else None

    def __enter__(self) -> "PageServer":
        self._thread.start()
        return self

    def __exit__(self, *failure) -> None:
        self._server.shutdown()
        self._server.server_close()


class Answering(http.server.BaseHTTPRequestHandler):
    """GET and HEAD of the page's files; everything else is nowhere."""

    protocol_version = "HTTP/1.1"
    server_version, sys_version = "Shapeshift", ""
    timeout = 30  # seconds that a silent connection is kept

    def do_GET(self) -> None:
        self._answer(body=True)

    def do_HEAD(self) -> None:
        self._answer(body=False)

    def _answer(self, body: bool) -> None:
        server: PageServer = self.server.page_server  # type: ignore[attr-defined]
        found = server.found(self.path, self.headers.get("Host", ""))
        name, data = found or ("", b"There is nothing here.")
        self.send_response(200 if found else 404)
        kind = KINDS.get(os.path.splitext(name)[1], "text/plain; charset=utf-8")
        for header, value in (HEADERS | {"Content-Type": kind}).items():
            self.send_header(header, value)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        if body:
            self.wfile.write(data)

    def log_message(self, format: str, *arguments) -> None:
        """Nobody needs a line for every request."""


class LocalServer(http.server.ThreadingHTTPServer):
    """One that says nothing of connections that browsers break off."""

    daemon_threads = True
    request_queue_size = 128  # connections that wait: a browser opens six for each page

    def handle_error(self, request, client_address) -> None:
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


def bound(port: int) -> LocalServer:
    """A server that listens on this computer alone.  Raises UsageError."""
    if not 0 <= port <= 65535:
        raise UsageError(f"--port is {port}, expected 0 (any that is free) to 65535.")
    try:
        return LocalServer((HERE, port), Answering)
    except OSError as error:
        if error.errno in (errno.EADDRINUSE, getattr(errno, "WSAEADDRINUSE", -1)):
            raise UsageError(
                f"port {port} is in use by another program; --port 0 takes one that is free."
            ) from None
        if error.errno in (errno.EACCES, errno.EPERM):
            raise UsageError(
                f"port {port} is not for every program; --port 0 takes one that is free."
            ) from None
        raise


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Show a scene in the browsers of this computer, and anew when its file changes."""

    scene: Annotated[Path, POSITIONAL]
    """A package, splats of any known format, a folder of layers or a scene file."""
    port: int = 8000
    """Of the address; 0: any that is free."""
    x: Annotated[str, CONTROL] = ""
    """Where the slider stands at first: a stop by its name, or a number from 0 to 1.  Default: the
    first stop, and in a scene file what it says for each object."""
    for_: Literal["any", "quest"] = "any"
    """quest: in a headset that has no PC the page leaves out what costs little, from 46 dB on, and
    says so (docs/headset.md)."""
    exact: Annotated[bool, EXPERT] = False
    """Tables as float32 instead of 8 to 24 bits."""


def run(options: Options) -> int:

    server = PageServer(options.port)  # a port that is taken is said before the scene is read
    server.files = page_files(options)
    say(
        f"{options.scene.name} is at {server.address}",
        f"A headset on USB: adb reverse tcp:{server.port} tcp:{server.port}, and in its browser "
        f"{server.address.replace('127.0.0.1', 'localhost')}",
        ALONE,
    )
    return serve(options, server)


def serve(options: Options, server: PageServer, opened: Callable[[], None] = lambda: None) -> int:
    """Answers until somebody interrupts it; `opened` is called when it does."""
    try:
        with server:
            opened()
            follow(options, server)
    except KeyboardInterrupt:
        say("Ended.")
    return 0


# The page in place of the window: `view` where there is no OpenGL 4.3, and `view --browser`.

IN_TERMINAL = ("www-browser", "links", "elinks", "lynx", "w3m")  # browsers that draw no page
TAKEN_OVER = ("scenes", "x")  # of view's options; those of reading, too
OF_THE_WINDOW = ("browser", "panel", "pictures")  # options that a page has no use for


def view(
    options: "ViewOptions", display: bool, importing: Callable[[], AbstractContextManager[None]]
) -> int:
    """In a window; where there can be none, or a browser was asked for, as a page in it.

    importing: what the window's modules are imported in.
    """
    asked = "A browser was asked for." if options.browser else ""
    if why := asked or ("" if display else "No display here."):
        code = view_in_browser(options, why, display)
        if code is not None:
            return code
    with importing():
        from shapeshift.app.editor import desktop
        from shapeshift.renderer.gl.context import NoContext
    try:
        return desktop.run(options)
    except NoContext as error:
        why = f"No window here: {str(error).partition(';')[0]}."
        code = view_in_browser(options, why, display and is_display_there())
        if code is None:
            raise
        return code


def is_display_there() -> bool:
    """Whether the display that is named is there: where it is not, browsers have none either."""
    import warnings

    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pyGLFW reports through warnings
        return bool(glfw.init())


def view_in_browser(options: "ViewOptions", why: str, display: bool) -> int | None:
    """The exit code of the page; None: nobody would see it, without a browser or a terminal."""
    if options.screenshot is not None:
        return None
    browser = find_browser() if display else None
    if not (options.browser or browser or sys.stderr.isatty()):
        return None
    return browse(options, why, browser)


def browse(view: "ViewOptions", why: str, browser: "BaseBrowser | None") -> int:
    """Serves what `view` was asked to show, and opens it in a browser; why: there is no window.

    Without a browser the address is for one elsewhere, by a tunnel.  Raises UsageError, BadFile.
    """
    scenes = list(view.scenes) or [TOUCH]
    if len(scenes) > 1:
        raise UsageError(f"{why} The page shows one scene; name one of the {len(scenes)}.")
    reading = {each.name: getattr(view, each.name) for each in fields(ReadingOptions)}
    options = Options(plain(scenes[0]), x=view.x, **reading)
    kept = {*reading, *TAKEN_OVER, *OF_THE_WINDOW}
    left = [a.name for a in arguments_of(type(view)) if a.field.name not in kept
            and getattr(view, a.field.name) != a.field.default]  # fmt: skip
    files = page_files(options)  # what cannot be shown is one sentence, before a page is promised
    server = server_on_free_port(options.port)
    server.files = files
    say(f"{why} The page in a browser shows {options.scene.name} instead.")
    if left:
        say(f"It leaves out {', '.join(left)}, which the window has.")

    def tell_where() -> None:
        if browser is not None and browser.open(server.address):
            say(f"It opens in the browser: {server.address}")
        else:
            say(f"It is at {server.address}", tunnel_words(server.port))
        say(ALONE)

    return serve(options, server, tell_where)


def find_browser() -> "BaseBrowser | None":
    """The browser that this computer's user has chosen; None: none, or one that draws no page."""
    import webbrowser

    try:
        found = webbrowser.get()
    except webbrowser.Error:
        return None
    return None if os.path.basename(str(getattr(found, "name", ""))) in IN_TERMINAL else found


def server_on_free_port(first: int) -> PageServer:
    """On the first port, else one of the next, else on any that is free."""
    for port in (*range(first, first + PORTS), 0):
        try:
            return PageServer(port)
        except UsageError:
            if port == 0:
                raise
    raise AssertionError("0 is any that is free")


def tunnel_words(port: int) -> str:
    """How another computer's browser reaches the page."""
    to = (os.environ.get("SSH_CONNECTION") or "").split()
    host = to[2] if len(to) == 4 else "THIS-COMPUTER"
    return f"From another computer: `ssh -L {port}:{HERE}:{port} {host}`, then that address there."


def follow(options: Options, server) -> None:
    """Looks at the files until somebody interrupts it, and waits for those that are written."""
    shown = seen = state_of(options.scene)
    while True:
        time.sleep(LOOK_S)
        now = state_of(options.scene)
        if now and now == seen != shown:  # twice the same: nobody writes it any more
            shown = now
            show_anew(options, server)
        seen = now


def show_anew(options: Options, server) -> None:
    """The page of the files as they are; where they cannot be used, says so and keeps the last."""
    from shapeshift.runtime_models.model import BadFile

    try:
        server.files = page_files(options)
    except (BadFile, UsageError, OSError) as error:
        say(f"{options.scene.name} has changed, and the page stays as it was: {error}")
    else:
        say(f"{options.scene.name} has changed: shown anew.")


def state_of(path: Path) -> tuple:
    """What differs when a file, a file of a folder, or a model of a scene file is written."""
    import json

    paths = [path]
    try:
        if path.is_dir():
            paths = sorted(path.rglob("*"))
        elif path.suffix == ".json":
            found = json.loads(path.read_text("utf-8")).get("objects", [])
            paths += [path.parent / str(item["model"]) for item in found if item.get("model")]
        stats = [(str(part), part.stat()) for part in paths]
    except (OSError, ValueError, AttributeError, TypeError):
        return ()
    return tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats)


def page_files(options: Options) -> dict[str, bytes]:
    """The files of the page.  Raises BadFile, UsageError."""
    from shapeshift.app.page.page_file import folder_files
    from shapeshift.app.page.page_scene import PageSettings, coarse_scene, page_scene

    document = document_of(options)
    title = options.scene.name.removesuffix(".scene.json").rsplit(".", 1)[0]
    settings = PageSettings(title, exact=options.exact, profile=options.for_)
    with progress_after(PATIENCE_S) as progress:
        scene = page_scene(document, settings, progress)
    return folder_files(title, scene, coarse_scene(document, settings))


def document_of(options: Options) -> "Document":
    """What is shown, at its x, with a pace between its stops.  Raises BadFile, UsageError."""
    from shapeshift.app.document import open_document
    from shapeshift.app.pace import with_pace
    from shapeshift.runtime_models.model import AnchorModel
    from shapeshift.scene.scene import Scene

    document = open_document(options.scene, options)
    if options.x:
        document = document.placed(options.x)
    if not document.file:
        (obj,) = document.scene.objects
        if isinstance(obj.model, AnchorModel):
            document = replace(document, scene=Scene((replace(obj, model=with_pace(obj.model)),)))
    return document
