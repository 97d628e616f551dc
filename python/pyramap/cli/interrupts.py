"""Ctrl-C as a request that a loop answers when its frame is done."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType


class Interrupts:
    """While entered, the first SIGINT only sets `requested`; the second one raises `KeyboardInterrupt` as usual."""

    def __init__(self) -> None:
        self.requested = False
        self._before: object = None

    def __enter__(self) -> Interrupts:
        # Python allows handlers in the main thread alone; elsewhere signals stay whoever's they are.
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._request)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)  # type: ignore[arg-type]

    def _request(self, _number: int, _frame: FrameType | None) -> None:
        self.requested = True
        signal.signal(signal.SIGINT, signal.default_int_handler)
