"""Figure 4: iso-surfaces of the maps of BOX and SPHERES at 0.02 m, against the true surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from numpy.typing import NDArray

from .. import OccupancyGrid, SensorModel, pictures, scenes
from . import charts
from .comparison import Floats
from .effort import Effort
from .rooms import ROOMS, Room
from .section import Section, Table

VOXEL = 0.02
SIGMA = VOXEL
"""And k, metres: the paper does not say which it used here."""
Offset = Literal["paper", "centred"]
OFFSETS: dict[Offset, float | Literal["centred"]] = {"paper": 0.0, "centred": "centred"}
TITLES: dict[Offset, str] = {"paper": "the paper's model", "centred": 'surface_offset="centred"'}
CUT_COLOURS: dict[Offset, str] = {"paper": charts.VERMILION, "centred": charts.BLUE}
SOLID = "#cccccc"
COLOURS = colormaps["PuOr_r"]
SCALE = 2 * SIGMA
"""Distances of this many metres and more have the last colours of the scale."""


@dataclass(frozen=True)
class Surface:
    """The iso-surface of one map.

    Attributes:
        image: (h, w, 3) uint8, coloured by the distance to the true surface.
        distances: (V,) of its vertices to the true surface, metres, positive in free space.
        slice: Log-odds in the plane of `Room.level`.
    """

    image: NDArray[np.uint8]
    distances: Floats
    slice: pictures.Slice

    def facts(self) -> dict[str, float]:
        """Metres."""
        size = np.abs(self.distances)
        return {
            "vertices": len(self.distances),
            "median": float(np.median(self.distances)),
            "mean": float(self.distances.mean()),
            "rms": float(np.sqrt(np.mean(self.distances**2))),
            "p95": float(np.quantile(size, 0.95)),
            "p99": float(np.quantile(size, 0.99)),
        }


@dataclass(frozen=True)
class Mapped:
    """One room, mapped with and without offset.

    Attributes:
        room: Which.
        views: How many were fused.
        surfaces: By offset.
    """

    room: Room
    views: int
    surfaces: dict[Offset, Surface]


def compute(effort: Effort) -> list[Mapped]:
    """Map both rooms."""
    return [_compute(room, effort) for room in ROOMS]


def _compute(room: Room, effort: Effort) -> Mapped:
    scene = room.make()
    frames = list(scene.frames()[:: effort.room_stride])
    surfaces: dict[Offset, Surface] = {}
    for offset, metres in OFFSETS.items():
        grid = OccupancyGrid(
            VOXEL, SensorModel(SIGMA, k=SIGMA, surface_offset=metres), max_range=room.reach, backend="cpu"
        )
        for frame in frames:
            grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
        surfaces[offset] = _surface(scene, room, grid, effort.picture_width)
    return Mapped(room, len(frames), surfaces)


def _surface(scene: scenes.Scene, room: Room, grid: OccupancyGrid, width: int) -> Surface:
    mesh = grid.mesh()
    distances = scene.signed_distance(mesh.vertices)
    colours = 255 * COLOURS(Normalize(-SCALE, SCALE)(distances))[:, :3]
    image = pictures.mesh_image(
        mesh.vertices, mesh.faces, room.view(width), mesh.normals, colours=colours.astype(np.uint8)
    )
    return Surface(image, distances, pictures.cut(grid, axis=1, at=room.level))


def draw(rooms: list[Mapped]) -> Figure:
    """A row a room, a column an offset."""
    figure = charts.figure(8.6)
    panels = figure.subplots(len(rooms), len(OFFSETS))
    for row, mapped, letter in zip(panels, rooms, "ab", strict=True):
        for axes, (offset, surface) in zip(row, mapped.surfaces.items(), strict=True):
            axes.imshow(surface.image)
            axes.set_axis_off()
            axes.set_title(f"({letter}) {mapped.room.name}, {TITLES[offset]}", loc="left")
    scale = ScalarMappable(Normalize(-1e3 * SCALE, 1e3 * SCALE), COLOURS)
    label = "distance to the true surface (mm): positive is too near to the camera"
    figure.colorbar(scale, ax=panels, label=label, orientation="horizontal", aspect=50, extend="both", pad=0.02)
    return figure


def draw_cuts(rooms: list[Mapped]) -> Figure:
    """A row a room: the iso-surfaces and the true one where a level plane cuts them, and a part of it from near by."""
    figure = charts.figure(9.4)
    panels = figure.subplots(len(rooms), 2)
    for (whole, close), mapped, letter in zip(panels, rooms, "ab", strict=True):
        layer = mapped.surfaces["paper"].slice
        (left, low), (rows, columns) = layer.origin, layer.log_odds.shape
        whole.set(xlim=(left, left + columns * layer.cell), ylim=(low, low + rows * layer.cell))
        x, z, width = mapped.room.close
        close.set(xlim=(x - width / 2, x + width / 2), ylim=(z - width / 2, z + width / 2))
        for axes in (whole, close):
            _draw_truth(axes, mapped.room.make(), layer.at)
            for offset, colour in CUT_COLOURS.items():
                _draw_contour(axes, mapped.surfaces[offset].slice, colour)
            axes.set(xlabel="x (m)", ylabel="z (m)", aspect="equal")
        whole.add_patch(Rectangle((x - width / 2, z - width / 2), width, width, fill=False, edgecolor=charts.BLACK))
        whole.plot([0], [0], "o", color=charts.BLACK, markersize=5)
        whole.annotate("camera", (0, 0), xytext=(6, 4), textcoords="offset points")
        whole.set_title(f"({letter}) {mapped.room.name} at y = {layer.at:.2f} m", loc="left")
        close.set_title("the square from near by", loc="left")
    lines = [Line2D([], [], color=colour, label=TITLES[offset]) for offset, colour in CUT_COLOURS.items()]
    solid = Patch(facecolor=SOLID, edgecolor=charts.BLACK, label="solid in truth")
    figure.legend(handles=[solid, *lines], loc="outside lower center", ncols=3, frameon=False)
    return figure


def _draw_contour(axes: Axes, layer: pictures.Slice, colour: str) -> None:
    """Where a slice's log-odds, interpolated between the centres of voxels, are 0; nothing beside unknown voxels."""
    rows, columns = layer.log_odds.shape
    x, z = (start + (np.arange(n) + 0.5) * layer.cell for start, n in zip(layer.origin, (columns, rows), strict=True))
    axes.contour(x, z, np.ma.masked_invalid(layer.log_odds), levels=[0.0], colors=colour, linewidths=1.5)


