"""The runtime's images: colours with their one conversion on the way, and depths."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np

from shapeshift.vr.openxr.gl_depth import DepthFramebuffers
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


def choose_format(
    offered: list[int], wanted: str = "", formats: Sequence[SwapchainFormat] = FORMATS
) -> SwapchainFormat:
    """The best of `formats` among the runtime's, or the one that is named; ValueError for none."""
    known = [each for each in formats if each.gl in offered]
    if wanted:
        known = [each for each in known if each.name == wanted]
    if not known:
        names = ", ".join(hex(each) for each in offered)
        raise ValueError(f"no format of {wanted or 'ours'} among the runtime's ({names}).")
    return known[0]


# Of depth, the finest first: floats keep what is far apart.
DEPTH_FORMATS = (
    SwapchainFormat(0x8CAC, "DEPTH_COMPONENT32F", True, "f4"),
    SwapchainFormat(0x81A6, "DEPTH_COMPONENT24", True, "f4"),
    SwapchainFormat(0x81A5, "DEPTH_COMPONENT16", True, "f4"),
)


class Images:
    """Images of (width, height) pixels of the runtime's, and their turn-taking."""

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
        deep = pixels in DEPTH_FORMATS
        drawn = use.DEPTH_STENCIL_ATTACHMENT_BIT if deep else use.COLOR_ATTACHMENT_BIT
        info = xr.SwapchainCreateInfo(
            usage_flags=drawn | use.SAMPLED_BIT,
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
        self.textures = [int(image.image) for image in images]  # GL's names

    @contextmanager
    def acquired(self) -> Iterator[int]:
        """Within it the image of that number is ours; afterwards the runtime has it."""
        xr = self._xr
        with self._instance.asked("take a picture"):
            number = xr.acquire_swapchain_image(self.handle, xr.SwapchainImageAcquireInfo())
            xr.wait_swapchain_image(self.handle, xr.SwapchainImageWaitInfo(timeout=WAIT_NS))
            self._ctx.__enter__()  # as above
            yield number
            xr.release_swapchain_image(self.handle, xr.SwapchainImageReleaseInfo())

    @property
    def whole(self) -> Any:
        """The latest image that was handed over, as layers name it."""
        xr = self._xr
        rect = xr.Rect2Di(xr.Offset2Di(0, 0), xr.Extent2Di(*self.size))
        return xr.SwapchainSubImage(self.handle, rect, 0)

    def close(self) -> None:
        """The textures are the runtime's."""
        try:
            self._xr.destroy_swapchain(self.handle)
        except self._xr.exception.ErrorResult:
            pass  # lost with its session


class Swapchain(Images):
    """Colours: the picture of an eye, or of a layer."""

    def __init__(self, *made: Any) -> None:
        super().__init__(*made)
        self._framebuffers = [
            self._ctx.framebuffer(
                [self._ctx.external_texture(texture, self.size, 4, 0, self.pixels.dtype)]
            )
            for texture in self.textures
        ]

    def show(self, texture: moderngl.Texture, shown: Blit, keep: bool = False):
        """Hands a display-encoded picture over, row 0 at the bottom.

        With `keep` the runtime's image is read back, (H, W, 4) float32 with row 0 on top and the
        values that lie in it; else None.
        """
        with self.acquired() as number:
            framebuffer = self._framebuffers[number]
            framebuffer.viewport = (0, 0, *self.size)
            shown.draw(texture, framebuffer, linear=self.pixels.linear)
            return read(framebuffer, 4) if keep else None

    def close(self) -> None:
        for framebuffer in self._framebuffers:
            framebuffer.release()
        super().close()


class DepthSwapchain(Images):
    """Depths of an eye's picture, 0 at near and 1 at far."""

    def __init__(self, *made: Any) -> None:
        super().__init__(*made)
        self._made = DepthFramebuffers(self._ctx)
        self._framebuffers = [self._made.around(texture) for texture in self.textures]

    def fill(self, write: Callable[[moderngl.Framebuffer], None], keep: bool = False):
        """Hands over what `write` draws; with `keep` also returns it, (H, W) float32, row 0 on top,
        else None.
        """
        with self.acquired() as number:
            framebuffer = self._framebuffers[number]
            framebuffer.viewport = (0, 0, *self.size)
            write(framebuffer)
            return read_depth(framebuffer, self.size) if keep else None

    def close(self) -> None:
        self._made.release()
        super().close()


def read(framebuffer: moderngl.Framebuffer, parts: int = 3) -> np.ndarray:
    """(H, W, parts) float32 of what lies in it, row 0 on top."""
    width, height = framebuffer.size
    data = framebuffer.read(components=parts, alignment=1, dtype="f4")
    return np.frombuffer(data, np.float32).reshape(height, width, parts)[::-1]


def read_depth(framebuffer: moderngl.Framebuffer, size: tuple[int, int]) -> np.ndarray:
    """(H, W) float32 of its depth, row 0 on top."""
    width, height = size
    area = (0, 0, width, height)
    data = framebuffer.read(area, components=1, attachment=-1, alignment=1, dtype="f4")
    return np.frombuffer(data, np.float32).reshape(height, width)[::-1]
