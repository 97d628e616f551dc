"""A robot explores an office: where should it look next?

A small drone with a depth camera knows nothing but what it has seen. It turns around once; then, again and again, it
chooses a place to fly to, looks, and adds the image to its map. Three ways to choose are compared:

- "view gain": of many views of the frontiers, the one that may show the most unknown space for the way there. It is the
  suggestion of views that the paper names as its next step.
- "nearest": the nearest view of a frontier that shows anything new (after Yamauchi 1997).
- "random": any place that can be reached, any direction.

It is over when no view is worth its while, or after as many views as are asked for. What is printed and drawn is the
part that has been seen of all free space that is connected to the start. After 100 views that is nearly all by view
gain, less than half by going to the nearest, which flies less for it, and less than a third by chance.
Run it without arguments for 100 views (some 15 s), or with fewer: `--views 20`.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyramap as pm
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

Array = NDArray[np.float64]

CAMERA = pm.PinholeCamera(width=160, height=120, fx=100.0, fy=100.0, cx=79.5, cy=59.5)
"""77 by 62 degrees."""
VOXEL_SIZE = 0.1
MAX_RANGE = 4.0
LOW, HIGH = np.array([-2.0, -2.5, -0.2]), np.array([24.0, 12.5, 2.9])
"""Around the office, metres: nothing beyond is planned or counted."""
START = (0.0, 0.0)
FLIGHT_HEIGHT = 1.35
CLEARANCE = 0.35
"""Of the drone's middle to all that is not known to be free, metres, in its plane."""
WORTH = 0.3
"""Unknown space, cubic metres, for which a view is worth while."""
LOOK = 1.0
"""What a look costs, in metres of flight: a view's worth is its gain per metre."""
FRONTIERS, VIEWS_OF_EACH = 40, 3
"""How many of the largest frontiers are considered, and from how many places."""
STRIDE = 8
"""Pixels to a ray when a gain is estimated: rays fill the view however few they are, so that this is fine enough."""
TRUTH_SIZE = 0.2
"""Edge of the cells in which the free space of the office is counted, metres."""


def main() -> None:
    parser = argparse.ArgumentParser(description="Explore a simulated office, with three ways to choose a view.")
    parser.add_argument("--views", type=int, default=100, help="how many images may be taken")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()), help="where the picture goes")
    arguments = parser.parse_args()

    office = Office(pm.scenes.office_loop())
    drones = {name: explore(office, choose, arguments.views) for name, choose in CHOICES.items()}

    shown = sorted({*range(10, arguments.views, 10), arguments.views})
    print(f"{'views':>12}" + "".join(f"{views:>7}" for views in shown) + f"{'flown':>10}")
    for name, drone in drones.items():
        # Where exploration was over early, nothing has changed since.
        seen = [drone.coverage[min(views, len(drone.coverage)) - 1] for views in shown]
        print(f"{name:>12}" + "".join(f"{part:>7.1%}" for part in seen) + f"{drone.flown:>8.0f} m")
    picture = arguments.folder / "explore.png"
    draw(drones).savefig(picture, bbox_inches="tight")
    print(f"drawn in {picture}")


class Office:
    """The scene, and the free space in it that is connected to the start."""

    def __init__(self, scene: pm.scenes.Scene) -> None:
        self.scene = scene
        centres = lattice(LOW, HIGH, TRUTH_SIZE)
        # With so much room around its middle, nothing is between a cell and the next, not even a pane of glass.
        free = scene.signed_distance(centres.reshape(-1, 3)).reshape(centres.shape[:3]) > 0.5 * TRUTH_SIZE
        self.free = centres[steps_from(cell_of((*START, FLIGHT_HEIGHT), TRUTH_SIZE), free) >= 0]
        """Middles of its cells, (N, 3)."""
        self.plane = lattice(LOW, HIGH, VOXEL_SIZE)[:, :, cell_of((*START, FLIGHT_HEIGHT), VOXEL_SIZE)[2]]
        """Centres of the voxels at flight height, (columns, rows, 3)."""


