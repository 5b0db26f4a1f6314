"""`launch.py serve`: this computer alone, a token, a page that follows its file."""

import http.client
import socket
import struct
import threading
import time
import webbrowser
from types import SimpleNamespace

import pytest

from shapeshift.app import cli
from shapeshift.app.errors import UsageError
from shapeshift.app.page import serve
from shapeshift.app.page.serve import HERE, LocalServer, PageServer
from shapeshift.renderer.gl.context import NoContext
from shapeshift.runtime_models.package.feature_codes import EXACT
from shapeshift.runtime_models.package.write_package import write_package
from tests.support.web.page_scenes import paced_model


def ask(server: PageServer, path: str, host: str = "", method: str = "GET"):
    """(status, headers, body)"""
    connection = http.client.HTTPConnection(HERE, server.port, timeout=10)
    try:
        connection.request(method, path, headers={"Host": host or f"{HERE}:{server.port}"})
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()
    finally:
        connection.close()


@pytest.fixture
def server():
    with PageServer(0) as server:
        server.files = {"index.html": b"<html lang>", "scene.bin": b"12345"}
        yield server


def test_who_has_the_address_gets_the_page_and_nobody_else(server):
    token = server.address.removeprefix(f"http://{HERE}:{server.port}")
    status, headers, body = ask(server, token)
    assert (status, body) == (200, b'<html data-served="1" lang>')
    assert headers["Cache-Control"] == "no-store"
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert ask(server, token + "scene.bin?a=b")[2] == b"12345"
    assert ask(server, token, f"localhost:{server.port}")[0] == 200  # over adb reverse
    outside = ("/", "/x/", token[:-2] + "/", token + "other", token + "../index.html", "/%2e%2e/x")
    for path in outside:
        assert ask(server, path)[0] == 404, path
    for host in ("evil.example", f"evil.example:{server.port}", f"{HERE}:1", HERE):
        assert ask(server, token, host)[0] == 404, host  # a name that leads here by DNS
    assert ask(server, token, method="POST")[0] == 501
    assert ask(server, token, method="HEAD")[2] == b""


def test_every_answer_has_the_same_headers(server):
    """Found or not: nothing is kept, guessed, told to other pages or shown in their frames."""
    token = server.address.removeprefix(f"http://{HERE}:{server.port}")
    for path in (token, token + "scene.bin", "/x/"):
        headers = ask(server, path)[1]
        assert headers["Cache-Control"] == "no-store"
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Referrer-Policy"] == "no-referrer"  # the address holds the token
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert headers["Content-Security-Policy"] == "frame-ancestors 'none'"


def raw(server: PageServer, words: bytes, reset: bool = False) -> bytes:
    """What comes back for bytes of one's own; reset: the connection is thrown away at once."""
    with socket.create_connection((HERE, server.port), timeout=10) as held:
        held.sendall(words)
        if reset:
            held.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            return b""
        return held.recv(65536)


@pytest.mark.parametrize(
    "address",
    [b"http://[::1", b"//[", b"http://[x]/", b"*", b"x", b"/%", b"http://a:b:c/", b"/\xff"],
)
def test_an_address_that_is_none_is_nowhere(server, address):
    host = f"{HERE}:{server.port}".encode()
    answer = raw(server, b"GET " + address + b" HTTP/1.1\r\nHost: " + host + b"\r\n\r\n")
    assert answer.startswith(b"HTTP/1.1 404 ")


def test_connections_that_browsers_break_off_are_no_news(server, capfd):
    """Reset before, within and after a request; a line that is no request; then all goes on."""
    token = server.address.removeprefix(f"http://{HERE}:{server.port}")
    server.files = {"index.html": b"<html>", "scene.bin": bytes(8 << 20)}
    whole = f"GET {token}scene.bin HTTP/1.1\r\nHost: {HERE}:{server.port}\r\n\r\n".encode()
    for words in (b"", whole[:20], whole):
        for _ in range(4):
            raw(server, words, reset=True)
    assert raw(server, b"\x00\xff\r\n\r\n").startswith((b"HTTP/1.1 400 ", b"<!DOCTYPE", b""))
    assert ask(server, token)[0] == 200
    time.sleep(0.2)  # for threads of those that were reset
    assert capfd.readouterr().err == ""


def test_many_connections_wait_in_line():
    """socketserver's own line of 5 makes the sixth wait a second for each try."""
    assert LocalServer.request_queue_size >= 100


def test_new_files_are_another_version(server):
    token = server.address.removeprefix(f"http://{HERE}:{server.port}")
    assert ask(server, token + "version")[2] == b"1"
    server.files = {"index.html": b"<html>"}
    assert ask(server, token + "version")[2] == b"2"
    assert ask(server, token)[2] == b'<html data-served="2">'
    assert ask(server, token + "scene.bin")[0] == 404


def test_a_port_that_is_taken_is_said_in_a_sentence(server):
    with pytest.raises(UsageError, match=rf"^port {server.port} is in use .* --port 0 .*\.$"):
        PageServer(server.port)
    for port in (-1, 65536):
        with pytest.raises(UsageError, match=f"--port is {port}"):
            PageServer(port)


