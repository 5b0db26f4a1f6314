"""Cases of where the eye is: far from the origin, over all depths, within objects, any lens."""

from dataclasses import replace

import numpy as np

from shapeshift.app.stability_cases.case_context import (
    CaseContext,
    ComparedPicture,
    Panel,
    Result,
    at_least,
    at_most,
    broken_pixels,
    clean,
    decibels,
    difference,
    moved,
    turned,
    turned_about,
    worst_of,
)
from shapeshift.app.stability_cases.scenes import alone, around, front, shell, splats, turns
from shapeshift.scene.pose import Pose, View, look_at, perspective
from shapeshift.scene.scene import IDENTITY

FAR_OFF = np.array([5e6, -5e6, 5e6])  # metres: geocentric coordinates are that large
NEAREST, FARTHEST = 1e-2, 1e6  # metres
WALLS = 33  # from NEAREST to FARTHEST, four a decade
ORACLE_DB = 70  # 16 bits from 0 to the brightest colour, blended back to front, leave 78 and more
PART_DB = 80  # two draws of the same splats
PART_REASON = "else float32's rounding of places alone: 90 dB and more"
SMALL = (160, 96)  # pixels: what the float64 oracle draws in a second
FILL = 12.0  # times the frame from outside
CLOSE_UPS = 6


def far_origin(case: CaseContext) -> Result:
    """The scene and its view 5,000 km from the origin look as they do at it."""
    view = case.view()
    there = Pose(FAR_OFF, IDENTITY.wxyz)
    here = case.draw(case.scene(), view)
    far = case.draw(case.scene(pose=there), moved(view, FAR_OFF))
    findings = [
        clean(here, far),
        at_least(
            "5e6 m off against the origin, dB", decibels(far, here), 70,
            "float64 keeps 1e-9 m of 5e6: a thousandth of a pixel at most, and a few orders of "
            "equal depths; float32 would keep half a metre",
        ),
    ]  # fmt: skip
    return Result(findings, compared(case, "5e6 m off", far, "at the origin", here))


def depth_range(case: CaseContext) -> Result:
    """Walls at 1 cm to 1000 km, far ones listed first or last, each before the next."""
    size = case.size
    depths = np.geomspace(NEAREST, FARTHEST, WALLS)
    rng = np.random.default_rng(1)
    shuffled = rng.permutation(WALLS)
    # Each wall leaves the upper right a little freer, so that all of them are seen.
    shift = np.linspace(-0.25, 0.25, WALLS)
    means = np.stack([shift * depths, shift * depths * 0.4, -depths], axis=1)[shuffled]
    sizes = (0.06 * depths[:, None] * np.array([1, 1, 0.01]))[shuffled]
    scene = alone(splats(means, sizes, 0.9, rng.uniform(size=(WALLS, 3))))
    view = replace(front(size, 0.0, near=NEAREST / 2), far=2 * FARTHEST)
    image = case.draw(scene, view)
    want = case.reference(scene, view)
    coarse = case.draw(scene, view, key_bits=16)
    reason = "keys are the bits of the float depth: seven digits at any distance"
    tight = "linear steps of 15 m between 1 cm and 1000 km: one price that is named, not a fault"
    findings = [
        clean(image, coarse),
        at_least("32-bit keys against float64, dB", decibels(image, want), ORACLE_DB, reason),
        at_least("16-bit keys against float64, dB", decibels(coarse, want), 5, tight),
    ]
    return Result(findings, compared(case, "32-bit keys", image, "16-bit keys", coarse))


