"""objects.json as read_specs takes it."""

import json
from pathlib import Path

from shapeshift.decomposition.masks.specs import FORMAT, ObjectSpecs, object_row
from shapeshift.runtime_models.files.whole_file import write_whole


def write_specs(specs: ObjectSpecs, path: str | Path) -> None:
    """The inverse of read_specs: whole or not at all; what has its usual value is left out."""
    out = {"format": FORMAT, "objects": [object_row(spec) for spec in specs.objects]}
    write_whole(Path(path), (json.dumps(out, indent=1, ensure_ascii=False) + "\n").encode())
