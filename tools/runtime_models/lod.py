"""What `launch.py lod` makes of scenes: each level beside the whole scene, bytes and seconds.

    python tools/runtime_models/lod.py SCENE ... --out docs/bench/lod.csv

A scene is baked at its last stop, with one colour from all sides and with the harmonics that it
has, written, and read back by the program's own reader, level by level.  Rows: splats of the level,
mean PSNR (dB of the mean squared error over eight views) against the baked scene, from the usual
distance and from three times as far, the same of as many splats that --max-splats merges to, bytes
a splat over all levels, and processor seconds a million splats of the scene for levels and files.
"""

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE)]

from thin import SIZE, VIEWS, pictures, write_scenes  # noqa: E402

from shapeshift.runtime_models.bake import bake  # noqa: E402
from shapeshift.runtime_models.model import SplatLayers, Stop  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.runtime_models.splats.layers.read_layers import join_layers  # noqa: E402
from shapeshift.runtime_models.splats.operations.decimate import decimate  # noqa: E402
from shapeshift.runtime_models.splats.plain_splats import Reading  # noqa: E402
from shapeshift.runtime_models.splats.sog.read_streamed import read_level, read_tree  # noqa: E402
from shapeshift.runtime_models.splats.sog.write_streamed import write_streamed  # noqa: E402
from shapeshift.scene.cameras.framing import frame_points, model_points, orbit_path  # noqa: E402
from shapeshift.scene.metrics import psnr  # noqa: E402

COLUMNS = (
    "scene,sh_degree,leaves,level,splats,psnr_db,psnr_db_3x_farther,max_splats_db,bytes_a_splat,"
    "cpu_s_a_million"
)
LEAF = 4096  # splats, as the command has it
FAR = 3  # times the distance


def orbits(model: SplatLayers) -> list[list]:
    """Views from the usual distance and from FAR times as far."""
    target, radius, *rest = frame_points(*model_points(model))
    return [orbit_path(VIEWS, target, radius * far, *rest, size=SIZE) for far in (1, FAR)]


def measure(path: Path, renderer) -> list[str]:
    model = read_model(path)
    assert isinstance(model, SplatLayers)
    own = round(model.sh.shape[1] ** 0.5) - 1
    return [row for degree in sorted({0, own}) for row in rows_of(path, model, degree, renderer)]


def rows_of(path: Path, model: SplatLayers, degree: int, renderer) -> list[str]:
    views = orbits(model)
    plain = bake(model, model.stops[-1].x, sh_degree=degree)
    whole = join_layers([replace(plain)], (Stop("all", 0.0),), "", [path.name])

    def drawn(part: SplatLayers) -> list[np.ndarray]:
        return [pictures(renderer, part, orbit, 0.0) for orbit in views]

    true, rows = drawn(whole), []
    with tempfile.TemporaryDirectory() as folder:
        began = time.process_time()
        sizes = write_streamed(plain, Path(folder), LEAF, "bench", lambda part: None)
        seconds = (time.process_time() - began) / sizes.levels[0] * 1e6
        size = sum(file.stat().st_size for file in Path(folder).rglob("*") if file.is_file())
        tree = read_tree(Path(folder))
        for number, count in enumerate(sizes.levels):
            near, far = map(psnr, drawn(read_level(tree, number, Reading())), true)
            merged = psnr(drawn(decimate(whole, count))[0], true[0]) if number else np.inf
            rows.append(
                f"{path.name},{degree},{sizes.leaves},{number},{count},{near:.2f},{far:.2f},{merged:.2f},"
                f"{size / sum(sizes.levels):.1f},{seconds:.1f}"
            )
            print(rows[-1], flush=True)  # noqa: T201
    return rows


if __name__ == "__main__":
    write_scenes(__doc__, COLUMNS, measure)
