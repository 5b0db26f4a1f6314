"""Files to documents, for `load` and for whatever takes a scene or the path of one."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from shapeshift.api.arguments import PathText
from shapeshift.api.opened import OpenedScene
from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import plain
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.scene.document.scene_file import is_scene_file

OPTION = re.compile(r"(?<![\w/.\\-])--(?:no-)?([a-z][a-z-]*[a-z]|[a-z])")  # as a sentence has it
OF_OBJECTS = ("mode", "up", "flip")  # what a scene file says for each object


def read_document(path: PathText, reading: Reading) -> tuple[Document, Path]:
    """What lies at a path, and that path, absolute or from where the program was started.

    Raises BadFile, UsageError.
    """
    from shapeshift.runtime_models.read_scene import read_model
    from shapeshift.scene.document.read_scene_file import read_scene_file
    from shapeshift.scene.document.scene_file import read_models, scene_of

    path = plain(path)
    if not is_scene_file(path):
        return Document.of(read_model(path, reading)), path
    for name in OF_OBJECTS:
        if getattr(reading, name):
            raise UsageError(f"{name} is for one model; in {path.name} each object has its own.")
    file = read_scene_file(path)
    file, models = read_models(file, reading)
    scene = scene_of(file, models)
    if not scene.objects:
        raise BadFile(f"{path} has no object; nothing is there to be drawn.")
    return Document(scene, file), path


def opened(scene: PathText | OpenedScene) -> OpenedScene:
    """The scene itself, or the one in that file."""
    return (
        scene if isinstance(scene, OpenedScene) else OpenedScene(*read_document(scene, Reading()))
    )


@contextmanager
def in_words_of_python() -> Iterator[None]:
    """Where the work of a command refuses something: its sentence, with --sh-degree as sh_degree.

    Raises UsageError, BadFile.
    """
    try:
        yield
    except (UsageError, BadFile) as refusal:
        said = OPTION.sub(lambda found: found[1].replace("-", "_"), str(refusal))
        raise type(refusal)(said) from None
