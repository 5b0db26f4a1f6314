"""A comparison by a cluster: the models of one process, and rows of the same likeness."""

import csv
from pathlib import Path

import pytest

from shapeshift.app.errors import UsageError
from shapeshift.app.training.table import Options, run
from shapeshift.app.training.table_parts import parts_of
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training.synthetic.balls import make_balls
from tests.support.training.settings_files import settings_file

SMALL = {"asked": {"max_anchors": 200}, "splats": {"max_splats": 400, "sh_degree": 1}}
TIMES = ("seconds", "start_s")


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    return make_balls(tmp_path_factory.mktemp("balls"), size=32, views=6, test_views=2).folder


def options(balls: Path, out: Path, **more) -> Options:
    settings = settings_file(balls, **SMALL["splats"])
    return Options(balls, out, iterations=8, device="cpu", settings=settings, **SMALL, **more)


def rows(out: Path) -> list[dict]:
    lines = (out / "table.csv").read_text().splitlines()[3:]
    return [{k: v for k, v in row.items() if k not in TIMES} for row in csv.DictReader(lines)]


def models(out: Path) -> dict[str, bytes]:
    found = [p for p in out.rglob("*") if p.suffix in (".shift", ".ply", ".spz")]
    found.append(out / "splats" / "layers.json")
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in found}


@pytest.mark.slow
def test_two_workers_train_the_models_of_one(balls, tmp_path):
    pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    alone, many = tmp_path / "alone", tmp_path / "many"
    assert run(options(balls, alone)) == 0
    assert run(options(balls, many, cluster="local:2")) == 0
    assert models(many) == models(alone) and len(models(many)) == 8
    assert rows(many) == rows(alone) and len(rows(many)) == 12
    # A second start, with the rows gone, trains nothing.
    before = (many / "joint.shift").stat().st_mtime_ns
    (many / "table.csv").unlink()
    assert run(options(balls, many, cluster="local:1")) == 0
    assert (many / "joint.shift").stat().st_mtime_ns == before and rows(many) == rows(alone)


def test_parts_have_names_of_their_own(balls, tmp_path):
    parts = parts_of(read_capture(balls), tmp_path, ("joint", "separate", "splats"))
    assert [part.name for part in parts] == [
        "joint", "separate:RGB", "separate:Thermal", "splats:RGB", "splats:Thermal",
    ]  # fmt: skip
    files = [path for part in parts for path in (part.file, part.trained, part.checkpoint)]
    assert len(set(files)) == 15


def test_a_part_that_is_none_is_refused(balls, tmp_path):
    with pytest.raises(UsageError, match="--only is 'spz', expected one of joint, separate:RGB"):
        run(options(balls, tmp_path / "out", only="spz"))
    with pytest.raises(UsageError, match="--resume goes on with one model; add --only"):
        run(options(balls, tmp_path / "out", resume=True))
    with pytest.raises(UsageError, match="--cluster is 'local:0'"):
        run(options(balls, tmp_path / "out", cluster="local:0"))
