"""The systems that are compared: how each takes a frame, and what it tells about its map.

Each module is imported by the process that times it, and by no other. `prepare` makes what a user of the system would
already hold (an image, a point cloud) and is not timed; `integrate` is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any, Literal, Protocol, get_args

import numpy as np

from .frames import MAX_RANGE, Frame

CLAMP = (-2.0, 3.5)
"""Log-odds between which OctoMap holds its voxels unless told otherwise (probabilities 0.12 and 0.97)."""


GpuRule = Literal["pyramid", "area", "min_layer"]
Rule = GpuRule | Literal["ideal"]
"""How pyramap updates a voxel."""

Backend = Literal["cpu", "gpu"]
"""Where pyramap runs; "gpu" is the first device there is, a software one too."""


class Map(Protocol):
    """A map of one of the systems."""

    def prepare(self, frame: Frame) -> Any:
        """What the system takes in the place of a depth image; not timed."""

    def integrate(self, prepared: Any) -> None:
        """Fuses one frame; timed."""

    def nbytes(self) -> int:
        """The bytes of the map, as the system tells them."""

    def mesh(self) -> int:
        """Extracts the surface and returns how many triangles it has; timed."""


class PyramapMap:
    """`pyramap.OccupancyGrid` with its default sensor model."""

    def __init__(
        self,
        voxel_size: float,
        update: Rule,
        clamp: tuple[float, float] | None = None,
        backend: Backend = "cpu",
    ) -> None:
        import pyramap

        self._camera = pyramap.PinholeCamera
        self.grid = pyramap.OccupancyGrid(
            voxel_size,
            max_range=MAX_RANGE,
            update=update,
            backend=backend,
            adapter=usable_adapters()[0] if backend == "gpu" else None,
            clamp=clamp,
        )

    def prepare(self, frame: Frame) -> Any:
        """The depth in metres with the camera and the pose."""
        height, width = frame.depth.shape
        (fx, _, cx), (_, fy, cy), _ = frame.intrinsics
        return frame.depth, self._camera(width, height, fx, fy, cx, cy), frame.world_from_camera

    def integrate(self, prepared: Any) -> None:
        """`OccupancyGrid.integrate`, to its end: a GPU would else still be at work."""
        self.grid.integrate(*prepared)
        self.grid.synchronize()

    def nbytes(self) -> int:
        """`OccupancyGrid.nbytes`: directory and voxels."""
        return self.grid.nbytes

    def mesh(self) -> int:
        """`OccupancyGrid.mesh`: vertices, faces and normals."""
        return len(self.grid.mesh().faces)


def usable_adapters(part: str = "") -> list[str]:
    """The names, with `part` in them, of the devices that could run pyramap.

    Raises:
        LookupError: If there are none.
    """
    import pyramap

    names = [device.name for device in pyramap.devices() if device.problem is None]
    usable = [name for name in names if part.lower() in name.lower()]
    if not usable:
        raise LookupError(f"no adapter with {part!r} in its name among {names}" if part else "no GPU, not even Mesa's")
    return usable


class Open3dMap:
    """Open3D's `VoxelBlockGrid` of 8 x 8 x 8 blocks: a truncated signed distance and a weight a voxel.

    The truncation (8 voxels) and the stride in which pixels ask for blocks are the defaults.
    """

    BLOCK = 8

    def __init__(self, voxel_size: float) -> None:
        self._o3d: Any = import_module("open3d")
        self._device = self._o3d.core.Device("CPU:0")
        dtype = self._o3d.core.float32
        self._grid = self._o3d.t.geometry.VoxelBlockGrid(
            ("tsdf", "weight"), (dtype, dtype), ((1,), (1,)), voxel_size, self.BLOCK, device=self._device
        )

    def prepare(self, frame: Frame) -> Any:
        """The image, the intrinsics and camera_from_world as Open3D's tensors."""
        tensor = self._o3d.core.Tensor
        image = self._o3d.t.geometry.Image(frame.depth)
        return image, tensor(frame.intrinsics), tensor(np.linalg.inv(frame.world_from_camera))

    def integrate(self, prepared: Any) -> None:
        """The blocks that the image touches, then the fusion, as its tutorial has it."""
        options = {"depth_scale": 1.0, "depth_max": MAX_RANGE}
        blocks = self._grid.compute_unique_block_coordinates(*prepared, **options)
        self._grid.integrate(blocks, *prepared, **options)

    def nbytes(self) -> int:
        """The blocks in use, with their keys; what is reserved beyond that is left out."""
        blocks = self._grid.hashmap()
        reserved = sum(tensor.numpy().nbytes for tensor in (blocks.key_tensor(), *blocks.value_tensors()))
        return int(reserved * blocks.size() // blocks.capacity())

    def mesh(self) -> int:
        """`extract_triangle_mesh` of all voxels ever seen: vertices, faces and normals."""
        surface = self._grid.extract_triangle_mesh(weight_threshold=0.0)
        return int(surface.triangle.indices.shape[0])


class OctomapMap:
    """An `OcTree` of OctoMap, through one of its two Python packages, which have the same calls.

    Args:
        module: "pyoctomap" or "octomap" (of the package octomap-python).
        discretize: Cast one ray a voxel hit instead of one a point.
    """

    def __init__(self, voxel_size: float, module: str, discretize: bool) -> None:
        self._tree: Any = import_module(module).OcTree(voxel_size)
        self._discretize = discretize

    def prepare(self, frame: Frame) -> Any:
        """The readings as points in the world, (N, 3) float64, and the place of the camera."""
        v, u = np.nonzero((frame.depth > 0) & np.isfinite(frame.depth))
        z = frame.depth[v, u].astype(np.float64)
        pixels = np.stack([u, v, np.ones_like(u)], axis=1)
        in_camera = z[:, None] * (pixels @ np.linalg.inv(frame.intrinsics).T)
        origin = frame.world_from_camera[:3, 3].copy()
        return in_camera @ frame.world_from_camera[:3, :3].T + origin, origin

    def integrate(self, prepared: Any) -> None:
        """`insertPointCloud`; rays longer than the range are cut there."""
        self._tree.insertPointCloud(*prepared, MAX_RANGE, discretize=self._discretize)

    def nbytes(self) -> int:
        """`memoryUsage`: the nodes of the tree."""
        return int(self._tree.memoryUsage())

    def mesh(self) -> int:
        """Not possible."""
        raise NotImplementedError("OctoMap extracts no surface")


@dataclass(frozen=True)
class System:
    """One of the systems, and how to measure it.

    Attributes:
        name: What tables call it.
        package: The Python package that must be installed.
        module: What it is imported as.
        new_map: Makes an empty map of a voxel size in metres.
        parallel: Whether it uses more than one thread.
        finest: The smallest voxel size in metres at which it is worth the wait.
        on_gpu: Whether it runs on a GPU.
    """

    name: str
    package: str
    module: str
    new_map: Callable[[float], Map]
    parallel: bool = True
    finest: float = 0.0
    on_gpu: bool = False

    def affords(self, voxel_size: float) -> bool:
        """Whether it is measured at this voxel size."""
        return voxel_size >= self.finest


PYRAMID = System("pyramap pyramid", "pyramap", "pyramap", partial(PyramapMap, update="pyramid"))
CLAMPED = System("pyramap pyramid, clamped", "pyramap", "pyramap", partial(PyramapMap, update="pyramid", clamp=CLAMP))
AREA = System("pyramap area", "pyramap", "pyramap", partial(PyramapMap, update="area"))
MIN_LAYER = System("pyramap min_layer", "pyramap", "pyramap", partial(PyramapMap, update="min_layer"))
IDEAL = System("pyramap ideal", "pyramap", "pyramap", partial(PyramapMap, update="ideal"), finest=0.16)
PYRAMID_GPU, AREA_GPU, MIN_LAYER_GPU = (
    System(f"pyramap {rule}, GPU", "pyramap", "pyramap", partial(PyramapMap, update=rule, backend="gpu"), on_gpu=True)
    for rule in get_args(GpuRule)
)
OPEN3D = System("Open3D TSDF", "open3d", "open3d", Open3dMap)
PYOCTOMAP = System(
    "pyoctomap", "pyoctomap", "pyoctomap", partial(OctomapMap, module="pyoctomap", discretize=False), parallel=False
)
PYOCTOMAP_DISCRETISED = System(
    "pyoctomap, discretised",
    "pyoctomap",
    "pyoctomap",
    partial(OctomapMap, module="pyoctomap", discretize=True),
    parallel=False,
)
OCTOMAP_PYTHON = System(
    "octomap-python",
    "octomap-python",
    "octomap",
    partial(OctomapMap, module="octomap", discretize=False),
    parallel=False,
)
OCTOMAP_PYTHON_DISCRETISED = System(
    "octomap-python, discretised",
    "octomap-python",
    "octomap",
    partial(OctomapMap, module="octomap", discretize=True),
    parallel=False,
)

SYSTEMS = (
    PYRAMID,
    CLAMPED,
    AREA,
    MIN_LAYER,
    IDEAL,
    PYRAMID_GPU,
    AREA_GPU,
    MIN_LAYER_GPU,
    OPEN3D,
    PYOCTOMAP,
    PYOCTOMAP_DISCRETISED,
    OCTOMAP_PYTHON,
    OCTOMAP_PYTHON_DISCRETISED,
)
"""All of them, in the order of the tables."""
