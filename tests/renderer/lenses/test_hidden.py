"""Where lenses show nothing: nothing is drawn there, and all else is the same to the last bit."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.project import TILE
from shapeshift.renderer.foveation import hidden_pixels, hidden_tiles
from shapeshift.scene.pose import HiddenMesh, View
from shapeshift.scene.scene import IDENTITY
from tests.support.renderer.eye_scenes import SCENES, eyes
from tests.support.renderer.frames import draw_counted
from tests.support.renderer.renderers import TILES, quads
from tests.support.xr.masked_eyes import PART, frame_mesh

RENDERERS = {"tiles": TILES, "quads": quads(mlps="onnxruntime", pair=False)}
LENS = (-1.28, 0.9, -1.19, 1.11)


def mesh_of(tangents: tuple[float, float, float, float]) -> HiddenMesh:
    corners, order = frame_mesh(tangents)
    return HiddenMesh(np.array(corners)[order].reshape(-1, 3, 2))


def a_view(size: tuple[int, int], mesh: HiddenMesh | None, lens=LENS) -> View:
    return View(IDENTITY, lens, 0.05, 50.0, size, hidden=mesh)


def inside_one(triangle: np.ndarray, x: float, y: float) -> bool:
    """By barycentric coordinates, another formula than by the sides."""
    a, b, c = triangle
    try:
        u, v = np.linalg.solve(np.stack([b - a, c - a], 1), np.array([x, y]) - a)
    except np.linalg.LinAlgError:
        return False
    return u >= -1e-12 and v >= -1e-12 and u + v <= 1 + 1e-12


def test_pixels_are_hidden_whose_centre_a_triangle_holds():
    rng = np.random.default_rng(3)
    mesh = HiddenMesh(rng.uniform(-1.6, 1.6, (7, 3, 2)))  # turned both ways, and beyond the edge
    view = a_view((23, 17), mesh)
    found = hidden_pixels(view)
    left, right, down, up = LENS
    for row in range(17):
        for column in range(23):
            x = left + (column + 0.5) / 23 * (right - left)
            y = up - (row + 0.5) / 17 * (up - down)
            wanted = any(inside_one(triangle, x, y) for triangle in mesh.triangles)
            assert found[row, column] == wanted, (row, column)
    assert 0.1 < found.mean() < 0.95


def test_the_share_of_a_frame_is_its_area():
    hidden = hidden_pixels(a_view((320, 240), mesh_of(LENS)))
    edge = 2 * (320 + 240) / (320 * 240)  # pixels that the inner edge may cut
    assert abs(hidden.mean() - (1 - PART**2)) <= edge
    assert not hidden[120, 160] and hidden[[0, 0, -1, -1], [0, -1, 0, -1]].all()


@pytest.mark.parametrize("size", [(1, 1), (TILE - 1, TILE + 1), (2 * TILE, TILE), (95, 70)])
def test_a_tile_is_hidden_where_all_of_its_pixels_are(size):
    view = a_view(size, mesh_of(LENS))
    pixels = hidden_pixels(view)
    tiles = hidden_tiles(view, TILE)
    if tiles is None:
        tiles = np.zeros((-(-size[1] // TILE), -(-size[0] // TILE)), bool)
    for row, column in np.ndindex(tiles.shape):
        part = pixels[row * TILE : (row + 1) * TILE, column * TILE : (column + 1) * TILE]
        assert tiles[row, column] == part.all()


def test_without_a_mesh_nothing_is_hidden_and_bad_ones_are_refused():
    assert hidden_tiles(a_view((64, 64), None), TILE) is None
    assert not hidden_pixels(a_view((64, 64), None)).any()
    assert hidden_tiles(a_view((64, 64), HiddenMesh(np.zeros((0, 3, 2)))), TILE) is None
    flat = HiddenMesh(np.array([[(9.0, 9.0), (9.0, 9.0), (9.0, 9.0)]]))
    assert hidden_tiles(a_view((64, 64), flat), TILE) is None
    for wrong in (np.full((1, 3, 2), np.nan), np.zeros((1, 4, 2)), np.full((1, 3, 2), np.inf)):
        with pytest.raises(ValueError, match="hidden mesh"):
            HiddenMesh(wrong)


def pixels_left_out(renderer, view: View) -> np.ndarray:
    """(H, W) bool: where this drawing draws nothing."""
    if getattr(renderer.drawing, "stereo_pair", 0) is None:
        return hidden_pixels(view)
    tiles = hidden_tiles(view, TILE)
    assert tiles is not None
    pixels = tiles.repeat(TILE, 0).repeat(TILE, 1)
    return pixels[: view.size[1], : view.size[0]]


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_what_is_seen_is_the_same_to_the_bit(renderer, name, scale):
    plain = eyes()
    masked = [replace(view, hidden=mesh_of(view.tangents)) for view in plain]
    scene = SCENES[name]()
    wanted, _ = draw_counted(renderer, scene, plain, render_scale=scale)
    images, _ = draw_counted(renderer, scene, masked, render_scale=scale)
    for view, image, whole in zip(masked, images, wanted, strict=True):
        size = image.shape[1::-1]
        out = pixels_left_out(renderer, replace(view, size=size))
        assert 0.1 < out.mean() < 0.66 and not image[out].any()
        np.testing.assert_array_equal(image[~out], whole[~out])


def test_an_eye_alone_may_have_a_mesh_and_the_next_frame_none(renderer):
    left, right = eyes()
    scene = SCENES[next(iter(SCENES))]()
    wanted, _ = draw_counted(renderer, scene, [left, right])
    blind = replace(left, hidden=HiddenMesh(np.array([[(-9.0, -9), (9, -9), (0, 30)]])))
    images, _ = draw_counted(renderer, scene, [blind, right])
    assert not images[0].any()
    np.testing.assert_array_equal(images[1], wanted[1])
    images, _ = draw_counted(renderer, scene, [left, right])
    np.testing.assert_array_equal(images, wanted)


def test_depth_is_left_out_with_the_colours():
    from shapeshift.renderer.renderer import Renderer

    plain = eyes()
    masked = [replace(view, hidden=mesh_of(view.tangents)) for view in plain]
    with Renderer(None) as renderer:
        scene = SCENES[next(iter(SCENES))]()
        draw_counted(renderer, scene, plain, depth_scale=1.0)
        wanted = [renderer.drawing.presentable_depth(i).copy() for i in range(2)]
        draw_counted(renderer, scene, masked, depth_scale=1.0)
        for i, view in enumerate(masked):
            depth = renderer.drawing.presentable_depth(i)
            seen = ~hidden_pixels(view)
            np.testing.assert_array_equal(depth[seen], wanted[i][seen])
            assert not depth[0, 0].any()
