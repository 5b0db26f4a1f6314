"""`launch.py vr` on a runtime that shows four views, as Monado does not: XR_VARJO_quad_views.

four_views.py vr ...    arguments as of launch.py; beside the lines, a JSON file has what was asked
for and, of each frame, the views that were handed over.  Monado gets the first two of them.
"""

import json
import math
import os
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[3]
NAME = "XR_VARJO_quad_views"
FOUR = 1000037000  # XrViewConfigurationType, of the extension and of OpenXR 1.1
PART = 0.5  # of an eye's own pixels a side that its wide view has
INSET_PX = (96, 80)
# Where an inset lies in its wide view's angles, by eye: off the middle, and not the same in both
INSETS = ((0.40, 0.70, 0.35, 0.60), (0.32, 0.62, 0.35, 0.60))  # left, right, down, up


def inset_angles(fov: tuple[float, float, float, float], eye: int) -> tuple[float, ...]:
    """Left, right, down, up of the inset of an eye, radians, as those of its wide view."""
    left, right, down, up = (math.tan(angle) for angle in fov)
    a, b, c, d = INSETS[eye]
    tangents = (
        left + a * (right - left), left + b * (right - left),
        down + c * (up - down), down + d * (up - down),
    )  # fmt: skip
    return tuple(math.atan(tangent) for tangent in tangents)


class FourViews:
    """Answers in the place of a runtime that has them, by the extension or by OpenXR 1.1."""

    def __init__(self, xr: Any, how: str) -> None:
        self.xr, self.how = xr, how  # "extension", "core", or "refused": listed, and without views
        self.asked: list[str] = []
        self.begun: list[int] = []
        self.frames: list[list[dict]] = []  # of each frame the views that were handed over

    def switch_on(self) -> None:
        """Puts itself between the program and the runtime."""
        xr = self.xr
        created, listed = xr.create_instance, xr.enumerate_instance_extension_properties
        kinds, views_of = xr.enumerate_view_configurations, xr.enumerate_view_configuration_views
        begin, locate, end = xr.begin_session, xr.locate_views, xr.end_frame
        blends = xr.enumerate_environment_blend_modes
        stereo = xr.ViewConfigurationType.PRIMARY_STEREO

        def plain(kind: Any) -> Any:
            return stereo if int(kind) == FOUR else kind

        def extensions(*given):
            more = [] if self.how == "core" else [xr.ExtensionProperties(extension_name=NAME)]
            return [*listed(*given), *more]

        def create(info, *given):
            names = [
                name.decode() if isinstance(name, bytes) else str(name)
                for name in info.enabled_extension_names
            ]
            version = xr.Version(info.application_info.api_version)
            self.asked = [f"{version.major}.{version.minor}", *(n for n in names if n == NAME)]
            info = xr.InstanceCreateInfo(
                application_info=info.application_info,
                enabled_extension_names=[name for name in names if name != NAME],
            )
            return created(info, *given)

        def configurations(*given):
            there = NAME in self.asked or (self.how == "core" and self.asked[0] == "1.1")
            return [*kinds(*given), *([FOUR] if there else [])]

        def recommended(instance, system, kind):
            if int(kind) != FOUR:
                return views_of(instance, system, kind)
            if self.how == "refused":
                return []
            made = []
            for i in range(4):
                (view, *_) = views_of(instance, system, stereo)
                if i < 2:
                    view.recommended_image_rect_width = round(
                        view.recommended_image_rect_width * PART
                    )
                    view.recommended_image_rect_height = round(
                        view.recommended_image_rect_height * PART
                    )
                else:
                    view.recommended_image_rect_width, view.recommended_image_rect_height = INSET_PX
                made.append(view)
            return made

        def begins(session, info):
            self.begun.append(int(info.primary_view_configuration_type))
            return begin(session, xr.SessionBeginInfo(stereo))

        def located(session, info):
            asked = xr.ViewLocateInfo(
                plain(info.view_configuration_type), info.display_time, info.space
            )
            state, views = locate(session, asked)
            if int(info.view_configuration_type) != FOUR:
                return state, views
            made = list(views)
            for eye, view in enumerate(views):
                fov = view.fov
                a, b, c, d = inset_angles(
                    (fov.angle_left, fov.angle_right, fov.angle_down, fov.angle_up), eye
                )
                made.append(xr.View(view.pose, xr.Fovf(a, b, d, c)))
            return state, made

        def ends(session, info):
            layers = []
            for layer in info.layers:
                kind = int(layer.contents.type)
                if kind == int(xr.StructureType.COMPOSITION_LAYER_PROJECTION):
                    layer = self._take(layer)
                layers.append(layer)
            rest = xr.FrameEndInfo(info.display_time, info.environment_blend_mode, layers=layers)
            return end(session, rest)

        xr.create_instance, xr.enumerate_instance_extension_properties = create, extensions
        xr.enumerate_view_configurations = configurations
        xr.enumerate_view_configuration_views = recommended
        xr.enumerate_environment_blend_modes = lambda instance, system, kind: blends(
            instance, system, plain(kind)
        )
        xr.begin_session, xr.locate_views, xr.end_frame = begins, located, ends

    def _take(self, layer: Any) -> Any:
        """Notes a projection's views; what Monado gets is as it knows it."""
        import ctypes

        xr = self.xr
        whole = ctypes.cast(layer, ctypes.POINTER(xr.CompositionLayerProjection)).contents
        views = list(whole.views)
        self.frames.append([
            {
                "fov": [v.fov.angle_left, v.fov.angle_right, v.fov.angle_down, v.fov.angle_up],
                "size": [v.sub_image.image_rect.extent.width, v.sub_image.image_rect.extent.height],
                "chain": ctypes.cast(v.sub_image.swapchain, ctypes.c_void_p).value,
                "deep": bool(v.next),
            }
            for v in views
        ])  # fmt: skip
        self.kept = xr.CompositionLayerProjection(whole.layer_flags, whole.space, views=views[:2])
        return ctypes.byref(self.kept)


def main(arguments: list[str]) -> int:
    sys.path.insert(0, str(ROOT))
    import xr

    import shapeshift  # noqa: F401  makes the folders its subpackages
    from shapeshift.app.cli import main as run

    runtime = FourViews(xr, os.environ["SHAPESHIFT_TEST_VIEWS"])
    runtime.switch_on()
    try:
        return run(arguments)
    finally:
        told = {"asked": runtime.asked, "begun": runtime.begun, "frames": runtime.frames}
        Path(os.environ["SHAPESHIFT_TEST_TOLD"]).write_text(json.dumps(told))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