def inside(case: CaseContext) -> Result:
    """The eye within a splat, on the near plane of one, in the scene's middle, at its surface."""
    findings, pair = within_a_splat(case)
    outside_ms = case.cpu_ms(case.scene(), case.view())
    looks = [*from_the_middle(case), *from_close_up(case)]
    images = [case.draw(case.scene(), look) for look in looks]
    times = [case.cpu_ms(case.scene(), look, 2) for look in looks]
    slowest = int(np.argmax(times))
    findings += [
        clean(*images),
        at_most(
            f"slowest of {len(looks)} looks from inside, times the frame from outside",
            times[slowest] / max(outside_ms, 1.0), FILL,
            "the picture from outside is covered to a tenth or more; full cover alone is ten "
            "times that, and an early stop must save the rest (process time, least of 2)",
        ),
    ]  # fmt: skip
    panels = [
        case.panel(f"slowest look: {times[slowest]:.0f} ms of the CPU", images[slowest]),
        case.panel(f"from outside: {outside_ms:.0f} ms", case.draw(case.scene(), case.view())),
        *pair,
    ]
    return Result(findings, panels)


def from_the_middle(case: CaseContext) -> list[View]:
    """Six ways to look from the centre of the scene."""
    centre, radius = case.bounds()
    forward = View(
        Pose(centre, IDENTITY.wxyz), case.view().tangents, 1e-3 * radius, 400 * radius, case.size
    )
    across = [turned(forward, angle) for angle in (0, 90, 180, 270)]
    return across + [turned_about(forward, centre, angle, (1, 0, 0)) for angle in (89, -89)]


def from_close_up(case: CaseContext) -> list[View]:
    """Eyes a hundredth of the radius before splats of the scene, looking at them: the fullest."""
    centre, radius = case.bounds()
    means, opacity = case.subject.points()
    seen = np.flatnonzero((np.linalg.norm(means - centre, axis=1) < radius) & (opacity > 0.1))
    if not len(seen):
        return []
    view = replace(case.view(), near=1e-3 * radius, far=400 * radius)
    eye = np.asarray(view.world_from_eye.position)
    looks = []
    for target in means[np.random.default_rng(6).choice(seen, CLOSE_UPS)]:
        way = (eye - target) / np.linalg.norm(eye - target)
        looks.append(replace(view, world_from_eye=look_at(target + 0.01 * radius * way, target)))
    return looks


def within_a_splat(case: CaseContext) -> tuple[list, list[Panel]]:
    """A splat of 30 cm whose centre lies before, on, and behind the near plane."""
    near = np.float32(0.05)
    places = {
        "at the eye": 0.0, "behind the eye": -0.1, "half way to the near plane": near / 2,
        "on the near plane": near, "next to it": np.nextafter(near, np.float32(1)),
        "just beyond": near * 1.01,
    }  # fmt: skip
    comparisons, images = [], []
    for what, depth in places.items():
        scene = alone(splats([[0, 0, -depth], [0.1, 0, -2]], [[0.3] * 3, [0.2] * 3]))
        view = front(SMALL, 0.0, near=float(near))
        image = case.draw(scene, view)
        images.append(image)
        # On the plane itself a rounding decides: either of the two pictures is right.
        wants = [case.reference(scene, replace(view, near=float(near) * s)) for s in (1, 1.000001)]
        wants.append(case.reference(scene, replace(view, near=float(near) * 0.999999)))
        db = max(decibels(image, want) for want in wants)
        comparisons.append(ComparedPicture(db, what, image, wants[0]))
    worst = worst_of(comparisons)
    reason = "16 bits leave 78 dB and more; a splat on the plane may be drawn or not"
    findings = [
        clean(*images),
        at_least(f"splat {worst.what}, against float64, dB", worst.db, ORACLE_DB, reason),
    ]
    return findings, [case.panel(f"a splat {worst.what}", worst.image)]


