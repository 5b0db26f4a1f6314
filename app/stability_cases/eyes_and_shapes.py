"""Cases of two eyes, and of what splats are: needles and pancakes, numbers at their limits."""

from dataclasses import replace

import numpy as np

from shapeshift.app.stability_cases.case_context import (
    CaseContext,
    CaseFinding,
    ComparedPicture,
    Panel,
    Result,
    at_least,
    at_most,
    clean,
    decibels,
    difference,
    turned,
    turned_about,
    worst_of,
)
from shapeshift.app.stability_cases.places import ORACLE_DB, SMALL, compared
from shapeshift.app.stability_cases.scenes import (
    alone,
    faint_layers,
    front,
    glossy,
    shell,
    splats,
    turns,
)
from shapeshift.renderer.colors import color_cache
from shapeshift.scene.cameras.framing import distances_from
from shapeshift.scene.pose import PUPILS_M, View, eyes_apart, stereo_pair
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


# Cases of two eyes: where a point must lie in each, and orders shared between them.

DEPTHS = (0.5, 1.0, 3.0, 10.0, 100.0)  # metres
CANTED = (2.0, 5.0, 10.0)  # degrees between the eyes: each then wants an order of its own
NEARLY_PARALLEL = 0.5  # degrees: one order for both by rule (up to 1 degree)
SAME_DB = 90  # of pictures from the same orders: only what is drawn in another sequence differs
SHARED_DB = 75  # and where equal depths round differently
AUTO_DB = color_cache.SHARED_DB  # below that colours are never shared
SAME_EYE_DB = 75  # of an eye in a pair and alone: other rounding, 16 bits on the way
SAME_EYE = "an eye in a pair sees what it sees alone"
AUTO_REASON = (
    "colours are shared where the eyes are so near each other for the scene that they differ by "
    "less (8 bits alone cost 58.9), else each eye has its own"
)
YAW_DB = 46  # a quarter degree off costs splats of random colours 54 (case stale-yaw), 0.5 each 48


def disparity(case: CaseContext) -> Result:
    """Two eyes see a splat where a pinhole puts it, off-centre lenses too, and in this order."""
    size = case.size
    straight = front(size, 0.0)
    left_view, right_view = stereo_pair(straight, PUPILS_M)
    left, right, down, up = straight.tangents
    views = [
        replace(left_view, tangents=(1.3 * left, 0.8 * right, 1.1 * down, 0.9 * up)),
        replace(right_view, tangents=(0.8 * left, 1.3 * right, 1.1 * down, 0.9 * up)),
    ]
    findings, drawn = [], []
    for depth in DEPTHS:
        place = np.array([0.05 * depth, 0.03 * depth, -depth])  # metres
        pixel = (right - left) / size[0] * depth  # metres at that depth
        scene = alone(splats(place, 2.5 * pixel))
        images = case.draw_all(scene, views)
        found = [centroid(image) for image in images]
        wanted = [pinhole_pixel(view, place) for view in views]
        off = max(float(np.abs(a - b).max()) for a, b in zip(found, wanted, strict=True))
        findings.append(
            at_most(
                f"at {depth:g} m, pixels beside the pinhole's place", off, 0.05,
                "a splat is symmetric about its centre; cut at 1/255 on whole pixels moves it by "
                "less than a twentieth of one",
            )
        )  # fmt: skip
        drawn += images
    shifted = [centroid(image)[0] for image in drawn[:2]]
    straight_pair = case.draw_all(scene_of_disparity(), stereo_pair(straight, PUPILS_M))
    across = centroid(straight_pair[0])[0] - centroid(straight_pair[1])[0]
    fx = size[0] / (right - left)
    findings.append(
        at_most(
            "parallel eyes at 1 m, pixels off b f / z", abs(across - PUPILS_M * fx), 0.1,
            "the disparity of equal lenses, twice the error of a place; swapped eyes fail",
        )
    )  # fmt: skip
    panels = [
        case.panel(f"left eye, splat at {shifted[0]:.1f} px", drawn[0]),
        case.panel(f"right eye, splat at {shifted[1]:.1f} px", drawn[1]),
    ]
    return Result([clean(*drawn, *straight_pair), *findings, *shared(case)], panels)


def scene_of_disparity():
    """One splat of a centimetre, a metre ahead of the eyes."""
    return alone(splats((0, 0, -1.0), 0.01))


def shared(case: CaseContext) -> list:
    """The user's scene by parallel eyes: one order for both against an order each."""
    scene, pair = case.scene(), eyes_of(case)
    one = case.draw_all(scene, pair, stereo_sort="shared")
    each = case.draw_all(scene, pair, stereo_sort="each")
    db = min(decibels(a, b) for a, b in zip(one, each, strict=True))
    return [
        clean(*one, *each),
        at_least(
            "parallel eyes, one order against one each, dB", db, SHARED_DB,
            "depth along parallel axes is the same for both eyes: only its rounding differs",
        ),
    ]  # fmt: skip


