"""What somebody types as a length."""

import pytest

from shapeshift.app.inspection.window.ruler import parse_length


@pytest.mark.parametrize(
    "text, unit, metres",
    [
        ("0.75", "m", 0.75),
        ("75 cm", "m", 0.75),
        ("75", "cm", 0.75),
        (" 2,5 m ", "mm", 2.5),
        ("12in", "m", 0.3048),
        ("1 ft", "cm", 0.3048),
        ("0", "m", None),
        ("-1", "m", None),
        ("nan", "m", None),
        ("inf m", "m", None),
        ("a door", "m", None),
        ("", "m", None),
    ],
)
def test_a_typed_length(text, unit, metres):
    found = parse_length(text, unit)
    assert found == (metres if metres is None else pytest.approx(metres))
