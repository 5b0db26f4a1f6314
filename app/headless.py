"""launch.py headless: the bundled demo as pictures and a frame-time table, without a window."""

import json
import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

DEMO = Path(__file__).resolve().parents[1] / "assets" / "workshop.shift"
BACKGROUND = (0.075, 0.078, 0.085)  # as in the viewer, where the scene names none


@dataclass(frozen=True)
class Options:
    """Draw a scene at its stops and between them, and time it."""

    scene: Path = DEMO
    """What to draw; the bundled demo unless given."""
    out: Path = Path("out/demo")
    """Folder for the pictures and bench.json; those of an earlier run are replaced."""
    size: str = "480x320"
    """WIDTHxHEIGHT of one picture."""
    frames: int = 30
    """Frames that are timed."""


def run(options: Options) -> int:
    from dataclasses import replace

    from app.bench import command_line, print_table, write_json
    from app.headless_drawing import make_folder, open_renderer, parse_size
    from app.measure import Measure
    from runtime_models.read_scene import read_model
    from scene.framing import default_background

    size = parse_size(options.size)
    model = read_model(options.scene)
    make_folder(options.out)
    with open_renderer("auto", "auto") as (renderer, ctx):
        background = default_background(model, BACKGROUND)
        renderer.settings = replace(renderer.settings, background=background)
        draw_sheet(renderer, model, size, options.out)
        result = Measure(renderer, ctx, model, model.stops[0].x, size).all(
            options.frames, 20, (192, 128)
        )
    result |= {"command": command_line(), "scene": options.scene.name}
    print_table(result)
    write_json(options.out / "bench.json", result)
    print(
        f"Pictures (sheet.png shows all) and bench.json are in {options.out.resolve()}",
        file=sys.stderr,
    )
    print(json.dumps({"out": str(options.out), "frame_ms": result["frame_ms"],
                      "psnr_db": result["psnr_db"]}))  # fmt: skip
    return 0


def draw_sheet(renderer, model, size: tuple[int, int], out: Path) -> None:
    """A row a viewpoint; columns are the stops and the middles between them."""
    import numpy as np

    from app.headless_drawing import save_png
    from scene.framing import default_view, frame_points, model_points, orbit_path
    from scene.scene import Scene, SceneObject

    stops = [stop.x for stop in model.stops]
    middles = [(a + b) / 2 for a, b in pairwise(stops)]
    controls = sorted(stops + middles)
    centre, radius = frame_points(*model_points(model))
    views = [default_view(model, size), orbit_path(3, centre, radius, size)[1]]
    rows = []
    for v, view in enumerate(views):
        row = []
        for x in controls:
            renderer.update(Scene((SceneObject("scene", model, x=x),)))
            renderer.draw([view])
            row.append(renderer.resolved(0))
            save_png(row[-1], out / f"view{v}_x{x:.2f}.png")
        rows.append(np.concatenate(row, axis=1))
    save_png(np.concatenate(rows, axis=0), out / "sheet.png")
