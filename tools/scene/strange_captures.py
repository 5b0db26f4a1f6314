"""What the program makes of captures as other people's tools leave them: the table in
docs/capture.md.

    python3 tools/scene/strange_captures.py [--check]

Every situation of tests/support/scene/strangers (whose situations.py says how to add one) is made
in a folder of its own and read; --check compares with what is expected, and writes nothing.
"""

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

DOCS = ROOT / "docs/capture.md"
BEGIN, END = "<!-- strange captures: written by a program -->\n", "<!-- end -->\n"
HEAD = "| situation | what people have | what comes out |\n|---|---|---|\n"


def table_of(rows: Sequence[tuple]) -> str:
    """rows: situations with what came out."""
    cells = [(s.name, s.met, found) for s, found in rows]
    return HEAD + "".join(f"| {' | '.join(map(plain, row))} |\n" for row in cells)


def plain(text: str) -> str:
    """As a cell of a table in Markdown."""
    for sign in "\\|<>*_":
        text = text.replace(sign, f"\\{sign}")
    return text


def table_in(text: str) -> str:
    return text.split(BEGIN)[1].split(END)[0] if BEGIN in text and END in text else ""


def main() -> int:
    from tests.support.scene.strangers.situations import situations

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    rows, wrong = [], 0
    with tempfile.TemporaryDirectory() as place:
        for number, (module, situation) in enumerate(situations()):
            found = situation.look(situation.make(Path(place) / str(number)))
            rows.append((situation, found))
            if found != situation.expected:
                wrong += 1
                sys.stderr.write(f"{module}: {situation.name}: {found!r}, expected "
                                 f"{situation.expected!r}\n")  # fmt: skip
    text = DOCS.read_text()
    if not options.check:
        before, _, rest = text.partition(BEGIN)
        DOCS.write_text(before + BEGIN + table_of(rows) + END + rest.partition(END)[2])
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
