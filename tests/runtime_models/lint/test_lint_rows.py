"""What is done with single splats, against the rules in words, one row and one number at a time."""

import math

import numpy as np
import pytest

from shapeshift.runtime_models.files.blocks import BLOCK
from shapeshift.runtime_models.lint.lint import judge
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.plain_splats import RawSplats, Reading
from tests.support.splats.lint_scenes import copied, raw_splats

LARGEST = float(np.finfo(np.float32).max)
LONGEST_LOG = float(np.log(np.float64(LARGEST)))  # exp of the next float32 is Inf
POISON = (
    math.nan, math.inf, -math.inf, 0.0, -0.0, 1.0, -1.0, 1e-45, -1e-45, 1e-38, 79.9, 80.0, 80.1,
    88.7, 88.8, -103.0, -104.0, 1e15, 1e16, 1e-15, 1e-16, 1e30, LARGEST, -LARGEST, 1.0000001,
)  # fmt: skip


def said(raw: RawSplats, i: int) -> dict:
    """The rules for one row: {"what": ..., "done": ..., "scales": ..., "opacity": ...}."""
    numbers = {
        "a NaN or Inf position": [float(v) for v in raw.means[i]],
        "a NaN or Inf rotation": [float(v) for v in raw.wxyz[i]],
        "a NaN or Inf colour": [float(v) for v in raw.sh[i].ravel()],
    }
    scales, opacity = [float(v) for v in raw.scales[i]], float(raw.opacity[i])

    def bad(what):
        return not all(math.isfinite(v) and abs(v) <= LARGEST for v in numbers[what])

    if bad("a NaN or Inf position"):
        return {"what": ["a NaN or Inf position"]}
    if raw.log_scales:
        if any(math.isnan(s) or s > LONGEST_LOG for s in scales):
            return {"what": ["a NaN or infinite scale"]}
        sigma = [np.float32(math.exp(s)) if s > -math.inf else 0.0 for s in scales]
    else:
        if not all(map(math.isfinite, scales)):
            return {"what": ["a NaN or infinite scale"]}
        sigma = [abs(s) for s in scales]
    if bad("a NaN or Inf rotation"):
        return {"what": ["a NaN or Inf rotation"]}
    if not any(numbers["a NaN or Inf rotation"]):
        return {"what": ["a zero rotation"]}
    if math.isnan(opacity):
        return {"what": ["a NaN opacity"]}
    if bad("a NaN or Inf colour"):
        return {"what": ["a NaN or Inf colour"]}
    what = []
    if not any(sigma):
        what.append("no size")
    elif raw.log_scales and -math.inf in scales:
        what.append("a scale of -Inf along an axis")
    elif not raw.log_scales and min(scales) < 0:
        what.append("a negative scale")
    if not raw.log_scales and not any(sigma) and min(scales) < 0:
        what.append("a negative scale")
    if raw.logits:
        if math.isinf(opacity):
            what.append(f"an opacity of {'+' if opacity > 0 else '-'}Inf")
        shown = 0.0 if opacity < -700 else 1 / (1 + math.exp(-opacity))
    else:
        if not 0 <= opacity <= 1:
            what.append("an opacity outside 0..1")
        shown = min(max(opacity, 0.0), 1.0)
    return {"what": what, "scales": sigma, "opacity": shown if any(sigma) else 0.0}


@pytest.mark.parametrize("coding", [(True, True), (False, False), (True, False), (False, True)])
@pytest.mark.parametrize("count", [1, 2, 255, 256, 257, BLOCK - 1, BLOCK, BLOCK + 1])
def test_every_row_as_the_rules_in_words_say(count, coding):
    rng = np.random.default_rng(count)
    raw = raw_splats(count, seed=count, log_scales=coding[0], logits=coding[1])
    arrays = [raw.means, raw.scales, raw.wxyz, raw.opacity[:, None], raw.sh.reshape(count, -1)]
    for i in {0, count - 1, *rng.integers(0, count, min(count, 400)).tolist()}:
        for _ in range(rng.integers(1, 3)):
            array = arrays[rng.integers(len(arrays))]
            column = slice(None) if rng.random() < 0.5 else rng.integers(array.shape[1])
            array[i, column] = rng.choice(POISON)
    raw.means[0] = 0  # one that stays, whatever else is done
    raw.scales[0], raw.wxyz[0], raw.opacity[0], raw.sh[0] = 0.5, 1, 0.5, 0
    raw.means[1:] = np.where(np.abs(raw.means[1:]) > 1e9, math.nan, raw.means[1:])
    raw.labels = np.arange(count, dtype=np.int32)
    words = [said(raw, i) for i in range(count)]
    plain = judge(copied(raw), Reading(allow_huge=True))

    kept = [i for i in range(count) if "scales" in words[i]]
    assert plain.labels.tolist() == kept
    assert plain.dropped == count - len(kept)
    rows: dict[str, list[int]] = {}
    for i in range(count):
        for what in words[i]["what"]:
            rows.setdefault(what, []).append(i)
    found = {f.what.split(" with ")[1]: f for f in plain.findings}
    assert {what: (f.count, f.rows) for what, f in found.items()} == {
        what: (len(i), tuple(i[:10])) for what, i in rows.items()
    }
    want = np.array([words[i]["scales"] for i in kept])
    np.testing.assert_allclose(plain.scales, want, rtol=3e-7, atol=2e-45)
    want = np.array([words[i]["opacity"] for i in kept])
    np.testing.assert_allclose(plain.opacity, want, rtol=3e-7, atol=1e-38)
    np.testing.assert_allclose(np.linalg.norm(plain.wxyz, axis=1), 1, atol=3e-7)
    np.testing.assert_array_equal(plain.means, raw.means[kept])
    np.testing.assert_array_equal(plain.sh, raw.sh[kept])


