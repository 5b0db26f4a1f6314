"""launch.py headless: the bundled demo as pictures and a frame-time table, without a window."""

import json
import sys
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

DEMO = Path(__file__).resolve().parents[1] / "assets" / "workshop.shift"
BACKGROUND = (0.075, 0.078, 0.085)  # as in the viewer, where the scene names none
QUALITY_SIZE = (192, 128)  # of the pictures that are compared with the float64 reference
TURN = 0.6  # radians between the viewpoints


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
    """Frames that are timed, mono and stereo each (after 3 that do not count)."""
    sweep: int = 30
    """Values of x that are timed from 0 to 1 (after 3 that do not count)."""


def run(options: Options) -> int:
    from app.bench import check_counts, check_result_path, measure, print_table, write_json
    from app.drawing import make_folder, open_renderer, parse_size
    from app.errors import UsageError
    from app.measure import Measure
    from app.subject import Subject
    from runtime_models.read_scene import read_model
    from scene.framing import default_background

    size = parse_size(options.size)
    check_counts(options)
    if options.scene == DEMO and not DEMO.exists():
        raise UsageError(f"the bundled demo {DEMO} is missing; `launch.py demo` makes one.")
    model = read_model(options.scene)
    result_path = options.out / "bench.json"
    make_folder(options.out)
    check_result_path(result_path)
    with open_renderer("auto", "auto") as (renderer, ctx):
        background = default_background(model, BACKGROUND)
        renderer.settings = replace(renderer.settings, background=background)
        draw_sheet(renderer, model, size, options.out)
        work = Measure(renderer, ctx, Subject.of(model), None, size)
        result = measure(work, options, QUALITY_SIZE)
    print_table(result)
    write_json(result_path, result)
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

    from app.drawing import save_png
    from scene.scene import Scene, SceneObject

    stops = sorted({stop.x for stop in model.stops})
    controls = sorted(stops + [(a + b) / 2 for a, b in pairwise(stops)])
    views = viewpoints(model, size)
    names = [[f"view{v}_x{x:.3f}.png" for x in controls] for v in range(len(views))]
    check_ours([out / name for row in names for name in row] + [out / "sheet.png"])
    rows = [[None] * len(controls) for _ in views]
    for column, x in enumerate(controls):  # geometry is decoded once a column
        renderer.update(Scene((SceneObject("scene", model, x=x),)))
        for row, view in enumerate(views):
            renderer.draw([view])
            rows[row][column] = renderer.resolved(0)
            save_png(rows[row][column], out / names[row][column])
    save_png(np.concatenate([np.concatenate(row, axis=1) for row in rows]), out / "sheet.png")


def check_ours(paths: list[Path]) -> None:
    """Pictures of an earlier run are replaced, anybody else's files are not."""
    from app.drawing import is_our_png
    from app.errors import UsageError

    for path in paths:
        if path.exists() and not (path.is_file() and is_our_png(path)):
            raise UsageError(f"{path} was not made by this program; choose another --out.")


def viewpoints(model, size: tuple[int, int]) -> list:
    """The first look at a model, and from TURN to the left and right of it."""
    import numpy as np

    from scene.framing import default_view, frame_points, model_points
    from scene.pose import Pose

    first = default_view(model, size)
    centre, _ = frame_points(*model_points(model))
    views = [first]
    for angle in (TURN, -TURN):
        about_y = np.array([np.cos(angle / 2), 0, np.sin(angle / 2), 0])
        turn = Pose(np.zeros(3), about_y).matrix()
        turn[:3, 3] = centre - turn[:3, :3] @ centre
        pose = Pose.from_matrix(turn @ first.world_from_eye.matrix())
        views.append(replace(first, world_from_eye=pose))
    return views
