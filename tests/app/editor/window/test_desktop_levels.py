"""The viewer on a streamed scene: coarse in the first frame, the finest level in the end."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.editor.desktop import Options, Viewer, attach_refiner
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.opened import Source
from shapeshift.app.editor.state.scene_objects import scene_of
from shapeshift.app.streaming.refine import Refiner
from shapeshift.renderer.renderer import Renderer
from tests.support.desktop.desktop_stand import run_frames, start, until_opened
from tests.support.splats.sog_scenes import random_sog, rewrite, write_folder, write_streamed

LEVELS = (400, 90, 20)
COLORS = ((0, 255, 0), (0, 0, 255), (255, 0, 0))  # of each level, the finest green
GREEN, BLUE = 1, 2  # of red, green, blue


@pytest.fixture
def scene(tmp_path) -> Path:
    folder = write_streamed(tmp_path / "colours é", LEVELS)
    for level, (count, color) in enumerate(zip(LEVELS, COLORS, strict=True)):
        meta, pictures = random_sog(count, seed=level)
        meta["means"] |= {"mins": [-0.7] * 3, "maxs": [0.7] * 3}
        meta["scales"]["codebook"] = list(np.linspace(-4, -2.5, 256))
        meta["sh0"]["codebook"] = list(np.linspace(-1.5, 1.5, 256))
        pictures["sh0.webp"][..., :3], pictures["sh0.webp"][..., 3] = color, 255
        write_folder(folder / f"{level}_0", meta, pictures)
    return rewrite(folder, lambda meta: None)


def attach(viewer: Viewer, refiner: Refiner) -> None:
    """As the program does."""
    upload, changed = viewer.shown.upload, viewer.dial.scene_changed
    attach_refiner(refiner, viewer.state, viewer.hooks, upload, changed)


def shares(picture: np.ndarray) -> np.ndarray:
    """(3,) parts of the picture that are red, green, blue rather than anything else."""
    seen = picture[: picture.shape[0] - 40, 300:].astype(int)  # beside the panel
    most = seen.max(axis=2)
    return np.array([((seen[..., i] == most) & (seen[..., i] > 150)).mean() for i in range(3)])


@pytest.mark.parametrize(
    ("options", "level"), [(("--frames", 1), GREEN), (("--max-splats", 100), BLUE)]
)
def test_a_screenshot_waits_for_the_finest_level_that_the_budget_allows(
    display, scene, tmp_path, options, level
):
    out = tmp_path / "window.png"
    done = start(display, "view", scene, "--screenshot", out, *options)
    assert done.returncode == 0, done.stderr
    seen = shares(np.asarray(Image.open(out)))
    assert seen[level] > 0.03 and np.delete(seen, level).max() < 0.002


def test_the_first_frame_is_coarse_and_the_camera_stays(window, scene, tmp_path):
    options = Options(pictures=tmp_path / "pictures")
    with Refiner(options) as refiner, Renderer(window.ctx) as renderer:
        state = EditorState(refiner.open)
        sources = [Source(scene, refiner.open(scene))]
        state.open_sources(sources, scene_of(sources))
        viewer = Viewer(window, renderer, state, options)
        viewer.frame(0.0)
        red, green, blue = shares(window.picture())
        assert red > 0.005 and green < 0.002 and blue < 0.002
        attach(viewer, refiner)
        before = viewer.viewpoint.camera.view((900, 640))
        for _ in range(200):
            run_frames(viewer, 1)
            if not viewer.polling:
                break
        red, green, blue = shares(window.picture())
        assert green > 0.03 and red < 0.002 and blue < 0.002
        after = viewer.viewpoint.camera.view((900, 640))
        assert np.array_equal(before.world_from_eye.matrix(), after.world_from_eye.matrix())
        assert "detail 3 of 3" in [said() for said in viewer.hooks.status]


def test_a_streamed_scene_that_is_dropped_on_the_window_is_refined(window, scene, tmp_path):
    options = Options(pictures=tmp_path / "pictures")
    with Refiner(options) as refiner, Renderer(window.ctx) as renderer:
        state = EditorState(refiner.open)
        sources = [Source(scene / "1_0", refiner.open(scene / "1_0"))]  # one level alone: blue
        state.open_sources(sources, scene_of(sources))
        viewer = Viewer(window, renderer, state, options)
        attach(viewer, refiner)
        run_frames(viewer, 2)
        assert not refiner.running
        viewer.files.open_soon((scene,))
        until_opened(viewer)
        for _ in range(200):
            run_frames(viewer, 1)
            if not refiner.running:
                break
        run_frames(viewer, 1)
        red, green, blue = shares(window.picture())
        assert green > 0.03 and red + blue < green / 20
        assert state.scene.objects[0].model.splat_count == LEVELS[0]
        assert state.sources[0].facts["splats"] == LEVELS[0] and state.problem == ""
