"""launch.py serve: a scene as a page on this computer, shown anew when its file changes."""

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import CONTROL, EXPERT, POSITIONAL
from shapeshift.app.opening import PATIENCE_S, ReadingOptions, progress_after
from shapeshift.app.terminal import say

if TYPE_CHECKING:
    from shapeshift.app.document import Document

LOOK_S = 0.5  # how often the file is looked at


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Show a scene in the browsers of this computer, and anew when its file changes."""

    scene: Annotated[Path, POSITIONAL]
    """A package, splats of any known format, a folder of layers or a scene file."""
    port: int = 8000
    """Of the address; 0: any that is free."""
    x: Annotated[str, CONTROL] = ""
    """Where the slider stands at first: a stop by its name, or a number from 0 to 1.  Default: the
    first stop, and in a scene file what it says for each object."""
    for_: Literal["any", "quest"] = "any"
    """quest: in a headset that has no PC the page leaves out what costs little, from 46 dB on, and
    says so (docs/headset.md)."""
    exact: Annotated[bool, EXPERT] = False
    """Tables as float32 instead of 8 to 24 bits."""


def run(options: Options) -> int:
    from shapeshift.app.page.page_server import PageServer

    server = PageServer(options.port)  # a port that is taken is said before the scene is read
    server.files = page_files(options)
    say(
        f"{options.scene.name} is at {server.address}",
        f"A headset on USB: adb reverse tcp:{server.port} tcp:{server.port}, and in its browser "
        f"{server.address.replace('127.0.0.1', 'localhost')}",
        "Only this computer reaches it, and only with this address.  Ctrl-C ends it.",
    )
    try:
        with server:
            follow(options, server)
    except KeyboardInterrupt:
        say("Ended.")
    return 0


def follow(options: Options, server) -> None:
    """Looks at the files until somebody interrupts it, and waits for those that are written."""
    shown = seen = state_of(options.scene)
    while True:
        time.sleep(LOOK_S)
        now = state_of(options.scene)
        if now and now == seen != shown:  # twice the same: nobody writes it any more
            shown = now
            show_anew(options, server)
        seen = now


def show_anew(options: Options, server) -> None:
    """The page of the files as they are; where they cannot be used, says so and keeps the last."""
    from shapeshift.app.errors import UsageError
    from shapeshift.runtime_models.model import BadFile

    try:
        server.files = page_files(options)
    except (BadFile, UsageError, OSError) as error:
        say(f"{options.scene.name} has changed, and the page stays as it was: {error}")
    else:
        say(f"{options.scene.name} has changed: shown anew.")


def state_of(path: Path) -> tuple:
    """What differs when a file, a file of a folder, or a model of a scene file is written."""
    import json

    paths = [path]
    try:
        if path.is_dir():
            paths = sorted(path.rglob("*"))
        elif path.suffix == ".json":
            found = json.loads(path.read_text("utf-8")).get("objects", [])
            paths += [path.parent / str(item["model"]) for item in found if item.get("model")]
        stats = [(str(part), part.stat()) for part in paths]
    except (OSError, ValueError, AttributeError, TypeError):
        return ()
    return tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats)


def page_files(options: Options) -> dict[str, bytes]:
    """The files of the page.  Raises BadFile, UsageError."""
    from shapeshift.app.page.page_file import folder_files
    from shapeshift.app.page.page_scene import PageSettings, coarse_scene, page_scene

    document = document_of(options)
    title = options.scene.name.removesuffix(".scene.json").rsplit(".", 1)[0]
    settings = PageSettings(title, exact=options.exact, profile=options.for_)
    with progress_after(PATIENCE_S) as progress:
        scene = page_scene(document, settings, progress)
    return folder_files(title, scene, coarse_scene(document, settings))


def document_of(options: Options) -> "Document":
    """What is shown, at its x, with a pace between its stops.  Raises BadFile, UsageError."""
    from shapeshift.app.document import open_document
    from shapeshift.app.pace import with_pace
    from shapeshift.runtime_models.model import AnchorModel
    from shapeshift.scene.scene import Scene

    document = open_document(options.scene, options)
    if options.x:
        document = document.placed(options.x)
    if not document.file:
        (obj,) = document.scene.objects
        if isinstance(obj.model, AnchorModel):
            document = replace(document, scene=Scene((replace(obj, model=with_pace(obj.model)),)))
    return document
