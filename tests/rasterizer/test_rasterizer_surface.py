"""rasterizer/surface: depth where rays are halfway through splats, and its gradients."""

import numpy as np
import pytest

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.project import Camera, project, project_backward
from shapeshift.rasterizer.raster import rasterize, rasterize_backward
from shapeshift.rasterizer.surface import (
    rasterize_depth,
    rasterize_depth_backward,
    surface,
    surface_arena,
    surface_backward,
)
from tests.support.renderer.rasterizer_reference import finite_differences
from tests.support.renderer.rasterizer_scenes import (
    GROUPS,
    arena,
    as_double,
    device,
    off_centre_camera,
    random_splats,
    upload,
)
from tests.support.renderer.surface_reference import render_depth_reference

FORMS = ("cpu", "gpu")
BACKGROUND = (0.2, 0.5, 0.9)


def draw(splats: list, camera, form: str = "cpu") -> tuple:
    d, on_device = device(), upload(splats)
    projected = project(d, *on_device, camera, form=form)
    tiles = bin_tiles(d, projected, camera.size, form)
    surfaces = surface(d, *on_device[:3], camera, projected, form)
    drawn = rasterize_depth(d, projected, tiles, surfaces, camera.size, BACKGROUND, form)
    return on_device, projected, tiles, drawn


def gradients(splats: list, camera, upstream: tuple, form: str) -> list:
    """The five gradients by upstream ones of image, transmittance and metres."""
    d = device()
    on_device, projected, tiles, drawn = draw(splats, camera, form)
    asked = [d.upload(g) for g in upstream]
    by_record, by_surface = rasterize_depth_backward(d, projected, tiles, drawn, *asked, form)
    back = project_backward(d, *on_device, camera, projected, by_record, form)
    surface_backward(
        d, *on_device[:3], camera, projected, drawn.surface, by_surface, back[:3], form
    )
    return [d.download(g) for g in back]


def random_upstream(size: tuple[int, int], seed: int = 0) -> tuple:
    rng = np.random.default_rng(seed)
    shapes = ((3, *size[::-1]), size[::-1], size[::-1])
    return tuple(rng.normal(size=shape).astype(np.float32) for shape in shapes)


def loss_of(splats: list, group: int, camera, upstream: tuple):
    doubles = as_double(splats)

    def loss(values: np.ndarray) -> float:
        changed = (*doubles[:group], values, *doubles[group + 1 :])
        drawn = render_depth_reference(changed, camera, BACKGROUND)
        return float(sum((a * g).sum() for a, g in zip(drawn, upstream, strict=True)))

    return loss


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("size", [(75, 66), (16, 17), (1, 1)])
def test_depth_is_that_of_rays_through_ellipsoids(form, size):
    splats, camera = random_splats(300, seed=2), off_centre_camera(size)
    splats[3][:] *= 0.4  # nothing stops early: the float64 twin does not
    _, _, _, drawn = draw(splats, camera, form)
    _, through, metres = render_depth_reference(tuple(as_double(splats)), camera, BACKGROUND)
    np.testing.assert_allclose(device().download(drawn.metres), metres, atol=3e-5)
    np.testing.assert_allclose(device().download(drawn.frame.transmittance), through, atol=1e-5)


@pytest.mark.parametrize("form", FORMS)
def test_the_picture_is_the_one_without_depth(form):
    size = (70, 50)
    splats, camera = random_splats(400, seed=3), off_centre_camera(size)
    _, projected, tiles, drawn = draw(splats, camera, form)
    plain = rasterize(device(), projected, tiles, size, BACKGROUND, form)
    for name in ("image", "transmittance", "tile_ends"):
        one, other = (device().download(getattr(f, name)) for f in (plain, drawn.frame))
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("form", FORMS)
def test_a_slanted_wall_of_flat_splats_is_a_plane(form):
    """Centre depth would show steps as high as the splats are wide."""
    size, rng = (96, 72), np.random.default_rng(0)
    camera = Camera(np.eye(4), 80.0, 80.0, 48.0, 36.0, size, 0.05)
    angle = np.radians(60)  # of the wall's normal from the view, about y
    along, normal = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [-np.sin(angle), 0, np.cos(angle)]]
    )
    places = rng.uniform(-4, 4, (900, 2))
    means = places[:, :1] * along + places[:, 1:] * [0, 1, 0] + [0, 0, 4.0]
    turn = np.array([np.cos(angle / 2), 0, -np.sin(angle / 2), 0])  # z onto the normal
    splats = [means, np.tile([0.3, 0.3, 1e-5], (900, 1)), np.tile(turn, (900, 1)),
              np.full(900, 0.9), np.full((900, 3), 0.5)]  # fmt: skip
    splats = [a.astype(np.float32) for a in splats]
    _, _, _, drawn = draw(splats, camera, form)
    coverage = 1 - device().download(drawn.frame.transmittance)
    depth = device().download(drawn.metres) / np.maximum(coverage, 1e-6)
    x, y = np.meshgrid(np.arange(96) + 0.5, np.arange(72) + 0.5)
    rays = np.stack([(x - 48) / 80, (y - 36) / 80, np.ones_like(x)], -1)
    wall = 4.0 * normal[2] / (rays @ normal)
    solid = (coverage > 0.99) & (wall > 2.5) & (wall < 6)
    assert solid.mean() > 0.4
    np.testing.assert_allclose(depth[solid], wall[solid], rtol=1e-3)
    # ... and the arena's way to it gives the same, with the wall's normal.
    d, packed = device(), arena(splats)
    projected = project(d, *upload(splats), camera, form=form)
    tiles = bin_tiles(d, projected, size, form)
    surfaces = surface_arena(d, packed[0], packed[1], packed[3], np.eye(4)[None], camera, projected)
    other = rasterize_depth(d, projected, tiles, surfaces, size, form=form)
    np.testing.assert_allclose(d.download(other.metres)[solid], (coverage * wall)[solid], rtol=1e-3)
    normals = np.moveaxis(d.download(other.frame.image), 0, 2)[solid] / coverage[solid][:, None]
    toward = -normal * np.sign(normal[2]) * [1, -1, -1]  # eye axes
    np.testing.assert_allclose(normals, np.broadcast_to(toward, normals.shape), atol=2e-3)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("left", "metres"), [(0.7, 3.0), (0.8, 2.0), (0.16, 3.0), (0.04, 0.0)])
