"""The first frame between a stop and a thermal one compiles nothing: the second frame did, and the
first one, which somebody waits for, did not.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
# Prints, for few splats and for many, the programs that the driver has compiled (the files of its
# cache) and those that we have asked for: after one and two frames at a stop, and after the first
# one with heat.  PoCL has a binary of its own for more than 65,535 items.
FRAMES = """
import sys
from pathlib import Path
from tests.renderer.colors.test_heat import VIEW, model, scene_of
from shapeshift.renderer.colors.false_colors import BESIDE
from shapeshift.renderer.renderer import Renderer

def compiled():
    return len(list(Path(sys.argv[1]).rglob("*.so"))), len(renderer.drawing.device.programs)

with Renderer(None, "tiles") as renderer:
    for count in (60, 22_000):  # times 3 splats
        opened = model(count)
        counts = []
        for x in (0.0, 0.0, 0.2):
            renderer.update(scene_of(opened, x=x))
            renderer.draw([VIEW])
            counts.append(compiled())
        assert renderer.drawing.draws_heat and renderer._false_colors.way == BESIDE
        print(*counts)
"""


@pytest.mark.slow
def test_the_first_frame_with_heat_compiles_nothing(tmp_path):
    pytest.importorskip("pyopencl")
    from shapeshift.rasterizer.device import NoDevice, open_device

    try:
        device = open_device()  # as the program that is started here
    except NoDevice as none:
        pytest.skip(str(none))
    if "PoCL" not in device.platform:
        pytest.skip("counts the files in the cache of PoCL, and this driver is another one")
    done = subprocess.run(
        [sys.executable, "-c", FRAMES, str(tmp_path)], cwd=ROOT, capture_output=True, text=True,
        env={**os.environ, "POCL_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    rows = [line.replace("(", "").replace(")", "") for line in done.stdout.splitlines()]
    numbers = [[int(n) for n in row.replace(",", " ").split()] for row in rows]
    assert len(numbers) == 2
    for first_files, _, *second, after_files, after_programs in numbers:
        assert first_files > 0, "the driver has kept nothing: the test sees no compilation"
        assert [after_files, after_programs] == second
        assert second[0] > first_files
    assert numbers[0][3] == numbers[0][1] + 2, "programs of heat, and of drawing with it"
