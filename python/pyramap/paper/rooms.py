"""The two simulated rooms of the paper, BOX and SPHERES, as Figures 3, 4 and 6 use them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .. import pictures, scenes

UP = (0.0, -1.0, 0.0)
"""The world's axes are those of the first camera: y points down."""


@dataclass(frozen=True)
class Room:
    """One of them.

    Attributes:
        name: In the paper.
        make: Makes the scene.
        objects: What stands in it.
        reach: Greatest range that is mapped, metres: farther than any wall.
        corner: An eye from which all of it is seen, and what it looks at, metres.
        examples: Numbers of the views that Figure 3 shows.
        level: y of the plane in which Figure 4 cuts it, metres.
        close: x and z of the middle, and the width, of what Figure 4 shows from near by in that plane, metres.
    """

    name: str
    make: Callable[[], scenes.Scene]
    objects: str
    reach: float
    corner: tuple[tuple[float, float, float], tuple[float, float, float]]
    examples: tuple[int, int]
    level: float
    close: tuple[float, float, float]

    def view(self, width: int) -> pictures.View:
        """All of the room, from inside."""
        return pictures.looking_at(*self.corner, up=UP, size=(width, width * 3 // 4), angle_deg=85.0)


BOX = Room(
    "BOX",
    scenes.box,
    "six cubes of 1 m",
    reach=15.0,
    corner=((4.7, -3.6, -5.3), (-1.2, 0.3, 1.6)),
    examples=(0, 96),
    level=0.31,
    close=(-0.45, 2.15, 0.5),
)
SPHERES = Room(
    "SPHERES",
    scenes.spheres,
    "a box and four balls",
    reach=5.0,
    corner=((0.98, -0.9, -0.82), (-0.3, 0.25, 0.4)),
    examples=(0, 151),
    level=0.05,
    close=(0.24, 0.72, 0.3),
)
ROOMS = (BOX, SPHERES)