def lattice(low: Array, high: Array, size: float) -> Array:
    """Middles of the cells of a box, (columns, rows, layers, 3)."""
    axes = [np.arange(a + 0.5 * size, b, size) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def cell_of(point: tuple[float, ...], size: float) -> tuple[int, ...]:
    """The cell of a lattice from `LOW` on that holds a point, or a point of the floor."""
    return tuple(math.floor((c - low) / size) for c, low in zip(point, LOW, strict=False))


def steps_from(start: tuple[int, ...], free: NDArray[np.bool_]) -> NDArray[np.int32]:
    """How many steps, along axes and through free cells, lead from one cell to each other; -1 where none do."""
    room = np.pad(free, 1)
    steps = np.where(room, -1, -2).astype(np.int32).ravel()
    strides = [stride // room.itemsize for stride in room.strides]
    directions = np.array([*strides, *(-stride for stride in strides)])
    wave = np.array([np.ravel_multi_index([i + 1 for i in start], room.shape)])
    count = 0
    while len(wave):
        steps[wave] = count
        near = np.unique(wave[:, None] + directions)
        wave = near[steps[near] == -1]
        count += 1
    inside: NDArray[np.int32] = steps.reshape(room.shape)[(slice(1, -1),) * room.ndim]
    return np.maximum(inside, -1)


@dataclass
class Drone:
    """What it has seen, where it is, and how it fared."""

    office: Office
    grid: pm.OccupancyGrid = field(default_factory=lambda: pm.OccupancyGrid(VOXEL_SIZE, max_range=MAX_RANGE))
    position: tuple[float, float] = START
    flown: float = 0.0
    path: list[tuple[float, float]] = field(default_factory=list)
    coverage: list[float] = field(default_factory=list)

    def look(self, pose: Array) -> None:
        """Takes an image and adds it to the map."""
        depth = self.office.scene.render(CAMERA, pose)
        depth[depth == 0.0] = np.inf  # a simulation knows that there is nothing; a sensor would not say so
        self.grid.integrate(depth, CAMERA, pose)
        self.path.append(self.position)
        self.coverage.append(float(np.mean(self.grid.state(self.office.free) >= 0)))

    def ways(self) -> NDArray[np.int32]:
        """Steps to each place of the plane that keeps its distance from all that is not known to be free."""
        plane = self.office.plane
        safe = self.grid.state(plane.reshape(-1, 3)).reshape(plane.shape[:2]) == 0
        for x, y in self.path:
            # The camera does not see what is next to it; but there it has been.
            safe |= np.hypot(plane[..., 0] - x, plane[..., 1] - y) < CLEARANCE + 2 * VOXEL_SIZE
        reach = math.ceil(CLEARANCE / VOXEL_SIZE)
        clear = safe.copy()
        for dx, dy in np.argwhere(np.ones((2 * reach + 1, 2 * reach + 1))) - reach:
            if math.hypot(dx, dy) * VOXEL_SIZE <= CLEARANCE:
                clear &= np.roll(safe, (dx, dy), axis=(0, 1))
        return steps_from(cell_of(self.position, VOXEL_SIZE), clear)


@dataclass(frozen=True)
class Views:
    """Poses, and the way to each, metres."""

    poses: Array
    ways: Array


def pose_at(place: Array, yaw: float) -> Array:
    """A level camera, `world_from_camera`."""
    pose = np.eye(4)
    pose[:3, 0] = [math.sin(yaw), -math.cos(yaw), 0.0]
    pose[:3, 1] = [0.0, 0.0, -1.0]
    pose[:3, 2] = [math.cos(yaw), math.sin(yaw), 0.0]
    pose[:3, 3] = place
    return pose


def views_of_frontiers(drone: Drone, rng: np.random.Generator) -> Views:
    """Of each frontier some views, from places within a good distance that can be reached."""
    steps = drone.ways()
    places, ways = drone.office.plane[steps >= 0], steps[steps >= 0] * VOXEL_SIZE
    frontiers = drone.grid.frontiers(min_size=20, max_extent=1.5)
    poses, chosen = [], []
    inside = np.all((frontiers.centre > LOW) & (frontiers.centre < HIGH), axis=1)
    for centre in frontiers.centre[inside][:FRONTIERS]:
        distance = np.hypot(*(centre - places)[:, :2].T)
        near = np.flatnonzero((distance > 0.5) & (distance < 0.75 * MAX_RANGE))
        for place in rng.choice(near, min(VIEWS_OF_EACH, len(near)), replace=False):
            dx, dy = (centre - places[place])[:2]
            poses.append(pose_at(places[place], math.atan2(dy, dx)))
            chosen.append(ways[place])
    return Views(np.reshape(poses, (-1, 4, 4)), np.array(chosen))


Choose = Callable[[Drone, np.random.Generator], tuple[Array, float] | None]
"""The next view and the way there; None when there is nothing left to do."""


def by_view_gain(drone: Drone, rng: np.random.Generator) -> tuple[Array, float] | None:
    views, gain = worthwhile_views(drone, rng)
    return best_of(views, gain / (views.ways + LOOK))


def by_distance(drone: Drone, rng: np.random.Generator) -> tuple[Array, float] | None:
    views, _ = worthwhile_views(drone, rng)
    return best_of(views, -views.ways)


def worthwhile_views(drone: Drone, rng: np.random.Generator) -> tuple[Views, Array]:
    """Views of the frontiers, and the unknown space that each may show, cubic metres."""
    views = views_of_frontiers(drone, rng)
    gain = drone.grid.view_gain(CAMERA, views.poses, stride=STRIDE).unknown_volume
    worth = gain > WORTH
    return Views(views.poses[worth], views.ways[worth]), gain[worth]


def best_of(views: Views, score: Array) -> tuple[Array, float] | None:
    if not len(score):
        return None
    best = np.argmax(score)
    return views.poses[best], float(views.ways[best])


def by_chance(drone: Drone, rng: np.random.Generator) -> tuple[Array, float] | None:
    steps = drone.ways()
    place = rng.choice(np.flatnonzero(steps.ravel() >= 0))
    pose = pose_at(drone.office.plane.reshape(-1, 3)[place], rng.uniform(-math.pi, math.pi))
    return pose, float(steps.ravel()[place] * VOXEL_SIZE)


CHOICES: dict[str, Choose] = {"view gain": by_view_gain, "nearest": by_distance, "random": by_chance}


def explore(office: Office, choose: Choose, max_views: int) -> Drone:
    drone, rng = Drone(office), np.random.default_rng(1)
    start = np.array([*START, FLIGHT_HEIGHT])
    for yaw in np.linspace(-math.pi, math.pi, 5, endpoint=False)[:max_views]:
        drone.look(pose_at(start, yaw))
    while len(drone.coverage) < max_views and (choice := choose(drone, rng)) is not None:
        pose, way = choice
        drone.position = (float(pose[0, 3]), float(pose[1, 3]))
        drone.flown += way
        drone.look(pose)
    return drone


def draw(drones: dict[str, Drone]) -> Figure:
    figure = Figure(figsize=(13, 4.6), dpi=100, layout="constrained")
    plan, curves = figure.subplots(1, 2, width_ratios=[1.6, 1.0])
    draw_plan(plan, drones["view gain"])
    for name, drone in drones.items():
        curves.plot(range(1, len(drone.coverage) + 1), 100.0 * np.array(drone.coverage), label=name)
    curves.set(xlabel="views", ylabel="free space seen, %", ylim=(0, 100), title="Coverage")
    curves.grid(alpha=0.3)
    curves.legend(loc="lower right")
    return figure


def draw_plan(axes: Axes, drone: Drone) -> None:
    plane = drone.office.plane
    states = drone.grid.state(plane.reshape(-1, 3)).reshape(plane.shape[:2])
    shades = np.array([0.75, 1.0, 0.15])[states + 1]  # unknown, free, occupied
    (left, bottom), (right, top) = plane[0, 0, :2], plane[-1, -1, :2]
    axes.imshow(shades.T, cmap="gray", vmin=0, vmax=1, origin="lower", extent=(left, right, bottom, top))
    x, y = np.transpose(drone.path)
    points = axes.scatter(x, y, c=range(1, len(x) + 1), cmap="viridis", s=18, zorder=3)
    axes.figure.colorbar(points, ax=axes, label="view", shrink=0.8)
    axes.set(xlabel="x, m", ylabel="y, m", title=f'"view gain", map at {FLIGHT_HEIGHT} m: white free, black occupied')


if __name__ == "__main__":
    main()
