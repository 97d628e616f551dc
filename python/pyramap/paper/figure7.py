"""Figure 7: the map of the indoor loop as an iso-surface, and close-ups beside the images."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .. import Mesh, pictures
from . import charts, exact
from .comparison import Floats
from .effort import Effort
from .section import Section
from .walk import FRAMES, MAX_RANGE, NOISE_SEED, Walk

UP = (0.0, 0.0, 1.0)
CLOSE_UPS = {"b": 72, "c": 312}
"""Letters, and the numbers of the images that were taken from there."""
MIN_FACES = 50
"""Smaller pieces of the mesh are specks."""
NEAR = 0.05
"""Metres from the true surface."""


@dataclass(frozen=True)
class CloseUp:
    """One place from which an image was taken.

    Attributes:
        number: Of the image.
        surface: (h, w, 3) uint8: the mesh as that camera would see it.
        truth: The same of the exact scene.
        depth: (480, 640) metres: the image itself, 0 where there is no reading.
        mark: Pixel of the camera in the overview, and of the point a metre ahead of it.
    """

    number: int
    surface: NDArray[np.uint8]
    truth: NDArray[np.uint8]
    depth: NDArray[np.float32]
    mark: Floats


@dataclass(frozen=True)
class Loop:
    """The finest map of the walk.

    Attributes:
        overview: (h, w, 3) uint8: the mesh from obliquely above, without ceilings.
        close_ups: By letter.
        voxel_size: Metres.
        frames: How many were mapped.
        triangles: Of the mesh.
        distances: (V,) of its vertices, or of an even choice of them, to the true surface, metres.
    """

    overview: NDArray[np.uint8]
    close_ups: dict[str, CloseUp]
    voxel_size: float
    frames: int
    triangles: int
    distances: Floats


def compute(walk: Walk, effort: Effort) -> Loop:
    """Mesh the finest map and draw it."""
    grid = walk.runs[0].grid
    mesh = grid.mesh(min_faces=MIN_FACES)
    width = effort.picture_width * 4 // 3
    view = pictures.overview(mesh.vertices, mesh.faces, UP, size=(width, width * 3 // 4))
    image = pictures.mesh_image(mesh.vertices, mesh.faces, view, mesh.normals)
    some = mesh.vertices[:: max(1, len(mesh.vertices) // 50_000)]
    return Loop(
        pictures.with_scale_bar(image, view),
        {letter: _close_up(walk, mesh, number, view) for letter, number in CLOSE_UPS.items()},
        grid.voxel_size,
        len(walk.frames),
        len(mesh.faces),
        walk.scene.signed_distance(some),
    )


def _close_up(walk: Walk, mesh: Mesh, number: int, overview: pictures.View) -> CloseUp:
    camera, pose = walk.scene.camera, walk.scene.poses()[number]
    angle = 2 * math.degrees(math.atan(camera.width / 2 / camera.fx))
    view = pictures.from_pose(pose, (camera.width, camera.height), angle, back=0.0)
    places = np.stack([pose[:3, 3], pose[:3, 3] + pose[:3, 2]])
    pixels = (places - overview.eye) @ overview.axes[:, :2] * overview.size[0] / overview.width
    return CloseUp(
        number,
        pictures.mesh_image(mesh.vertices, mesh.faces, view, mesh.normals),
        exact.shaded(walk.scene, view),
        walk.scene.render(camera, pose, noise=NOISE_SEED + number),
        pixels + np.array(overview.size) / 2,
    )


def draw(loop: Loop) -> Figure:
    """The whole loop, with the places of the close-ups."""
    height, width = loop.overview.shape[:2]
    figure = charts.figure(charts.WIDTH * height / width)
    axes = figure.subplots()
    axes.imshow(loop.overview)
    for letter, close_up in loop.close_ups.items():
        (x, y), (ahead_x, ahead_y) = close_up.mark
        style = {"color": charts.VERMILION, "arrowstyle": "-|>", "linewidth": 2.5, "mutation_scale": 18}
        axes.annotate("", (ahead_x, ahead_y), xytext=(x, y), arrowprops=style)
        behind = x - 0.8 * (ahead_x - x), y - 0.8 * (ahead_y - y)
        axes.text(
            behind[0], behind[1], letter, color=charts.VERMILION, weight="bold", ha="center", va="center", fontsize=15
        )
    axes.set_axis_off()
    axes.set_title("(a) the loop from obliquely above, without its ceilings", loc="left")
    return figure


def draw_close_ups(loop: Loop) -> Figure:
    """A row a place: the map, the exact scene, the depth image."""
    figure = charts.figure(6.2)
    panels = figure.subplots(len(loop.close_ups), 3)
    for row, (letter, close_up) in zip(panels, loop.close_ups.items(), strict=True):
        depth = row[2].imshow(
            np.ma.masked_equal(close_up.depth, 0), cmap="viridis", vmin=0, vmax=MAX_RANGE, interpolation="nearest"
        )
        row[2].set_facecolor("white")
        for axes, image, title in (
            (row[0], close_up.surface, f"({letter}) the map"),
            (row[1], close_up.truth, "the scene"),
            (row[2], None, f"depth image {close_up.number}"),
        ):
            if image is not None:
                axes.imshow(image)
            axes.set(xticks=(), yticks=())
            axes.set_title(title, loc="left")
    label = "z-depth (m); white: no reading"
    figure.colorbar(depth, ax=panels, label=label, orientation="horizontal", aspect=60, pad=0.02)
    return figure


def section(loop: Loop, lead_sigmas: float) -> Section:
    """For the page.

    Args:
        loop: The data.
        lead_sigmas: How far in front of a reading Eq. 7 is 0.5 (Figure 1).
    """
    size = np.abs(loop.distances)
    near_share, median = float(np.mean(size < NEAR)), float(np.median(loop.distances))
    return Section(
        name="figure7",
        title="Figure 7: the indoor loop",
        figures={"figure7": draw(loop), "figure7_close": draw_close_ups(loop)},
        results={
            "voxel_size_m": loop.voxel_size,
            "frames": loop.frames,
            "triangles": loop.triangles,
            "median_distance_m": median,
            "p95_distance_m": float(np.quantile(size, 0.95)),
            "share_within_5_cm": near_share,
            "close_ups": {letter: close_up.number for letter, close_up in loop.close_ups.items()},
        },
        values={
            "images": str(FRAMES) if loop.frames == FRAMES else f"{loop.frames} of the {FRAMES}",
            "voxel": f"{loop.voxel_size:g}",
            "triangles": f"{loop.triangles / 1e6:.1f}",
            "near_share": f"{near_share:.0%}",
            "median": f"{1e3 * median:.0f}",
            "model_lead": f"{1e3 * lead_sigmas * loop.voxel_size:.0f}",
            "least_faces": str(MIN_FACES),
        },
    )
