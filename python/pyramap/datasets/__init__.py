"""Depth images with poses, from the usual data sets.

```python
for frame in pyramap.datasets.open("redkitchen"):
    grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
```

To read another kind of data set, write a module with a `Format` and add it to `FORMATS`.
"""

from __future__ import annotations

import os
from pathlib import Path

from .._core import PinholeCamera
from .dataset import Dataset
from .errors import DatasetError
from .frame import Frame
from .listing import Format, FrameRef, Listing, Options
from .redwood import REDWOOD
from .seven_scenes import SEVEN_SCENES
from .tum import TUM

__all__ = ["FORMATS", "Dataset", "DatasetError", "Format", "Frame", "FrameRef", "Listing", "Options", "open"]

FORMATS: tuple[Format, ...] = (SEVEN_SCENES, TUM, REDWOOD)
"""The kinds of data set that `open` knows, in the order in which it tries them."""


def open(
    path: str | os.PathLike[str],
    *,
    skip_bad: bool = False,
    camera: PinholeCamera | None = None,
    stride: int = 1,
    limit: int | None = None,
    max_gap: float = 0.02,
) -> Dataset:
    """Opens a data set, recognised by its content.

    Args:
        path: its folder: 7-Scenes, TUM RGB-D, or Redwood/ICL-NUIM (there also the `.log` trajectory itself).
        skip_bad: leave out frames that cannot be read, and note them in `Dataset.skipped`, instead of raising.
        camera: the camera of the depth images, in the place of the data set's own or its usual one.
        stride: take every `stride`-th frame.
        limit: take at most that many frames (after the stride).
        max_gap: where poses have times of their own (TUM), how far the nearest pose may be from the image, in
            seconds. Frames without such a pose are not an error; they are noted in `Dataset.skipped`.

    Raises:
        DatasetError: if no format fits, or the data set as a whole cannot be used: no poses, no images, or not as many
            of one as of the other where only their order matches them.
        ValueError: if `stride`, `limit` or `max_gap` is out of range.
    """
    if stride < 1:
        raise ValueError(f"stride must be at least 1, got {stride}")
    if limit is not None and limit < 0:
        raise ValueError(f"limit must be at least 0, got {limit}")
    if not max_gap >= 0:
        raise ValueError(f"max_gap must be at least 0 seconds, got {max_gap}")
    root = Path(path)
    format = _recognise(root)
    listing = format.list_frames(root, Options(camera, skip_bad, max_gap))
    return Dataset(root, format.name, listing, skip_bad=skip_bad)[::stride][:limit]


def _recognise(path: Path) -> Format:
    if not path.exists():
        raise DatasetError(path, "there is no such folder")
    for format in FORMATS:
        if format.recognise(path):
            return format
    wanted = "; ".join(f"{format.name} ({format.looks_for})" for format in FORMATS)
    raise DatasetError(path, f"not a data set that is known here. Looked for {wanted}. Found {_content(path)}")


def _content(path: Path, at_most: int = 8) -> str:
    if not path.is_dir():
        return "a file, not a folder"
    names = sorted(entry.name + "/" * entry.is_dir() for entry in path.iterdir())
    more = f" and {len(names) - at_most} more" if len(names) > at_most else ""
    return ", ".join(names[:at_most]) + more if names else "nothing: it is empty"
