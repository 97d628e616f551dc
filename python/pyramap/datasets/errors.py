"""The error that every reader raises."""

from __future__ import annotations

from pathlib import Path


class DatasetError(OSError):
    """A file or folder of a data set is missing, damaged, or not what it should be.

    Attributes:
        path: the file or folder at fault; the message begins with it.
    """

    def __init__(self, path: Path, problem: str) -> None:
        super().__init__(f"{path}: {problem}")
        self.path = path
