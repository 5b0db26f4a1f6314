"""Files to scenes."""

from dataclasses import replace
from typing import Any, Literal

from shapeshift.api.arguments import PathText, Progress
from shapeshift.api.opened import OpenedScene
from shapeshift.api.read import in_words_of_python, opened, read_document
from shapeshift.api.scene import Scene
from shapeshift.app.opening import DrawingOptions
from shapeshift.app.paths import plain
from shapeshift.runtime_models.model import BadFile


def load(
    path: PathText,
    *,
    mode: Literal["", "cumulative", "exclusive"] = "",
    up: Literal["", "+X", "-X", "+Y", "-Y", "+Z", "-Z"] = "",
    flip: bool = False,
    strict: bool = False,
    allow_huge: bool = False,
    max_splats: int = 0,
    budget: int | str = "",
    cache_mb: int = 2048,
    memory_gb: float = 0.0,
    progress: Progress | None = None,
) -> Scene:
    """Opens whatever the viewer opens: a package, splats of any known format, a folder of layers,
    the folder of a training run, or a scene file of objects (docs/formats.md, docs/scene.md).

    mode: how layers add up.  up: the axis of the file that points up, where its format does not
    say; flip: half a turn after that.  strict: refuse a file that needs repair.  allow_huge: open a
    file whose splats would lie thousands deep over every pixel.  max_splats: neighbours become one
    until there are no more than these; 0 is all.  memory_gb: what files may take while they are
    read; 0 is 64 bytes for each byte of a file.  budget: of scenes in levels of detail draw at most
    so many splats, 2_000_000, "2M" or "auto", finer where more pixels show it; cache_mb: of such
    files that are kept decoded.  progress: called with (what, part 0..1) from this
    thread.

    Raises BadFile, one sentence: what was found, what is wanted, what to do.  What was repaired is
    in `scene.findings`.

        scene = ss.load("workshop.shift")
        scan = ss.load("scan.ply", up="+Z")
    """
    asked = DrawingOptions(
        up=up, flip=flip, mode=mode, strict=strict, allow_huge=allow_huge, max_splats=max_splats,
        budget=str(budget), cache_mb=cache_mb, memory=memory_gb,
    )  # fmt: skip
    reading = replace(asked.reading(), progress=progress)
    document, found = read_document(path, reading)
    return Scene(document, found, up=up, flip=flip)


def info(scene: PathText | Scene) -> dict[str, Any]:
    """What is in a scene: format, splats, stops, networks, objects; or what was found in posed
    photos; JSON types alone, as `shapeshift info --json`.

    Of a scene that lies nowhere on disk, `bytes` is missing.  Raises BadFile.

        ss.info("workshop.shift")["splats"]
        [stop["name"] for stop in ss.info(scene)["stops"]]
    """
    from shapeshift.app.inspection.capture_facts import capture_facts

    if isinstance(scene, OpenedScene):
        return scene.info()
    try:
        return opened(scene).info()
    except BadFile:
        if (capture := capture_facts(plain(scene))) is None:
            raise
        return capture


def lint(
    path: PathText,
    *,
    mode: Literal["", "cumulative", "exclusive"] = "",
    up: Literal["", "+X", "-X", "+Y", "-Y", "+Z", "-Z"] = "",
    flip: bool = False,
    strict: bool = False,
    allow_huge: bool = False,
    memory_gb: float = 0.0,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """What is wrong with a file, and what opening it repairs: the result of `shapeshift lint
    --json`, where `findings` has what, rows, count, done and repaired of each; nothing is drawn.

    The rest: format, splats, bytes, extent_m (the 1st to 99th percentile, metres), origin_m,
    splats_over_a_pixel.  Arguments as of `load`.  Raises UsageError, and BadFile for a file that is
    refused.

        for found in ss.lint("scan.ply")["findings"]:
            print(found["what"], found["rows"], found["done"])
    """
    from shapeshift.app.commands.lint import Options, examine

    options = Options(
        plain(path), up=up, flip=flip, mode=mode, strict=strict, allow_huge=allow_huge,
        memory=memory_gb,
    )  # fmt: skip
    with in_words_of_python():
        return examine(options, progress or (lambda what, part: None))
