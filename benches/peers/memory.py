"""The peak of the memory that this process holds."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

STATUS = Path("/proc/self/status")
CLEAR_REFS = Path("/proc/self/clear_refs")
RESET_PEAK = "5"


class Memory(NamedTuple):
    """Bytes of resident memory; None where the operating system is not Linux.

    Attributes:
        peak: The most that the whole process held, interpreter and libraries included.
        rise: How much of that came after the measurement began.
    """

    peak: int | None
    rise: int | None


class MemoryProbe:
    """Measures from its making on."""

    def __init__(self) -> None:
        self._before = None
        if CLEAR_REFS.exists():
            CLEAR_REFS.write_text(RESET_PEAK)
            self._before = _status_bytes("VmRSS")

    def read(self) -> Memory:
        """The peak since then."""
        if self._before is None:
            return Memory(None, None)
        peak = _status_bytes("VmHWM")
        return Memory(peak, peak - self._before)


def _status_bytes(field: str) -> int:
    line = next(line for line in STATUS.read_text().splitlines() if line.startswith(field + ":"))
    return 1024 * int(line.split()[1])
