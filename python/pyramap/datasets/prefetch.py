"""Work done ahead of the consumer, on one thread, in order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

THREAD_NAME = "pyramap-decode"


def prefetch(load: Callable[[Item], Result], items: Iterable[Item], ahead: int = 3) -> Generator[Result, None, None]:
    """Yields `load(item)` for each item, in order, keeping at most `ahead` results ready on another thread.

    One thread is enough: it has only to hide the decoding, and the mapper wants the other cores. What `load` raises
    is raised here in the place of its result. The thread starts with the first `next`, and ends when the generator
    is exhausted, closed or dropped.
    """
    remaining = iter(items)
    executor = ThreadPoolExecutor(max_workers=1, thread_name_prefix=THREAD_NAME)
    try:
        pending = deque(executor.submit(load, item) for item in islice(remaining, ahead))
        while pending:
            current = pending.popleft()
            pending.extend(executor.submit(load, item) for item in islice(remaining, 1))
            yield current.result()
    finally:
        # The thread ends by itself after the item in hand. It is not joined: the garbage collector may be running
        # this very line on that thread.
        executor.shutdown(wait=False, cancel_futures=True)
