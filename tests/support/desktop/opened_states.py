"""Editor states of files that were opened, without a window."""

from pathlib import Path

import numpy as np

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.open_scene import opened_scene
from shapeshift.app.editor.state.files.opened import OpenedFiles
from shapeshift.runtime_models.model import BadFile, Model, SplatLayers, Stop


def no_model(path: Path) -> Model:
    raise BadFile(f"{path} is not read here.")


def state_of(found: OpenedFiles) -> EditorState:
    state = EditorState(no_model)
    scene, edited = opened_scene(found)
    state.open_sources(found.sources, scene, None, edited)
    return state


def model(name: str) -> SplatLayers:
    return SplatLayers(
        np.zeros((3, 3), np.float32), np.full((3, 3), 0.1, np.float32),
        np.tile(np.array([1, 0, 0, 0], np.float32), (3, 1)), np.full(3, 0.9, np.float32),
        np.zeros((3, 1, 3), np.float32), np.zeros(3, np.int32),
        (Stop(name, 0.0), Stop("other", 1.0)),
    )  # fmt: skip
