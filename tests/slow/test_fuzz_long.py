"""The same as tests/program/test_fuzz.py, 20,000 times and more."""

import os

import pytest

pytest.importorskip("hypothesis")
pytest.importorskip("pyopencl")

from tests.support.hostile.fuzz_rounds import fuzz_all

EXAMPLES = int(os.environ.get("FUZZ_EXAMPLES", "22000"))


@pytest.mark.slow
def test_twenty_thousand_wrong_files_become_a_model_or_one_sentence(tmp_path):
    only = os.environ.get("FUZZ_ONLY", "")  # a word in the names of seeds
    count, then = fuzz_all(tmp_path, EXAMPLES, only)
    assert count >= EXAMPLES
    assert then.opened > 0 and (only or then.drawn > 0)
