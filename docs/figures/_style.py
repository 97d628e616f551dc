"""What the figures share. Each is a script that draws itself into a file: `python blocks.py blocks.png`."""

from __future__ import annotations

import sys

import numpy as np
import pyramap as pm
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from pyramap.pictures.slice_drawing import UNKNOWN, colours

BLUE, VERMILION, GREEN, GREY = "#0072b2", "#d55e00", "#009e73", "#999999"
"""Of the palette of Okabe and Ito: told apart with any colour vision."""


def figure(height: float) -> Figure:
    """An empty figure as wide as a page; inches."""
    return Figure(figsize=(8.0, height), dpi=130, layout="constrained", facecolor="white")


def save(drawn: Figure) -> None:
    """Writes the figure to where the script was told."""
    drawn.savefig(sys.argv[1])


def draw_slice(axes: Axes, grid: pm.OccupancyGrid, height: float) -> None:
    """A level plane through a map whose z points up: blue free, red occupied, grey unknown."""
    assert grid.bounds is not None
    region = grid.bounds.copy()
    region[:, 2] = height, height + grid.voxel_size
    log_odds, first = grid.dense(region)
    plane = np.where(log_odds[..., 0] == 0, np.nan, log_odds[..., 0]).T
    (x, y), (rows, columns) = first[:2] * grid.voxel_size, plane.shape
    extent = (x, x + columns * grid.voxel_size, y, y + rows * grid.voxel_size)
    axes.imshow(colours(plane), origin="lower", extent=extent, interpolation="nearest")
    axes.set(facecolor=UNKNOWN, xlabel="x (m)", ylabel="y (m)")


def world_from_camera(yaw: float, position: tuple[float, float, float]) -> NDArray[np.float64]:
    """A camera that looks level in a world whose z points up; yaw 0 looks along x. Radians, metres."""
    forward = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    down = np.array([0.0, 0.0, -1.0])
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([np.cross(down, forward), down, forward])
    pose[:3, 3] = position
    return pose
