"""Work on long arrays in blocks that stay in a processor's cache, by a few threads."""

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from contextvars import copy_context

BLOCK = 8192  # rows: 2 MB of a splat's 62 floats; with 2048 the threads wait for the interpreter
CACHED = 1 << 21  # bytes of rows that are short
THREADS = min(4, os.cpu_count() or 1)  # memory is the limit; numpy lets go of the interpreter
WORTH_A_THREAD = 4  # blocks


def each_block(
    count: int,
    work: Callable[..., None],
    progress: Callable[[float], None] | None = None,
    tool: Callable[[], AbstractContextManager] = nullcontext,
    block: int = BLOCK,
) -> None:
    """Calls work(rows, own) for slices of range(count), several at once and in no set order.

    own: what the context `tool()` gives, entered once a thread (an open file, a buffer).
    progress(part done 0..1) is called by the calling thread alone.  The first error ends it all.
    """
    blocks = iter(range(0, count, block))  # next() of it is atomic
    errors: list[BaseException] = []

    def run(progress: Callable[[float], None] | None = None) -> None:
        with tool() as own:
            for first in blocks_left(blocks, errors):
                work(slice(first, min(first + block, count)), own)
                if progress:
                    progress(min(first + block, count) / count)

    def run_beside() -> None:
        try:
            run()
        except Exception as error:
            errors.append(error)  # raised again by the caller

    threads = []
    for _ in range(THREADS - 1 if count > WORTH_A_THREAD * block else 0):
        context = copy_context()  # numpy's errstate is the caller's
        threads.append(threading.Thread(target=context.run, args=(run_beside,), daemon=True))
    for thread in threads:
        thread.start()
    try:
        run(progress)
    except BaseException as error:  # Ctrl-C, too: the others stop at their next block
        errors.insert(0, error)
    for thread in threads:
        thread.join()
    if errors:
        raise errors[0]
    if progress and threads:
        progress(1.0)  # another one may have done the last block


def block_of(bytes_a_row: int) -> int:
    """Rows of a block: BLOCK, or up to 4 times as many where rows are short."""
    return min(max(CACHED // bytes_a_row // BLOCK, 1), 4) * BLOCK


def blocks_left(blocks: Iterator[int], errors: list) -> Iterator[int]:
    """The blocks that no thread has taken yet, until one of them failed."""
    for first in blocks:
        if errors:
            return
        yield first
