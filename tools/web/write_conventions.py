"""Writes what the page shares with Python: python3 tools/web/write_conventions.py

web/conventions.js and web/entries.d.ts.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from shapeshift.runtime_models.files.whole_file import write_whole  # noqa: E402
from tools.web.conventions import conventions_text, entries_text  # noqa: E402

write_whole(ROOT / "web" / "conventions.js", conventions_text().encode())
write_whole(ROOT / "web" / "entries.d.ts", entries_text().encode())