def test_a_page_follows_its_file(tmp_path, monkeypatch, capsys):
    """A change is shown once the file rests; a broken one leaves the page as it was."""
    monkeypatch.setattr(serve, "LOOK_S", 0.05)
    path = tmp_path / "a.shift"
    write_package(paced_model(20), path, EXACT)
    options = serve.Options(scene=path, port=0)
    server = PageServer(0)
    server.files = serve.page_files(options)
    first = server.files
    assert {"index.html", "scene.bin", "coarse.bin", "version"} == first.keys()

    class Over(Exception):
        pass

    looks = iter(range(60))

    def sleep(_):
        look = next(looks)
        if look == 2:
            path.write_bytes(b"no package")
        if look == 6:
            assert server.files is first
            path.unlink()
            write_package(paced_model(30), path, EXACT)
        if look == 10:
            raise Over

    monkeypatch.setattr(serve.time, "sleep", sleep)
    with pytest.raises(Over):
        serve.follow(options, server)
    assert server.files["version"] == b"2" and server.files["scene.bin"] != first["scene.bin"]
    said = capsys.readouterr().err
    assert said.count("the page stays as it was") == 1 and said.count("shown anew") == 1
    with server:  # so that it can be closed
        assert threading.active_count() > 1


# ---- in place of the window


class StandInBrowser:
    """`opens` says whether it does; what it was given is in `opened`."""

    name = "/usr/bin/firefox"

    def __init__(self, opens: bool) -> None:
        self.opens, self.opened = opens, []

    def open(self, address: str) -> bool:
        self.opened.append(address)
        return self.opens


@pytest.fixture
def visit(tmp_path, monkeypatch, capsys):
    """visit(words, browser=, terminal=, ...) -> (exit code, what was said, the page that was)."""
    package = tmp_path / "a.shift"
    write_package(paced_model(30), package)

    def desktop_run(options):
        raise NoContext("no window with OpenGL 4.3 could be opened (why); `x headless` needs none.")

    def visit(words, browser=None, terminal=False, display=True, there=True):
        pages = []

        def look(options, server):
            pages.append(ask(server, server.address.partition(str(server.port))[2])[2])
            raise KeyboardInterrupt

        monkeypatch.setattr("shapeshift.app.editor.desktop.run", desktop_run)
        monkeypatch.setattr(serve, "follow", look)
        monkeypatch.setattr(serve, "find_browser", lambda: browser)
        monkeypatch.setattr(serve, "is_display_there", lambda: there)
        monkeypatch.setattr(cli, "has_display", lambda: display)
        monkeypatch.setattr("sys.stderr.isatty", lambda: terminal, raising=False)
        code = cli.main(["view", str(package), *map(str, words)])
        return code, capsys.readouterr().err, pages

    return visit


def test_where_there_is_no_window_the_page_opens(visit):
    browser = StandInBrowser(True)
    code, said, (page,) = visit(["--x", "Thermal", "--section", "0,0,1,0"], browser)
    assert code == 0 and b"<html" in page and browser.opened[0] in said
    assert "No window here: no window with OpenGL 4.3 could be opened (why). The page" in said
    assert "It leaves out --section, which the window has." in said and "ssh" not in said
    code, said, pages = visit(["--browser"], browser)
    assert code == 0 and "A browser was asked for." in said and len(pages) == 1


def test_without_a_browser_the_address_is_told_where_somebody_reads(visit, monkeypatch):
    monkeypatch.setenv("SSH_CONNECTION", "10.0.0.2 50000 10.0.0.7 22")
    for how in ({}, {"display": False}, {"browser": StandInBrowser(False)}):
        code, said, pages = visit([], terminal=True, **how)
        port = said.partition(f"{HERE}:")[2].partition("/")[0]
        assert code == 0 and len(pages) == 1 and "It is at http://" in said
        assert f"`ssh -L {port}:{HERE}:{port} 10.0.0.7`" in said
    assert visit(["--browser"], display=False)[0] == 0  # asked for: whoever reads it


def test_where_nobody_would_see_it_there_is_a_sentence(visit, tmp_path):
    firefox = StandInBrowser(True)
    for how in ({}, {"display": False}, {"browser": firefox, "there": False}):
        code, said, pages = visit([], **how)
        assert (code, pages, firefox.opened) == (2, [], []) and "`x headless` needs none" in said
    picture = ["--screenshot", tmp_path / "a.png"]
    assert visit(picture, browser=firefox, terminal=True)[0] == 2
    code, said, pages = visit(["--browser", "--memory", "1k"], browser=firefox)
    assert (code, pages, said.count("\n")) == (2, [], 1) and "The page" not in said
    code, said, pages = visit([tmp_path / "a.shift", "--browser"], browser=firefox)
    assert (code, pages) == (2, []) and "The page shows one scene; name one of the 2." in said


def test_a_port_that_is_taken_leads_to_the_next():
    with PageServer(0) as taken, serve.server_on_free_port(taken.port) as server:
        assert server.port != taken.port
        first_free = range(taken.port + 1, taken.port + serve.PORTS)
        assert server.port in first_free or taken.port + serve.PORTS > 65535


@pytest.mark.parametrize(
    ("found", "is_one"),
    [("/usr/bin/firefox", True), ("lynx", False), ("/usr/bin/www-browser", False), (None, False)],
)
def test_browsers_of_a_terminal_draw_no_page(monkeypatch, found, is_one):
    def get():
        if found is None:
            raise webbrowser.Error("could not locate runnable browser")
        return SimpleNamespace(name=found)

    monkeypatch.setattr(webbrowser, "get", get)
    assert (serve.find_browser() is not None) == is_one
