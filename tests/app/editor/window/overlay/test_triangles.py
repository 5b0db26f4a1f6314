"""Which tiles of the window the overlay's triangles meet, and which of them have changed."""

import numpy as np
import pytest

from shapeshift.app.editor.window.overlay.triangles import (
    CORNER,
    INDEX,
    TILE,
    DrawList,
    boxes_of,
    changed_boxes,
    tiles_of,
)

SIZE = (150, 70)  # neither a whole number of tiles
ALL = (0.0, 0.0, 150.0, 70.0)


def tiles_by_pixels(boxes: np.ndarray) -> np.ndarray:
    """One box, one tile at a time."""
    columns, rows = (-(-side // TILE) for side in SIZE)
    found = np.zeros((rows, columns), bool)
    for left, top, right, low in boxes:
        for row in range(rows):
            for column in range(columns):
                across = left < min((column + 1) * TILE, SIZE[0]) and right >= column * TILE
                down = top < min((row + 1) * TILE, SIZE[1]) and low >= row * TILE
                found[row, column] |= across and down and left <= right
    return found


EDGES = [
    -40.0,
    -1.0,
    0.0,
    0.5,
    31.0,
    31.99,
    32.0,
    33.0,
    63.9,
    64.0,
    69.0,
    70.0,
    149.9,
    150.0,
    400.0,
]


@pytest.mark.parametrize("count", [0, 1, 2, 40])
def test_tiles_are_those_that_a_box_meets(count):
    rng = np.random.default_rng(count)
    for _ in range(60):
        boxes = rng.choice(EDGES, (count, 4)).astype(np.float32)
        found = tiles_of(boxes, SIZE)
        seen = boxes[boxes[:, 1] <= boxes[:, 3]]  # upside down in y alone never comes out of a list
        if len(seen) == len(boxes):
            np.testing.assert_array_equal(found, tiles_by_pixels(boxes))


def test_what_is_nowhere_meets_no_tile_and_what_is_everywhere_all():
    nan, inf = np.nan, np.inf
    nowhere = np.array([(nan, 0, nan, 9), (5, 0, 4, 9), (-9, -9, -1, -1), (150, 0, 160, 9)], "f4")
    assert not tiles_of(nowhere, SIZE).any()
    assert tiles_of(np.array([(-inf, -inf, inf, inf)], "f4"), SIZE).all()


@pytest.mark.parametrize("seed", range(40))
def test_boxes_cover_the_tiles_and_no_pixel_twice(seed):
    rng = np.random.default_rng(seed)
    tiles = rng.random((-(-SIZE[1] // TILE), -(-SIZE[0] // TILE))) < rng.choice(
        [0.0, 0.1, 0.5, 0.9, 1.0]
    )
    times = np.zeros(SIZE[::-1], int)
    boxes = boxes_of(tiles, SIZE)
    for left, top, right, low in boxes:
        assert left < right <= SIZE[0] and top < low <= SIZE[1]
        times[top:low, left:right] += 1
    want = tiles.repeat(TILE, axis=0).repeat(TILE, axis=1)[: SIZE[1], : SIZE[0]]
    np.testing.assert_array_equal(times, want.astype(int))
    assert len(boxes) == 1 or not tiles.all()


def drawn(places, ink=7, clip=ALL, texture=1, scale=(1.0, 1.0)) -> DrawList:
    """Triangles (T, 3, 2) by one command."""
    places = np.asarray(places, np.float32).reshape(-1, 3, 2)
    corners = np.zeros(3 * len(places), CORNER)
    corners["place"], corners["color"] = (
        places.reshape(-1, 2),
        np.repeat(ink, 3 * len(places) // np.size(ink)),
    )
    indices = np.arange(3 * len(places), dtype=INDEX)
    commands = ((clip, texture, len(places)),)
    return DrawList(corners.tobytes(), indices.tobytes(), commands, scale)


def triangle(x: float, y: float) -> list[tuple[float, float]]:
    return [(x, y), (x + 4, y), (x, y + 4)]


def found_in(before, after) -> set[tuple[float, ...]]:
    return {tuple(box) for box in changed_boxes(before, after).tolist()}


def test_what_has_changed_is_both_where_it_was_and_where_it_is():
    a, b, c = triangle(0, 0), triangle(40, 0), triangle(80, 30)
    box = {"a": (0, 0, 4, 4), "b": (40, 0, 44, 4), "c": (80, 30, 84, 34)}
    same = (drawn([a, b, c]),)
    assert found_in(same, (drawn([a, b, c]),)) == set()
    moved = triangle(100, 50)
    assert found_in(same, (drawn([a, moved, c]),)) == {box["b"], (100, 50, 104, 54)}
    assert found_in(same, (drawn([a, b, c], ink=[7, 8, 7]),)) == {box["b"]}
    assert found_in(same, (drawn([a, c]),)) == {box["b"]}, "what follows has not moved"
    assert found_in((drawn([a, c]),), same) == {box["b"]}
    assert found_in(same, (drawn([a, c, b]),)) == {box["b"], box["c"]}, "another order"
    assert found_in(same, ()) == found_in((), same) == set(box.values())
    assert found_in((), ()) == found_in((drawn([]),), ()) == set()
    assert found_in((drawn([a, a]),), (drawn([a, a, a]),)) == {box["a"]}
    assert found_in(same, (*same, drawn([moved]))) == {(100, 50, 104, 54)}


def test_clip_texture_and_density_count_as_well():
    a, b = triangle(0, 0), triangle(40, 0)
    same = (drawn([a, b]),)
    both = {(0, 0, 4, 4), (40, 0, 44, 4)}
    assert found_in(same, (drawn([a, b], texture=2),)) == both
    clipped = drawn([a, b], clip=(2.0, 0.0, 40.0, 70.0))
    assert found_in(same, (clipped,)) == both | {(2, 0, 4, 4), (40, 0, 40, 4)}
    assert found_in(same, (drawn([a, b], scale=(2.0, 3.0)),)) == both | {
        (0, 0, 8, 12), (80, 0, 88, 12),
    }  # fmt: skip
    (unseen,) = drawn([a], clip=(20.0, 0.0, 30.0, 9.0)).boxes
    assert unseen[2] < unseen[0], "what is clipped away is nowhere"
