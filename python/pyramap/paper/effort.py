"""How much of each experiment is done: all of it, or as much as takes two minutes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Effort:
    """What may be left out where time is short.

    Attributes:
        room_stride: Every n-th of the 181 views of BOX and SPHERES is mapped (Figure 4).
        office_stride: Every n-th of the 684 views of the office is mapped (Figure 7, Table 1).
        voxel_sizes: At which the office is mapped, metres, the smallest first.
        views: How many images of each scene are compared with the ideal.
        picture_width: Of drawn meshes, pixels.
    """

    room_stride: int
    office_stride: int
    voxel_sizes: tuple[float, ...]
    views: int
    picture_width: int


FULL = Effort(room_stride=1, office_stride=1, voxel_sizes=(0.02, 0.04, 0.08, 0.16), views=8, picture_width=1200)
QUICK = Effort(room_stride=6, office_stride=6, voxel_sizes=(0.02, 0.04, 0.08, 0.16), views=2, picture_width=900)
