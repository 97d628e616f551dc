"""Probabilistic 3D occupancy mapping from depth images: what is free, what is occupied, what nobody has seen.

The method is that of Pirker, Rüther, Schweighofer and Bischof (2011), "the paper" in these pages. Camera axes are x
right, y down, z forward; integer pixel coordinates are pixel centres; depth is z-depth in metres; a pose is
`world_from_camera`, (4, 4) float64.
"""

from . import datasets, scenes
from ._core import (
    OCTOMAP_CLAMP,
    Device,
    DeviceError,
    DeviceForkedError,
    DeviceLostError,
    DeviceMemoryError,
    DeviceNotFoundError,
    DistanceField,
    FrameStats,
    Frontiers,
    MapFullError,
    Mesh,
    OccupancyGrid,
    OrthographicCamera,
    PinholeCamera,
    RayHits,
    SensorModel,
    SphericalSensor,
    ViewGain,
    __version__,
    devices,
    load_octomap,
    num_threads,
    pyramid,
    range_image,
    ranges,
    set_num_threads,
)
from .stereo import depth_from_disparity

__all__ = [
    "OCTOMAP_CLAMP",
    "Device",
    "DeviceError",
    "DeviceForkedError",
    "DeviceLostError",
    "DeviceMemoryError",
    "DeviceNotFoundError",
    "DistanceField",
    "FrameStats",
    "Frontiers",
    "MapFullError",
    "Mesh",
    "OccupancyGrid",
    "OrthographicCamera",
    "PinholeCamera",
    "RayHits",
    "SensorModel",
    "SphericalSensor",
    "ViewGain",
    "__version__",
    "datasets",
    "depth_from_disparity",
    "devices",
    "load_octomap",
    "num_threads",
    "pyramid",
    "range_image",
    "ranges",
    "scenes",
    "set_num_threads",
]
