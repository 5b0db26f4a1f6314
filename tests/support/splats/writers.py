"""The formats that are written, as cases of a test; those of an absent package are skipped."""

from importlib.util import find_spec

import pytest

from shapeshift.runtime_models.splats.write_plain import WRITERS

WITHOUT = pytest.mark.skipif(find_spec("pxr") is None, reason="usd-core is not installed")
EACH_WRITER = pytest.mark.parametrize(
    "writer",
    [pytest.param(w, marks=WITHOUT if w.name == "USD" else (), id=w.ending) for w in WRITERS],
)
