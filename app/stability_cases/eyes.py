"""Cases of two eyes: where a point must lie in each, and orders shared between them."""

from dataclasses import replace

import numpy as np

from shapeshift.app.stability_cases.case_context import (
    CaseContext,
    difference,
    turned,
    turned_about,
)
from shapeshift.app.stability_cases.finding import (
    CaseFinding,
    ComparedPicture,
    Panel,
    Result,
    at_least,
    at_most,
    clean,
    decibels,
    worst_of,
)
from shapeshift.app.stability_cases.scenes import alone, front, glossy, splats
from shapeshift.renderer.colors import color_cache
from shapeshift.scene.cameras.framing import distances_from
from shapeshift.scene.pose import PUPILS_M, View, eyes_apart, stereo_pair

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
