"""What the program makes of captures as other people's tools leave them:
docs/bench/strange_captures.csv.

    python3 tools/scene/strange_captures.py [--check]

Every situation of tests/support/scene/strangers (whose situations.py says how to add one) is made
in a folder of its own and read; --check compares with what is expected, and writes nothing.
"""

import argparse
import csv
import io
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

ROWS = ROOT / "docs/bench/strange_captures.csv"
HEAD = "# python3 tools/scene/strange_captures.py\n"


def table_of(rows: Sequence[tuple]) -> str:
    """rows: situations with what came out."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("situation", "what people have", "what comes out"))
    writer.writerows((s.name, s.met, found) for s, found in rows)
    return HEAD + text.getvalue()


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
    if not options.check:
        ROWS.write_text(table_of(rows), encoding="utf-8")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