def canted(case: CaseContext) -> Result:
    """Eyes turned outwards by 2, 5 and 10 degrees, against an order for each eye."""
    scene = case.scene()
    findings, images, comparisons = [], [], []
    for degrees in (NEARLY_PARALLEL, *CANTED):
        left, right = eyes_of(case)
        pair = [turned(left, degrees / 2), turned(right, -degrees / 2)]
        one = case.draw_all(scene, pair, stereo_sort="shared")
        sorts = case.stats.sorts
        each = case.draw_all(scene, pair, stereo_sort="each")
        images += [*one, *each]
        db = min(decibels(a, b) for a, b in zip(one, each, strict=True))
        if degrees in CANTED:
            findings += [
                at_least(f"{degrees:g} degrees, orders of one frame", sorts, 2,
                         "axes more than 1 degree apart: no order is right for both"),
                at_least(f"{degrees:g} degrees, against an order each, dB", db, SAME_DB,
                         "the same two orders"),
            ]  # fmt: skip
        else:
            findings.append(
                at_least(f"{degrees:g} degrees, against an order each, dB", db, YAW_DB,
                         "one order by rule, a quarter of a degree off for each eye (stale-yaw)")
            )  # fmt: skip
        what = f"left eye, {degrees:g} degrees between the eyes"
        comparisons.append(ComparedPicture(db, what, one[0], each[0]))
    _, what, shared, own = worst_of(comparisons)
    panels = [
        case.panel(what, shared),
        case.panel("with an order of its own", own),
        Panel("8 times the difference", difference(shared, own)),
    ]
    return Result([clean(*images), *findings], panels)


def stereo(case: CaseContext) -> Result:
    """Each eye of a stereo frame against that eye drawn alone; lenses that lean, heads askew."""
    findings, images, comparisons = [], [], []
    near, reach = stereo_pair(front(case.size, 1.5), PUPILS_M), f"half a metre away, {SAME_EYE}"
    for what, scene, pair, wish, least, reason in (
        ("the scene", case.scene(), eyes_of(case), "auto", AUTO_DB, AUTO_REASON),
        ("the scene, colours each", case.scene(), eyes_of(case), "each", SAME_EYE_DB, SAME_EYE),
        ("a glossy ball", alone(glossy()), near, "auto", SAME_EYE_DB, reach),
    ):  # fmt: skip
        frame = case.draw_all(scene, pair, stereo_colors=wish)
        single = [case.draw(scene, eye) for eye in pair]
        images += [*frame, *single]
        db, eye = min(
            (decibels(a, b), i) for i, (a, b) in enumerate(zip(frame, single, strict=True))
        )
        findings.append(at_least(f"{what}, an eye against it alone, dB", db, least, reason))
        comparisons.append(ComparedPicture(db, what, frame[eye], single[eye]))
    leaning, drawn = lean(case)
    _, what, together, itself = worst_of(comparisons)
    panels = [
        case.panel(f"{what}, one of two eyes", together),
        case.panel("the same eye alone", itself),
        Panel("8 times the difference", difference(together, itself)),
    ]
    return Result([clean(*images, *drawn), *findings, leaning], panels)


def lean(case: CaseContext) -> tuple[CaseFinding, list[np.ndarray]]:
    """Eyes of a headset on a head askew, against one centred picture that holds what each sees."""
    width, height = case.size
    scene, narrow = alone(glossy()), max(width // 4, 1)
    straight = turned_about(front(case.size, 1.5), np.zeros(3), 20.0, (0, 0, 1))
    wholes = stereo_pair(straight, PUPILS_M)
    lenses = [eye.part(x, height // 5, (width - narrow, height - height // 5))
              for eye, x in zip(wholes, (0, narrow), strict=True)]  # fmt: skip
    pair = [replace(lens, whole=None) for lens in lenses]
    frame = case.draw_all(scene, pair)
    dbs = []
    for image, whole, x in zip(frame, wholes, (0, narrow), strict=True):
        there = case.draw(scene, whole)[height // 5 :, x : x + width - narrow]
        dbs.append(decibels(image, there))
    what = "lenses off centre on a head askew, an eye against the centred picture around it, dB"
    return at_least(what, min(dbs), SAME_EYE_DB, f"an off-centre lens is a part; {SAME_EYE}"), frame


def eyes_of(case: CaseContext) -> list[View]:
    """Two parallel eyes on the scene, as far apart as a person's are who stands 1.8 m before it."""
    view = case.view()
    return stereo_pair(view, eyes_apart(distances_from(case.subject.points(), view)))


def centroid(image: np.ndarray) -> np.ndarray:
    """(2,) pixels x, y of the middle of what covers an image, row 0 on top."""
    alpha = np.asarray(image[..., 3], np.float64)
    y, x = np.indices(alpha.shape)
    total = alpha.sum()
    if not total > 0:
        return np.full(2, np.nan)
    return np.array([(alpha * (x + 0.5)).sum(), (alpha * (y + 0.5)).sum()]) / total


def pinhole_pixel(view: View, place: np.ndarray) -> np.ndarray:
    """(2,) pixels where a pinhole shows a point (3,) of the world."""
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    x, y, z = camera_from_world[:3, :3] @ place + camera_from_world[:3, 3]
    return np.array([fx * x / z + cx, fy * y / z + cy])


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
