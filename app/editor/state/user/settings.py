"""What a person has set and finds again at the next start: text, panel, language, window."""

import json
from dataclasses import dataclass, field, fields
from pathlib import Path

from shapeshift.runtime_models.files.json_fields import is_number, saved_object
from shapeshift.runtime_models.files.whole_file import write_whole

FILE = "settings.json"
LARGEST = 1 << 16  # bytes; a few numbers are never so long
TEXT_SIZES = (0.75, 0.9, 1.0, 1.1, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)
LONGEST_WORD = 40  # letters
MOST_SECTIONS = 50
FARTHEST_PX, LEAST_SIDE_PX = 32_000, 200  # of a window's place and size
PLAIN_DPI = 110.0  # pixels an inch up to which text of 15 pixels is read without leaning forward
HIGH_PX = 1440.0  # of a monitor: above, such text is small, whatever inches the monitor tells
PLAUSIBLE_MM = (120.0, 1500.0)  # height of a monitor; projectors and screens in memory say 0 or 1


@dataclass
class ProgramSettings:
    """In a file of the folder; a broken or missing one counts as empty, and so does each value."""

    folder: Path | None = None  # None: nothing is kept
    text_size: float | None = None  # None: by the monitor
    panel_open: bool | None = None  # None: as there is room
    language: str = "en"  # code of a table of texts
    temperature: str = ""  # unit of legends; "": as the scene has it
    lengths: str = ""  # unit of what is measured; "": metres
    palette: str = ""  # of value stops; "": the scene's own
    place: tuple[int, int, int, int] | None = None  # left, top, width, height of the window
    sections: dict[str, bool] = field(default_factory=dict)  # of the panel, that a hand has moved
    tool: str = ""  # of the bar; "": the first

    @staticmethod
    def read(folder: Path) -> "ProgramSettings":
        found = saved_object(folder / FILE, LARGEST)
        size, panel = found.get("text_size"), found.get("panel_open")
        if not (is_number(size) and TEXT_SIZES[0] <= size <= TEXT_SIZES[-1]):
            size = None
        return ProgramSettings(
            folder,
            None if size is None else float(size),
            panel if isinstance(panel, bool) else None,
            a_word(found.get("language")) or "en",
            a_word(found.get("temperature")),
            a_word(found.get("lengths")),
            a_word(found.get("palette")),
            a_place(found.get("place")),
            some_sections(found.get("sections")),
            a_word(found.get("tool")),
        )

    def keep(self) -> None:
        """Writes the file; OSError where the folder cannot be written."""
        if self.folder is None:
            return
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "folder"}
        self.folder.mkdir(parents=True, exist_ok=True)
        write_whole(self.folder / FILE, json.dumps(values, indent=1).encode())


def a_word(value: object) -> str:
    """A short text; "" for anything else."""
    return value if isinstance(value, str) and len(value) <= LONGEST_WORD else ""


def a_place(value: object) -> tuple[int, int, int, int] | None:
    """Left, top, width, height of a window that some desktop could have shown."""
    if not (isinstance(value, list) and len(value) == 4 and all(type(n) is int for n in value)):
        return None
    left, top, width, height = value
    near = max(abs(left), abs(top)) <= FARTHEST_PX
    sized = LEAST_SIDE_PX <= min(width, height) and max(width, height) <= FARTHEST_PX
    return (left, top, width, height) if near and sized else None


def some_sections(value: object) -> dict[str, bool]:
    """Which sections are open, by name."""
    if not isinstance(value, dict):
        return {}
    good = {k: v for k, v in value.items() if a_word(k) and isinstance(v, bool)}
    return dict(list(good.items())[:MOST_SECTIONS])


def default_text_size(high_px: float, high_mm: float, desktop_scale: float) -> float:
    """The text size for a monitor that is so high, in logical pixels and in millimetres.

    A desktop that has been set to a scale has been set by a person: only what it lacks to a
    readable size is added.  From the inches where they can be true, never less than from the
    pixels alone: 1.5 at 3840x2160.
    """
    by_inches = 1.0
    if PLAUSIBLE_MM[0] <= high_mm <= PLAUSIBLE_MM[1]:
        by_inches = high_px / (high_mm / 25.4) / PLAIN_DPI
    wanted = max(by_inches, high_px / HIGH_PX) / desktop_scale
    at_least_1 = [size for size in TEXT_SIZES if size >= 1]
    return min(at_least_1, key=lambda size: abs(size - wanted))


def other_text_size(now: float, step: int) -> float:
    """The next larger (1) or smaller (-1) of the sizes; the same at the end."""
    sizes = [size for size in TEXT_SIZES if (size - now) * step > 1e-6]
    return min(sizes, key=lambda size: abs(size - now), default=now)
