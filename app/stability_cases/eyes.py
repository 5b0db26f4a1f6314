"""Cases of two eyes: where a point must lie in each, and orders shared between them."""

from dataclasses import replace

import numpy as np

from app.stability_cases.finding import (
    Panel,
    Result,
    at_least,
    at_most,
    clean,
    decibels,
)
from app.stability_cases.scenes import alone, front, splats
from app.stability_cases.stage import Stage, difference, turned
from scene.pose import View
from scene.stereo import stereo_pair

APART = 0.064  # metres between the eyes of a person
DEPTHS = (0.5, 1.0, 3.0, 10.0, 100.0)  # metres
CANTED = (2.0, 5.0, 10.0)  # degrees between the eyes: each then wants an order of its own
NEARLY_PARALLEL = 0.5  # degrees: one order for both by rule (up to 1 degree)
SAME_DB = 90  # of pictures from the same orders: only what is drawn in another sequence differs
SHARED_DB = 60  # and where equal depths round differently: half floats alone cost 59.5 to 80
YAW_DB = 46  # a quarter degree off costs splats of random colours 54 (case stale-yaw), 0.5 each 48


def disparity(stage: Stage) -> Result:
    """Two eyes see a splat where a pinhole puts it, off-centre lenses too, and in this order."""
    size = stage.size
    straight = front(size, 0.0)
    left_view, right_view = stereo_pair(straight, APART)
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
        images = stage.draw_all(scene, views)
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
    straight_pair = stage.draw_all(scene_of_disparity(), stereo_pair(straight, APART))
    across = centroid(straight_pair[0])[0] - centroid(straight_pair[1])[0]
    fx = size[0] / (right - left)
    findings.append(
        at_most(
            "parallel eyes at 1 m, pixels off b f / z", abs(across - APART * fx), 0.1,
            "the disparity of equal lenses, twice the error of a place; swapped eyes fail",
        )
    )  # fmt: skip
    panels = [
        stage.panel(f"left eye, splat at {shifted[0]:.1f} px", drawn[0]),
        stage.panel(f"right eye, splat at {shifted[1]:.1f} px", drawn[1]),
    ]
    return Result([clean(*drawn, *straight_pair), *findings, *shared(stage)], panels)


def scene_of_disparity():
    """One splat of a centimetre, a metre ahead of the eyes."""
    return alone(splats((0, 0, -1.0), 0.01))


def shared(stage: Stage) -> list:
    """The user's scene by parallel eyes: one order for both against an order each."""
    scene, pair = stage.scene(), eyes_of(stage)
    one = stage.draw_all(scene, pair, stereo_sort="shared")
    each = stage.draw_all(scene, pair, stereo_sort="each")
    db = min(decibels(a, b) for a, b in zip(one, each, strict=True))
    return [
        clean(*one, *each),
        at_least(
            "parallel eyes, one order against one each, dB", db, SHARED_DB,
            "depth along parallel axes is the same for both eyes: only its rounding differs",
        ),
    ]  # fmt: skip


def canted(stage: Stage) -> Result:
    """Eyes turned outwards by 2, 5 and 10 degrees, against an order for each eye."""
    scene = stage.scene()
    findings, images, worst = [], [], None
    for degrees in (NEARLY_PARALLEL, *CANTED):
        left, right = eyes_of(stage)
        pair = [turned(left, degrees / 2), turned(right, -degrees / 2)]
        one = stage.draw_all(scene, pair, stereo_sort="shared")
        sorts = stage.stats.sorts
        each = stage.draw_all(scene, pair, stereo_sort="each")
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
        if worst is None or db < worst[0]:
            worst = (db, degrees, one[0], each[0])
    _, degrees, one, own = worst
    panels = [
        stage.panel(f"left eye, {degrees:g} degrees between the eyes", one),
        stage.panel("with an order of its own", own),
        Panel("8 times the difference", difference(one, own)),
    ]
    return Result([clean(*images), *findings], panels)


def eyes_of(stage: Stage) -> list[View]:
    """Two parallel eyes on the scene, as far apart as a person's are for its size."""
    _, radius = stage.bounds()
    return stereo_pair(stage.view(), APART * radius / 2)


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
