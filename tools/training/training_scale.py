"""What a training step costs as scenes grow: milliseconds of each pass, bytes on the device.

    python tools/training/training_scale.py [--anchors 50000] [--size 1000x750] [--steps 5] \
        --out FILE

Anchors lie on a ball's surface in front of the camera, networks are fresh, photos are noise: the
arithmetic and the memory of a real scene of that size, without its data.  slots: pairs of a splat
and a tile of its box, listed: those whose ellipse touches the tile.  pool_mb: what the device's
pool holds after the last step; said_mb: what tools/app/step_memory.py says of it.  cpu_ms:
processor time of all threads, mean of the steps but the first; the passes are wall time.
"""

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from shapeshift.rasterizer.device import Device, open_device  # noqa: E402
from shapeshift.scene.pose import View, look_at, perspective  # noqa: E402
from shapeshift.training.densify import DensificationStats  # noqa: E402
from shapeshift.training.heads.networks import HeadLayout, initial_weights, padded  # noqa: E402
from shapeshift.training.heads.optimizer import Adam  # noqa: E402
from shapeshift.training.losses.losses import ImageLoss  # noqa: E402
from shapeshift.training.step import TrainingStep  # noqa: E402
from tools.app.step_memory import step_memory  # noqa: E402

PASSES = (
    "heads", "activate", "project", "bin", "rasterize", "loss", "rasterize backward",
    "project backward", "density", "heads backward", "adam",
)  # fmt: skip
COLUMNS = (
    "anchors,splats,size,form,slots,listed,cpu_ms,pool_mb,said_mb,bytes_an_anchor,bytes_a_slot,"
    + ",".join(name.replace(" ", "_") + "_ms" for name in PASSES)
)
RADIUS = 1.0  # metres


def ball(count: int, rng: np.random.Generator) -> np.ndarray:
    """(count, 3) float32 points on the surface of a ball."""
    away = rng.normal(size=(count, 3))
    return (RADIUS * away / np.linalg.norm(away, axis=1, keepdims=True)).astype(np.float32)


def own_pool(kind: str | None) -> Device:
    """A device whose pool holds nothing yet; a CPU may stand in for a GPU."""
    from pyopencl.tools import ImmediateAllocator, MemoryPool

    device = open_device()
    pool = MemoryPool(ImmediateAllocator(device.queue))
    return replace(device, kind=kind or device.kind, pool=pool)


def measure(anchors: int, splats: int, size: tuple[int, int], steps: int, form: str | None) -> str:
    """A row of COLUMNS."""
    device, layout = own_pool(form), HeadLayout(splats=splats)
    rng = np.random.default_rng(0)
    features = rng.normal(size=(anchors, padded(layout.features))) * 0.1
    values = {
        "weights": initial_weights(layout, rng),
        "anchors": ball(anchors, rng),
        "features": features.astype(np.float32),
        "frames": np.tile(np.array([0, 0, 0, 1, 0, 0, 0], np.float32), (anchors, 1)),
        "colors": np.zeros((anchors, 3), np.float32),
    }
    adam = Adam(device, values, {name: np.full(1, 1e-3, np.float32) for name in values})
    voxel = 2 * RADIUS * np.sqrt(np.pi / anchors)  # the mean distance of neighbours
    step, loss = TrainingStep(device, layout, voxel, adam), ImageLoss(device, size)
    stats = DensificationStats(device, layout, anchors, 1)
    rgba = rng.integers(0, 256, (size[1], size[0], 4)).astype(np.uint8)
    target = loss.target(device.upload(rgba), (0, 0, 0))
    lens = perspective(np.deg2rad(45), size)
    cpu = 0.0
    for number in range(steps + 1):
        turn = 0.4 * number
        eye = look_at(3.0 * np.array([np.sin(turn), 0.3, np.cos(turn)]), np.zeros(3))
        step.ms = {} if number <= 1 else step.ms
        start = time.process_time()
        drawing = step.draw(View(eye, lens, 0.05, 100.0, size), rng.random(16), (0, 0, 0))
        step.update(step.gradients(drawing, loss, target, stats=stats), 1.0)
        device.queue.finish()
        cpu += time.process_time() - start if number else 0.0
    if not np.isfinite(loss.value()):
        raise SystemExit("The loss is not a number; such a row says nothing.")
    said, tiles = step_memory(layout, device.kind), drawing.tiles
    listed = int(device.view(tiles.starts)[tiles.grid[0] * tiles.grid[1]])
    cells = [
        anchors, anchors * splats, f"{size[0]}x{size[1]}", device.kind, tiles.count, listed,
        f"{1e3 * cpu / steps:.1f}", f"{device.pool.managed_bytes / 1e6:.1f}",
        f"{said.total(anchors, tiles.count, size[0] * size[1]) / 1e6:.1f}", said.anchor, said.slot,
        *(f"{step.ms[name] / steps:.2f}" for name in PASSES),
    ]  # fmt: skip
    return ",".join(map(str, cells))


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--anchors", type=int, nargs="+", default=[5000, 50000])
    parser.add_argument("--splats", type=int, default=10, help="splats an anchor")
    parser.add_argument("--size", nargs="+", default=["400x300", "1000x750"])
    parser.add_argument("--steps", type=int, default=5)
    parser.add_argument("--form", choices=["cpu", "gpu"], help="instead of the device's own")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args(arguments)
    device = open_device()
    lines = [
        f"# python tools/training/training_scale.py {' '.join(arguments)}",
        f"# {device.name}, {device.platform}", COLUMNS,
    ]  # fmt: skip
    for text in given.size:
        width, height = (int(side) for side in text.split("x"))
        for anchors in given.anchors:
            lines.append(measure(anchors, given.splats, (width, height), given.steps, given.form))
            sys.stderr.write(lines[-1] + "\n")
    given.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
