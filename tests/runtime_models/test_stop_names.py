"""Names of stops as people read them."""

import pytest

from shapeshift.runtime_models.stop_names import stems_named


@pytest.mark.parametrize(
    ("stems", "names"),
    [
        (["0_normal", "1_ice", "2_fire"], ["normal", "ice", "fire"]),
        (["01 - skin", "02.muscle", "bone"], ["skin", "muscle", "bone"]),
        (["0_leg", "1_leg"], ["0_leg", "1_leg"]),  # two would have the same
        (["0_", "1_leg"], ["0_", "1_leg"]),  # one would have none
        (["2024", "2025"], ["2024", "2025"]),
        (["layer0", "layer1", "3d_scan"], ["layer0", "layer1", "3d_scan"]),
        ([], []),
    ],
)
def test_numbers_that_only_order_files_are_no_part_of_a_name(stems, names):
    assert stems_named(stems) == names
