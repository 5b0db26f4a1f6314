"""Viewers that install from package registries beside ours: same splats, poses and sizes, no GPU.

    python tools/renderer/peers.py LEG_FOLDER --out docs/bench/peers.csv

Ours draws with OpenCL tiles, and twice as a page in the browser: "page" as it comes, by a picture
of 16 bits, "direct" into the canvas' 8 bits as the other viewers do.  gausscam (PyPI) wants a
Vulkan driver for the CPU: name one newer than Mesa 23 with VK_ICD_FILENAMES where the system's is
older.  gaussian-splats-3d, spark and playcanvas (npm) want npm, Chromium and Xvfb; the page wants
the latter two.  A peer that cannot run is left out with its reason; the rest goes on.
CPU ms are those of the whole process tree, so that other load does not count (Linux only).
"""

import argparse
import json
import os
import subprocess
import sys
import time
import venv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE)]

from peer_pages.browser import NAMES, NPM_PACKAGES, CannotRun, browser_frames  # noqa: E402

from shapeshift.app.document import open_document  # noqa: E402
from shapeshift.app.drawing import save_png  # noqa: E402
from shapeshift.app.opening import ReadingOptions  # noqa: E402
from shapeshift.app.page.page_scene import PageSettings, page_scene  # noqa: E402
from shapeshift.renderer.reference import reference_image  # noqa: E402
from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.runtime_models.model import SplatLayers  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.runtime_models.splats.plain_splats import PlainSplats  # noqa: E402
from shapeshift.runtime_models.splats.ply.write_ply import write_ply  # noqa: E402
from shapeshift.scene.cameras.framing import fit_distance, frame_points, view_from  # noqa: E402
from shapeshift.scene.metrics import psnr  # noqa: E402
from shapeshift.scene.pose import View  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402

SCALE = 4.0  # of the scene: some viewers cut what is nearer than 0.3
FOV_Y_DEGREES = 45.0
WARM_UP = 3
FILE_FROM_WORLD = np.diag([1.0, -1.0, -1.0, 1.0])  # a PLY keeps COLMAP's axes
SIZES = ((640, 360), (1280, 720))


@dataclass(frozen=True)
class Frames:
    """What one peer did with the poses."""

    peer: str
    version: str
    cpu_ms: float  # a frame
    wall_ms: float  # median
    picture: np.ndarray  # (H, W, 3) of the first pose, over black


def make_views(model, count: int, size: tuple[int, int]) -> list[View]:
    """An orbit with changing height and distance, near enough for the splats to fill the view."""
    centre, radius = frame_points(model.means, model.opacity)
    fov_y = np.radians(FOV_Y_DEGREES)
    views = []
    for i in range(count):
        turn, height = np.pi / 2 + 2 * np.pi * i / count, 0.25 + 0.35 * np.sin(2.4 * i)
        away = fit_distance(radius, size, fov_y) * (0.4 + 0.15 * np.cos(1.7 * i))
        side = [np.sin(turn) * np.cos(height), np.sin(height), np.cos(turn) * np.cos(height)]
        views.append(view_from(centre + away * np.array(side), centre, radius, size, fov_y))
    return views


def write_job(folder: Path, views: list[View]) -> None:
    """What the peers read: poses in the file's axes, row by row; `views` in ours, for the page."""
    poses = [(FILE_FROM_WORLD @ v.world_from_eye.matrix()).ravel().tolist() for v in views]
    seen = [
        {"worldFromEye": {"position": v.world_from_eye.position.tolist(),
                          "wxyz": v.world_from_eye.wxyz.tolist()},
         "tangents": list(v.tangents)}
        for v in views
    ]  # fmt: skip
    job = {
        "size": views[0].size, "fov_y_degrees": FOV_Y_DEGREES, "near": 0.1, "far": 1000.0,
        "warm_up": WARM_UP, "poses": poses, "views": seen,
    }  # fmt: skip
    (folder / "job.json").write_text(json.dumps(job))


def ours(model, views: list[View]) -> Frames:
    """The whole frame of the tiles drawing: colours, projection, sort, bin, rasterize."""
    scene = Scene((SceneObject("scene", model, x=1.0),))
    with Renderer(None, "tiles") as renderer:
        cpu, wall = [], []
        renderer.update(scene)
        for view in [*views[:1] * WARM_UP, *views]:
            start, cpu_start = time.perf_counter(), time.process_time()
            renderer.draw([view])
            cpu.append((time.process_time() - cpu_start) * 1e3)
            wall.append((time.perf_counter() - start) * 1e3)
            if len(wall) == WARM_UP:
                picture = renderer.image(0)[..., :3].copy()
        name = f"ours, {renderer.backends['drawing']}"
    cpu_ms, wall_ms = float(np.mean(cpu[WARM_UP:])), float(np.median(wall[WARM_UP:]))
    return Frames(name, "", cpu_ms, wall_ms, picture)


