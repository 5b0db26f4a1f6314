"""PLY files of other trainers whose columns and comments change the picture."""

import numpy as np
import pytest

from shapeshift.runtime_models.colors.spherical_harmonics import COEFFICIENTS
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.formats import read_plain, read_raw
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.splats.ply_files import names_of, random_rows, write_rows

HUGE = Reading(allow_huge=True)


def filtered(row: dict, f: float) -> tuple[list[float], float]:
    """Mip-Splatting's own two lines for one splat: sigmas and opacity, in plain float64."""
    sigma = [np.exp(np.float64(row[f"scale_{i}"])) for i in range(3)]
    wider = [np.sqrt(s * s + f * f) for s in sigma]
    opacity = 1 / (1 + np.exp(-np.float64(row["opacity"])))
    share = np.sqrt(np.prod([s * s for s in sigma]) / np.prod([w * w for w in wider]))
    return wider, opacity * share


@pytest.mark.parametrize("encoding", ["binary_little_endian", "binary_big_endian", "ascii"])
@pytest.mark.parametrize("kind", ["float", "double"])
def test_mip_splatting_s_filter_is_in_sizes_and_opacities(tmp_path, encoding, kind):
    rows = random_rows(300, [*names_of(4), "filter_3D"])
    rng = np.random.default_rng(1)
    for row in rows:
        row["filter_3D"] = float(np.float32(rng.choice([0.0, 1e-3, 0.05, 20.0])))
        for i in range(3):
            row[f"scale_{i}"] -= 4
    path = write_rows(tmp_path / "a.ply", rows, {"filter_3D": kind}, encoding)
    got = read_plain(path, HUGE)
    for row, scales, opacity in zip(rows, got.scales, got.opacity, strict=True):
        sigma, seen = filtered(row, row["filter_3D"])
        np.testing.assert_allclose(scales, sigma, rtol=3e-6)
        np.testing.assert_allclose(opacity, seen, rtol=3e-5, atol=1e-9)
    assert "filter_3D" not in got.extra and "filter_3D" in got.findings[0].what
    write_ply(got, tmp_path / "b.ply")
    again = read_plain(tmp_path / "b.ply", HUGE)
    assert b"filter_3D" not in (tmp_path / "b.ply").read_bytes()
    np.testing.assert_allclose(again.scales, got.scales, rtol=1e-6)
    np.testing.assert_allclose(again.opacity, got.opacity, atol=3e-7)


def test_a_filter_at_the_ends_of_its_numbers(tmp_path):
    """0 with a scale of -Inf stays flat and seen; what is no number or over 1e12 m is no size and
    goes; a negative one counts without its sign; what hides its splat is said."""
    rows = random_rows(11, [*names_of(1), "filter_3D"])
    for row in rows:
        row["filter_3D"] = 0.01
    rows[0]["filter_3D"], rows[0]["scale_2"] = 0.0, float("-inf")
    rows[1]["filter_3D"] = float("nan")
    rows[2]["filter_3D"] = float("inf")
    rows[3]["filter_3D"] = -0.01
    rows[4]["opacity"] = float("inf")
    rows[5]["opacity"] = float("-inf")
    rows[8]["filter_3D"], rows[9]["filter_3D"], rows[10]["filter_3D"] = 1e30, 1e12, -1e12
    path = write_rows(tmp_path / "a.ply", rows, {"filter_3D": "double"})
    got = read_plain(path, HUGE)
    assert len(got.means) == 8 and (got.opacity[6:] < 1e-30).all()
    assert [(f.what, f.rows) for f in got.findings[1:4]] == [
        ("3 splats with a filter_3D that is no size in metres", (1, 2, 8)),
        ("2 splats with a negative filter_3D", (3, 10)),
        ("2 splats with a filter_3D that leaves them too faint to be seen", (9, 10)),
    ]
    with pytest.raises(BadFile, match="a filter_3D that is no size in metres"):
        read_plain(path, Reading(strict=True, allow_huge=True))
    for row in rows:
        row["filter_3D"] = 1e30
    with pytest.raises(BadFile, match="11 splats with a filter_3D that is no size"):
        read_plain(write_rows(path, rows), HUGE)
    assert got.scales[0, 2] == 0 and got.opacity[0] > 0
    sigma, seen = filtered(rows[3], 0.01)
    np.testing.assert_allclose(got.scales[1], sigma, rtol=3e-6)
    np.testing.assert_allclose(got.opacity[1], seen, rtol=3e-5)
    np.testing.assert_allclose(got.opacity[2], filtered(rows[4], 0.01)[1], rtol=3e-5)
    assert got.opacity[3] == 0


