"""Numbers out of text files, with errors that name the file and the line."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from .errors import DatasetError

Content = TypeVar("Content", str, bytes)


@dataclass(frozen=True, slots=True)
class Line:
    """The words of one line of a text file."""

    path: Path
    number: int
    words: Sequence[str]

    def error(self, problem: str) -> DatasetError:
        """The error that says what is wrong with this line."""
        return DatasetError(self.path, f"line {self.number}: {problem}")

    def numbers(self, count: int) -> list[float]:
        """The line as exactly `count` finite numbers.

        Raises:
            DatasetError: if there are more or fewer, or one is not a finite number.
        """
        if len(self.words) != count:
            raise self.error(f"expected {count} numbers, got {len(self.words)}: {' '.join(self.words)[:80]!r}")
        return [self._number(word) for word in self.words]

    def _number(self, word: str) -> float:
        try:
            number = float(word)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise self.error(f"expected a finite number, got {word[:80]!r}")
        return number


def read_lines(path: Path, separator: str | None = None) -> list[Line]:
    """The lines of a text file that are neither blank nor a `#` comment; words end at white space or `separator`.

    Raises:
        DatasetError: if the file is missing or cannot be read.
    """
    # A binary file in the place of a text file then fails as "expected a number", with its line.
    text = _read_text(path)
    split = ((number, line.split(separator)) for number, line in enumerate(text.splitlines(), start=1) if line.strip())
    return [Line(path, number, words) for number, words in split if not words[0].startswith("#")]


def read_comments(path: Path) -> str:
    """The `#` comments of a text file, joined by line ends. Raises `DatasetError` as `read_lines` does."""
    return "\n".join(line for line in _read_text(path).splitlines() if line.lstrip().startswith("#"))


def read_matrix(path: Path, size: int) -> NDArray[np.float64]:
    """A text file that holds one (size, size) matrix, row by row, as float64.

    Raises:
        DatasetError: if the file is missing, or does not hold `size * size` finite numbers.
    """
    return matrix(path, read_lines(path), size)


def read_bytes(path: Path) -> bytes:
    """The content of a file. Raises `DatasetError` if it is missing or cannot be read."""
    return _read(path, path.read_bytes)


def matrix(path: Path, lines: Sequence[Line], size: int) -> NDArray[np.float64]:
    """The (size, size) matrix whose rows are `lines` of the file `path`.

    Raises:
        DatasetError: if there are more or fewer than `size` lines of `size` finite numbers.
    """
    if len(lines) != size:
        raise DatasetError(path, f"expected a {size}x{size} matrix, got {len(lines)} rows")
    return np.array([line.numbers(size) for line in lines], dtype=np.float64)


def _read_text(path: Path) -> str:
    return _read(path, partial(path.read_text, encoding="utf-8", errors="replace"))


def _read(path: Path, read: Callable[[], Content]) -> Content:
    try:
        return read()
    except FileNotFoundError:
        raise DatasetError(path, "the file is missing") from None
    except OSError as error:
        raise DatasetError(path, f"cannot be read: {error.strerror}") from error
