"""What is decided so far, in a folder: who is interrupted goes on from there with the same command.

FOLDER/inputs.json says of what; FOLDER/LABEL/decisions.json lists the views of an object that are
decided, and FOLDER/LABEL/NUMBER.png are the masks.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from shapeshift.decomposition.masks.label_maps import read_grey, write_label_map
from shapeshift.decomposition.masks.segmenter import Candidate
from shapeshift.runtime_models.files.json_fields import saved_object
from shapeshift.runtime_models.files.whole_file import make_folders, whole_folder, write_whole
from shapeshift.runtime_models.model import BadFile

INPUTS, DECISIONS = "inputs.json", "decisions.json"
MOST_BYTES = 8 << 20  # of a list of decisions
WHITE = 255


@dataclass
class MaskJournal:
    """Candidates that were taken, by object and view; None where none was."""

    folder: Path
    taken: dict[int, dict[int, float | None]] = field(default_factory=dict)  # scores
    resumed: int = 0  # decisions that were there

    def known(self, label: int, view: int) -> bool:
        return view in self.taken.get(label, {})

    def candidates(self, label: int, view: int, size: tuple[int, int]) -> list[Candidate]:
        """What was taken then, as the only candidate.  Raises BadFile."""
        score = self.taken[label][view]
        if score is None:
            return []
        path = self.folder / str(label) / f"{view}.png"
        mask = read_grey(path, size[0] * size[1]) == WHITE
        if mask.shape != size[::-1]:
            raise BadFile(f"{path}: not of its photo's size; remove {self.folder}.")
        return [Candidate(mask, score)]

    def write(self, label: int, view: int, taken: Candidate | None) -> None:
        """The mask first, then the list that names it: what is killed between is asked again."""
        folder = make_folders(self.folder, str(label))
        if taken is not None:
            write_label_map(np.where(taken.mask, WHITE, 0).astype(np.uint8), folder / f"{view}.png")
        rows = self.taken.setdefault(label, {})
        rows[view] = None if taken is None else taken.score
        text = json.dumps({str(number): score for number, score in rows.items()})
        write_whole(folder / DECISIONS, text.encode())


def open_journal(folder: Path, inputs: dict[str, object]) -> MaskJournal:
    """The journal of these inputs, with what it holds; of others it begins anew.

    Raises BadFile where the folder holds what is no journal.
    """
    journal = MaskJournal(folder)
    if folder.exists() or folder.is_symlink():
        refuse_other(folder)
        if saved_object(folder / INPUTS, MOST_BYTES) == inputs:
            for path in folder.glob(f"*/{DECISIONS}"):
                rows = decisions_of(saved_object(path, MOST_BYTES))
                if path.parent.name.isdecimal():
                    journal.taken[int(path.parent.name)] = rows
                    journal.resumed += len(rows)
            return journal
    folder.parent.mkdir(parents=True, exist_ok=True)
    with whole_folder(folder) as new:  # with its inputs, or not at all
        write_whole(new / INPUTS, json.dumps(inputs, indent=1).encode())
    return journal


def refuse_other(folder: Path) -> None:
    """Nothing that is not ours is removed.  Raises BadFile."""
    ours = folder.is_dir() and not folder.is_symlink()
    names = {path.name for path in folder.iterdir()} if ours else set()
    known = not names or INPUTS in names  # an empty one was being made, or removed
    if not (ours and known and all(name == INPUTS or name.isdecimal() for name in names)):
        raise BadFile(
            f"{folder} is where unfinished masks are kept, and holds something else; move it away."
        )


def decisions_of(rows: dict) -> dict[int, float | None]:
    """Of a list as it stands in a file; what is no decision is asked again."""
    return {
        int(view): score
        for view, score in rows.items()
        if view.isdecimal() and (score is None or isinstance(score, float | int))
    }
