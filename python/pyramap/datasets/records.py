"""Values out of JSON files, with errors that name the file and the place in it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import DatasetError


@dataclass(frozen=True, slots=True)
class Record:
    """An object of a JSON file.

    Attributes:
        path: the file, for errors.
        place: where in the file, for errors: "" for the whole.
        values: what it holds.
    """

    path: Path
    place: str
    values: dict[str, Any]

    def __contains__(self, key: str) -> bool:
        """Whether the key is there, and not null."""
        return self.values.get(key) is not None

    def error(self, problem: str) -> DatasetError:
        """The error that says what is wrong with this object."""
        return DatasetError(self.path, f"{self.place}: {problem}" if self.place else problem)

    def number(self, key: str) -> float:
        """A finite number. Raises `DatasetError` if there is none."""
        value = self._value(key)
        if not _is_number(value):
            raise self.error(f"expected a finite number for {key!r}, got {_shown(value)}")
        return float(value)

    def size(self, *keys: str) -> tuple[int, int]:
        """Width and height: two positive whole numbers. Raises `DatasetError` if they are not that."""
        width, height = (self.number(key) for key in keys)
        if not (width > 0 and height > 0 and width.is_integer() and height.is_integer()):
            raise self.error(f"expected a width and a height in pixels for {' and '.join(keys)}, got {width}x{height}")
        return int(width), int(height)

    def text(self, key: str) -> str:
        """A string. Raises `DatasetError` if there is none."""
        value = self._value(key)
        if not isinstance(value, str):
            raise self.error(f"expected a text for {key!r}, got {_shown(value)}")
        return value

    def array(self, key: str, *shape: int) -> NDArray[np.float64]:
        """Nested lists of finite numbers, of a shape where -1 stands for any length; float64.

        Raises:
            DatasetError: if there is none of that shape.
        """
        wanted = "x".join("N" if length < 0 else str(length) for length in shape)
        value = self._value(key)
        try:
            array = np.array(value, dtype=np.float64)
        except (ValueError, TypeError):
            raise self.error(f"expected {wanted} numbers for {key!r}, got {_shown(value)}") from None
        fits = len(array.shape) == len(shape) and all(w in (-1, n) for w, n in zip(shape, array.shape, strict=True))
        if not fits or not np.isfinite(array).all():
            raise self.error(f"expected {wanted} finite numbers for {key!r}, got {_shown(value)}")
        return array

    def record(self, key: str) -> Record:
        """An object within this one. Raises `DatasetError` if there is none."""
        return _record(self.path, self._at(key), self._value(key))

    def records(self, key: str) -> list[Record]:
        """A list of objects. Raises `DatasetError` if there is none."""
        values = self._value(key)
        if not isinstance(values, list):
            raise self.error(f"expected a list for {key!r}, got {_shown(values)}")
        return [_record(self.path, f"{self._at(key)}[{i}]", value) for i, value in enumerate(values)]

    def _value(self, key: str) -> Any:
        if key not in self:
            there = ", ".join(sorted(self.values)) or "nothing"
            raise self.error(f"there is no {key!r}, only {there[:200]}")
        return self.values[key]

    def _at(self, key: str) -> str:
        return f"{self.place}.{key}" if self.place else key


def parse_record(path: Path, data: bytes) -> Record:
    """The JSON object that a file holds.

    Raises:
        DatasetError: if it is not JSON, or not an object.
    """
    try:
        return _record(path, "", json.loads(data))
    except ValueError as error:  # json's own error, and that of text that is not UTF-8
        raise DatasetError(path, f"not a JSON file: {error}") from None


def _record(path: Path, place: str, value: object) -> Record:
    if not isinstance(value, dict):
        at = f"{place}: " if place else ""
        raise DatasetError(path, f"{at}expected an object with keys, got {_shown(value)}")
    return Record(path, place, value)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _shown(value: object) -> str:
    return repr(value)[:80]
