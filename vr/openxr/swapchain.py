"""The runtime's images of one eye, and the one conversion of colour on the way into them."""

from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np

from shapeshift.vr.openxr.instance import Instance, NoHeadset
from shapeshift.vr.shown import Blit

WAIT_NS = 1_000_000_000  # for an image that the runtime still reads


@dataclass(frozen=True)
class SwapchainFormat:
    """A format of OpenGL; `linear`: runtimes take its values for light, not for display values."""

    gl: int
    name: str
    linear: bool
    dtype: str  # moderngl's


# The order of wanting: eight bits that are display values hold all that our pictures hold;
# of light, eight bits would show bands in the dark.
FORMATS = (
    SwapchainFormat(0x8C43, "SRGB8_ALPHA8", False, "f1"),
    SwapchainFormat(0x881A, "RGBA16F", True, "f2"),
    SwapchainFormat(0x805B, "RGBA16", True, "f2"),
    SwapchainFormat(0x8C3A, "R11F_G11F_B10F", True, "f2"),
    SwapchainFormat(0x8059, "RGB10_A2", True, "f1"),
    SwapchainFormat(0x8058, "RGBA8", True, "f1"),
)


def choose_format(offered: list[int], wanted: str = "") -> SwapchainFormat:
    """The best of FORMATS among the runtime's, or the one that is named; ValueError for none."""
    known = [each for each in FORMATS if each.gl in offered]
    if wanted:
        known = [each for each in known if each.name == wanted]
    if not known:
        names = ", ".join(hex(each) for each in offered)
        raise ValueError(f"no format of {wanted or 'ours'} among the runtime's ({names}).")
    return known[0]


class Swapchain:
    """Images of (width, height) pixels that are shown to one eye."""

    def __init__(
        self,
        instance: Instance,
        session: Any,
        ctx: moderngl.Context,
        size: tuple[int, int],
        pixels: SwapchainFormat,
    ) -> None:
        xr = self._xr = instance.xr
        self.size, self.pixels, self._ctx = size, pixels, ctx
        self._instance = instance
        use = xr.SwapchainUsageFlags
        info = xr.SwapchainCreateInfo(
            usage_flags=use.COLOR_ATTACHMENT_BIT | use.SAMPLED_BIT,
            format=pixels.gl, sample_count=1, width=size[0], height=size[1],
            face_count=1, array_size=1, mip_count=1,
        )  # fmt: skip
        try:
            with instance.asked("make images for an eye"):
                self.handle = xr.create_swapchain(session, info)
        except xr.exception.SwapchainFormatUnsupportedError:
            raise NoHeadset(f"{instance.runtime} refuses its own format {pixels.name}.") from None
        ctx.__enter__()  # SteamVR on Linux leaves its own context current here
        images = xr.enumerate_swapchain_images(self.handle, xr.SwapchainImageOpenGLKHR)
        self._framebuffers = [
            ctx.framebuffer([ctx.external_texture(image.image, size, 4, 0, pixels.dtype)])
            for image in images
        ]

    def show(self, texture: moderngl.Texture, shown: Blit, keep: bool = False):
        """Hands an eye's display-encoded picture over.

        With `keep` the runtime's image is read back, (H, W, 3) float32 with row 0 on top and the
        values that lie in it; else None.
        """
        xr, kept = self._xr, None
        with self._instance.asked("take a picture"):
            number = xr.acquire_swapchain_image(self.handle, xr.SwapchainImageAcquireInfo())
            xr.wait_swapchain_image(self.handle, xr.SwapchainImageWaitInfo(timeout=WAIT_NS))
            self._ctx.__enter__()  # as above
            framebuffer = self._framebuffers[number]
            framebuffer.viewport = (0, 0, *self.size)
            shown.draw(texture, framebuffer, linear=self.pixels.linear)
            if keep:
                kept = read(framebuffer)
            xr.release_swapchain_image(self.handle, xr.SwapchainImageReleaseInfo())
        return kept

    def close(self) -> None:
        for framebuffer in self._framebuffers:  # the textures are the runtime's
            framebuffer.release()
        try:
            self._xr.destroy_swapchain(self.handle)
        except self._xr.exception.ErrorResult:
            pass  # lost with its session


def read(framebuffer: moderngl.Framebuffer) -> np.ndarray:
    """(H, W, 3) float32 of what lies in it, row 0 on top."""
    width, height = framebuffer.size
    data = framebuffer.read(components=3, alignment=1, dtype="f4")
    return np.frombuffer(data, np.float32).reshape(height, width, 3)[::-1]
