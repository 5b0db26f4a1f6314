"""launch.py view: what may be asked, known before OpenGL is imported."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from shapeshift.app.command_line import (
    CONTROL,
    EXPERT,
    POSITIONAL,
    REGIONS,
    SECTIONS,
    SIZE,
    Debug,
    Opt,
)
from shapeshift.app.opening import DrawingOptions


@dataclass(frozen=True)
class Options(DrawingOptions):
    """Open a scene in a window."""

    scenes: Annotated[tuple[Path, ...], POSITIONAL] = ()
    """Packages, splats of any known format, folders of layers, scene files, and files of cameras to
    step through.  Default: the bundled demo."""
    x: Annotated[str, CONTROL] = ""
    """Where the slider stands at the start: a stop by its name, or a number from 0 to 1.  Default:
    the first stop."""
    camera: Path | None = None
    """File or folder of cameras: starts at the first, N and P step through them (docs/cameras.md).
    Default: the whole scene in view."""
    size: Annotated[str, SIZE] = ""
    """WIDTHxHEIGHT of the window in pixels.  Default: 1280x720, and as much larger as the text
    is."""
    select: Annotated[tuple[str, ...], REGIONS] = ()
    """Regions with an X of their own (a stop's name or a number): sphere:x,y,z:radius:X[:border]
    box:x,y,z:hx,hy,hz:X[:border] half:x,y,z:nx,ny,nz:X[:border] lens:degrees:X[:border].  Default:
    none."""
    section: Annotated[tuple[str, ...], SECTIONS] = ()
    """Planes and boxes in the world that cut all objects, as of render: plane:nx,ny,nz,d keeps the
    places p with n.p <= d, box:x,y,z:hx,hy,hz its inside; then :capped, :hard or :soft:WIDTH for
    the edge, and :beyond=X to show another stop there.  Default: none."""
    compare: Annotated[str, Opt(metavar="SCENE")] = ""
    """Another scene (or scene@Stop, scene@0.5) to compare with: a line parts the two pictures.
    Default: none."""
    play: bool = False
    """Let the objects of a scene file fall and be carried from the start; T switches it."""
    pictures: Path | None = None
    """Folder for the pictures that F12 saves and the views that K keeps; scenes and exports go
    beside it.  Default: Shapeshift/pictures among your documents."""
    browser: bool = False
    """Show it as a page in this computer's browser in place of a window, as happens by itself where
    there is no OpenGL 4.3."""
    panel: bool = True
    """Show the panel over the picture; H switches it."""
    target_ms: Annotated[float | None, EXPERT] = None
    """Milliseconds that a frame may take: the setting is chosen by a chart that is measured at the
    start.  Default: no limit, the exact picture."""
    floor_db: Annotated[float | None, EXPERT] = None
    """PSNR in dB against the exact picture below which --target-ms never goes.  Default: 35."""
    fov_y: Annotated[float, EXPERT] = 0.0
    """Degrees from top to bottom, for a camera file that says nothing about the lens; 0: not
    known."""
    drawing: Annotated[Literal["auto", "quads", "tiles"], EXPERT] = "auto"
    """What draws the splats: OpenGL quads, or OpenCL tiles, which need no GPU."""
    debug: Annotated[Debug, EXPERT] = ""
    """Debug view to start in; G goes through them.  Default: the picture."""
    screenshot: Annotated[Path | None, EXPERT] = None
    """Write a picture of the whole window to this file after --frames frames, and end.  Default:
    the window stays."""
    frames: Annotated[int, EXPERT] = 3
    """How many frames to draw before the --screenshot."""