LINEAR = {"log_scales": False, "logits": False}


@pytest.mark.parametrize(
    "coding, name, number, what, done, repaired",
    [
        ({}, "means", math.nan, "a NaN or Inf position", "dropped", True),
        ({}, "means", -math.inf, "a NaN or Inf position", "dropped", True),
        ({}, "scales", math.inf, "a NaN or infinite scale", "dropped", True),
        ({}, "scales", 88.73, "a NaN or infinite scale", "dropped", True),
        ({}, "scales", 88.72, None, "", False),
        ({}, "scales", -math.inf, "no size", "kept, invisible", False),
        ({}, "scales", -104.0, "no size", "kept, invisible", False),
        ({}, "scales", -103.0, None, "", False),  # the least float32
        (LINEAR, "scales", 0.0, "no size", "kept, invisible", False),
        (LINEAR, "scales", 1e-45, None, "", False),
        (LINEAR, "scales", -0.1, "a negative scale", "read without their sign", True),
        (LINEAR, "scales", math.inf, "a NaN or infinite scale", "dropped", True),
        ({}, "wxyz", 0.0, "a zero rotation", "dropped", True),
        ({}, "wxyz", 1e-40, None, "", False),
        ({}, "wxyz", LARGEST, None, "", False),
        ({}, "opacity", math.inf, "an opacity of +Inf", "kept, opaque", False),
        ({}, "opacity", -math.inf, "an opacity of -Inf", "kept, invisible", False),
        ({}, "opacity", LARGEST, None, "", False),
        ({}, "opacity", math.nan, "a NaN opacity", "dropped", True),
        (LINEAR, "opacity", 1.0, None, "", False),
        (LINEAR, "opacity", 1.0000001, "an opacity outside 0..1", "cut there", True),
        (LINEAR, "opacity", -1e-45, "an opacity outside 0..1", "cut there", True),
        (LINEAR, "opacity", math.inf, "an opacity outside 0..1", "cut there", True),
        ({}, "sh", math.inf, "a NaN or Inf colour", "dropped", True),
    ],
)
def test_each_rule_at_its_threshold(coding, name, number, what, done, repaired):
    raw = raw_splats(20, **coding)
    getattr(raw, name)[7] = number
    strict = copied(raw)
    plain = judge(raw, Reading())
    assert len(plain.means) == (19 if done == "dropped" else 20)
    if what is None:
        assert plain.findings == ()
    else:
        (found,) = plain.findings
        assert found.what == f"1 splat with {what}" and found.done == done and found.rows == (7,)
        assert found.repaired == repaired and found.file == "a.ply"
    for array in (plain.means, plain.scales, plain.wxyz, plain.opacity, plain.sh):
        assert np.isfinite(array).all()
    assert (plain.scales >= 0).all() and (0 <= plain.opacity).all() and (plain.opacity <= 1).all()
    if repaired:
        with pytest.raises(BadFile, match=f"a.ply: 1 splat with {what}; --strict repairs nothing"):
            judge(strict, Reading(strict=True))
    else:
        assert len(judge(strict, Reading(strict=True)).means) == 20


def test_strict_names_the_first_and_counts_the_others():
    raw = raw_splats(20)
    raw.means[3], raw.wxyz[[4, 9]], raw.opacity[5] = math.nan, 0, math.inf
    with pytest.raises(BadFile, match=r"1 splat with a NaN or Inf position \(1 more finding\);"):
        judge(copied(raw), Reading(strict=True))
    raw.sh[6] = math.nan
    with pytest.raises(BadFile, match=r"\(2 more findings\);"):
        judge(raw, Reading(strict=True))


def test_a_file_of_nothing_but_broken_rows_is_refused_with_the_reason():
    raw = raw_splats(3)
    raw.wxyz[:] = 0
    with pytest.raises(BadFile, match=r"not one of 3 splats .*3 splats with a zero rotation"):
        judge(raw, Reading())


def test_twice_the_same_splat_is_fine():
    raw = raw_splats(40)
    for name in ("means", "scales", "wxyz", "opacity", "sh"):
        getattr(raw, name)[20:] = getattr(raw, name)[:20]
    plain = judge(raw, Reading(strict=True))
    assert plain.findings == () and len(plain.means) == 40


@pytest.mark.parametrize("name", ["means", "scales", "wxyz", "opacity", "sh"])
def test_signalling_nan_is_nan_without_a_warning(name):
    raw = raw_splats(300)
    getattr(raw, name).reshape(300, -1).view(np.uint32)[5] = 0x7F800001
    plain = judge(raw, Reading())
    assert len(plain.means) == 299 and plain.findings[0].rows == (5,)


def test_positions_beyond_float32_are_dropped():
    raw = raw_splats(20)
    raw.means = raw.means.astype(np.float64)
    raw.means[4, 1] = 4e38
    plain = judge(raw, Reading())
    assert len(plain.means) == 19 and plain.findings[0].rows == (4,)
