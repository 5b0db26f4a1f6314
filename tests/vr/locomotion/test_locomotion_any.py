"""Moving in VR, whatever the hands do: hundreds of frames without rhyme or reason."""

import math

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.vr.locomotion import LONGEST_S, RULES, Rules, Travel, move
from shapeshift.vr.play_space import FAR_M, LEAST_SCALE, MOST_SCALE, PlaySpace
from tests.support.vr.vr_frames import LOST, frame, hand, yawed

START = PlaySpace(Pose(np.array([1.0, 0.5, -2]), yawed(0.3)), 1.0)


def any_frame(random):
    """Hands that come and go, press anything, and sticks that are broken now and then."""

    def any_hand(side):
        if random.random() < 0.1:
            return LOST
        stick = tuple(random.uniform(-1, 1, 2)) if random.random() < 0.9 else (math.nan, math.inf)
        wxyz = random.normal(size=4)
        return hand(
            side,
            random.uniform(-1, 2, 3),
            wxyz / np.linalg.norm(wxyz),
            stick=stick,
            squeeze=random.choice([0, 0.5, 1.0]),
            primary=random.random() < 0.3,
            secondary=random.random() < 0.3,
        )

    wxyz = random.normal(size=4)
    head = Pose(random.uniform(-1, 2, 3), wxyz / np.linalg.norm(wxyz))
    recentred = random.random() < 0.02
    return frame(any_hand("left"), any_hand("right"), head, recentred=recentred)


@pytest.mark.parametrize("seed", range(4))
def test_whatever_hands_do_the_room_stays_level_and_within_bounds(seed):
    random = np.random.default_rng(seed)
    rules = Rules(walks=("left", "right")[seed % 2], turning=("snap", "smooth")[seed // 2])
    play_space, travel = START, Travel()
    for _ in range(600):
        one = any_frame(random)
        before = play_space
        play_space, travel, comfort = move(
            play_space, travel, one, random.choice([0, 0.011, 9]), rules
        )
        room = play_space.world_from_play
        assert np.isfinite(room.position).all() and np.abs(room.position).max() <= FAR_M
        assert LEAST_SCALE <= play_space.scale <= MOST_SCALE
        assert room.wxyz[1] == pytest.approx(0, abs=1e-9) == room.wxyz[3]
        assert np.linalg.norm(room.wxyz) == pytest.approx(1, abs=1e-12)
        assert 0 <= comfort.vignette <= 1 and 0 <= comfort.blink <= 1
        # Only what says so takes more than a walk, a flight or a grip would.
        if not (comfort.jumps or travel.grips):
            shift = play_space.point(one.head.position) - before.point(one.head.position)
            most = math.hypot(RULES.walk_m_s, RULES.fly_m_s) * LONGEST_S * play_space.scale
            assert np.linalg.norm(shift) <= most + 1e-6