def lenses(case: CaseContext) -> Result:
    """Fields of view of 1 and 170 degrees; parts of a picture against what the whole has there."""
    findings, images, panels = parts(case)
    ball = shell()
    for degrees, distance in ((1.0, 100.0), (170.0, 0.2)):
        fov_y = np.radians(degrees)
        view = front(SMALL, distance, fov_y=fov_y)
        scene = alone(ball)
        image = case.draw(scene, view)
        db = decibels(image, case.reference(scene, view))
        findings.append(
            at_least(
                f"{degrees:g} degrees, a ball against float64, dB", db, 45,
                "a lens of 1 degree magnifies float32's 1e-7 of a place to hundredths of a pixel, "
                "one of 170 its edge the same way",
            )
        )  # fmt: skip
        own = replace(case.view(), tangents=perspective(fov_y, case.size))
        seen = case.draw(case.scene(), own)
        images += [image, seen]
        panels += [
            case.panel(f"{degrees:g} degrees, a ball", image),
            case.panel(f"{degrees:g} degrees, the scene", seen),
        ]
    return Result([clean(*images), *findings], panels)


def parts(case: CaseContext) -> tuple[list, list, list]:
    """Findings, images and panels: what an off-centre lens sees, against the whole picture."""
    width, height = case.size
    quarter, eighth = max(width // 4, 1), max(width // 8, 1)
    edges = {  # left, top, width, height; the whole need not be known
        "left half": (0, 0, width // 2, height),
        "right quarter": (width - quarter, 0, quarter, height),
        "right eighth": (width - eighth, 0, eighth, height),
        "upper right corner": (width - quarter, 0, quarter, max(height // 4, 1)),
    }
    middle = {
        "second quarter": (quarter, 0, quarter, height),
        "fifth eighth": (width // 2, 0, eighth, height),
        "ninth in the middle": (width // 3, height // 3, width // 3 + 1, height // 3 + 1),
    }
    findings, images, comparisons = [], [], []
    scenes = {"splats around the eye": (alone(around()), front(case.size, 0.0)),
              "the scene": (case.scene(), case.view())}  # fmt: skip
    for what, (scene, view) in scenes.items():
        whole = case.draw(scene, view)
        images.append(whole)
        for kind, boxes, reason in (
            ("at the edge", edges, "a lens off centre is that part of the centred one"),
            ("inside, of a known whole", middle, "View.whole says how wide the lens is"),
        ):  # fmt: skip
            decided = []
            for name, (left, top, across, down) in boxes.items():
                part = view.part(left, top, (across, down))
                image = case.draw(scene, part if boxes is middle else replace(part, whole=None))
                there = whole[top : top + down, left : left + across]
                images.append(image)
                decided.append((decibels(image, there), name))
                comparisons.append(ComparedPicture(decided[-1][0], f"{name}, {what}", image, there))
            db, name = min(decided)
            figure = f"{what}, parts {kind} (worst: {name}), dB to the whole"
            findings.append(at_least(figure, db, PART_DB, f"{reason}; {PART_REASON}"))
    worst = worst_of(comparisons)
    return findings, images, compared(case, worst.what, worst.image, "in the whole", worst.wanted)


def random_eyes(case: CaseContext) -> Result:
    """Eyes anywhere in and around the scene, turned anyhow: no picture may break."""
    centre, radius = case.bounds()
    rng = np.random.default_rng(3)
    view = case.view()
    broken, most, images = 0, -1, 0
    for wxyz in turns(case.steps, rng):
        eye = centre + rng.normal(size=3) * radius * rng.uniform(0.01, 2)
        look = replace(view, world_from_eye=Pose(eye, wxyz))
        image = case.draw(case.scene(), look)
        bad = broken_pixels(image)
        images += 1
        if bad > most:
            most, worst = bad, image
        broken += bad
    reason = "no place of the eye may break a pixel; which ones were tried is fixed by a seed"
    findings = [at_most(f"broken pixels in {images} pictures", broken, 0, reason)]
    return Result(findings, [case.panel("one of the eyes", worst)])


def compared(case: CaseContext, name: str, image, other: str, beside) -> list[Panel]:
    return [
        case.panel(name, image),
        case.panel(other, beside),
        Panel("8 times the difference", difference(image, beside)),
    ]
