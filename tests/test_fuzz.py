"""Every reader against files made wrong: a model or one sentence, in time and in little memory."""

import os
import time

import pytest

pytest.importorskip("hypothesis")
pytest.importorskip("pyopencl")

from fuzz_run import Hung, fuzz
from fuzz_seeds import all_seeds
from fuzz_then import Then

from renderer.renderer import Renderer

EXAMPLES = 600  # over all seeds together


def fuzz_all(folder, examples: int, word: str = "") -> tuple[int, Then]:
    """(wrong files opened, what came of them); fails with every seed that found something."""
    seeds = [sown for sown in all_seeds(folder / "seeds") if word in sown.name]
    each = -(-examples // len(seeds))
    failures, count = [], 0
    with Renderer(None, "tiles") as renderer:
        then = Then(renderer)
        for i, sown in enumerate(seeds):
            began = time.perf_counter()
            try:
                fuzz(sown, folder / f"{i}", each, then)
            except (Exception, Hung) as error:
                notes = " | ".join(getattr(error, "__notes__", ()))
                failures.append(f"{sown.name}: {type(error).__name__}: {error} {notes}"[:1500])
                if os.environ.get("FUZZ_TRACE"):
                    import traceback

                    traceback.print_exc()
            count += each
            if os.environ.get("FUZZ_TRACE"):
                print(f"{sown.name}: {time.perf_counter() - began:.1f} s")
    assert not failures, "\n".join(failures)
    return count, then


def test_wrong_files_become_a_model_or_one_sentence(tmp_path):
    count, then = fuzz_all(tmp_path, EXAMPLES)
    assert count >= 500 and then.opened > 50 and then.drawn > 5
