"""What a renderer draws, decodes and sorts with, where that is left to it."""

import moderngl

from shapeshift.renderer.drawing import Drawing
from shapeshift.renderer.gl.context import is_software
from shapeshift.renderer.gl.gpu import Gpu

CHOICES = {
    "drawing": ("quads", "tiles"),
    "mlps": ("gl", "opencl", "onnxruntime"),
    "sort": ("gl", "numpy"),
}


def choose_backends(
    ctx: moderngl.Context | None, drawing: str, mlps: str, sort: str
) -> tuple[str, str, str]:
    """(drawing, mlps, sort) with "auto" replaced; ValueError for what cannot work."""
    for what, name in (("drawing", drawing), ("mlps", mlps), ("sort", sort)):
        if name != "auto" and name not in CHOICES[what]:
            raise ValueError(
                f"there is no {what} {name!r}; choose auto, {', '.join(CHOICES[what])}."
            )
    gpu = ctx is not None and not is_software(ctx)
    if drawing == "auto":
        drawing = "quads" if gpu else "tiles"
    if drawing == "tiles" and (mlps == "gl" or sort == "gl"):
        raise ValueError(
            "tiles decode and sort without GL; leave mlps and sort at auto, or draw quads."
        )
    if drawing == "quads" and ctx is None:
        raise ValueError("quads are drawn with GL; open a context, or draw tiles.")
    if drawing == "quads" and mlps == "opencl":
        raise ValueError("quads decode without OpenCL; leave mlps at auto, or draw tiles.")
    by_default = ("gl", "gl") if gpu and drawing == "quads" else ("onnxruntime", "numpy")
    if drawing == "tiles":
        by_default = ("opencl", "numpy")
    return (
        drawing,
        by_default[0] if mlps == "auto" else mlps,
        by_default[1] if sort == "auto" else sort,
    )


def open_drawing(drawing: str, gpu: Gpu | None, mlps: str, sort: str) -> Drawing:
    """The drawing that choose_backends has named; gpu None: tiles."""
    if drawing == "tiles" or gpu is None:
        # Needs OpenCL, which quads do without.
        from shapeshift.renderer.tiles.paged_tiles import PagedTiles

        return PagedTiles(mlps=mlps)
    from shapeshift.renderer.gl.paged_quads import PagedQuads

    return PagedQuads(gpu, mlps, sort)