def test_depth_is_where_so_much_light_is_left(form, left, metres):
    """Fog of opacity 1/4 at 2 m before a wall of 4/5 at 3 m leaves .75, then .15: no mean of both
    depths, and nothing where more light than that goes on.
    """
    size = (19, 18)
    camera = Camera(np.eye(4), 80.0, 80.0, 9.5, 9.0, size, 0.05)
    splats = [np.array([[0, 0, 2.0], [0, 0, 3.0]]), np.full((2, 3), [9.0, 9.0, 1e-4]),
              np.tile([1.0, 0, 0, 0], (2, 1)), np.array([0.25, 0.8]), np.zeros((2, 3))]  # fmt: skip
    d = device()
    means, scales, wxyz, opacity, color = upload([a.astype(np.float32) for a in splats])
    projected = project(d, means, scales, wxyz, opacity, color, camera, form=form)
    tiles = bin_tiles(d, projected, size, form)
    surfaces = surface(d, means, scales, wxyz, camera, projected, form)
    drawn = rasterize_depth(d, projected, tiles, surfaces, size, form=form, light_left=left)
    np.testing.assert_allclose(d.download(drawn.metres), metres, rtol=1e-4)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("group", range(5), ids=GROUPS)
def test_every_gradient_matches_finite_differences(group, form):
    size = (37, 26)
    splats, camera = random_splats(14, seed=21, scale=0.15), off_centre_camera(size)
    upstream = random_upstream(size)
    got = gradients(splats, camera, upstream, form)[group]
    want = finite_differences(
        loss_of(splats, group, camera, upstream), as_double(splats)[group], 1e-7
    )
    error = np.linalg.norm(got - want) / np.linalg.norm(want)
    assert error <= 2e-5, f"{GROUPS[group]}: {error:.1e}"


@pytest.mark.parametrize("group", range(3), ids=GROUPS[:3])
def test_gradients_of_depth_alone_of_small_and_flat_splats(group):
    """Small ones are held at their ends, flat ones are planes: other branches than round ones."""
    size = (33, 24)
    splats, camera = random_splats(12, seed=5, scale=0.05), off_centre_camera(size)
    splats[1][:4] *= 0.1
    splats[1][4:8, 2] *= 0.02
    upstream = tuple(g * (i == 2) for i, g in enumerate(random_upstream(size, seed=3)))
    got = gradients(splats, camera, upstream, "cpu")[group]
    want = finite_differences(
        loss_of(splats, group, camera, upstream), as_double(splats)[group], 1e-8
    )
    error = np.linalg.norm(got - want) / np.linalg.norm(want)
    assert error <= 1e-4, f"{GROUPS[group]}: {error:.1e}"


@pytest.mark.parametrize("form", FORMS)
def test_without_a_gradient_of_depth_nothing_changes(form):
    size = (40, 30)
    splats, camera = random_splats(200, seed=4), off_centre_camera(size)
    d, upstream = device(), random_upstream(size)
    _, projected, tiles, drawn = draw(splats, camera, form)
    by_image, by_through = (d.upload(g) for g in upstream[:2])
    nothing = d.zeros(size[::-1])
    got, by_surface = rasterize_depth_backward(
        d, projected, tiles, drawn, by_image, by_through, nothing, form
    )
    want = rasterize_backward(d, projected, tiles, drawn.frame, by_image, by_through, form)
    np.testing.assert_allclose(d.download(got), d.download(want), rtol=1e-5, atol=1e-5)
    assert not d.download(by_surface).any()


def test_nothing_of_a_hopeless_splat_is_nan():
    """Through the eye, edge-on, without a size: what is drawn stays finite, and so do gradients."""
    size = (32, 24)
    splats, camera = random_splats(6, seed=1, scale=0.2), off_centre_camera(size)
    splats[1][0] = [0.3, 0.3, 0]
    splats[1][1] = [0, 0, 0.2]
    splats[1][2] = 1e-7
    splats[1][3] = [50, 50, 1e-6]
    for form in FORMS:
        _, _, _, drawn = draw(splats, camera, form)
        assert np.isfinite(device().download(drawn.metres)).all()
        got = gradients(splats, camera, random_upstream(size), form)
        assert all(np.isfinite(g[3:]).all() for g in got)
