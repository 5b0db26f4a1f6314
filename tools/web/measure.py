"""A page in headless Chromium on two cores: sizes, likeness, and processor time of its passes.

    python3 tools/web/measure.py assets/workshop.shift examples/touch.scene.json --out FILE

Processor time is that of all of the browser's processes; software GL (llvmpipe) draws.  Each figure
of a pass is the mean of RUNS after one that is not counted; `frame` is what a moving eye asks for
(colours, project, splat, resolve), `two eyes` the same for two views of that size each.
"""

import argparse
import csv
import io
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

from shapeshift.app.document import open_document  # noqa: E402
from shapeshift.app.opening import ReadingOptions  # noqa: E402
from shapeshift.app.page.page_file import (  # noqa: E402
    export_page,
    one_script,
)
from shapeshift.app.page.page_scene import PageSettings  # noqa: E402
from shapeshift.app.terminal import say  # noqa: E402
from shapeshift.runtime_models.files.whole_file import write_whole  # noqa: E402
from shapeshift.scene.cameras.framing import orbit_path  # noqa: E402
from tests.support.web.chromium import Chromium  # noqa: E402
from tests.support.web.page_pictures import at, decibels, still  # noqa: E402

SIZE, CAMERAS, XS, RUNS = (640, 360), 3, (0.0, 0.25, 0.5, 0.75, 1.0), 10
TARGETS = ("rgba16", "rgba16f", "rgba8")
COLUMNS = ("scene", "what", "least", "median", "unit")
SETUP = """(() => {
  const { renderer, camera, gl } = shapeshift, { position, wxyz } = camera.pose, size = [640, 360];
  renderer.resortDegrees = 360; renderer.scene.radius *= 1000;  // one order for all frames
  const view = (k, left, shift) => ({
    worldFromEye: { wxyz, position: [position[0] + shift + 1e-3 * k, position[1], position[2]] },
    tangents: [-0.75, 0.75, -0.42, 0.42], near: 0.01, viewport: [left, 0, ...size] });
  const shade = (o) => ({ rest: o.model.colorsFollow ? x : 0, heats: [], pure: false });
  const read = (framebuffer, type, array) => {
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, type, array);
  };
  const wait = () => {
    const { means, colored, records } = renderer.arena;
    for (const framebuffer of [means, colored, records[0].framebuffer])
      read(framebuffer, gl.FLOAT, new Float32Array(4));
    read(null, gl.UNSIGNED_BYTE, new Uint8Array(4));
  };
  let k = 0, x = 0;
  globalThis.measured = {
    frame() { renderer.draw([view(++k, 0, 0)]); },
    standing() { renderer.draw([view(k, 0, 0)]); },
    eyes() { ++k; renderer.draw([view(k, 0, -0.0315), view(k, 640, 0.0315)]); },
    colors() {
      ++k;
      for (const o of renderer.objects)
        renderer.decoder.decodeColors(o, shade(o), "no heat", [k, 0, 0]);
    },
    shift() {
      x = (x + 0.13) % 1;
      for (const o of renderer.objects) { o.x = x; renderer.decoder.decodeShape(o); }
      measured.colors();
    },
    project() { renderer.projector.project(0, renderer.objects, view(++k, 0, 0), size); },
  };
  globalThis.repeat = (name, n) => { for (let i = 0; i < n; i++) { measured[name](); wait(); } };
})()"""
SORTS = """(async () => {
  const { renderer, camera } = shapeshift, found = [];
  for (let i = 0; i < 21; i++) {
    renderer.sortedFor = null;
    renderer.sort(camera.pose, 0.01);
    while (!renderer.sorter.settled) await new Promise((r) => setTimeout(r, 2));
    found.push(renderer.sorter.ms);
  }
  return found;
})()"""


def processor_ms(page, name: str) -> float:
    """Of one call of what SETUP made."""
    page.run(f"repeat('{name}', 1)")
    before = page.cpu_seconds()
    page.run(f"repeat('{name}', {RUNS})")
    return 1000 * (page.cpu_seconds() - before) / RUNS


def likeness(page, document) -> dict[str, list[float]]:
    """target -> PSNR of XS from CAMERAS cameras."""
    centre, radius = document.bounds()
    views = [document.view(SIZE), *orbit_path(CAMERAS, centre, radius, SIZE)[1:]]
    found: dict[str, list[float]] = {}
    for target in TARGETS:
        xs, cameras = (XS, views) if target == "rgba16" else (XS[:3], views[:1])
        found[target] = [
            decibels(page, document, at(document, x), view, target) for x in xs for view in cameras
        ]
    return found


def measure(scene: Path, folder: Path) -> list[tuple]:
    """Rows (what, least, median, unit)."""
    document = open_document(scene, ReadingOptions())
    path = folder / "page.html"
    size = export_page(document, path, PageSettings(scene.stem), lambda *_: None)
    rows: list[tuple] = [("page", size, size, "bytes")]
    with Chromium((1280, 720)) as page:
        page.run("1")
        before = page.cpu_seconds()
        page.open(path)
        page.until("shapeshift.renderer.settled && shapeshift.renderer.arena.sorted")
        started = page.cpu_seconds() - before
        rows.append(("first picture, 1280x720", started, started, "CPU s"))
        still(page)
        page.run(SETUP)
        names = ("frame", "eyes", "standing", "colors", "shift", "project")
        times = {name: processor_ms(page, name) for name in names}
        rows += [
            ("full shift: networks, covariances, colours", times["shift"]),
            ("colours alone", times["colors"]),
            ("project", times["project"]),
            ("frame, eye stands", times["standing"]),
            ("frame, eye moves", times["frame"]),
            ("two eyes", times["eyes"]),
        ]
        rows = [row if len(row) == 4 else (row[0], row[1], row[1], "CPU ms") for row in rows]
        ratio = times["eyes"] / times["frame"]
        sorts = page.run(SORTS)
        drawn = page.run("shapeshift.renderer.arena.sorted")
        rows += [
            ("two eyes / one", ratio, ratio, ""),
            (f"sort of {drawn:,} splats", min(sorts), float(np.median(sorts)), "wall ms"),
        ]
    with Chromium(SIZE) as page:
        page.open(path)
        still(page)
        for target, found in likeness(page, document).items():
            rows.append(
                (
                    f"PSNR, {target}, {len(found)} pictures",
                    min(found),
                    float(np.median(found)),
                    "dB",
                )
            )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    held = io.StringIO()
    command = ["python3 tools/web/measure.py", *map(str, options.scenes), "--out", str(options.out)]
    held.write(f"# {' '.join(command)}\n")
    writer = csv.writer(held, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerow(("", "script of the page", len(one_script()), len(one_script()), "bytes"))
    with tempfile.TemporaryDirectory() as folder:
        for scene in options.scenes:
            for what, least, median, unit in measure(scene, Path(folder)):
                writer.writerow((scene.stem, what, f"{least:.6g}", f"{median:.6g}", unit))
                say(f"{scene.stem} {what}: {least:.4g} {median:.4g} {unit}")
    if options.out:
        write_whole(options.out, held.getvalue().encode())


if __name__ == "__main__":
    main()
