"""Every reader against files made wrong: a model or one sentence, in time and in little memory."""

import gzip
import io
import json
import sys
import zipfile
import zlib

import numpy as np
import pytest

from tests.support.hostile.fuzz_rounds import fuzz_all

pytest.importorskip("hypothesis")
pytest.importorskip("pyopencl")

import tests.support.hostile.fuzz_run as fuzz_run
from tests.support.hostile.fuzz_mutations import mutate
from tests.support.hostile.fuzz_run import Hung, watched
from tests.support.hostile.fuzz_seeds import all_seeds

EXAMPLES = 800  # over all seeds together


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="watched on Linux alone")
def test_the_watch_sees_memory_and_time(monkeypatch):
    """The guard itself; 230 MB that are touched, 8 GB that are only asked for, and no end."""
    with watched(0):
        np.ones(100 << 20, np.uint8)
    with pytest.raises(AssertionError, match="MB for 0 bytes"), watched(0):
        np.ones(230 << 20, np.uint8)
    with watched(30 << 20):
        np.ones(230 << 20, np.uint8)
    with pytest.raises(MemoryError), watched(0):
        np.empty(8 << 30, np.uint8)
    monkeypatch.setattr(fuzz_run, "LONGEST_S", 0.05)
    with pytest.raises(Hung), watched(0):
        while True:
            pass


@pytest.mark.parametrize("kind", ["", "json", "zip", "gzip", "spz4", "glb"])
def test_mutations_do_the_same_every_time_and_reach_inside(tmp_path, kind):
    """Inside an archive the content changes while the archive stays whole."""
    rng = np.random.default_rng(1)
    zipped = io.BytesIO()
    with zipfile.ZipFile(zipped, "w") as archive:
        archive.writestr("a.json", json.dumps({"a": [1, 2, {"b": 3.5}]}))
    datas = {"": bytes(range(200)), "json": b'{"a": [1, {"b": "c"}], "d": null}',
             "zip": zipped.getvalue(), "gzip": gzip.compress(bytes(100))}  # fmt: skip
    files = {
        next(iter(s.kinds.values()), s.name): next(iter(s.files.values()))
        for s in all_seeds(tmp_path / "seeds")
        if s.name in ("spz v4 degree 0", "glb")
    }
    data = datas.get(kind) or files[kind]
    changed = whole = 0
    for _ in range(200):
        steps = [tuple(map(int, rng.integers(0, 65536, 3)))]
        once = mutate(data, steps, kind)
        assert once == mutate(data, steps, kind)
        changed += once != data
        if kind == "zip":
            try:
                with zipfile.ZipFile(io.BytesIO(once)) as archive:
                    whole += archive.testzip() is None and once != data
            except (zipfile.BadZipFile, OSError, ValueError, RuntimeError):
                continue
        elif kind == "gzip" and once != data:
            try:
                whole += gzip.decompress(once) != bytes(100)
            except (OSError, EOFError, zlib.error):
                continue
    assert changed > 140  # some replace a number by itself
    assert kind not in ("zip", "gzip") or whole > 60


def test_wrong_files_become_a_model_or_one_sentence(tmp_path):
    count, then = fuzz_all(tmp_path, EXAMPLES)
    assert count >= 800 and then.opened > 50 and then.drawn > 5
