"""The edges of the room that is free to walk in: where they are, how clear, and over what."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.vr.drawn import Drawn
from shapeshift.vr.floor import CLEAR_M, HEIGHTS_M, MOST, SEEN_M, area_edges, edges
from shapeshift.vr.frame import LOST, Area
from shapeshift.vr.overlay import FINE, Overlay
from shapeshift.vr.scene_depth import SceneDepth
from tests.support.renderer.frames import texture_target
from tests.support.vr.vr_hands import HEAD, a_frame, eyes, hand_at, pixel_of

SIZE = (240, 200)
SIZE_M = (3.0, 2.0)  # along x and z
YAW = np.array([np.cos(0.3), 0.0, np.sin(0.3), 0.0])
TURNED = Area(Pose(np.array([0.4, 0.0, -0.2]), YAW), SIZE_M)
STRAIGHT = Area(Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])), SIZE_M)


def place_in(area: Area, x: float, z: float, y: float = 1.6) -> np.ndarray:
    return area.play_from_area.matrix()[:3] @ (x, y, z, 1.0)


@pytest.mark.parametrize("area", [STRAIGHT, TURNED])
def test_lines_lie_on_the_wall_that_is_near_and_not_beyond_its_ends(area):
    assert edges(area, [place_in(area, 0.0, 0.0)]) == []
    lines = edges(area, [place_in(area, 1.2, 0.5)])
    assert lines
    back = np.linalg.inv(area.play_from_area.matrix())
    ends = np.array([end for line in lines for end in (line.a, line.b)])
    local = ends @ back[:3, :3].T + back[:3, 3]
    across, along = np.abs(local[:, 0]), np.abs(local[:, 2])
    on_x, on_z = np.isclose(across, 1.5), np.isclose(along, 1.0)
    assert (on_x | on_z).all() and (across <= 1.5 + 1e-9).all() and (along <= 1.0 + 1e-9).all()
    assert on_x.any() and on_z.any()  # a corner is near two
    assert set(np.round(local[:, 1], 9)) == set(HEIGHTS_M)


@pytest.mark.parametrize(
    ("away_m", "opacity"),
    [(SEEN_M, 0.0), (SEEN_M + 0.1, 0.0), ((SEEN_M + CLEAR_M) / 2, 0.5), (CLEAR_M, 1.0), (0.0, 1.0),
     (-0.4, 1.0)],
)  # fmt: skip
def test_the_nearer_the_clearer_and_clearest_beyond(away_m, opacity):
    lines = edges(STRAIGHT, [place_in(STRAIGHT, 1.5 - away_m, 0.0)])
    clearest = max((line.color[3] for line in lines), default=0.0)
    assert clearest == pytest.approx(MOST * opacity, abs=1e-9)


def test_far_beyond_a_corner_there_are_lines_all_the_same():
    for x, z in ((1.2, 2.5), (-4.0, -3.0), (1.45, -1.9)):
        lines = edges(STRAIGHT, [place_in(STRAIGHT, x, z)])
        assert lines and all(np.isfinite([line.a, line.b]).all() for line in lines)


def test_hands_bring_them_too_and_without_an_area_there_are_none():
    far = a_frame(area=STRAIGHT)
    assert area_edges(far) == () == area_edges(a_frame(hand_at((1.4, 1.0, 0.0))))
    assert area_edges(replace(far, hands={"left": hand_at((1.4, 1.0, 0.0)), "right": LOST}))


def test_splats_do_not_hide_an_edge(ctx):
    """A captured wall stands before the real one."""
    view = eyes(SIZE)[0]
    area = Area(Pose(np.array([0.0, 0.0, 0.55]), HEAD.wxyz), SIZE_M)  # its edge: 0.45 m ahead
    lines = area_edges(a_frame(area=area))
    wall = np.zeros((SIZE[1], SIZE[0], 4), np.float32)
    wall[..., 0], wall[..., 3] = 0.2, 1.0
    with texture_target(ctx, SIZE) as target, Overlay(ctx, FINE) as overlay:
        with SceneDepth(ctx) as scene_depth:
            depth = scene_depth.of(wall, 1.0)
            seen = []
            for drawn in (Drawn(edges=lines), Drawn(lines=lines)):
                target.clear(0, 0, 0, 1)
                overlay.draw(target, view, drawn, depth)
                pixels = np.frombuffer(target.read(components=3), np.uint8)
                seen.append(pixels.reshape(*SIZE[::-1], 3)[::-1])
    row, column = pixel_of(view, np.array([0.0, HEIGHTS_M[-1], -0.45]))
    assert seen[0][row - 2 : row + 3, column].max() > 60 and not seen[1].any()
