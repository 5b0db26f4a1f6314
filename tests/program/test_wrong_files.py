"""Every command with files not meant for it, empty or cut off: one sentence, exit code 2."""

import os
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app import cli
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.scene.captures import save_image, simple, write_transforms
from tests.support.splats.ply_files import some_splats

COMMANDS = {
    "info": ("info", "FILE"), "lint": ("lint", "FILE"), "bench": ("bench", "FILE"),
    "view": ("view", "FILE"), "chart": ("chart", "FILE"), "cameras": ("cameras", "FILE"),
    "render": ("render", "FILE", "--out", "OUT"),
    "film": ("film", "FILE", "--out", "OUT"),
    "path": ("film", "good.ply", "--cameras", "FILE", "--out", "OUT"),
    "export": ("export", "FILE", "--out", "OUT/a.ply"),
    "compare": ("compare", "good.ply", "FILE"),
    "camera": ("render", "good.ply", "--camera", "FILE", "--out", "OUT"),
    "simulate": ("simulate", "FILE", "--out", "OUT"),
    "train": ("train", "FILE", "--out", "OUT/a.shift"),
    "points": ("train", "capture", "--points", "FILE", "--out", "OUT/a.shift"),
    "eval": ("eval", "good.ply", "FILE"), "eval a": ("eval", "FILE", "capture"),
    "fit": ("fit", "FILE", "--out", "OUT"), "table": ("table", "FILE", "--out", "OUT"),
}  # fmt: skip
FILES = ("empty.ply", "empty.json", "empty.splat", "cut.ply", "head.ply", "noise.ply", "noise.npz",
         "noise.scene.json", "noise.laz", "list.json", "deep.json", "text.txt", "photo.png",
         "folder", "folder.ply", "gone.ply", "pipe.ply", "link.ply")  # fmt: skip


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    """A folder with all of them, a good scene and a good capture."""
    folder = tmp_path_factory.mktemp("wrong")
    write_ply(some_splats(40, 4), folder / "good.ply")
    whole = (folder / "good.ply").read_bytes()
    noise = np.random.default_rng(0).bytes(500)
    files = {"cut.ply": whole[:-5], "head.ply": whole[:50], "list.json": b"[1, 2, 3]"}
    files |= {"deep.json": b"[" * 100_000, "text.txt": b"hello\n" * 9}
    for name in FILES:
        if name.startswith(("empty", "noise")):
            files[name] = noise if name.startswith("noise") else b""
    for name, data in files.items():
        (folder / name).write_bytes(data)
    save_image(folder / "photo.png")
    (folder / "folder").mkdir()
    (folder / "folder.ply").mkdir()
    (folder / "link.ply").symlink_to("/nowhere/a.ply")
    os.mkfifo(folder / "pipe.ply")
    (folder / "capture").mkdir()
    frames, more = simple(folder / "capture", 6)
    write_transforms(folder / "capture", frames, **more)
    return folder


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes in folders are Unix's")
@pytest.mark.parametrize("command", COMMANDS)
def test_it_is_one_sentence(place, command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(place)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    for file in FILES:
        given = [
            file if w == "FILE" else w.replace("OUT", str(tmp_path)) for w in COMMANDS[command]
        ]
        code = cli.main(given)
        last = capsys.readouterr().err.strip().splitlines()[-1]
        assert code == 2 and last.startswith("shapeshift "), (file, code, last)
        assert len(last) < 400 and last.endswith(".") and "Traceback" not in last, (file, last)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("words", [("info",), ("view",), ()])
def test_an_address_of_the_web_says_what_to_do(words, capsys, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    assert cli.main([*words, "https://example.org/scene.ply"]) == 2
    assert "download the file, then open that." in capsys.readouterr().err
