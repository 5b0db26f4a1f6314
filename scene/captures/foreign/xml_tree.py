"""XML of other programs: a tree of plain elements, and nothing that a document type may do."""

from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from shapeshift.runtime_models.files.memory import Memory, refuse_empty
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture_rules import LARGEST_NUMBER

A_BYTE = 48  # of memory for each byte: "<a b=''/>" becomes an element with a dictionary, 400
MOST_BYTES = 1 << 30
DEEPEST = 100  # elements in elements


def read_xml(path: Path) -> Element:
    """The root; the memory of the tree is charged before.

    A document type is refused: with entities a few lines become gigabytes, or files of this
    machine.  Raises BadFile.
    """
    refuse_empty(path)
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise BadFile(f"{path} has {size:,} bytes; at most {MOST_BYTES:,} are read.")
    Memory().of(path).charge(A_BYTE * size, "its elements")
    builder, depth = TreeBuilder(), [0]
    parser = expat.ParserCreate()
    parser.buffer_text = True

    def start(name: str, attributes: dict) -> None:
        depth[0] += 1
        if depth[0] > DEEPEST:
            raise BadFile(f"{path}: elements lie more than {DEEPEST} deep in each other.")
        builder.start(name.rpartition(":")[2], attributes)

    def end(name: str) -> None:
        depth[0] -= 1
        builder.end(name.rpartition(":")[2])

    def refuse(*_: object) -> None:
        raise BadFile(
            f"{path} has a document type (DOCTYPE), which no program of cameras writes; export it "
            "again, or take that line out."
        )

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(path.read_bytes(), True)
        return builder.close()
    except BadFile:  # which is a ValueError
        raise
    except (expat.ExpatError, ValueError, AssertionError, LookupError) as error:
        raise BadFile(f"{path} is no XML ({error!s:.60}); export it again.") from None


def text_of(element: Element | None, name: str, default: str = "") -> str:
    found = None if element is None else element.find(name)
    return default if found is None or found.text is None else found.text.strip()


def number_of(
    element: Element | None, name: str, where: str, default: float | None = None
) -> float:
    """The number under a name.  Raises BadFile for none where there is no default."""
    text = text_of(element, name)
    if not text and default is not None:
        return default
    try:
        return finite(float(text))
    except ValueError:
        raise BadFile(f"{where}: {name} is {text[:40]!r}; a number is wanted") from None


def numbers_in(text: str, count: int, where: str) -> list[float]:
    try:
        values = [finite(float(word)) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count:
        raise BadFile(f"{where}: {count} numbers are wanted; export it again")
    return values


def finite(value: float) -> float:
    if not abs(value) <= LARGEST_NUMBER:  # NaN is not
        raise ValueError
    return value
