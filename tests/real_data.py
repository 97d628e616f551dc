"""Where real sequences lie; they are no part of the project."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


def real(name: str) -> Path:
    """The folder of a sequence; skips the test where it is not there."""
    folders = [Path(os.environ.get("PYRAMAP_DATA", "")), Path(__file__).parents[2] / "shared/data"]
    found = next((folder / name for folder in folders if folder.parts and (folder / name).is_dir()), None)
    if found is None:
        pytest.skip(f"{name} lies neither in ../shared/data nor in $PYRAMAP_DATA")
    return found
