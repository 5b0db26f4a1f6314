"""Pictures in a panel: arrays on the GPU that ImGui can draw."""

import moderngl
import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.overlay_renderer import OverlayRenderer


class Textures:
    """Those of one ImGui context; each is uploaded once and kept until its name has another."""

    def __init__(self, ctx: moderngl.Context, overlay: OverlayRenderer) -> None:
        self._ctx, self._overlay = ctx, overlay
        self._kept: dict[str, tuple[np.ndarray, moderngl.Texture]] = {}

    def __len__(self) -> int:
        return len(self._kept)

    def reference(self, name: str, picture: np.ndarray) -> imgui.ImTextureRef:
        """What ImGui draws a picture by, (H, W, 3) or, with alpha, (H, W, 4) uint8; `name` has one
        at a time.
        """
        kept = self._kept.get(name)
        if kept is not None and kept[0] is picture:
            return imgui.ImTextureRef(kept[1].glo)
        if kept is not None:
            self._overlay.remove_texture(kept[1])
            kept[1].release()
        height, width, channels = picture.shape
        texture = self._ctx.texture((width, height), channels, picture.tobytes(), alignment=1)
        self._overlay.register_texture(texture)
        self._kept[name] = (picture, texture)
        return imgui.ImTextureRef(texture.glo)

    def release(self) -> None:
        for _, texture in self._kept.values():
            self._overlay.remove_texture(texture)
            texture.release()
        self._kept.clear()