@pytest.mark.parametrize(
    "comment, up",
    [("Vertical Axis: z", "+Z"), ("vertical axis: Y", "+Y"), ("Vertical Axis: -y", "-Y"),
     ("Vertical Axis = +x", "+X"), ("a Vertical Axis: z", None)],
)  # fmt: skip
def test_a_comment_says_what_is_up(tmp_path, comment, up):
    path = write_rows(tmp_path / "a.ply", random_rows(20, names_of(1)), comments=(comment,))
    raw = read_raw(path, Reading())
    assert raw.up == (up or "-Y")
    assert [f"its comment says that {up} is up"] * (up is not None) == [
        finding.what for finding in raw.findings
    ]
    asked = read_plain(path, Reading(up="-Y", allow_huge=True))
    np.testing.assert_allclose(asked.means, raw.means * (1, -1, -1), atol=1e-6)


@pytest.mark.parametrize(
    "comments, told",
    [(["Vertical Axis: w"], "(W)"), (["Vertical Axis:"], "(nothing)"),
     (["Vertical Axis: z", "vertical axis: y"], "(Z, Y)")],
)  # fmt: skip
def test_comments_that_name_no_one_axis_are_said(tmp_path, comments, told):
    path = write_rows(tmp_path / "a.ply", random_rows(20, names_of(1)), comments=tuple(comments))
    raw = read_raw(path, Reading())
    assert raw.up == "-Y"
    assert [finding.what for finding in raw.findings] == [
        f"its comments name no one vertical axis {told}"
    ]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("f, told", [(float("nan"), "0 m"), (-0.01, "0.01 m")])
def test_the_filter_s_middle_is_of_sizes_and_numbers(tmp_path, f, told):
    rows = [row | {"filter_3D": f} for row in random_rows(9, names_of(1))]
    raw = read_raw(write_rows(tmp_path / "a.ply", rows), Reading())
    assert f"half of it over {told})" in raw.findings[0].what


def test_a_comment_of_points_says_what_is_up(tmp_path):
    rows = [{"x": float(i), "y": float(i % 3), "z": float(i % 5)} for i in range(30)]
    path = write_rows(tmp_path / "a.ply", rows, comments=("Vertical Axis: z",))
    assert read_raw(path, Reading()).up == "+Z"


@pytest.mark.parametrize("encoding", ["binary_little_endian", "ascii"])
def test_degree_four_is_drawn_as_three_and_its_share_is_told(tmp_path, encoding):
    rows = random_rows(40, names_of(25))
    path = write_rows(tmp_path / "a.ply", rows, encoding=encoding)
    raw = read_raw(path, Reading())
    assert raw.sh.shape == (40, COEFFICIENTS[-1], 3) and raw.extra.keys() <= {"nx", "ny", "nz"}
    fourth = whole = 0.0
    for row, sh in zip(rows, raw.sh, strict=True):
        for channel in range(3):
            rest = [row[f"f_rest_{24 * channel + j}"] for j in range(24)]
            np.testing.assert_allclose(sh[1:, channel], rest[:15], rtol=1e-6)
            fourth += sum(v * v for v in rest[15:])
            whole += sum(v * v for v in rest)
    (found,) = raw.findings
    assert "9 coefficients of SH degree 4" in found.what and not found.repaired
    assert f"{100 * fourth / whole:.2g} % of what varies" in found.done
