"""Cases of what splats are: needles and pancakes, numbers at their limits, one, none."""

import numpy as np

from shapeshift.app.stability_cases.case_context import CaseContext, difference
from shapeshift.app.stability_cases.finding import (
    ComparedPicture,
    Panel,
    Result,
    at_least,
    at_most,
    clean,
    decibels,
    worst_of,
)
from shapeshift.app.stability_cases.places import ORACLE_DB, SMALL, compared
from shapeshift.app.stability_cases.scenes import alone, faint_layers, front, shell, splats, turns
from shapeshift.scene.scene import Scene, SceneObject

LONG = 1e4  # times as long as thick
FLOATS_AT_LIMITS = (
    1 / 255, np.nextafter(np.float32(1 / 255), np.float32(0)),
    np.nextafter(np.float32(1 / 255), np.float32(1)), 0.99,
    np.nextafter(np.float32(0.99), np.float32(1)), 1.0, 1e-38, 1e-45,
)  # fmt: skip
LARGEST_HALF = 65504.0  # what packHalf2x16 and rgba16f hold
STACKED = 400
FAINT = 100_000


def needles(case: CaseContext) -> Result:
    """Splats 10,000 times as long as thick, and as wide as flat, turned every way."""
    rng = np.random.default_rng(2)
    count = 120
    means = rng.normal(size=(count, 3)) * 0.5
    long = rng.uniform(0.1, 0.5, (count, 1))  # metres
    shapes = {"needles": (1, 1 / LONG, 1 / LONG), "pancakes": (1, 1, 1 / LONG)}
    findings, comparisons = [], []
    view = front(SMALL)
    for name, shape in shapes.items():
        model = splats(means, long * shape, 0.7, rng.uniform(size=(count, 3)), turns(count, rng))
        image = case.draw(alone(model), view)
        want = case.reference(alone(model), view)
        db = decibels(image, want)
        findings.append(
            at_least(
                f"{name} 1:{LONG:g} against float64, dB", db, 50,
                "float32 rounds a covariance by 1e-7 of its longest axis squared: under 0.01 px^2 "
                "here, beside the 0.3 px^2 that every splat has",
            )
        )  # fmt: skip
        comparisons.append(ComparedPicture(db, name, image, want))
    _, name, image, want = worst_of(comparisons)
    panels = compared(case, name, image, "float64", want)
    return Result([clean(*(c.image for c in comparisons)), *findings], panels)


def faint(case: CaseContext) -> Result:
    """100,000 faint splats over each other: what each step of the picture's numbers adds up to."""
    layers = faint_layers(FAINT, SMALL, 2 / 255, 3.0)
    image = case.draw(layers.scene, layers.view)
    dark = abs(float(np.mean(image - layers.picture)))
    findings = [
        clean(image),
        at_least(
            f"{FAINT:,} splats of opacity 2/255 against their formula, dB",
            decibels(image, layers.picture), 75,
            "16 bits from 0 to the brightest colour round by 1/131070 a layer: 84 dB; half floats "
            "by 1/4096 near 1: 36 dB",
        ),
        at_most(
            "brightness that is lost or added, in the mean", dark, 5e-4,
            "an eighth of a grey step; half floats lose 0.015",
        ),
    ]  # fmt: skip
    return Result(findings, compared(case, "drawn", image, "the formula", layers.picture))


