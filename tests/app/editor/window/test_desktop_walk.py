"""How many calls of ours carry a slider's x from the frame to the launch that uses it."""

from pathlib import Path

import pytest

import shapeshift as ss
from shapeshift.app.editor.desktop import Options, Viewer
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.rasterizer.device import Device
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.read_scene import read_model
from tests.support.desktop.desktop_stand import ball, run_frames
from tests.support.walks import calls_below

# Below Viewer.draw_splats, the launch itself included: the picture on the screen, the renderer's
# scene, the drawing, then what differs.  Quads have a decoder that picks among networks by GL, by
# onnxruntime and plain layers, and networks run four times; tiles launch all networks of the shape
# at once, or the packing of layers through a copy.
MOST = {
    ("quads", "networks"): 7,
    ("quads", "layers"): 6,
    ("tiles", "networks"): 5,
    ("tiles", "layers"): 6,
}


@pytest.mark.parametrize(("drawing", "model"), MOST)
def test_x_is_handed_on_by_few_calls(window, tmp_path, monkeypatch, drawing, model):
    launches: list[list[str]] = []

    def noted(launch):
        def note(*given, **named):
            calls = calls_below("Viewer.draw_splats")
            if calls is not None:  # not of the overlay, which is laid over the picture later
                launches.append([*calls, launch.__qualname__])
            return launch(*given, **named)

        return note

    mlps = "gl" if drawing == "quads" else "auto"
    state = EditorState(lambda path: read_model(path) if model == "networks" else ball(50))
    state.open([Path(ss.DEMO)])
    with Renderer(window.ctx, drawing=drawing, mlps=mlps) as renderer:
        viewer = Viewer(window, renderer, state, Options(pictures=tmp_path))
        run_frames(viewer, 2)
        monkeypatch.setattr(Gpu, "run", noted(Gpu.run))
        monkeypatch.setattr(Device, "launch", noted(Device.launch))
        state.set_x(0, 0.37)
        run_frames(viewer, 1)
    first = next(calls for calls in launches if "Renderer.update" in calls)
    assert first[:2] == ["Shown.draw", "Renderer.update"]
    assert len(first) <= MOST[drawing, model], first
