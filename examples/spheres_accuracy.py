"""How near does the mesh come to the true surface, and which settings bring it nearest?

The paper's SPHERES room (181 exact views from one place) is mapped with voxels of 20 mm under many settings, and the
vertices of each mesh are compared with the true surface. What the table shows:

- The paper's own model calls space occupied 1.48 sigma in front of a reading: the mesh lies that much too near.
  `surface_offset="centred"` takes that away.
- With the paper's k = sigma a reading says more for "occupied" (log-odds up to 2.2) than for "free" (-0.85). Between
  two voxels evidence is interpolated linearly, so the stronger side pushes the surface away, by 1 to 2 mm here. With
  `EVEN_K` both sides are equally strong, and that bias is gone.
- A texel of a pyramid keeps one reading of its window; `area` reads every pixel that it samples, and errs by a half to
  a third of what `pyramid` does.
- What is left lies behind edges: every vertex that is 10 mm off does. There seen free space borders on voxels in the
  shadow of an object, whose evidence is the far tail of the model, a hundredth of a full reading, and the mesh draws a
  wall between the two. `min_evidence` leaves such voxels out. It must be small against the evidence of all sightings
  together: voxels right at a surface have little evidence too, and without them the mesh has holes. With a tenth of the
  views the value that is best here already tears some.
- Where what was seen ends, some cells draw a triangle or two that touch no others. They lie on the surface, but are
  not part of it: `min_faces` drops them. What remains is one piece for the room with all that touches its walls,
  and one for each of three spheres.

Run it without arguments for the table, with `--quick` for a tenth of the views.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
import pyramap as pm
import trimesh
from matplotlib.figure import Figure
from numpy.typing import NDArray
from pyramap.scenes import Scene

VOXEL_SIZE = 0.02

EVEN_K = 0.2 * math.sqrt(2.0 * math.pi)
"""k / sigma for which a = 0.2 in Eq. 7: p peaks at 0.7, as far above one half as 0.3, the free space, is below."""

SPECK_FACES = 50
"""Pieces with fewer faces are no surface: at this voxel size that is a patch of some 10 x 10 cm."""


@dataclass(frozen=True)
class Settings:
    """What the experiment varies; lengths in metres."""

    rule: Literal["pyramid", "min_layer", "area"]
    sigma: float
    k_per_sigma: float = 1.0
    surface_offset: float | Literal["centred"] = "centred"
    min_evidence: float = 0.0


BEST = Settings("area", sigma=VOXEL_SIZE, k_per_sigma=EVEN_K, min_evidence=0.1)

PAPER = [Settings("pyramid", sigma, surface_offset=0.0) for sigma in (0.005, 0.01, 0.02, 0.03)]
CENTRED = [Settings(rule, sigma) for rule in ("pyramid", "min_layer", "area") for sigma in (0.01, 0.02)]
EVEN = [Settings(rule, 0.02, EVEN_K) for rule in ("pyramid", "min_layer")]
SIGMAS = [replace(BEST, sigma=sigma, min_evidence=0.0) for sigma in (0.005, 0.01, 0.015, 0.02, 0.03)]
EVIDENCE = [replace(BEST, min_evidence=evidence) for evidence in (0.05, BEST.min_evidence, 0.2, 0.4)]


@dataclass(frozen=True)
class Accuracy:
    """Distances of the vertices from the true surface, metres, towards free space; and the pieces of the mesh."""

    distances: NDArray[np.float64]
    pieces: int
    specks: int

    @property
    def rms(self) -> float:
        """Root of the mean square."""
        return float(np.sqrt(np.mean(self.distances**2)))

    @property
    def mean(self) -> float:
        """Positive: the mesh is too near to the camera."""
        return float(np.mean(self.distances))

    def within(self, share: float) -> float:
        """The distance within which this share of the vertices lies."""
        return float(np.quantile(np.abs(self.distances), share))


def fuse(scene: Scene, views: Sequence[pm.datasets.Frame], settings: Settings) -> pm.OccupancyGrid:
    """The map of some views of the scene."""
    k = settings.k_per_sigma * settings.sigma
    model = pm.SensorModel(settings.sigma, k=k, surface_offset=settings.surface_offset)
    grid = pm.OccupancyGrid(VOXEL_SIZE, sensor_model=model, update=settings.rule)
    for view in views:
        grid.integrate(view.depth, scene.camera, view.world_from_camera)
    return grid


def pieces_of(mesh: trimesh.Trimesh) -> list[NDArray[np.int64]]:
    """The faces of each piece: faces that share an edge belong to the same."""
    return list(trimesh.graph.connected_components(mesh.face_adjacency, nodes=np.arange(len(mesh.faces))))


def measure(scene: Scene, mesh: trimesh.Trimesh) -> Accuracy:
    """Compares a mesh with the surface of the scene."""
    pieces = pieces_of(mesh)
    specks = sum(len(faces) < SPECK_FACES for faces in pieces)
    return Accuracy(scene.signed_distance(mesh.vertices), len(pieces), specks)


def row(settings: Settings, accuracy: Accuracy, remark: str = "") -> str:
    """One line of the table; lengths in millimetres."""
    s, a = settings, accuracy
    given = f"{s.rule:9} {1e3 * s.sigma:5g} {s.k_per_sigma:7.2f} {s.surface_offset:>7} {s.min_evidence:8g}"
    errors = [a.rms, a.mean, a.within(0.95), a.within(0.99), a.within(1.0)]
    measured = " ".join(f"{1e3 * error:6.2f}" for error in errors)
    return f"{given}  {len(a.distances):8} {measured} {a.pieces:7} {a.specks:7}  {remark}".rstrip()


HEADER = (
    "rule      sigma k/sigma  offset evidence  vertices    RMS   mean    95%    99%    max  pieces  specks\n"
    "             mm                 (least)                mm     mm     mm     mm     mm"
)


def draw(accuracies: dict[str, Accuracy]) -> Figure:
    """How the vertices' distances from the true surface are spread."""
    figure = Figure(figsize=(8, 3.5), layout="constrained")
    axes = figure.subplots()
    for (name, accuracy), colour in zip(accuracies.items(), ("#d55e00", "#e69f00", "#0072b2", "#000000"), strict=True):
        millimetres = 1e3 * accuracy.distances
        edges = np.arange(-10.0, 40.0, 0.5).tolist()
        axes.hist(millimetres, edges, density=True, histtype="step", color=colour, label=name)
    axes.set(xlabel="distance from the true surface, towards the camera (mm)", ylabel="share a millimetre")
    axes.legend()
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description="Accuracy of the SPHERES mesh under many settings.")
    parser.add_argument("--quick", action="store_true", help="map every tenth view only")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()), help="where the picture goes")
    arguments = parser.parse_args()

    scene = pm.scenes.spheres()
    frames = scene.frames()
    views = list(frames[::10] if arguments.quick else frames)
    print(f"SPHERES, {len(views)} views, voxels of {1e3 * VOXEL_SIZE:g} mm")
    print(HEADER)

    @cache
    def grid_of(settings: Settings) -> pm.OccupancyGrid:
        return fuse(scene, views, settings)

    def mesh_of(settings: Settings, min_faces: int = 0) -> trimesh.Trimesh:
        grid = grid_of(replace(settings, min_evidence=0.0))  # only the mesh depends on it
        return grid.mesh(min_evidence=settings.min_evidence, min_faces=min_faces).to_trimesh()

    groups = [
        ("The paper's model and rule", PAPER),
        ("Centred on the reading", CENTRED),
        ("Free and occupied equally strong", EVEN + SIGMAS),
        ("Voxels with little evidence left out", EVIDENCE),
    ]
    for title, group in groups:
        print(title)
        for settings in group:
            remark = "best" if settings == BEST else ""
            print(row(settings, measure(scene, mesh_of(settings)), remark), flush=True)
    print("The best without its specks")
    best = measure(scene, mesh_of(BEST, min_faces=SPECK_FACES))
    print(row(BEST, best))
    shown = {"the paper's model and rule": PAPER[2], "centred": CENTRED[1], "area, centred": CENTRED[5]}
    accuracies = {name: measure(scene, mesh_of(settings)) for name, settings in shown.items()}
    picture = arguments.folder / "spheres_accuracy.png"
    draw({**accuracies, "the best": best}).savefig(picture)
    print(f"drawn in {picture}")


if __name__ == "__main__":
    main()