def _draw_truth(axes: Axes, scene: scenes.Scene, y: float) -> None:
    """What is solid within the limits of the picture."""
    x, z = np.meshgrid(np.linspace(*axes.get_xlim(), 400), np.linspace(*axes.get_ylim(), 400))
    points = np.stack([x, np.full_like(x, y), z], axis=-1)
    distances = scene.signed_distance(points.reshape(-1, 3)).reshape(x.shape)
    axes.contourf(x, z, distances, levels=[-np.inf, 0.0], colors=[SOLID])
    axes.contour(x, z, distances, levels=[0.0], colors=charts.BLACK, linewidths=0.8)


def section(rooms: list[Mapped], lead_sigmas: float) -> Section:
    """For the page.

    Args:
        rooms: The data.
        lead_sigmas: How far in front of a reading Eq. 7 is 0.5 (Figure 1).
    """
    facts = {mapped.room.name: {offset: s.facts() for offset, s in mapped.surfaces.items()} for mapped in rooms}
    medians = {
        f"{name.lower()}_{offset}": f"{1e3 * fact['median']:.1f}"
        for name, by_offset in facts.items()
        for offset, fact in by_offset.items()
    }
    rows = [
        [
            f"{name}, {TITLES[offset]}",
            f"{fact['vertices']:,}",
            *(f"{1e3 * fact[key]:.1f}" for key in ("median", "rms", "p95", "p99")),
        ]
        for name, by_offset in facts.items()
        for offset, fact in by_offset.items()
    ]
    return Section(
        name="figure4",
        title="Figure 4: iso-surfaces at 0.02 m",
        figures={"figure4": draw(rooms), "figure4_cuts": draw_cuts(rooms)},
        results={
            "voxel_size_m": VOXEL,
            "sigma_m": SIGMA,
            "views": rooms[0].views,
            "distance_to_true_surface_m": facts,
        },
        values={
            "views": str(rooms[0].views),
            **medians,
            "model_lead": f"{1e3 * lead_sigmas * SIGMA:.1f}",
            "sigma": f"{SIGMA:g}",
        },
        table=Table(["surface", "vertices", "median (mm)", "RMS (mm)", "95 % within (mm)", "99 % within (mm)"], rows),
    )