def limits(case: CaseContext) -> Result:
    """Scales, opacities and colours at and beyond what half floats and 8 bits hold."""
    view = front(SMALL)
    behind = ([0.4, 0, -0.5], [0.2] * 3)  # a plain splat that must stay as it is
    comparisons = []
    focal = SMALL[1] / (2 * np.tan(0.4))  # pixels
    at_half = LARGEST_HALF * 3 / focal  # metres, 3 m off: one sigma of 65504 pixels
    sizes = [s * at_half for s in (0.9, 0.916, 1.0, 1.0001, 100, 1e10)] + [1e18, 1e30, 3e38]
    rows = [("scale", s, 0.5, (1.0, 0.5, 0.2)) for s in sizes]
    rows += [("opacity", 0.1, o, (1.0, 0.5, 0.2)) for o in FLOATS_AT_LIMITS]
    rows += [("colour", 0.1, 0.5, (c, 0.5, 0.2)) for c in (60000.0, LARGEST_HALF, 1e5, 9e37)]
    for what, scale, opacity, color in rows:
        model = splats(
            [[0, 0, 0], behind[0]], [[scale] * 3, behind[1]], [opacity, 0.8], [color, (0.2, 0.4, 1)]
        )
        alone_there = splats([behind[0]], [behind[1]], 0.8, (0.2, 0.4, 1))
        image = case.draw(alone(model), view)
        # Drawn as float64 draws it, or left out: nothing in between.
        wants = [case.reference(alone(m), view) for m in (model, alone_there)]
        scale_of = [max(1.0, float(np.abs(w).max())) for w in wants]
        db = max(decibels(image / s, w / s) for w, s in zip(wants, scale_of, strict=True))
        value = {"scale": scale, "opacity": opacity, "colour": color[0]}[what]
        comparisons.append(ComparedPicture(db, f"{what} {value:.6g}", image, wants[0]))
    worst = worst_of(comparisons)
    right_or_absent = at_least(
        f"worst of {len(rows)} ({worst.what}), dB to float64 with or without it", worst.db,
        ORACLE_DB, "a number past a limit is drawn right or not at all (16 bits: 78)",
    )  # fmt: skip
    rng = np.random.default_rng(4)
    wall = splats(rng.normal(size=(STACKED, 3)) * 0.02, 0.5, 1.0, rng.uniform(size=(STACKED, 3)))
    stack = case.draw(alone(wall), view)
    covered = at_most(
        f"coverage under {STACKED} opaque splats", stack[..., 3].max(), 1.002,
        "0.99 of what is left each time never passes 1; two steps of a half float below 1",
    )  # fmt: skip
    panels = [
        *compared(case, worst.what, worst.image, "float64", np.clip(worst.wanted, 0, 1)),
        case.panel(f"{STACKED} opaque splats", stack),
    ]
    images = [comparison.image for comparison in comparisons]
    return Result([clean(*images, stack), right_or_absent, covered], panels)


def counts(case: CaseContext) -> Result:
    """Zero objects, zero splats, all culled, one splat, and then the scene as if nothing was."""
    scene, view = case.scene(), case.view()
    before = case.draw(scene, view)
    one = splats([[0, 0, 0]], 0.1)
    hidden = SceneObject("hidden", one, visible=False)
    nothing = {
        "no objects": Scene(()),
        "zero splats": alone(splats(np.zeros((0, 3)), 0.1)),
        "all behind the eye": alone(splats([[0, 0, 9.0]] * 3, 0.1)),
        "all absent (opacity 0 and below)": alone(splats([[0, 0, 0]] * 2, 0.1, [0.0, -1.0])),
        "hidden": Scene((hidden,)),
    }
    images, covered = [], {}
    for what, empty in nothing.items():
        image = case.draw(empty, front(case.size))
        images.append(image)
        covered[what] = float(np.abs(image).max())
    worst = max(covered, key=lambda what: covered[what])
    single = case.draw(alone(one), front(SMALL))
    db = decibels(single, case.reference(alone(one), front(SMALL)))
    culled = case.draw(scene, view, max_distance=1e-6)
    after = case.draw(scene, view)
    left_out = "a frame with nothing in it is nothing, to the last bit"
    findings = [
        clean(*images, single, culled, after),
        at_most(f"largest pixel of nothing ({worst})", covered[worst], 0, left_out),
        at_most("largest pixel of a scene culled whole", np.abs(culled).max(), 0, left_out),
        at_least("one splat against float64, dB", db, ORACLE_DB, "16 bits leave 78 dB and more"),
        at_most(
            "largest change of the scene after all this", np.abs(after - before).max(), 1e-6,
            "a frame depends on what is in it, not on what was drawn before",
        ),
    ]  # fmt: skip
    panels = [
        case.panel("the scene after the empty frames", after),
        case.panel("before them", before),
        Panel("8 times the difference", difference(after, before)),
        case.panel("one splat", single),
    ]
    return Result(findings, panels)


def crowd(case: CaseContext) -> Result:
    """The same ball twice in one place: equal depths must not make the picture depend on luck."""
    ball = shell()
    both = Scene((SceneObject("a", ball), SceneObject("b", ball)))
    images = [case.draw(both, front(SMALL)) for _ in range(3)]
    change = max(float(np.abs(image - images[0]).max()) for image in images[1:])
    db = decibels(images[0], case.reference(both, front(SMALL)))
    findings = [
        clean(*images),
        at_most("largest change between three draws of it", change, 0, "orders are stable"),
        at_least("against float64, dB", db, ORACLE_DB, "16 bits leave 78 dB and more"),
    ]
    return Result(findings, [case.panel("two balls in one place", images[0])])
