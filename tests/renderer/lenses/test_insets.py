"""Four views a frame: an inset is what one picture of the whole has there at the inset's density.

The oracles: the whole of each eye's field of view drawn alone in the inset's pixels, of which the
inset is a part, and the float64 reference.
"""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.colors.color_cache import eyes_among
from shapeshift.renderer.reference import reference_image
from shapeshift.scene.pose import View
from shapeshift.vr.openxr.view_configuration import with_insets
from tests.support.renderer.eye_scenes import SCENES, eyes
from tests.support.renderer.frames import draw_counted
from tests.support.renderer.renderers import TILES, quads
from tests.support.splat_scenes import psnr_db

RENDERERS = {"tiles": TILES, "quads": quads(mlps="onnxruntime", pair=False)}
FINE = (192, 160)  # pixels of an eye's whole field of view in the density of the insets
WIDE = (48, 40)  # that its wide view has: a sixteenth as many
LENSES = ((-0.9, 0.6, -0.7, 0.8), (-0.6, 0.9, -0.7, 0.8))
INSET = (80, 64)
# Left and top pixel of either inset: near the middle, at the outer corners, on no tile's edge.
PLACES = {
    "middle": ((64, 48), (48, 48)),
    "corner": ((0, 96), (112, 0)),
    "odd": ((57, 33), (61, 35)),
}
CASES = [("both", "middle"), ("both", "corner"), ("harmonics", "odd"), ("tinted", "middle")]


def wholes() -> list[View]:
    return [replace(v, tangents=t, size=FINE) for v, t in zip(eyes(), LENSES, strict=True)]


def four_views(place: str) -> tuple[View, ...]:
    """As a session has them: an inset has its own tangents, and knows of no whole yet."""
    wide = [view.resized(WIDE) for view in wholes()]
    parts = [v.part(*at, INSET) for v, at in zip(wholes(), PLACES[place], strict=True)]
    return with_insets([*wide, *(replace(part, whole=None) for part in parts)])


@pytest.mark.parametrize(("name", "place"), CASES)
def test_insets_are_parts_of_the_whole_and_wide_views_are_as_alone(renderer, name, place):
    """95 dB of an inset: tiles begin elsewhere, so sums are rounded otherwise, 101 and more were
    measured.  Where an inset is, a wide view of a sixteenth of the pixels has 51 at most.
    """
    scene, views = SCENES[name](), four_views(place)
    got, stats = draw_counted(renderer, scene, views)
    assert stats.color_sets == 2 and eyes_among(list(views)) == [0, 1, 0, 1]
    for eye, whole in enumerate(wholes()):
        (fine,), _ = draw_counted(renderer, scene, [whole])
        left, top = PLACES[place][eye]
        wanted = fine[top : top + INSET[1], left : left + INSET[0]]
        assert wanted[..., 3].max() > 0.5, "there is something to see"
        assert psnr_db(got[2 + eye], wanted) > 95
        (wide,), _ = draw_counted(renderer, scene, [whole.resized(WIDE)])
        np.testing.assert_array_equal(got[eye], wide)
        coarse = np.repeat(np.repeat(got[eye], 4, 0), 4, 1)
        assert psnr_db(coarse[top : top + INSET[1], left : left + INSET[0]], wanted) < 55


@pytest.mark.parametrize("place", ["middle", "corner"])
def test_each_view_is_what_the_reference_draws(renderer, place):
    """75 dB: quads have 79 and more, by half floats of their records; tiles 101."""
    scene, views = SCENES["harmonics"](), four_views(place)
    got, _ = draw_counted(renderer, scene, views)
    for view, image in zip(views, got, strict=True):
        assert psnr_db(image, reference_image(scene, view)) > 75


def test_an_inset_that_is_turned_otherwise_is_no_part():
    views = four_views("middle")
    assert [view.whole for view in views] == [None, None, *LENSES]
    turned = replace(views[2], whole=None, world_from_eye=eyes(away=1.0)[0].world_from_eye)
    turned = replace(
        turned, world_from_eye=replace(turned.world_from_eye, wxyz=np.array([1.0, 0, 0, 0]))
    )
    again = with_insets([*views[:2], turned, replace(views[3], whole=None)])
    assert again[2].whole is None and again[3].whole == LENSES[1]
    opposite = replace(  # the same turn by the other quaternion
        views[2].world_from_eye, wxyz=-views[2].world_from_eye.wxyz
    )
    again = with_insets([*views[:2], replace(views[2], whole=None, world_from_eye=opposite)])
    assert again[2].whole == LENSES[0]
    assert with_insets(views[:2]) == views[:2]


def test_views_from_one_place_are_one_eyes():
    left, right = eyes()
    assert eyes_among([left]) == [0] and eyes_among([left, right]) == [0, 1]
    assert eyes_among([right, left, left, right]) == [0, 1, 1, 0]
    third = eyes(away=3.0)[0]
    assert eyes_among([left, right, third, right, left]) == [0, 1, 2, 1, 0]


def test_shared_colours_and_a_kept_order_hold_for_all_four(renderer):
    """The second frame sorts nothing, and is the first again."""
    scene, views = SCENES["both"](), four_views("middle")
    how = {"stereo_colors": "shared", "resort_frames": 4}
    first, stats = draw_counted(renderer, scene, views, **how)
    assert stats.color_sets == 1 and stats.sorts == 1
    again, stats = draw_counted(renderer, scene, views, **how)
    assert stats.sorts == 0
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one, other)