def gausscam(folder: Path) -> Frames:
    """gausscam in an environment of its own."""
    environment = folder / "gausscam"
    python = environment / "bin" / "python"
    if not python.exists():
        venv.create(environment, with_pip=True)
        run([python, "-m", "pip", "install", "-q", "gausscam[webgpu,io]==0.1.5"])
    (folder / "result.json").unlink(missing_ok=True)
    run([python, HERE / "peer_pages" / "gausscam_frames.py", folder])
    found = json.loads((folder / "result.json").read_text())
    picture = np.load(folder / "picture.npy").astype(np.float32) / 255
    cpu, wall = float(np.mean(found["cpu_ms"])), float(np.median(found["wall_ms"]))
    return Frames("gausscam (degree 0 only)", found["version"], cpu, wall, picture)


def in_browser(peer: str, folder: Path) -> Frames:
    """A npm viewer or our page in Chromium, its WebGL drawn by the system's software GL."""
    if peer in NAMES and not (folder / "node_modules").exists():
        run(["npm", "install", "--no-audit", "--no-fund", "--prefix", folder, *NPM_PACKAGES])
    found = browser_frames(peer, folder)
    cpu = found.cpu_s * 1e3 / len(found.wall_ms)
    assert found.picture is not None
    wall = float(np.median(found.wall_ms))
    return Frames(found.name, found.version, cpu, wall, found.picture)


def run(command: list) -> None:
    """A command that must succeed; CannotRun with the end of what it said."""
    words = [str(word) for word in command]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=900, check=False)
    except FileNotFoundError:
        raise CannotRun(f"{words[0]} is not installed") from None
    if done.returncode:
        said = (done.stderr or done.stdout).strip().splitlines()
        raise CannotRun(f"{Path(words[0]).name} ended with {done.returncode}: {said[-1:]}")


PEERS = {
    "ours": lambda folder, model, views: ours(model, views),
    "gausscam": lambda folder, model, views: gausscam(folder),
    "kellogg": lambda folder, model, views: in_browser("kellogg", folder),
    "spark": lambda folder, model, views: in_browser("spark", folder),
    "playcanvas": lambda folder, model, views: in_browser("playcanvas", folder),
    "page": lambda folder, model, views: in_browser("page", folder),
    "direct": lambda folder, model, views: in_browser("direct", folder),
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path, help="a folder of PLY layers, drawn at x = 1")
    parser.add_argument("--out", type=Path, required=True, help="the CSV file to write")
    parser.add_argument("--work", type=Path, default=Path("out/peers"), help="where peers install")
    parser.add_argument("--poses", type=int, default=10)
    parser.add_argument("--peers", nargs="+", choices=PEERS, default=list(PEERS))
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    layers = read_model(options.scene)
    assert isinstance(layers, SplatLayers)
    bigger = (layers.means * SCALE, layers.scales * SCALE)
    splats = PlainSplats(*bigger, layers.wxyz, layers.opacity, layers.sh)
    write_ply(splats, options.work / "splats.ply")
    model = read_model(options.work / "splats.ply")
    document = open_document(options.work / "splats.ply", ReadingOptions())
    settings = PageSettings("peers", pictures=False)
    scene = page_scene(document, settings, lambda *_: None)
    (options.work / "scene.bin").write_bytes(scene)
    rows = []
    for size in SIZES:
        rows += measure(options, model, size)
    words = f"python tools/renderer/peers.py {options.scene.name} --out peers.csv"
    head = [f"# {words} --poses {options.poses}", f"# load average {os.getloadavg()[0]:.1f}"]
    columns = "peer,version,size,splats,cpu_ms,wall_ms,cpu_over_ours,psnr_db"
    options.out.write_text("\n".join([*head, columns, *rows]) + "\n")
    return 0


def measure(options, model, size: tuple[int, int]) -> list[str]:
    """One CSV row a peer at one size; the first one is the yardstick."""
    views = make_views(model, options.poses, size)
    write_job(options.work, views)
    scene = Scene((SceneObject("scene", model, x=1.0),))
    want = reference_image(scene, views[0])[..., :3]
    rows, yardstick = [], None
    for name in options.peers:
        try:
            frames = PEERS[name](options.work.resolve(), model, views)
        except CannotRun as reason:
            sys.stderr.write(f"{name} is left out: {reason}\n")
            continue
        yardstick = yardstick or frames.cpu_ms
        error = psnr(frames.picture, want)
        save_png(frames.picture, options.work / f"{name}-{size[0]}x{size[1]}.png")
        row = (
            f'"{frames.peer}",{frames.version},{size[0]}x{size[1]},{model.splat_count},'
            f"{frames.cpu_ms:.1f},{frames.wall_ms:.1f},{frames.cpu_ms / yardstick:.2f},{error:.1f}"
        )
        sys.stderr.write(row + "\n")
        rows.append(row)
    return rows


if __name__ == "__main__":
    raise SystemExit(main())
