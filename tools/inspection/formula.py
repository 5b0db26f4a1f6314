"""How far a stop by formula, as its splats show it, is from the formula of its stops' pictures.

    python3 tools/inspection/formula.py SCENE... [--views 8]

Writes a line a scene and stop: mean, median and 95th percentile of the difference in the stop's
unit, PSNR over its range of the worst view and in the mean, and the share of pixels that only one
of the two knows.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

import numpy as np  # noqa: E402

from shapeshift.app.document import Document  # noqa: E402
from shapeshift.app.drawing import open_renderer  # noqa: E402
from shapeshift.app.inspection.draw_values import (  # noqa: E402
    ValueChoice,
    draw_values,
    measured_scene,
)
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.training.styles.train_stop import dome_views  # noqa: E402

SIZE = (320, 240)


def difference(path: Path, views: int) -> list[str]:
    model, lines = read_model(path), []
    assert isinstance(model, AnchorModel)
    document = Document.of(model)
    with open_renderer("none", "tiles") as (renderer, _):
        for stop in model.stops:
            if not stop.formula:
                continue
            measured = measured_scene(document, ValueChoice(stop.name))
            assert stop.value_range is not None
            low, high = stop.value_range
            errors, decibels, alone = [], [], []
            for view in dome_views(model, views, SIZE):
                exact = draw_values(renderer, measured, view)
                shown = draw_values(renderer, replace(measured, parts=()), view)
                both = exact.known & shown.known
                error = (np.clip(exact.values, low, high) - shown.values)[both]
                errors.append(np.abs(error))
                decibels.append(-10 * np.log10(np.mean((error / (high - low)) ** 2)))
                alone.append((exact.known != shown.known).mean())
            every = np.concatenate(errors)
            lines.append(
                f"{path.name}, {stop.name} = {stop.formula}, {low:g} to {high:g}: mean "
                f"{every.mean():.4f}, median {np.median(every):.4f}, 95 of 100 within "
                f"{np.percentile(every, 95):.4f}; {min(decibels):.1f} dB in the worst view, "
                f"{np.mean(decibels):.1f} in the mean; {100 * np.mean(alone):.2f} % known to one"
            )
    return lines


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="+", type=Path)
    parser.add_argument("--views", type=int, default=8)
    options = parser.parse_args()
    for path in options.scenes:
        print("\n".join(difference(path, options.views)))  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
