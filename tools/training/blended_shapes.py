"""What a viewer draws between two stops, by the share of steps with blended shapes.

    python3 tools/training/schedule.py CAPTURE ... --iterations 1200 --out FILE

CAPTURE is as of growth.py.  A way is a share of TrainSettings.blended_shapes.  A row whose `where`
is a stop has the mean PSNR over its held-out photos, `mean` that of the stops; a row "A to B" has
the PSNR of the pictures at nine places between two stops against the cross-fade of the pictures at
both, as the viewer draws them: the mean over places and views, and the worst of all.
"""

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from ways import Turn, asked, measure_ways, parser_of, settings_of  # noqa: E402

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.scene.metrics import psnr  # noqa: E402
from shapeshift.scene.pose import View  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

WAYS = {f"{share:g}": {"blended_shapes": share} for share in (0.0, 0.25, 0.5)}
COLUMNS = ("capture", "way", "seed", "steps", "seconds", "where", "psnr_db", "worst_db")
PLACES = np.linspace(0, 1, 11)[1:-1]  # of the way between two stops


def main() -> None:
    parser = parser_of(__doc__, WAYS)
    parser.add_argument("--views", type=int, default=3, help="to look from")
    options = asked(parser)

    def rows_of(turn: Turn) -> list[dict]:
        trainer = Trainer(open_device(), turn.capture, turn.settings, loaded=turn.photos)
        for _ in trainer.steps():
            pass
        shared = {"steps": trainer.iteration, "seconds": f"{trainer.elapsed:.1f}"}
        return [turn.about | shared | row for row in measured(trainer, options.views)]

    measure_ways(options, COLUMNS, settings_of(options), WAYS, rows_of)


def measured(trainer: Trainer, views: int) -> list[dict]:
    """The rows of a run."""
    at_stops = trainer.held_out_psnr(most=len(trainer.held_out))
    at_stops["mean"] = float(np.mean(list(at_stops.values())))
    rows = [{"where": name, "psnr_db": f"{db:.2f}"} for name, db in at_stops.items()]
    seen = [photo.view for photo in trainer.held_out][:views]
    stops, model = sorted(trainer.stops, key=lambda stop: stop.x), trainer.model()
    with Renderer(None) as renderer:

        def picture(x: float, view: View) -> np.ndarray:
            renderer.update(Scene((SceneObject("it", model, x=x),)))
            renderer.draw([view])
            return renderer.resolved().copy()

        for low, high in pairwise(stops):
            found = []
            for view in seen:
                first, last = picture(low.x, view), picture(high.x, view)
                for share in PLACES:
                    there = picture(low.x + share * (high.x - low.x), view)
                    found.append(psnr(there, (1 - share) * first + share * last))
            likeness = {"psnr_db": f"{np.mean(found):.2f}", "worst_db": f"{min(found):.2f}"}
            rows.append({"where": f"{low.name} to {high.name}"} | likeness)
    return rows


if __name__ == "__main__":
    main()
