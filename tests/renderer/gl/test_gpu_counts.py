"""What a frame and a training step ask of a graphics card: never more than their row says."""

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.layered import GlFunctions
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import FrameStats
from shapeshift.renderer.timing import UnderWay
from shapeshift.scene.cameras.framing import orbit_path
from shapeshift.scene.pose import stereo_pair
from tools.gpu.counting import COUNTS, counting_gl
from tools.gpu.side_by_side import SIZE, at, count_quads, count_tiles, count_training, made_scenes

ROWS = Path(__file__).resolve().parents[3] / "docs/bench/gpu_counts.csv"
MOST_UPLOADED = 8192  # bytes a frame of quads


def kept_rows() -> dict[tuple[str, str, str], dict[str, str]]:
    with ROWS.open(encoding="utf-8") as lines:
        rows = csv.DictReader(line for line in lines if not line.startswith("#"))
        return {(row["drawing"], row["scene"], row["frame"]): row for row in rows}


def assert_within(rows: Iterator[dict]) -> list[dict]:
    """A count that rises is a fault, or belongs into the file; one that falls belongs there, too,
    but breaks nothing."""
    kept, told = kept_rows(), []
    for row in rows:
        most = kept[row["drawing"], row["scene"], row["frame"]]
        more = {n: (row[n], int(most[n])) for n in COUNTS if row[n] > int(most[n])}
        assert not more, (row["drawing"], row["scene"], row["frame"], more)
        told.append(row)
    return told


def test_frames_of_quads_wait_for_nothing():
    rows = assert_within(count_quads(made_scenes()))
    assert len(rows) == 12
    for row in rows:
        assert row["finishes"] == row["reads"] == row["queries"] == 0, row
        assert row["upload_bytes"] <= MOST_UPLOADED


def test_frames_of_tiles_ask_for_no_more_than_they_did():
    assert len(assert_within(count_tiles(made_scenes()))) == 10


def test_a_training_step_asks_for_no_more_than_it_did(tmp_path):
    assert len(assert_within(count_training(tmp_path))) == 1


def test_each_way_to_wait_is_counted(ctx):
    """Else rows of noughts would say nothing: a read is free behind a fence that has passed, where
    no pass may have written meanwhile, and nowhere else."""
    with counting_gl() as told:
        gpu, under_way = Gpu(ctx), UnderWay[str]()
        buffer, copy = gpu.upload(np.arange(4, dtype=np.uint32)), gpu.reserve(16)
        with ctx.query(time=True) as query:
            pass
        ctx.copy_buffer(copy, buffer, 16)
        copy.read()
        assert (told.counts["reads"], query.elapsed >= 0, told.counts["queries"]) == (1, True, 1)
        under_way.leave("the copy")
        ctx.finish()
        assert under_way.done() == [(0, "the copy")] and told.counts["finishes"] == 1
        copy.read()
        assert (told.counts["reads"], query.elapsed >= 0, told.counts["queries"]) == (1, True, 1)
        copy.bind_to_storage_buffer(0)
        copy.read()
        assert told.counts["reads"] == 2 and told.counts["read_bytes"] == 32
        assert told.counts["made"] == 2 and told.counts["upload_bytes"] == 16 + 2 * 16


def test_counts_say_of_which_frame_they_are(ctx, monkeypatch):
    """A card that is up to three frames behind, beside software GL, which waits for all."""
    scene, views = made_scenes()["anchors"], orbit_path(8, np.zeros(3), 1.0, SIZE)
    behind, call, frames = [True], GlFunctions.call, []

    def slow(self, name, *arguments):
        return 0x911B if behind and "Wait" in name else call(self, name, *arguments)

    def draw(renderer: Renderer, number: int) -> FrameStats:
        renderer.update(at(scene, number / len(views)))
        return renderer.draw(stereo_pair(views[number], 0.5))

    with Renderer(ctx, "quads", "gl", "gl") as renderer:
        for number in range(len(views)):
            stats = draw(renderer, number)
            assert stats.age == 0
            frames.append((stats.drawn, stats.culled))
    monkeypatch.setattr(GlFunctions, "call", slow)  # GL_TIMEOUT_EXPIRED
    with counting_gl(), Renderer(ctx, "quads", "gl", "gl") as renderer:
        ages = []
        for number in range(len(views)):
            if number % 3 == 2:
                behind.clear()
                ctx.finish()
            stats = draw(renderer, number)
            assert (stats.drawn, stats.culled) == frames[number - renderer.drawing.counts_age]
            ages.append(stats.age)
            behind[:] = [True]
        assert max(ages) >= 2
        exact = renderer.exact_stats()
        assert (exact.drawn, exact.culled, exact.age) == (*frames[-1], 0) and "splat" in exact.ms
