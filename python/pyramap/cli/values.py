"""What users type, as values. Each parser raises `typer.BadParameter`, which exits with code 2."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from enum import StrEnum
from typing import Literal

import typer

from .._core import PinholeCamera
from ..datasets.ros_topics import DEPTH_ROLES


class Update(StrEnum):
    """Update rules of `OccupancyGrid`."""

    pyramid = "pyramid"
    area = "area"
    min_layer = "min_layer"
    ideal = "ideal"
    rays = "rays"


class Backend(StrEnum):
    """Backends of `OccupancyGrid`."""

    auto = "auto"
    cpu = "cpu"
    gpu = "gpu"


class Axis(StrEnum):
    """World axes."""

    x = "x"
    y = "y"
    z = "z"


MOST_PIXELS = 16384
"""Along a side of a picture; larger ones would take gigabytes to draw."""

_UNITS = {
    "": 1,
    "B": 1,
    **{f"{prefix}B": 1000 ** (i + 1) for i, prefix in enumerate("KMGT")},
    **{f"{prefix}IB": 1024 ** (i + 1) for i, prefix in enumerate("KMGT")},
}


def byte_count(text: str) -> int:
    """`500MB`, `1.5 GiB` or a plain number of bytes."""
    match = re.fullmatch(r"\s*([0-9.]+)\s*([A-Za-z]*)\s*", text)
    unit = _UNITS.get(match[2].upper()) if match else None
    try:
        if match is None or unit is None:
            raise ValueError
        return int(float(match[1]) * unit)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not a number of bytes such as 500MB, 2GiB or 1000000") from None


class Numbers(tuple[float, ...]):
    """Numbers typed with commas between them."""


def surface_offset(text: str) -> float | Literal["centred"]:
    """Metres, or the word `centred`."""
    return "centred" if text == "centred" else _numbers(text, (1,), "0.01, or the word centred")[0]


def sigma(text: str) -> Numbers:
    """One sigma, or the three coefficients of its growth with range."""
    return _numbers(text, (1, 3), "0.02 or 0.01,0,0.002")


def pair(text: str) -> Numbers:
    """Two numbers."""
    return _numbers(text, (2,), "-2,3.5")


def point(text: str) -> Numbers:
    """Three coordinates."""
    return _numbers(text, (3,), "0.5,0,1.2")


def size(text: str) -> Numbers:
    """Width and height in pixels."""
    numbers = _numbers(text, (2,), "1600,1200")
    if not all(number in range(1, MOST_PIXELS + 1) for number in numbers):
        raise typer.BadParameter(f"{text!r} is not a width and a height of 1 to {MOST_PIXELS} whole pixels")
    return numbers


def direction(text: str) -> Numbers:
    """Three components, or an axis with or without a sign: `z`, `-y`."""
    match = re.fullmatch(r"([+-]?)([xyz])", text)
    if match is None:
        return _numbers(text, (3,), "0,0,1 or z or -y")
    sign = -1.0 if match[1] == "-" else 1.0
    return Numbers(sign if axis == match[2] else 0.0 for axis in "xyz")


def intrinsics(text: str) -> Numbers:
    """`fx,fy,cx,cy`, or these and width and height; pixels."""
    return _numbers(text, (4, 6), "585,585,320,240 (fx,fy,cx,cy) or 585,585,320,240,640,480 (and width,height)")


class Topic(tuple[str, str]):
    """What a topic of a ROS bag is taken for, and its name."""


def topic(text: str) -> Topic:
    """`depth=/camera/depth/image_rect`: a role and the name of a topic."""
    role, _, name = text.partition("=")
    if role not in DEPTH_ROLES or not name:
        raise typer.BadParameter(f"{text!r} is not one of {', '.join(f'{role}=NAME' for role in DEPTH_ROLES)}")
    return Topic((role, name))


def camera(values: Numbers, like: Callable[[], PinholeCamera]) -> PinholeCamera:
    """A camera of given intrinsics; unless these say the size too, of that of another one, which is then asked for."""
    fx, fy, cx, cy, *size = values
    width, height = (int(number) for number in size) if size else ((other := like()).width, other.height)
    return PinholeCamera(width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy)


def _numbers(text: str, counts: tuple[int, ...], example: str) -> Numbers:
    """Finite numbers, as many as one of `counts` says."""
    try:
        values = Numbers(float(part) for part in text.split(","))
    except ValueError:
        values = Numbers()
    if len(values) not in counts or not all(map(math.isfinite, values)):
        wanted = " or ".join("one number" if count == 1 else f"{count} numbers" for count in counts)
        raise typer.BadParameter(f"{text!r} is not {wanted} with commas between, such as {example}")
    return values
