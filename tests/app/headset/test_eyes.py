"""The pictures of the views of a session, which may have another number of them than the last."""

import numpy as np
import pytest

from shapeshift.app.headset.eyes import Eyes
from shapeshift.scene.pose import View
from shapeshift.scene.scene import IDENTITY
from shapeshift.vr.frame import SIDES
from shapeshift.vr.openxr.view_configuration import with_insets

WIDE, FINE = (12, 9), (8, 8)
WHOLE = View(IDENTITY, (-1.0, 1.0, -1.0, 1.0), 0.05, 50.0, WIDE)
FOUR = with_insets([
    *[WHOLE] * 2, *[View(IDENTITY, (-0.5, 0.25, -0.5, 0.5), 0.05, 50.0, FINE)] * 2
])  # fmt: skip


class Depths:
    """A renderer that tells how deep so many views are."""

    def __init__(self) -> None:
        self.drawing, self.asked = self, []

    def presentable_depth(self, i: int) -> np.ndarray:
        self.asked.append(i)
        return np.zeros((4, 4, 4), np.float32)


def test_a_session_with_insets_may_follow_one_without_and_the_other_way(ctx):
    renderer = Depths()
    with Eyes(ctx, [WIDE] * 2) as eyes:
        first = eyes.framebuffers[0]
        for sizes in ([WIDE] * 2, [WIDE] * 2 + [FINE] * 2, [WIDE] * 2):
            eyes.fit(sizes)
            assert [each.size for each in eyes.framebuffers] == sizes
            renderer.asked.clear()
            assert len(eyes.depths(renderer, 1.0)) == len(sizes)
            assert renderer.asked == list(range(len(sizes)))
        assert eyes.framebuffers[0] is not first
        kept = eyes.framebuffers[0]
        eyes.fit([WIDE] * 2)
        assert eyes.framebuffers[0] is kept, "nothing is made anew for the same sizes"
        ctx.detect_framebuffer(0).use()  # none that is gone stays bound


def test_the_desk_has_the_left_eye_s_inset_where_it_is(ctx):
    with Eyes(ctx, [WIDE] * 2 + [FINE] * 2) as eyes:
        inset = eyes.inset(FOUR)
        assert inset.texture is eyes.textures[len(SIDES)]
        assert inset.part == pytest.approx((0.25, 0.25, 0.375, 0.5))
        assert eyes.inset([*FOUR[:2], WHOLE, WHOLE]) is None, "it is turned otherwise"
        assert eyes.inset(FOUR[:2]) is None
        ctx.detect_framebuffer(0).use()
