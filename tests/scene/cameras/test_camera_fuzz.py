"""Camera files with bytes changed: a list of views or one sentence comes out, nothing else."""

import json
import warnings
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.read_cameras import read_camera_list
from shapeshift.scene.cameras.write_cameras import FORMS, paths_of, write_cameras
from tests.support.scene.camera_files import cameras

TIMES = 150  # a form
NUMBERS = [
    "0", "-1", "1e308", "1e-308", "NaN", "Infinity", "null", "true", '"a"', "[]", "{}", "1e999",
    "9" * 400, "-0.0", "[[[[]]]]", '"\\ud800"', '"\\u0000"',
]  # fmt: skip
SIZES = [b"\0" * 8, b"\xff" * 8, b"\x7f" * 8, b"\xff\xff\xff\x7f", b"\0\0\xf8\x7f", b"\1\0\0\0"]


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """Cut, doubled, overwritten at some place; numbers of JSON become others."""
    out = bytearray(data)
    at, end = sorted(int(n) for n in rng.integers(0, len(out) + 1, 2))
    kind = rng.integers(0, 6)
    if kind == 0:
        out = out[:at]
    elif kind == 1:
        out[at:at] = out[at : min(end, at + 200)]
    elif kind == 2:
        del out[at : min(end, at + 40)]
    elif kind == 3:
        piece = SIZES[rng.integers(len(SIZES))]
        out[at : at + len(piece)] = piece
    else:
        for place in rng.integers(0, len(out), 1 + int(rng.integers(0, 4))):
            out[place] = rng.integers(0, 256)
    return bytes(out)


def with_other_value(data: bytes, rng: np.random.Generator) -> bytes:
    """One value somewhere in the JSON becomes another that JSON, or Python's, can say."""
    tree = json.loads(data)
    node = tree
    while True:
        keys = list(node) if isinstance(node, dict) else range(len(node))
        key = list(keys)[rng.integers(len(keys))]
        if not (isinstance(node[key], dict | list) and node[key]) or rng.random() < 0.15:
            break
        node = node[key]
    if isinstance(node, dict) and rng.random() < 0.3:
        del node[key]
    else:
        node[key] = "MARK"
    return json.dumps(tree).replace('"MARK"', NUMBERS[rng.integers(len(NUMBERS))]).encode()


@pytest.mark.parametrize("form", FORMS)
def test_no_bytes_do_anything_but_views_or_a_sentence(tmp_path, form):
    rng = np.random.default_rng(FORMS.index(form))
    path = tmp_path / ("model" if form.startswith("colmap") else "cameras.json")
    write_cameras(cameras(plain=True), path, form)
    files = [p for p in paths_of(path, form) if "points3D" not in p.name]
    whole = {file: file.read_bytes() for file in files}
    refused = 0
    for _ in range(TIMES):
        file = files[rng.integers(len(files))]
        change = with_other_value if file.suffix == ".json" and rng.random() < 0.6 else mutated
        file.write_bytes(change(whole[file], rng))
        refused += is_refused(path)
        file.write_bytes(whole[file])
    assert 0.1 * TIMES < refused < TIMES  # neither all nor none: the changes reach the readers


def is_refused(path: Path) -> bool:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = read_camera_list(path)
        except BadFile as error:
            assert str(error) and "\n" not in str(error) and len(str(error)) < 2000
            return True
    assert len(found.views) == len(found.names) > 0
    for view in found.views:  # what a View refuses is checked there
        turn = view.world_from_eye.matrix()[:3, :3]
        assert np.abs(turn.T @ turn - np.eye(3)).max() < 1e-6
    return False
