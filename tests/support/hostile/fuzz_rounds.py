"""Many mutations of every seed, and what went wrong with them."""

import os
import time

from shapeshift.renderer.renderer import Renderer
from tests.support.hostile.fuzz_run import Hung, fuzz
from tests.support.hostile.fuzz_seeds import all_seeds
from tests.support.hostile.fuzz_then import Then


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
